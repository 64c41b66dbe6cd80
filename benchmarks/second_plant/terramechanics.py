"""Forces of a rigid wheel on soil that gives way: Wong and Reece's stresses, with sinkage that grows with slip.

Normal stress along the contact: Bekker's pressure-sinkage, sigma = k (r (cos theta - cos theta_1))^N before the angle of the
largest stress theta_m = (c1 + c2 s) theta_1, mirrored behind it (Wong and Reece 1967, J. Terramechanics 4(1) and 4(2)). Shear
stress: Janosi and Hanamoto 1961, tau = (c + sigma tan phi)(1 - e^(-j/K)). Slip-sinkage: N = n0 + n1 s (Ding, Gao, Deng, Li, Liu
2010, J. Terramechanics 47), s here being the slip that the wheel has dug itself in with. None of it stands in terragrip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

SINKAGES, SLIPS, DEPTHS, ANGLES = 40, 81, 8, 20
NODES = np.polynomial.legendre.leggauss(ANGLES)
DEEPEST = 0.9
"""Deepest sinkage of the tables over the wheel's radius."""


@dataclass(frozen=True)
class Soil:
    """Bekker, Wong and Janosi's constants. ``stiffness`` k = k_c/b + k_phi [N/m^(n+2)], ``cohesion`` c [Pa], ``friction`` phi
    [rad], ``shear`` K [m], ``exponent`` n0 and its growth ``exponent_slip`` n1 with slip, ``front`` and ``front_slip`` c1 and c2.
    """

    stiffness: float
    exponent: float
    exponent_slip: float
    cohesion: float
    friction: float
    shear: float
    front: float = 0.35
    front_slip: float = 0.25


@dataclass(frozen=True)
class Wheel:
    """``radius`` r and ``width`` b [m]."""

    radius: float
    width: float


def stresses(soil: Soil, wheel: Wheel, sinkage: ArrayLike, slip: ArrayLike, dug: ArrayLike) -> Floats:
    """Integrals over the contact (..., 5) [N]: normal force of pressure and of shear, moment over radius, forward part of shear
    and backward part of pressure. ``sinkage`` [m], ``slip`` -1..1 and ``dug``, the slip dug in with, 0..1, broadcast."""
    z, s, d = (np.asarray(value, dtype=float)[..., None] for value in (sinkage, slip, dug))
    r, b = wheel.radius, wheel.width
    entry = np.arccos(np.clip(1.0 - z / r, -1.0, 1.0))
    top = np.clip(soil.front + soil.front_slip * np.abs(s), 0.05, 0.9) * entry
    middle, weight = NODES
    angle = 0.5 * entry * (middle + 1.0)
    mirrored = entry - angle / np.maximum(top, 1e-12) * (entry - top)
    place = np.where(angle > top, angle, mirrored)
    depth = np.maximum(r * (np.cos(place) - np.cos(entry)), 0.0)
    sigma = soil.stiffness * depth ** (soil.exponent + soil.exponent_slip * np.abs(d))
    travel_ratio = np.where(s >= 0, 1.0 - s, 1.0 / np.maximum(1.0 + s, 0.02))  # hub's travel over the rim's
    j = r * ((entry - angle) - travel_ratio * (np.sin(entry) - np.sin(angle)))
    tau = np.sign(j) * (soil.cohesion + sigma * np.tan(soil.friction)) * -np.expm1(-np.abs(j) / soil.shear)
    tau = np.where(z > 0, tau, 0.0)
    parts = (
        sigma * np.cos(angle), tau * np.sin(angle), tau * np.ones_like(angle), tau * np.cos(angle), sigma * np.sin(angle),
    )  # fmt: skip
    scale = r * b * 0.5 * entry[..., 0]
    return np.stack([scale * (part * weight).sum(axis=-1) for part in parts], axis=-1)


def table(soil: Soil, wheel: Wheel) -> tuple[Floats, float]:
    """The integrals at nodes (SINKAGES, SLIPS, DEPTHS, 5), evenly spaced in the root of the sinkage, and the deepest sinkage."""
    deepest = DEEPEST * wheel.radius
    sinkage = deepest * np.linspace(0.0, 1.0, SINKAGES)[:, None, None] ** 2
    slip = np.linspace(-1.0, 1.0, SLIPS)[None, :, None]
    dug = np.linspace(0.0, 1.0, DEPTHS)[None, None, :]
    return np.ascontiguousarray(stresses(soil, wheel, sinkage, slip, dug)), deepest


def sinkage_under(
    soil: Soil, wheel: Wheel, load: float, slip: ArrayLike, dug: ArrayLike | None = None
) -> Floats:
    """Sinkage [m] at which the soil bears ``load`` [N] in steady motion at ``slip`` (n,); ``dug`` is the slip unless given."""
    slips = np.asarray(slip, dtype=float)
    depths = np.clip(np.abs(slips), 0, 1) if dug is None else np.asarray(dug, dtype=float)
    low, high = np.zeros_like(slips), np.full_like(slips, DEEPEST * wheel.radius)
    for _ in range(24):
        half = 0.5 * (low + high)
        bears = stresses(soil, wheel, half, slips, depths)[..., :2].sum(axis=-1)
        low, high = np.where(bears < load, half, low), np.where(bears < load, high, half)
    return 0.5 * (low + high)


def steady(soil: Soil, wheel: Wheel, load: float, slip: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Adhesion (tangential force over load), soil resistance over load, and sinkage [m] in steady motion at ``slip`` (n,)."""
    slips = np.asarray(slip, dtype=float)
    z = sinkage_under(soil, wheel, load, slips)
    _, _, tangential, thrust, resisting = np.moveaxis(
        stresses(soil, wheel, z, slips, np.clip(np.abs(slips), 0, 1)), -1, 0
    )
    return tangential / load, (tangential - thrust + resisting) / load, z


def soil_for(wheel: Wheel, load: float, sinkage: float, **constants: float) -> Soil:
    """A soil of given constants whose stiffness makes the wheel sink by ``sinkage`` [m] under ``load`` [N] when it just rolls."""
    unit = Soil(stiffness=1.0, **constants)
    pressure, _ = stresses(unit, wheel, sinkage, 0.0, 0.0)[:2]
    soil = unit
    for _ in range(8):  # the shear's share of the load goes with the stiffness, too
        shear = stresses(soil, wheel, sinkage, 0.0, 0.0)[1]
        soil = Soil(stiffness=float(max(load - shear, 0.2 * load) / pressure), **constants)
    return soil

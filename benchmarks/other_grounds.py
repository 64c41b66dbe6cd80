"""Development machines on grounds whose curve is no exponential: what leaving a family of curves out would show, were not all of
ours exponentials (docs/advice.md). Forms of the literature that rise slower or sharper; the held-out one is not among them.
*yielding*: what Wong and Reece's stresses under a rigid wheel of the machine's size add up to on Wong's soils (wheel_stresses.py),
each constant drawn about the table's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from types import MappingProxyType
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from terragrip.physics.adhesion import CURVES, CurveModel, Parameter
from terragrip.simulation import SimulationResult, families, family_soils, scenario, terrain
from terragrip.simulation.families import Kind
from terragrip.simulation.family_machines import Machine
from terragrip.units import STANDARD_GRAVITY
from wheel_stresses import SOILS, wheel

Floats = NDArray[np.float64]


def _contact(x: Floats) -> Floats:
    """Janosi and Hanamoto's shear, slip that grows along an evenly loaded contact patch; slope 1 at 0 as all of these."""
    x = np.maximum(2 * x, 1e-9)
    return 1 + np.expm1(-x) / x


RISES: dict[str, tuple[Callable[[Floats], Floats], float]] = {
    "contact": (_contact, 1.4),
    "brush": (lambda x: 1 - (1 - np.minimum(x / 3, 1.0)) ** 3, 0.6),
    "hyperbola": (lambda x: x / (1 + x), 1.8),
    "tanh": (np.tanh, 0.6),
}
"""Rise by name, and by what the rate is scaled so that slips of three quarters of the height are about the exponential's."""


def _model(name: str) -> CurveModel:
    rise = RISES[name][0]

    def value(s: Floats, q: dict[str, Floats]) -> Floats:
        return np.asarray(q["A"] * rise(q["k"] * s) * (1 - q["f"] * s))

    def slope(s: Floats, q: dict[str, Floats]) -> Floats:
        below = np.maximum(s - 1e-5, 0)
        return np.asarray((value(s + 1e-5, q) - value(below, q)) / (s + 1e-5 - below))

    figures = (("A", 1e-3, 5.0, 0.5), ("k", 0.5, 200.0, 10.0), ("f", -1.0, 1.0, 0.0))
    parameters = tuple(Parameter(key, "1", low, high, start, "") for key, low, high, start in figures)
    return CurveModel(name, parameters, value, slope, "")  # type: ignore[arg-type]


CONSTANTS = ("n", "kc", "kphi", "cohesion", "phi", "shear", "radius", "width", "load")
SLIPS = np.r_[0.0:0.1:0.01, 0.1:0.3:0.02, 0.3:1.05:0.1]
NO_JUMP = 0.004
"""Slip over which adhesion that yielding ground asks without slip comes up from 0: the plant's curves are odd in slip."""


@lru_cache(maxsize=64)
def _under(constants: tuple[float, ...]) -> tuple[Floats, Floats]:
    """(mu, rho_s) over SLIPS."""
    mu, rho = np.array([wheel(s, constants[:6], *constants[6:]) for s in SLIPS]).T  # type: ignore[arg-type]
    return mu, rho


def _yielding() -> CurveModel:
    def value(s: Floats, q: dict[str, Floats]) -> Floats:
        mu, _ = _under(tuple(float(q[name]) for name in CONSTANTS))
        return np.asarray(-np.interp(s, SLIPS, mu) * np.expm1(-s / NO_JUMP))

    def slope(s: Floats, q: dict[str, Floats]) -> Floats:
        below = np.maximum(s - 1e-4, 0)
        return np.asarray((value(s + 1e-4, q) - value(below, q)) / (s + 1e-4 - below))

    parameters = tuple(Parameter(key, "1", -1e9, 1e9, 1.0, "") for key in CONSTANTS)
    return CurveModel("yielding", parameters, value, slope, "")  # type: ignore[arg-type]


EVERY = MappingProxyType({**CURVES, **{name: _model(name) for name in RISES}, "yielding": _yielding()})


def machines(count: int, first: int, curves: tuple[str, ...] = tuple(RISES)) -> Iterator[tuple[Kind, int]]:
    """Development kinds, the name of a rise in the place of the family of curves."""
    for k, (kind, seed) in enumerate(families.machines("development", count, first)):
        yield Kind(kind.mass, curves[k % len(curves)], kind.sensors), seed


def draw(kind: Kind, seed: int, rate: float, duration: float | None = None) -> SimulationResult:
    """A work drive on such ground; soils drawn about as widely as the saturating ones."""
    faster = RISES[kind.curve][1] if kind.curve in RISES else 0.0

    def yielding(rng: np.random.Generator, machine: Machine) -> tuple[dict[str, object], float, float]:
        while True:
            drawn = np.array(SOILS[list(SOILS)[rng.integers(len(SOILS))]]) * np.exp(
                0.2 * rng.standard_normal(6)
            )
            size = (machine.radius, 0.5 * machine.radius, machine.corner_mass * STANDARD_GRAVITY)
            constants = tuple(float(x) for x in (*drawn, *size))
            mu, rho = _under(constants)
            growth, level = np.polyfit(SLIPS[SLIPS < 0.5], rho[SLIPS < 0.5], 1)
            if np.interp(0.2, SLIPS, mu - rho) > 0.1 and rho.max() < 0.4:
                form = {"name": "yielding", **dict(zip(CONSTANTS, constants, strict=True))}
                return form, float(level), max(float(growth), 0.0) + rng.uniform(0.0, 0.2)

    def soil(rng: np.random.Generator, machine: Machine) -> tuple[dict[str, object], float, float]:
        form = {"name": kind.curve, "A": rng.uniform(0.35, 0.8), "k": faster * rng.uniform(6, 25)}
        form["f"] = 0.0 if rng.uniform() < 0.5 else rng.uniform(0.1, 0.5)
        return form, rng.uniform(0.03, 0.12), rng.uniform(0.0, 0.2)

    with (
        patch.object(family_soils, "CURVES", EVERY),
        patch.object(terrain, "CURVES", EVERY),
        patch.object(scenario, "CURVES", EVERY),
        patch.dict(family_soils.SOILS_OF, {"saturating": yielding if kind.curve == "yielding" else soil}),
    ):
        return families.draw(Kind(kind.mass, "saturating", kind.sensors), seed, rate=rate, duration=duration)

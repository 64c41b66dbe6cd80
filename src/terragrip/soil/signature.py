"""The signature of a soil beyond its mean curve: the distributions of level and roughness of its blocks.

Learned from blocks of labelled estimates and kept in the library (`soils.<name>.signature`), for recognition.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import LARGEST_SLIP, Blocks
from terragrip.soil.library import Soil

if TYPE_CHECKING:
    from terragrip.estimation import Estimates


LEAST_BLOCKS = 20
"""Fewest blocks (10 s) that a signature is learned from."""
OFFSET = 0.05
"""mu at which the error about the curve is as much additive as proportional."""
USUAL_CURVE = {"a": 0.85}
"""Of the paper's prototype (eq. 8): what a soil without a curve of its own is compared with."""
USUAL_SOIL = Soil("usual", "exponential", USUAL_CURVE)
LEAST_SD = (0.005, 0.03)
"""Below this the ground of one soil does not vary from field to field: of rho_s, and of mu relative to its curve."""


@dataclass(frozen=True)
class Signature:
    """A soil's blocks: level (rho_s, relative error of mu about the curve) and roughness (see `Blocks`), normally distributed.

    `level_sd`, `level_correlation`: of the ground alone; the estimates' own variance is added, block by block. `roughness` and its
    covariance are None where the logs are too slow to show it (under 8 Hz).
    `made_by`: method of the estimates, since methods smooth differently. `blocks`, `runs`: the amount of data.
    """

    level: Floats
    level_sd: Floats
    level_correlation: float
    roughness: Floats | None
    roughness_covariance: Floats | None
    made_by: str
    blocks: int
    runs: int

    def to_dict(self) -> dict[str, Any]:
        """In the form of soils.json."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()}

    @classmethod
    def from_dict(cls, data: Any, place: str, file: str | os.PathLike[str] | None = None) -> Signature:
        """From a library's entry; raises InputError where it is not what `to_dict` gives."""
        shapes: dict[str, tuple[int, ...]] = {"level": (2,), "level_sd": (2,)}
        try:
            if data["roughness"] is not None:
                shapes |= {"roughness": (2,), "roughness_covariance": (2, 2)}
            arrays = {k: np.array(data[k], dtype=float).reshape(shape) for k, shape in shapes.items()}
            correlation = float(data["level_correlation"])
            counts = {k: int(data[k]) for k in ("blocks", "runs")}
            if "roughness" in arrays:
                np.linalg.cholesky(arrays["roughness_covariance"])
            sound = all(np.isfinite(x).all() for x in arrays.values()) and bool(
                (arrays["level_sd"] > 0).all()
            )
            sound &= abs(correlation) < 1 and min(counts.values()) > 0
        except (KeyError, TypeError, ValueError, np.linalg.LinAlgError):
            sound = False
        if not sound:
            raise InputError(
                "is not a signature of a soil",
                file=file,
                place=place,
                hint="learn the library again with 'terragrip soils'",
            )
        return cls(
            arrays["level"],
            arrays["level_sd"],
            correlation,
            arrays.get("roughness"),
            arrays.get("roughness_covariance"),
            str(data.get("made_by", "")),
            counts["blocks"],
            counts["runs"],
        )


def signature_in(soil: Soil, file: str | os.PathLike[str] | None = None) -> Signature | None:
    """The signature in a library's soil, None where there is none; InputError where it is damaged, in the library `file`."""
    data = soil.fit.get("signature")
    return None if data is None else Signature.from_dict(data, f"soils.{soil.name}.signature", file)


def curve_error(soil: Soil, blocks: Blocks) -> tuple[Floats, Floats, Floats]:
    """Relative error of mu about the soil's curve, its variance according to the estimates, and its scale, (blocks,) each.

    error = mean over wheels, by load, of mu - f(s), over scale = |f(s)| + `OFFSET`. Errors of the wheels are assumed alike; that of slip
    enters by the curve's slope, up to half the curve's height.
    """
    curve = soil.value(blocks.slip)
    scale = np.abs((curve * blocks.share).sum(axis=1)) + OFFSET
    error = ((blocks.adhesion - curve) * blocks.share).sum(axis=1) / scale
    by_slip = np.minimum(_slope(soil, blocks) * np.sqrt(blocks.slip_variance), 0.5 * _height(soil))
    known = np.hypot(np.sqrt(blocks.adhesion_variance), by_slip)
    return error, ((known * blocks.share).sum(axis=1) / scale) ** 2, scale


def steepness(soil: Soil, blocks: Blocks) -> Floats:
    """Slope of the soil's curve at the wheels' slips, their mean by load, (blocks,); at least the mean slope up to the largest slip."""
    return np.asarray(
        (np.maximum(_slope(soil, blocks), _height(soil) / LARGEST_SLIP) * blocks.share).sum(axis=1)
    )


def _slope(soil: Soil, blocks: Blocks) -> Floats:
    plain = {k: v for k, v in soil.parameters.items() if k != "intercept"}
    return np.abs(CURVES[soil.model].slope(blocks.slip, plain))


def _height(soil: Soil) -> float:
    return float(np.abs(soil.value(np.array([LARGEST_SLIP])))[0])


def learn_signature(soil: Soil, runs: Sequence[Blocks], made_by: str = "") -> Signature | None:
    """The signature of one soil from the blocks of runs on it; None where there are fewer than `LEAST_BLOCKS`.

    Differences between runs count: they widen the distribution.
    """
    levels, noises, roughness = [], [], []
    for run in runs:
        known = run.known
        error, noise, _ = curve_error(soil, run)
        levels.append(np.where(known[:, None], np.column_stack([run.resistance, error]), np.nan))
        noises.append(np.column_stack([run.resistance_variance, noise]))
        rough = np.isfinite(run.roughness).all(axis=1) & known
        roughness.append(np.where(rough[:, None], run.roughness, np.nan))
    if not levels:
        return None
    level, noise, rough = np.concatenate(levels), np.concatenate(noises), np.concatenate(roughness)
    measured = np.isfinite(level).all(axis=1) & np.isfinite(noise).all(axis=1)
    level, noise, rough = level[measured], noise[measured], rough[np.isfinite(rough).all(axis=1)]
    if len(level) < LEAST_BLOCKS:
        return None
    middle, sd = _ground(level, noise)
    scaled = (level - middle) / np.sqrt(sd**2 + noise)
    shown = len(rough) >= LEAST_BLOCKS
    return Signature(
        middle,
        sd,
        _correlation(scaled),
        rough.mean(axis=0) if shown else None,
        np.cov(rough, rowvar=False) + 0.01 * np.eye(rough.shape[1]) if shown else None,
        made_by,
        len(level),
        len(runs),
    )


def _correlation(pairs: Floats) -> float:
    """Correlation of two columns, within 0.9 either way; 0 where one is constant."""
    if (pairs.std(axis=0) == 0).any():
        return 0.0
    return float(
        np.clip(np.mean(np.prod((pairs - pairs.mean(axis=0)) / pairs.std(axis=0), axis=1)), -0.9, 0.9)
    )


def _ground(values: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Mean and SD of the ground under values (blocks, 2) whose own variances are known.

    The SD for which the squares, over their whole variance, have the mean 1 (Paule and Mandel 1982), by bisection; at least `LEAST_SD`.
    """
    middle, sd = np.zeros(2), np.zeros(2)
    for k in range(2):
        x, v = values[:, k], noise[:, k]
        low, high = 0.0, float(np.var(x)) + 1e-12
        for _ in range(40):
            ground = 0.5 * (low + high)
            weight = 1 / (ground + v)
            middle[k] = (weight * x).sum() / weight.sum()
            low, high = (ground, high) if (weight * (x - middle[k]) ** 2).mean() > 1 else (low, ground)
        sd[k] = max(np.sqrt(0.5 * (low + high)), LEAST_SD[k])
    return middle, sd


def maker(estimates: Estimates) -> str:
    """The method of a table of estimates in words: roughness depends on it."""
    return estimates.method + (", smoothed" if estimates.about.get("smooth") else "")


def with_signatures(
    soils: Mapping[str, Soil], blocks: Mapping[str, Sequence[Blocks]], made_by: str = ""
) -> dict[str, Soil]:
    """Each soil with the signature learned from its blocks, where there are enough of them."""
    out = {}
    for name, soil in soils.items():
        signature = learn_signature(soil, blocks.get(name, ()), made_by)
        out[name] = (
            soil if signature is None else replace(soil, fit={**soil.fit, "signature": signature.to_dict()})
        )
    return out

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
from terragrip.soil.blocks import PERIOD, Blocks
from terragrip.soil.library import Soil
from terragrip.soil.pair_density import log_density

if TYPE_CHECKING:
    from terragrip.estimation import Estimates


LEAST_BLOCKS = 20
"""Fewest blocks (10 s) that a signature is learned from."""
USUAL_CURVE = {"a": 0.85}
"""Of the paper's prototype (eq. 8): what a soil without a curve of its own is compared with."""
USUAL_SD = 0.6
"""Relative SD over all grounds of mu about the usual curve."""
LEVEL_TIME = 3.5
"""Seconds for which levels of neighbouring blocks repeat each other."""
LEAST_SD = (0.005, 0.03)
"""Below this the ground of one soil does not vary from field to field: of rho_s, and of mu relative to its curve."""


@dataclass(frozen=True)
class Signature:
    """A soil's blocks: level (rho_s, relative error of mu about the curve) and roughness (see `Blocks`), normally distributed.

    `level_sd`: of the ground alone; the estimates' own variance is added, block by block. `roughness` and its
    covariance are None where the logs are too slow to show it (under 8 Hz).
    `made_by`: method of the estimates, since methods smooth differently. `blocks`, `runs`: the amount of data.
    """

    level: Floats
    level_sd: Floats
    roughness: Floats | None
    roughness_covariance: Floats | None
    made_by: str
    blocks: int
    runs: int

    def to_dict(self) -> dict[str, Any]:
        """In the form of soils.json; a Terragrip from before 28 November 2026 reads a correlation, too."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()} | {
            "level_correlation": 0.0
        }

    @classmethod
    def from_dict(cls, data: Any, place: str, file: str | os.PathLike[str] | None = None) -> Signature:
        """From a library's entry; raises InputError where it is not what `to_dict` gives."""
        shapes: dict[str, tuple[int, ...]] = {"level": (2,), "level_sd": (2,)}
        try:
            if data["roughness"] is not None:
                shapes |= {"roughness": (2,), "roughness_covariance": (2, 2)}
            arrays = {k: np.array(data[k], dtype=float).reshape(shape) for k, shape in shapes.items()}
            counts = {k: int(data[k]) for k in ("blocks", "runs")}
            if "roughness" in arrays:
                np.linalg.cholesky(arrays["roughness_covariance"])
            sound = all(np.isfinite(x).all() for x in arrays.values()) and bool(
                (arrays["level_sd"] > 0).all()
            )
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


def usual_curve(slip: Floats) -> Floats:
    """mu at slips of any shape on the usual curve."""
    return CURVES["exponential"].value(slip, USUAL_CURVE)


def relative_interval(soil: Soil) -> float | None:
    """SD of the curve's first free parameter, its height, relative: its 95 % interval over 2 x 1.96; None where there is none."""
    for name, (low, high) in soil.interval.items():
        value = soil.parameters.get(name)
        if value:
            return float(abs(high - low) / (2 * 1.96 * abs(value)))
    return None


def learn_signature(soil: Soil, runs: Sequence[Blocks], made_by: str = "") -> Signature | None:
    """The signature of one soil from the blocks of runs on it; None where there are fewer than `LEAST_BLOCKS`.

    Differences between runs count: they widen the distribution.
    """
    known = [run[run.known] for run in runs]
    count = sum(map(len, known))
    if count < LEAST_BLOCKS:
        return None
    level, noise, rough = (
        np.concatenate([getattr(run, name) for run in known])
        for name in ("resistance", "resistance_variance", "roughness")
    )
    resistance, resistance_sd = _ground(level, noise)
    shift, spread = _about_curve(soil, known)
    rough = rough[np.isfinite(rough).all(axis=1)]
    shown = len(rough) >= LEAST_BLOCKS
    return Signature(
        np.array([resistance, shift]),
        np.array([resistance_sd, spread]),
        rough.mean(axis=0) if shown else None,
        np.cov(rough, rowvar=False) + 0.01 * np.eye(rough.shape[1]) if shown else None,
        made_by,
        count,
        len(runs),
    )


def _ground(values: Floats, noise: Floats) -> tuple[float, float]:
    """Mean and SD of the ground under values (blocks,) whose own variances are known.

    The SD for which the squares, over their whole variance, have the mean 1 (Paule and Mandel 1982), by bisection; at least `LEAST_SD`.
    """
    low, high, middle = 0.0, float(np.var(values)) + 1e-12, 0.0
    for _ in range(40):
        ground = 0.5 * (low + high)
        weight = 1 / (ground + noise)
        middle = float((weight * values).sum() / weight.sum())
        low, high = (ground, high) if (weight * (values - middle) ** 2).mean() > 1 else (low, ground)
    return middle, max(float(np.sqrt(0.5 * (low + high))), LEAST_SD[0])


def _about_curve(soil: Soil, runs: Sequence[Blocks]) -> tuple[float, float]:
    """Mean and SD of mu about the soil's curve, relative: the most probable ones, the SD with what the blocks leave open of the mean.

    Before the blocks the mean is 0, give or take the curve's interval, or what soils differ from the usual curve.
    """
    from scipy.optimize import minimize

    prior = relative_interval(soil) or USUAL_SD

    def cost(log_height: float, log_spread: float) -> float:
        spread = LEAST_SD[1] * np.exp(abs(log_spread))
        seen = sum(log_density(soil.value, run, spread, np.expm1(log_height)).sum() for run in runs)
        return float(0.5 * (log_height / prior) ** 2 - seen * PERIOD / LEVEL_TIME)

    begin = [[0, 1], [0.3, 1], [0, 2]]
    options = {"xatol": 0.01, "fatol": 0.01, "initial_simplex": begin}
    log_height, log_spread = minimize(lambda x: cost(*x), begin[0], method="Nelder-Mead", options=options).x
    step = 0.05
    costs = [cost(log_height + k * step, log_spread) for k in (-1, 0, 1)]
    bend = max(float(np.diff(costs, 2)[0]) / step**2, prior**-2)
    spread, height = LEAST_SD[1] * np.exp(abs(log_spread)), np.exp(log_height)
    return float(height - 1), float(np.hypot(spread, height / np.sqrt(bend)))


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

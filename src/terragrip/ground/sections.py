"""Sections of a drive: stretches in which vehicle and tool are on one soil, and what slip and adhesion were there (physics.md 7).

A section counts from where the tool has followed the vehicle onto the soil to where the vehicle leaves it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.estimation import Estimates
from terragrip.ground.span import Span
from terragrip.soil.blocks import driven_wheels, wheel_loads


@dataclass(frozen=True)
class Section(Span):
    """Vehicle and tool on one soil from `start` to `end` [s]; the vehicle came onto it at `entered`.

    `soil`: the most probable one; `probabilities` of all soils, the means over the section. `samples`: rows that count: moving and without
    an event. Means and SDs over them of slip and adhesion (the driven wheels' mean by load) and of rho_s; None where no row counts.
    `wheels`: slip and adhesion by wheel. `measured`: of each wheel with a force sensor, the mean and SD of its F_x/F_z (`force_ratio_mean`,
    `force_ratio_std`). `label`: the recording's own name of the soil, where it has one.
    """

    start: float
    end: float
    entered: float
    soil: str
    probabilities: Mapping[str, float]
    samples: int
    slip_mean: float | None
    slip_std: float | None
    adhesion_mean: float | None
    adhesion_std: float | None
    resistance_mean: float | None
    resistance_std: float | None
    wheels: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    measured: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    label: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As ground.json holds it."""
        out = {k: dict(v) if isinstance(v, Mapping) else v for k, v in vars(self).items()}
        return {k: v for k, v in out.items() if v not in ({}, "")}


@dataclass(frozen=True)
class Stretch:
    """A stretch of a drive between two borders, rows [first, last), and the probabilities of the soils over it."""

    first: int
    last: int
    probabilities: Mapping[str, float]

    @property
    def soil(self) -> str:
        """The most probable soil."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])


def sections_of(estimates: Estimates, stretches: Sequence[Stretch], length: float) -> tuple[Section, ...]:
    """The sections of stretches in order; those too short for vehicle and tool to be on them together are left out.

    `length` [m]: from where the vehicle first meets a soil to the end of its tool. The first stretch counts from its first row: nothing is
    known of what lies behind it.
    """
    values = _Values(estimates)
    distance, result = np.asarray(estimates["distance"], dtype=float), []
    for k, stretch in enumerate(stretches):
        begin = stretch.first
        if k:
            begin += int(np.searchsorted(distance[begin : stretch.last], distance[begin] + length))
        if begin < stretch.last:
            result.append(values.section(stretch, begin))
    return tuple(result)


class _Values:
    """The columns that sections are made of."""

    def __init__(self, estimates: Estimates) -> None:
        columns = {name: estimates[name] for name in estimates.names}
        axle_of = driven_wheels(estimates.vehicle)
        loads = wheel_loads(columns, axle_of)
        load = np.column_stack([loads[w] for w in axle_of])
        self.time = estimates.time
        self.slip = {w: np.asarray(columns[f"slip_{w}"], dtype=float) for w in axle_of}
        self.adhesion = {w: np.asarray(columns[f"adhesion_{w}"], dtype=float) for w in axle_of}
        share = load / load.sum(axis=1, keepdims=True)
        self.mean_slip = (np.column_stack(list(self.slip.values())) * share).sum(axis=1)
        self.mean_adhesion = (np.column_stack(list(self.adhesion.values())) * share).sum(axis=1)
        self.resistance = np.asarray(columns["soil_resistance"], dtype=float)
        self.force = {
            w: _ratio(columns[f"wheel_force_x_{w}"], columns[f"wheel_force_z_{w}"])
            for w in estimates.vehicle.wheels
            if f"wheel_force_x_{w}" in columns and f"wheel_force_z_{w}" in columns
        }
        self.counts = (
            (estimates.event_codes == 0) & np.isfinite(self.mean_slip) & np.isfinite(self.mean_adhesion)
        )
        self.labels = columns.get("soil")

    def section(self, stretch: Stretch, begin: int) -> Section:
        """The section of a stretch that counts from row `begin` on."""
        rows = slice(begin, stretch.last)
        counts = begin + np.flatnonzero(self.counts[rows])
        return Section(
            start=float(self.time[begin]),
            end=float(self.time[stretch.last - 1]),
            entered=float(self.time[stretch.first]),
            soil=stretch.soil,
            probabilities=stretch.probabilities,
            samples=counts.size,
            **_moments("slip", self.mean_slip[counts]),
            **_moments("adhesion", self.mean_adhesion[counts]),
            **_moments("resistance", self.resistance[counts]),
            wheels={
                w: _moments("slip", self.slip[w][counts]) | _moments("adhesion", self.adhesion[w][counts])
                for w in self.slip
            },
            measured={
                w: _moments("force_ratio", ratio[counts])
                for w, ratio in self.force.items()
                if np.isfinite(ratio[counts]).any()
            },
            label="" if self.labels is None else _commonest(self.labels[rows]),
        )


def _moments(name: str, values: Floats) -> dict[str, float | None]:
    """Mean and SD of a quantity, by their names."""
    known = values[np.isfinite(values)]
    mean, std = (float(known.mean()), float(known.std())) if known.size else (None, None)
    return {f"{name}_mean": mean, f"{name}_std": std}


def _ratio(force: Floats, load: Floats) -> Floats:
    """F_x/F_z of a force sensor, (rows,), NaN where the wheel is nearly lifted."""
    typical = np.nanmedian(load) if np.isfinite(load).any() else np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(load > 0.2 * typical, force / load, np.nan))


def _commonest(labels: NDArray[np.object_]) -> str:
    names, counts = np.unique([str(x) for x in labels if x], return_counts=True)
    return str(names[counts.argmax()]) if names.size else ""

"""What one soil's advice is worked out from: the vehicle's own slip, adhesion, resistance and pull, row by row of its drives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from terragrip.advice.fuel import fuel_rate_of
from terragrip.arrays import Floats
from terragrip.estimation import Estimates
from terragrip.estimation.provenance import measures
from terragrip.soil.estimates import whole_length
from terragrip.soil.transitions import settled
from terragrip.vehicle import Vehicle

RADII = 10.0
"""Wheel radii of way that count as one draw: several times the length over which ground varies (2 m of the paper's robot)."""
HARD, LOADED = 0.9, 0.2
"""Stretches that pull less than ``LOADED`` of what the quantile ``HARD`` of the way pulls are no work: transport, or a lifted tool."""


@dataclass(frozen=True)
class Samples:
    """Rows of one soil, arrays (rows,), where vehicle and tool are on it and nothing is flagged.

    ``slip``, ``adhesion``: the driven wheels' mean by load; ``resistance`` rho_s; ``pull``: net pull over weight, driven share times mu
    less all resistances; ``metres`` of way that each stands for; ``stretch``: run and `RADII` wheel radii of it; ``speed`` [m/s];
    ``slip_std``, ``adhesion_std``, ``resistance_std``: the estimates' own SD; ``wheel_adhesion``
    (rows, driven wheels); ``fuel`` [m³/s], NaN where not measured. ``driven``: the driven wheels' share of the weight, the mean.
    ``towed``: a drawbar force was in every log; without, a tool's pull is part of ``resistance``.
    """

    slip: Floats
    adhesion: Floats
    resistance: Floats
    pull: Floats
    metres: Floats
    stretch: NDArray[np.int64]
    speed: Floats
    slip_std: Floats
    adhesion_std: Floats
    resistance_std: Floats
    wheel_adhesion: Floats
    fuel: Floats
    driven: float
    towed: bool

    def levels(self, count: int = 12) -> tuple[Floats, Floats]:
        """(slip, pull): means (count,) over equal ways from the lowest pull to the highest."""
        order = np.argsort(self.pull, kind="stable")
        share = np.cumsum(self.metres[order]) / self.way
        cell = np.minimum((share * count).astype(np.int64), count - 1)
        way = np.bincount(cell, weights=self.metres[order], minlength=count)
        slip, pull = (
            np.bincount(cell, weights=(x * self.metres)[order], minlength=count)[way > 0] / way[way > 0]
            for x in (self.slip, self.pull)
        )
        return slip, pull

    def under_load(self) -> Samples:
        """The rows of the stretches that work (`LOADED`); all of them where nothing pulls.

        Transport tells of the curve, but its load is not to be advised on: its mean with the work's is a load that nobody pulled.
        """
        _, index = np.unique(self.stretch, return_inverse=True)
        way = np.bincount(index, weights=self.metres)
        pull = np.bincount(index, weights=self.metres * self.pull) / np.where(way > 0, way, 1.0)
        order = np.argsort(pull, kind="stable")
        hard = pull[order][np.searchsorted(np.cumsum(way[order]), HARD * way.sum())]
        rows = pull[index] >= (LOADED * hard if hard > 0 else -np.inf)
        columns = [one.name for one in fields(self) if one.name not in ("driven", "towed")]
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})

    @property
    def way(self) -> float:
        """Metres of all rows."""
        return float(self.metres.sum())


def driven_wheels(estimates: Estimates, vehicle: Vehicle) -> list[str]:
    """The driven wheels that the table has."""
    return [wheel for wheel in vehicle.driven_wheels if wheel in estimates.wheels]


def wheel_loads(estimates: Estimates, vehicle: Vehicle, wheels: Sequence[str]) -> Floats:
    """Vertical load of each wheel by row, (rows, wheels) [N]: its part of its axle's."""
    axle = dict(zip(vehicle.wheels, vehicle.wheel_axle, strict=True))
    count = np.bincount(vehicle.wheel_axle)
    columns = [estimates[f"vertical_load_{vehicle.axle_names[axle[w]]}"] / count[axle[w]] for w in wheels]
    return np.stack(columns, axis=1)


class GatheredSamples:
    """The usable rows of drives by soil label, table after table; rows without a label are all of one soil, named "" (or ``soil``)."""

    def __init__(self, vehicle: Vehicle, soil: str | None = None) -> None:
        self._vehicle, self._soil, self._count = vehicle, soil, 0
        self._parts: dict[str, list[Samples]] = {}
        self._masses: list[float] = []

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle with what it carried on average, where its mass was measured."""
        return self._vehicle.loaded(float(np.mean(self._masses))) if self._masses else self._vehicle

    def add(self, estimates: Estimates) -> None:
        """The rows of one more drive."""
        for name, part in _of_table(estimates, self._vehicle, self._soil, self._count):
            self._parts.setdefault(name, []).append(part)
        self._count += 1
        if "mass" in estimates.names and np.isfinite(estimates["mass"]).any():
            self._masses.append(float(np.nanmean(estimates["mass"])))

    def by_soil(self) -> dict[str, Samples]:
        """All of them, by soil."""
        return {name: _joined(several) for name, several in sorted(self._parts.items())}


def _of_table(
    estimates: Estimates, vehicle: Vehicle, soil: str | None, number: int
) -> Iterable[tuple[str, Samples]]:
    distance = np.asarray(estimates["distance"], dtype=float)
    labels = np.full(len(estimates), soil or "", dtype=object)
    if soil is None and "soil" in estimates.names:
        labels = np.asarray(estimates["soil"], dtype=object)
    good = estimates.during("")
    if (labels != labels[:1]).any():
        good &= settled(distance, labels, whole_length(vehicle)) | (labels == "")
    wheels = driven_wheels(estimates, vehicle)
    load = wheel_loads(estimates, vehicle, wheels)
    every = wheel_loads(estimates, vehicle, [w for w in vehicle.wheels if w in estimates.wheels]).sum(axis=1)
    share = load / load.sum(axis=1, keepdims=True)

    def mean(quantity: str) -> Floats:
        return np.asarray(sum(estimates[quantity.format(w)] * share[:, k] for k, w in enumerate(wheels)))

    slip, adhesion = mean("slip_{}"), mean("adhesion_{}")
    resistance, driven = estimates["soil_resistance"], load.sum(axis=1) / every
    pull = driven * adhesion - (1 - driven) * vehicle.tire_rolling_resistance - resistance
    metres = np.diff(distance, prepend=distance[:1])
    length = RADII * float(vehicle.wheel_radius.max())
    good &= np.isfinite([slip, adhesion, resistance, metres]).all(axis=0) & (metres > 0)
    stretch = number * 1_000_000 + np.floor(np.nan_to_num(distance) / length).astype(np.int64)
    each = np.stack([estimates[f"adhesion_{w}"] for w in wheels], axis=1)
    fuel = fuel_rate_of(estimates)
    towed = measures(estimates.about, "drawbar_force")
    slip_std, adhesion_std = mean("slip_{}_std"), mean("adhesion_{}_std")
    for name in sorted(set(labels[good])):
        rows = good & (labels == name)
        yield (
            str(name),
            Samples(
                slip[rows], adhesion[rows], resistance[rows], pull[rows], metres[rows], stretch[rows],
                np.asarray(estimates["ground_speed"])[rows], slip_std[rows], adhesion_std[rows],
                np.asarray(estimates["soil_resistance_std"])[rows], each[rows], fuel[rows], float(driven[rows].mean()), towed,
            ),
        )  # fmt: skip


def _joined(parts: Sequence[Samples]) -> Samples:
    columns = [name for name in Samples.__dataclass_fields__ if name not in ("driven", "towed")]
    way = [part.way for part in parts]
    driven = float(np.average([part.driven for part in parts], weights=way))
    return Samples(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in columns},
        driven=driven,
        towed=all(part.towed for part in parts),
    )

"""What a calibration hands back: quantities with their intervals, and what could not be determined."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from terragrip.estimation.consistency import NORMAL_95
from terragrip.text import aligned
from terragrip.vehicle import Vehicle
from terragrip.vehicle_parts import Calibration as CalibrationBlock

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Evidence:
    """What a quantity was computed from: a log, the time span [s] used in it, and samples (or windows)."""

    source: str
    start: float
    end: float
    samples: int


@dataclass(frozen=True)
class Quantity:
    """A calibrated quantity.

    ``key`` names its place in the vehicle file's ``calibration`` block and ``wheel`` the entry there, if the place
    holds one per wheel. ``std`` is the standard error with all that is considered; the 95 % interval is value
    ± factor std, where factor is that of few degrees of freedom where they are few. ``sentence`` says how it was
    found and on what assumption. ``own_std`` is the part of ``std`` that the vehicle's other uncertainties do not hold
    already (None: all of it).
    """

    key: str
    value: float
    std: float
    unit: str
    evidence: tuple[Evidence, ...]
    sentence: str
    wheel: str | None = None
    factor: float = NORMAL_95
    own_std: float | None = None

    @property
    def name(self) -> str:
        """``drive_torque_gain fl``."""
        return self.key if self.wheel is None else f"{self.key} {self.wheel}"

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - self.factor * self.std, self.value + self.factor * self.std

    @property
    def spread(self) -> float:
        """The standard deviation that the rest of the vehicle file should count with: ``own_std`` (or ``std``), widened
        where few degrees of freedom widen the interval."""
        return (self.std if self.own_std is None else self.own_std) * self.factor / NORMAL_95

    @property
    def rounded(self) -> float:
        """The value to a hundredth of its standard error: what a file should hold."""
        if not 0 < self.std < math.inf:
            return self.value
        return round(self.value, 2 - math.floor(math.log10(self.std)))

    @property
    def applies(self) -> bool:
        """Whether it has a place in the vehicle file; what has none is a check."""
        return self.key in CalibrationBlock.model_fields

    @property
    def samples(self) -> int:
        """Samples over all evidence."""
        return sum(part.samples for part in self.evidence)


@dataclass(frozen=True)
class Unknown:
    """A quantity that the data cannot give, and why."""

    name: str
    why: str


@dataclass(frozen=True)
class Calibration:
    """The result of :func:`terragrip.calibrate`.

    ``quantities`` were found, ``unknown`` could not be. ``uncertainty`` holds what is left of the constants that
    the vehicle file's ``uncertainty`` block considers. ``notes``: sentences on what is doubtful about the logs.
    """

    quantities: tuple[Quantity, ...]
    unknown: tuple[Unknown, ...]
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Quantity:
        """The quantity of a name such as ``"drive_torque_gain fl"``; raises KeyError if it was not found."""
        for quantity in self.quantities:
            if quantity.name == name:
                return quantity
        raise KeyError(name)

    def __contains__(self, name: str) -> bool:
        return any(quantity.name == name for quantity in self.quantities)

    def apply(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with the quantities in its ``calibration`` block and the rest in ``uncertainty``.

        What the data could not give keeps what the vehicle says. Raises InputError if a value is impossible for a
        vehicle.
        """
        data = vehicle.to_dict()
        block: dict[str, Any] = dict(data.get("calibration", {}))
        for quantity in self.quantities:
            if not quantity.applies:
                continue
            value = quantity.rounded
            if quantity.wheel is None:
                block[quantity.key] = value
            else:
                block[quantity.key] = {**block.get(quantity.key, {}), quantity.wheel: value}
        if block:
            data["calibration"] = block
        if self.uncertainty:
            left = {name: float(f"{value:.3g}") for name, value in self.uncertainty.items()}
            data["uncertainty"] = {**data.get("uncertainty", {}), **left}
        return Vehicle.from_dict(data)

    def to_pandas(self) -> pd.DataFrame:
        """A row a quantity: value, standard error, 95 % interval, unit, samples, sentence."""
        from terragrip.estimation.calibration.views import table_of

        return table_of(self)

    def plot(self) -> Figure:
        """The quantities with their intervals, as a matplotlib figure; raises InputError where there is none, or no matplotlib."""
        from terragrip.estimation.calibration.views import plot

        return plot(self)

    def _repr_html_(self) -> str:
        from terragrip.estimation.calibration.views import html_of

        return html_of(self)

    def table(self) -> str:
        """The quantities with their intervals and evidence, and what could not be determined, as plain text."""
        rows = [("quantity", "value", "95 % interval", "unit", "from")]
        rows += [_row(quantity) for quantity in self.quantities]
        lines = aligned(rows)
        sentences = dict.fromkeys((quantity.key, quantity.sentence) for quantity in self.quantities)
        lines += ["", *(f"{key}: {sentence}" for key, sentence in sentences)] if sentences else []
        lines += ["", "Not determined by the data:"] if self.unknown else []
        lines += [f"  {unknown.name}: {unknown.why}" for unknown in self.unknown]
        lines += ["", *(f"Note: {note}" for note in self.notes)] if self.notes else []
        return "\n".join(line.rstrip() for line in lines)


def _row(quantity: Quantity) -> tuple[str, str, str, str, str]:
    low, high = quantity.interval
    digits = max(0, 2 - math.floor(math.log10(max(high - low, 1e-12))))
    logs = len({part.source for part in quantity.evidence})
    span = sum(part.end - part.start for part in quantity.evidence)
    place = quantity.evidence[0].source if logs == 1 else f"{logs} logs"
    return (
        quantity.name,
        f"{quantity.value:.{digits}f}",
        f"{low:.{digits}f} to {high:.{digits}f}",
        quantity.unit if quantity.unit != "1" else "",
        f"{quantity.samples} samples in {span:.0f} s of {place}",
    )

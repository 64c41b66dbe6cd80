"""The table of measurements: one row per instant, SI units, NaN where a channel was not measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError, nearest, suggestion
from terragrip.recording import checks
from terragrip.recording.brake import refuse_no_share
from terragrip.recording.clock import LATEST, clock_index
from terragrip.recording.columns import numbers, seconds, stamps_of, start_of, texts
from terragrip.recording.frames import frame_of, in_si
from terragrip.recording.schema import (
    LABELS,
    REFERENCES,
    TIME,
    is_channel,
    split_channel,
    unit_of,
    wheel_names_in,
)

if TYPE_CHECKING:
    import pandas as pd

    from terragrip.vehicle import Vehicle


class ByName:
    """A table whose columns are read by name, ``table["time"]``; iteration gives the names, ``len`` the rows."""

    time: Floats

    @property
    def names(self) -> tuple[str, ...]:
        """All columns in the table's order."""
        raise NotImplementedError

    def _column(self, name: str) -> npt.NDArray[Any]:
        """The column of a name that there is."""
        raise NotImplementedError

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def keys(self) -> tuple[str, ...]:
        """The names, by which ``dict(table)`` has all columns: for pandas, or SciPy's ``savemat``."""
        return self.names

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """One column (n,); raises KeyError if there is none, and TypeError on rows or lists of names."""
        if not isinstance(name, str):
            raise TypeError(self._usage())
        if name not in self.names:
            hint = suggestion(name, self.names, f"the columns are {', '.join(self.names)}")
            raise KeyError(f"there is no column {name}; {hint}")
        return self._column(name)

    def __array__(self, *_: Any, **__: Any) -> NoReturn:
        """Raises TypeError: as an array, or a DataFrame of it, a table would be a list of its names."""
        raise TypeError(self._usage())

    if not TYPE_CHECKING:  # which would then take any attribute for granted

        def __getattr__(self, name: str) -> NoReturn:
            raise AttributeError(f"there is no {name!r}: {self._usage()}")

    def _usage(self) -> str:
        me = type(self).__name__.lower()
        return f"a column is {me}['time'], rows are {me}.select(rows), a DataFrame is {me}.to_pandas()"


@dataclass(frozen=True, eq=False)
class Recording(ByName):
    """Measured channels on one time base (columns and units: architecture.md, contracts).

    ``time`` (n,) [s] increases; ``channels`` are float64 (n,) by name, NaN = not measured at that
    instant; ``labels`` are text (n,), empty = unlabelled; ``notes`` are plain sentences for the user;
    ``noise`` is the standard deviation of a channel where the reader knows it (a derived one); ``start`` is the clock time of time 0
    [s since 1970], None where the log has none; ``profiles`` are those that the log was read with, as in their files; ``delay`` is the SD
    [s] of what the log's ground speed is late by behind its wheels, None where nobody has looked (`lag.delay_of`).
    Arrays may be read-only.
    """

    time: Floats
    channels: dict[str, Floats]
    labels: dict[str, npt.NDArray[np.object_]] = field(default_factory=dict)
    source: str | None = None
    sha256: str | None = None
    notes: tuple[str, ...] = ()
    noise: dict[str, float] = field(default_factory=dict)
    start: float | None = None
    profiles: tuple[Mapping[str, Any], ...] = ()
    delay: float | None = None

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        source: str | None = None,
        *,
        sha256: str | None = None,
        notes: Sequence[str] = (),
        noise: Mapping[str, float] | None = None,
        start: float | None = None,
    ) -> Self:
        """Convert a pandas or polars frame, an Arrow table, an xarray Dataset or a mapping of arrays; SI in float64 is not copied.

        Units as `frame_of` finds them are converted.

        Raises InputError with column and row on a missing required column (time, ground_speed, a wheel
        speed), text or infinities in a channel, a required channel without any value, time that is NaN,
        repeats or decreases, and on an empty table. ``source`` is the file that errors name. Without ``start``, it follows from
        dates and stamps since 1970.
        """
        table = frame_of(frame, source)
        checks.require_columns(table.columns, source, table.units)
        columns = in_si(table.columns, table.units, source)
        columns = {**columns, TIME: stamps_of(columns[TIME], source)}
        result, remark = cls.of_block(columns, source)
        remarks = [*notes, *table.notes, *remark, *checks.remarks(columns)]
        if start is None:
            start = start_of(columns[TIME], result.time)
        channels = {}
        for name, values in result.channels.items():
            if np.isnan(values).all():
                checks.refuse_empty(name, source)
                remarks.append(f"{name} has no value and is left out.")
            else:
                channels[name] = values
        notes = tuple(dict.fromkeys(remarks))
        return cls(result.time, channels, result.labels, source, sha256, notes, dict(noise or {}), start)

    @classmethod
    def of_block(
        cls,
        columns: Mapping[str, npt.NDArray[Any]],
        source: str | None,
        *,
        first_row: int = 0,
        after: float | None = None,
    ) -> tuple[Self, list[str]]:
        """Consecutive rows of a table, unchanged, with channels without a value too, and remarks on their time.

        ``first_row``: the number of rows of the table before them; ``after``: the time of the last of those. Raises InputError as
        `from_frame` does for time, texts and infinities.
        """
        time, remarks = seconds(columns[TIME], source)
        checks.check_time(time, source, first_row=first_row, after=after)
        channels: dict[str, Floats] = {}
        labels: dict[str, npt.NDArray[np.object_]] = {}
        for name, column in columns.items():
            if name in LABELS:
                labels[name] = texts(name, column, len(time), source)
            elif is_channel(name):
                channels[name] = numbers(name, column, time, source)
                checks.refuse_infinite(name, channels[name], time, source, first_row=first_row)
                checks.refuse_place(name, channels[name], source)
        north, east = (channels.get(name) for name in checks.PLACES)
        nowhere = np.zeros(0) if north is None or east is None else (north == 0.0) & (east == 0.0)
        if nowhere.any():
            remarks.append(
                "Rows whose latitude and longitude are both 0 are without a fix: they have no position."
            )
            channels |= {name: np.where(nowhere, np.nan, channels[name]) for name in checks.PLACES}
        return cls(time, channels, labels, source), remarks

    @property
    def names(self) -> tuple[str, ...]:
        """All columns: time, channels, labels."""
        return (TIME, *self.channels, *self.labels)

    def _column(self, name: str) -> npt.NDArray[Any]:
        return self.time if name == TIME else {**self.channels, **self.labels}[name]

    def __repr__(self) -> str:
        span = f"{self.time[-1] - self.time[0]:.1f} s" if len(self) else "no row"
        return f"<Recording: {len(self)} rows, {span}: {', '.join([*self.channels, *self.labels])}>"

    @property
    def clock_zero(self) -> float | None:
        """``start``, if it and the last row are dates of 1970 to 2199; else None."""
        if self.start is None or not len(self) or not -LATEST < self.start < LATEST:
            return None
        return self.start if self.start + self.time[0] > 0 and self.start + self.time[-1] < LATEST else None

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels that have a wheel speed, in the order of the columns."""
        return tuple(name for name in wheel_names_in(self.channels) if f"wheel_speed_{name}" in self.channels)

    @property
    def references(self) -> tuple[str, ...]:
        """Names of the columns that no filter may use: measured wheel forces and ``true_`` columns."""
        return tuple(n for n in self.channels if n.startswith(REFERENCES))

    def select(self, rows: Any) -> Self:
        """The rows of a mask, a slice or an array of increasing indices; a slice copies no data."""
        return replace(
            self,
            time=self.time[rows],
            channels={name: values[rows] for name, values in self.channels.items()},
            labels={name: values[rows] for name, values in self.labels.items()},
        )

    def with_channels(self, **channels: npt.ArrayLike) -> Self:
        """The same recording with channels (n,) added or replaced; raises InputError on another length."""
        added = {name: numbers(name, np.asarray(c), self.time, self.source) for name, c in channels.items()}
        return replace(self, channels={**self.channels, **added}, delay=None)

    def with_notes(self, *notes: str) -> Self:
        """The same recording with notes added, each once."""
        return replace(self, notes=tuple(dict.fromkeys((*self.notes, *notes))))

    def to_pandas(self) -> pd.DataFrame:
        """The whole table as a pandas DataFrame, time first.

        Its index is the clock time (UTC) where the log has one, else the row's number; ``attrs`` has ``units`` and ``notes``.
        """
        import pandas as pd

        result = pd.DataFrame({TIME: self.time, **self.channels, **self.labels}, copy=False)
        if self.clock_zero is not None:
            result.index = clock_index(self.time, datetime.fromtimestamp(self.clock_zero, UTC))
        result.attrs = {"units": {name: unit_of(name) or "" for name in result}, "notes": list(self.notes)}
        return result

    def _repr_html_(self) -> str:
        from terragrip.html import figure_of, html_notes, html_table

        span = f"{len(self)} rows, {self.time[-1] - self.time[0]:.1f} s" if len(self) else "no row"
        rows = []
        for name, values in self.channels.items():
            known = values[np.isfinite(values)]
            figures = (known.min(), np.median(known), known.max()) if len(known) else (None, None, None)
            rows.append((name, unit_of(name) or "", len(known), *map(figure_of, figures)))
        head = ("channel", "unit", "values", "min", "median", "max")
        return html_table(head, rows, f"{self.source or 'recording'}: {span}") + html_notes(self.notes)

    def check_against(self, vehicle: Vehicle) -> None:
        """Raise InputError unless the log's wheels and axles are the vehicle's, with all channels that estimates need.

        A driven wheel needs a speed and a torque; a free one without a speed rolls with the ground, and without a torque
        column has torque 0. A drawbar force
        on two or more axles needs the vehicle's ``hitch_height``, since it moves load between them.
        """
        known = ", ".join(vehicle.wheels)
        for name in self.channels:
            quantity, owner = split_channel(name) or ("", "")
            if quantity == "vertical_load" and owner not in vehicle.axle_names:
                axles = ", ".join(vehicle.axle_names)
                raise self._unfit(name, f"the vehicle has no axle {owner}", f"its axles are {axles}")
            if quantity not in ("", "vertical_load") and owner not in vehicle.wheels:
                unit, wheel = checks.unit_behind(name, name), owner.rpartition("_")[0]
                hint = f"its wheels are {known}"
                if unit and wheel in vehicle.wheels:
                    hint = f"write a unit in brackets: '{quantity}_{wheel} [{unit}]'"
                raise self._unfit(name, f"the vehicle has no wheel {owner}", hint)
        for wheel, driven in zip(vehicle.wheels, vehicle.driven, strict=True):
            if wheel not in self.wheels and (driven or self._like(f"wheel_speed_{wheel}")):
                evidence = (
                    f"the log has wheel speeds for {', '.join(self.wheels)}; the vehicle has wheels {known}"
                )
                raise self._missing(f"wheel_speed_{wheel}", "is missing", f"{evidence}; name them alike")
            if driven and f"drive_torque_{wheel}" not in self.channels:
                hint = "add it, or say 'driven: false' in the vehicle file if its axle has no drive"
                raise self._missing(
                    f"drive_torque_{wheel}", f"is missing, but the wheel {wheel} is driven", hint
                )
        for force in ("drawbar_force", "hitch_load"):
            checks.require_hitch(vehicle, force, self.channels, self.source)
        checks.refuse_other_mass(vehicle, self.channels, self.source)
        refuse_no_share(self.channels, self.source)

    def _like(self, column: str) -> str | None:
        """The unused column of the log that is named most like this one."""
        unused = "".join(n[len(checks.UNUSED) : -1] for n in self.notes if n.startswith(checks.UNUSED))
        return nearest(column, unused.split(", "))

    def _missing(self, column: str, problem: str, hint: str) -> InputError:
        if near := self._like(column):
            hint = f"the nearest column is {near!r}: rename it, or map it in a profile"
        return self._unfit(column, problem, hint, "vehicle#signals-that-are-missing")

    def _unfit(self, column: str, problem: str, hint: str, page: str | None = None) -> InputError:
        return InputError(problem, file=self.source, place=f"column {column}", hint=hint, page=page)

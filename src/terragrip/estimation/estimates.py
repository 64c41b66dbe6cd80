"""The table of estimates: one row per recording row, SI units (architecture.md, contracts)."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.arrow import choices, codes_of, floats, texts, values_of
from terragrip.estimation.columns import column_named, wheels_with
from terragrip.estimation.engine import EVENTS
from terragrip.recording.clock import clock_index
from terragrip.recording.table import ByName

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure

    from terragrip.vehicle import Vehicle


METADATA_KEY = b"terragrip"
"""Under it a Parquet file holds, as JSON, what the table was made from."""


@dataclass(frozen=True, eq=False)
class Estimates(ByName):
    """Estimates of one recording.

    ``time`` (n,) [s]; ``columns`` float64 (n,) by name in the table's order, then the recording's own columns
    (position, references), each with the unit of `terragrip.estimation.columns`; ``event_codes`` (n,) index
    :data:`~terragrip.estimation.engine.EVENTS`; ``labels`` text (n,), such as ``soil``; ``about``: version,
    method, smooth, vehicle, recording (source, sha256, start, profile), settings (noise, held, thresholds); ``notes``: plain
    sentences for the user.

    A quantity has a twin ``_std``: one standard deviation that covers the filter's own variance and the
    constants that the data cannot determine. ``channels`` is the number of channels in an update, the expectation of
    ``nis``. ``supervisor`` is γ of the supervised policy, 1 under `aukf`, 0 under a fixed policy. Under `bank`
    it is the position of the expected scale of the noise between the smallest (0) and the largest (1), on a
    logarithmic scale. ``adaptation_<state>`` (of `aukf` and `aukf-fs` alone) are the factors a_j on the diagonal of
    A_k, one for each state of the filter: the process noise of the row was Q_k = [I + γ_k (A_k - I)] Q_0
    (physics.md 6). ``curve_a`` (vehicle, and of each wheel) is the scale of the adhesion curve known so far
    (docs/kernel.md). ``warning`` is the score of the warning of immobilization, ``warning_<sign>`` its signs in points,
    ``warning_usual_slip`` the usual slip (docs/events.md). A value is NaN only where ``event`` gives the reason: slip and
    efficiency at ``standstill``, speeds in a ``gap`` before the first measurement, and in a ``gap`` of one wheel's speed,
    drive torque or the drawbar force alone all that depends on it.
    """

    time: Floats
    columns: dict[str, Floats]
    event_codes: npt.NDArray[np.uint8]
    labels: dict[str, npt.NDArray[np.object_]] = field(default_factory=dict)
    about: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All columns in the table's order."""
        return ("time", *self.columns, *self.labels, "event")

    def _column(self, name: str) -> npt.NDArray[Any]:
        if name == "event":
            return np.array(EVENTS, dtype=object)[self.event_codes]
        return self.time if name == "time" else {**self.columns, **self.labels}[name]

    def __repr__(self) -> str:
        of = (self.about.get("vehicle") or {}).get("name", "a vehicle")
        span = f"{self.time[-1] - self.time[0]:.1f} s" if len(self) else "no row"
        return f"<Estimates of {of} by {self.about.get('method', 'a method')}: {len(self)} rows, {span}, {len(self.names)} columns>"

    def select(self, rows: Any) -> Self:
        """The rows of a mask, a slice or an array of increasing indices; a slice copies no data."""
        return replace(
            self,
            time=self.time[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
            event_codes=self.event_codes[rows],
            labels={name: values[rows] for name, values in self.labels.items()},
        )

    def during(self, *kinds: str) -> npt.NDArray[np.bool_]:
        """The rows (n,) whose event is one of ``kinds``; "" is none. Raises ValueError on a kind that there is not."""
        return np.isin(self.event_codes, [EVENTS.index(kind) for kind in kinds])

    @property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels, in the vehicle's order."""
        return wheels_with("slip", self.columns)

    @property
    def has_adhesion(self) -> bool:
        """Whether torques were measured; without them there are slip and speeds alone."""
        return bool(wheels_with("adhesion", self.columns))

    @property
    def soil(self) -> npt.NDArray[np.object_]:
        """The log's soil label of each row (n,), empty where it has none."""
        return self.labels.get("soil", np.full(len(self), "", dtype=object))

    @property
    def method(self) -> str:
        """Name of the method."""
        return str(self.about.get("method", ""))

    @cached_property
    def vehicle(self) -> Vehicle:
        """The vehicle of the estimates; raises InputError if the table does not contain one."""
        from terragrip.vehicle import Vehicle

        if "vehicle" not in self.about:
            raise InputError(
                "the estimates contain no vehicle", hint="estimate the log again with this version"
            )
        return Vehicle.from_dict(self.about["vehicle"])

    @property
    def start(self) -> datetime | None:
        """The clock time (UTC) of the log's time 0, None where the log has none; dates without a zone count as UTC."""
        text = self.about.get("recording", {}).get("time_zero")
        return None if text is None else datetime.fromisoformat(text)

    def to_pandas(self) -> pd.DataFrame:
        """The whole table as a pandas DataFrame; ``event`` and labels are text.

        Its index is the clock time (UTC) where the log has one, else the row's number; beside rows of another table put arrays,
        ``table["slip"] = estimates["slip_rr"]``, since pandas places a Series by its index. ``attrs`` has ``units`` and ``descriptions``
        by column, ``notes``, and the content of `about`.
        """
        import pandas as pd

        table: dict[str, Any] = {"time": self.time, **self.columns}
        table.update(
            {
                name: pd.Series(values, dtype=pd.StringDtype(na_value=np.nan))
                for name, values in self.labels.items()
            }
        )
        table["event"] = pd.Series(self._events().to_pandas(), dtype=pd.StringDtype(na_value=np.nan))
        found = pd.DataFrame(table, copy=False)
        if self.start is not None:
            found.index = clock_index(self.time, self.start)
        meanings = {name: column_named(name) for name in self.names}
        found.attrs = {
            **self.about,
            "notes": list(self.notes),
            "units": {name: column.unit for name, column in meanings.items()},
            "descriptions": {name: column.description for name, column in meanings.items()},
        }
        return found

    def to_arrow(self) -> pa.Table:
        """The whole table as an Arrow table without copies, with its metadata and each column's unit and description."""
        import pyarrow as pa

        numbers = {"time": self.time, **self.columns}
        arrays: dict[str, Any] = {name: floats(values) for name, values in numbers.items()}
        arrays |= {name: texts(values) for name, values in self.labels.items()}
        arrays["event"] = self._events()
        fields = [
            pa.field(name, values.type, metadata=column_named(name)._asdict())
            for name, values in arrays.items()
        ]
        return pa.table(list(arrays.values()), schema=pa.schema(fields, {METADATA_KEY: self.metadata()}))

    def _events(self) -> pa.Array:
        return choices(self.event_codes, EVENTS)

    def metadata(self) -> bytes:
        """The metadata of a Parquet file: `about` and `notes` as JSON."""
        return json.dumps({**self.about, "notes": list(self.notes)}).encode()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a file, whole or not at all, in the format of its suffix (docs/export.md); `read` reads Parquet alone.

        Raises InputError if the suffix is none of `terragrip.estimation.export.KINDS`, the format cannot represent the table, or the
        file cannot be written.
        """
        from terragrip.estimation.writing import write_parts

        write_parts([self], path)

    def plot(self, kind: Literal["time", "plane", "map"] = "time", quantity: str = "slip") -> Figure:
        """A matplotlib figure, which a notebook shows: "time", speed, slip, adhesion and resistance with 95 % intervals and events;
        "plane", adhesion over slip by soil; "map", the track coloured by a ``quantity``.

        Raises InputError if there is nothing to draw, or matplotlib is not installed.
        """
        from terragrip.estimation.views import plot

        return plot(self, kind, quantity)

    def _repr_html_(self) -> str:
        from terragrip.estimation.views import html_of

        return html_of(self) if len(self) else "<p>no row</p>"

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a Parquet file of estimates; raises InputError if it is missing, damaged or no such table."""
        import pyarrow.parquet as pq

        def whole(name: str) -> Estimates:
            # a column at a time, which threads only slow: a table of all of them beside their arrays would double the memory.
            file = pq.ParquetFile(name, pre_buffer=False)
            return cls._of_columns(
                file.schema_arrow, lambda one: file.read([one], use_threads=False).column(0), name
            )

        made: Self = opened(path, whole)
        return made

    @classmethod
    def read_about(cls, path: str | os.PathLike[str]) -> dict[str, Any]:
        """The origin of a Parquet file of estimates (``about``), without its rows; raises InputError as `read`."""
        import pyarrow.parquet as pq

        about: dict[str, Any] = json.loads(
            (opened(path, pq.read_schema).metadata or {}).get(METADATA_KEY, b"{}")
        )
        about.pop("notes", None)
        return about

    @classmethod
    def from_arrow(cls, table: pa.Table, source: str | None = None) -> Self:
        """Convert an Arrow table of estimates; raises InputError if columns are missing or of another type."""
        return cls._of_columns(table.schema, table.column, source)

    @classmethod
    def _of_columns(
        cls, schema: pa.Schema, column: Callable[[str], pa.ChunkedArray], source: str | None
    ) -> Self:
        """From the columns that ``column`` gives by name."""
        missing = [n for n in ("time", "event", "ground_speed") if n not in schema.names]
        if missing:
            raise InputError(
                "is missing, so this is not a table of estimates",
                file=source,
                place=f"column {missing[0]}",
                hint="give a file written by 'terragrip estimate'",
            )
        about = json.loads((schema.metadata or {}).get(METADATA_KEY, b"{}"))
        notes = tuple(about.pop("notes", ()))
        columns: dict[str, Floats] = {}
        labels: dict[str, npt.NDArray[np.object_]] = {}
        for name in schema.names:
            if name == "event":
                continue
            values = values_of(column(name))
            if values.dtype.kind in "fiu":
                columns[name] = values.astype(np.float64, copy=False)
            else:
                labels[name] = np.where(values == None, "", values)  # noqa: E711  (elementwise)
        return cls(columns.pop("time"), columns, _event_codes(column("event"), source), labels, about, notes)

    @overload
    def summary(self) -> str: ...

    @overload
    def summary(self, by: str) -> pd.DataFrame: ...

    def summary(self, by: str | None = None) -> str | pd.DataFrame:
        """A short summary for the user, in a few lines of text; ``by`` a label ("soil") or "event": a table, a row for each text
        (see `terragrip.estimation.grouped.summary_by`). Raises InputError where ``by`` is not a column of texts."""
        if by is not None:
            from terragrip.estimation.grouped import summary_by

            return summary_by(self, by)
        from terragrip.estimation.summary import Tally

        tally = Tally()
        tally.add(self)
        return tally.text(self.notes)


def opened(path: str | os.PathLike[str], reading: Callable[[str], Any]) -> Any:
    """The result of ``reading`` on a Parquet file; raises InputError if it is missing, damaged or not a Parquet file."""
    import pyarrow as pa

    from terragrip.files import path_of, refuse_missing, unreadable

    path = path_of(path)
    refuse_missing(path, suffixes=(".parquet",))
    try:
        return reading(os.fspath(path))
    except pa.ArrowInvalid as error:
        hint = "give a file that 'terragrip estimate' wrote: a log is estimated first"
        if os.fspath(path).lower().endswith(".json"):
            hint = "a library of soils is given with --soils, a ground.json with --ground, beside files of estimates"
        raise InputError("is not a Parquet file, or is damaged", file=path, hint=hint) from error
    except OSError as error:
        raise unreadable(path, error) from error


def _event_codes(events: pa.ChunkedArray, source: str | None) -> npt.NDArray[np.uint8]:
    words, codes = codes_of(events)
    if unknown := [word for word in words if word not in EVENTS]:
        raise InputError(f"there is no event {unknown[0]}", file=source, place="column event")
    return np.array([EVENTS.index(str(word)) for word in words], dtype=np.uint8)[codes]

"""What is seen of a log before it means anything: columns, units, the time's column and its instants; of a long log in parts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from terragrip.arrays import Floats
from terragrip.formats.profile import Profile
from terragrip.formats.proposal import profile_text
from terragrip.formats.reading import read_log
from terragrip.formats.recognition import Proposals, propose
from terragrip.formats.signals import SignalLog
from terragrip.formats.spoilt import numbers_of
from terragrip.formats.stamps import Stamps
from terragrip.formats.table import LogTable, Sparse
from terragrip.formats.time_base import with_nanoseconds
from terragrip.formats.time_column import TimeColumn, find_time
from terragrip.formats.vocabulary import GENERAL, Vocabulary
from terragrip.recording.columns import SINCE_1970
from terragrip.recording.repeats import Repeats, merged
from terragrip.recording.schema import LABELS, TIME
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle
from terragrip.written_times import doubt, likely_order, times_of

_LONG, _ENOUGH = 200_000_000, 60_000_000  # bytes of a log that is looked at in parts, and of these parts


def read_whole_or_thinned(
    path: str | os.PathLike[str], dbc: Sequence[str | os.PathLike[str]] = ()
) -> tuple[LogTable | SignalLog, int]:
    """A log as its columns, and of a long one which blocks: one of every so many, all over it (1: all of it). Raises as `read_log`."""
    size = size_of(path)
    every = max(1, round(size / _ENOUGH)) if size > _LONG else 1
    return read_log(path, Sparse(every) if every > 1 else None, tuple(dbc)), every


@dataclass(frozen=True)
class Seen:
    """What is known of a log: columns and units by name, the time's column and unit, its instants [s].

    ``clocks``: the instants of signals that have their own.
    """

    columns: dict[str, npt.NDArray[Any]]
    units: dict[str, str]
    stamp: TimeColumn | None
    base: Floats | None
    clocks: dict[str, Floats]
    since_1970: bool
    whole: bool  # no block of the log was left out
    repeats: Repeats = field(default_factory=Repeats)

    @classmethod
    def of(cls, log: LogTable | SignalLog, *, whole: bool = True, vocabulary: Vocabulary = GENERAL) -> Seen:
        """What is seen of a log; ``whole``: no block of it was left out."""
        if isinstance(log, SignalLog):
            base = log.instants()
            first = float(base[0]) if len(base) else 0.0
            columns = {name: signal.values for name, signal in log.signals.items()}
            units = {name: signal.unit for name, signal in log.signals.items() if signal.unit}
            clocks = {name: signal.time - first for name, signal in log.signals.items()}
            return cls(
                columns, units, TimeColumn(TIME, "s"), base - first, clocks, since_1970=False, whole=whole
            )
        written = {n: v for n, c in log.columns.items() if (v := numbers_of(c)) is not None}
        texts = {  # a block of them may hold numbers
            n: [cell if isinstance(cell, str) else None for cell in c.tolist()]
            for n, c in log.columns.items()
            if c.dtype == object and n not in (*LABELS, *written)
        }
        orders = {n: order for n, cells in texts.items() if (order := likely_order(cells)) is not None}
        dated = {
            n: times for n, cells in texts.items() if (times := times_of(cells, orders.get(n))) is not None
        }
        log = replace(log, columns={**log.columns, **written, **dated})
        numbers = {n: c.astype(np.float64) for n, c in log.columns.items() if c.dtype.kind in "fiub"}
        stamps = {n: c[~np.isnat(c)] for n, c in log.columns.items() if c.dtype.kind in "mM"}
        # One that never changes is a day, or when a query began or ended.
        dates = tuple(n for n, c in stamps.items() if (c != c[:1]).any())
        stamp = find_time(numbers, dates, log.units, vocabulary)
        repeats = Repeats()
        if stamp is not None and stamp.name in orders:
            problem = (doubt(texts[stamp.name]) or (0, "", ""))[1]
            stamp = stamp._replace(dates=orders[stamp.name], doubt=problem)
        if stamp is not None:
            log = with_nanoseconds(stamp.name, stamp.nanoseconds, log)
            columns, repeats = merged(log.columns, stamp[0])
            log = Stamps(stamp.name, stamp.unit).corrected(replace(log, columns=columns))
        instants = None if stamp is None else _seconds(log.columns[stamp[0]], stamp[1])
        since_1970 = stamp is not None and (
            stamp[0] in dates
            or any(abs(float(x)) * factor_to(stamp[1], "s") > SINCE_1970 for x in log.columns[stamp[0]][:1])
        )
        return cls(log.columns, log.units, stamp, instants, {}, since_1970, whole, repeats)

    @property
    def rows(self) -> int:
        """How many rows the log has, those that say the same twice included; of signals the instants of all."""
        of = next(iter(self.columns.values()), ()) if self.base is None else self.base
        return self.repeats.merged + len(of)

    def clock_of(self, name: str) -> Floats | None:
        """The instants of a column; None of the time column, which has no rate or noise of its own."""
        own = self.stamp is not None and name == self.stamp[0]
        return self.clocks.get(name, None if own else self.base)

    def numbers(self) -> dict[str, Floats]:
        """The numeric columns but time."""
        own = None if self.stamp is None or self.clocks else self.stamp[0]
        kept = {n: c for n, c in self.columns.items() if c.dtype.kind in "fiub" and n != own}
        return {n: c.astype(np.float64, copy=False) for n, c in kept.items()}

    def proposals(self, vocabulary: Vocabulary, vehicle: Vehicle | None = None) -> Proposals:
        """What each channel may be made of, by a vocabulary, and by the radii of a vehicle."""
        numbers = self.numbers()
        clocks = {name: clock for name in numbers if (clock := self.clock_of(name)) is not None}
        return propose(numbers, self.texts(), self.units, clocks, vocabulary, vehicle)

    def profile_text(
        self, proposals: Proposals, dbc: Sequence[str | os.PathLike[str]] = (), file: str = "a log"
    ) -> str:
        """The profile of proposals, YAML."""
        return profile_text(
            file, self.stamp, proposals, since_1970=self.since_1970, dbc=dbc, namespace=proposals.namespace
        )

    def profile(self, proposals: Proposals) -> Profile:
        """That profile, loaded; raises InputError where it is none."""
        return Profile.from_dict(yaml.safe_load(self.profile_text(proposals)))

    def texts(self) -> dict[str, npt.NDArray[Any]]:
        """The text columns."""
        return {n: c for n, c in self.columns.items() if c.dtype.kind == "O"}


def size_of(path: str | os.PathLike[str]) -> int:
    """Bytes of a log that is a file or a folder; 0 where there is none, for the reader to name."""
    try:
        if os.path.isdir(path):
            return sum(entry.stat().st_size for entry in os.scandir(path) if entry.is_file())
        return os.path.getsize(path)
    except OSError:
        return 0


def _seconds(column: npt.NDArray[Any], unit: str) -> Floats:
    if column.dtype.kind in "mM":
        return np.asarray((column - column[0]) / np.timedelta64(1, "s"), dtype=np.float64)
    if column.dtype.kind in "iu" and len(column):
        column = column.astype(np.int64) - np.int64(column[0])
    return np.asarray(column, dtype=np.float64) * factor_to(unit, "s")

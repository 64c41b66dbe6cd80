"""A log of signals that each have a clock of their own, before they mean anything."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats, Ints
from terragrip.errors import InputError
from terragrip.formats.table import LogTable, Wanted, kept_rows
from terragrip.recording.columns import SINCE_1970
from terragrip.recording.cycles import CYCLE
from terragrip.recording.schema import TIME

SAME = 1e-3
"""Share of the shortest typical spacing within which two stamps are one instant, whatever they are of."""
_STEP = 1.0  # s by which a clock that was set goes back: samples that came late are no such step


@dataclass(frozen=True, eq=False)
class Signal:
    """One signal: ``time`` (n,) [s], ``values`` (n,) float64 (missing = NaN) or texts, and its unit if it is known.

    Signals of one message share one ``time`` array.
    """

    time: Floats
    values: npt.NDArray[Any]
    unit: str | None = None


@dataclass(frozen=True, eq=False)
class Clock:
    """The instants (n,) [s] of the `Samples` that name it by its ``key``."""

    key: Any
    time: Floats


@dataclass(frozen=True, eq=False)
class Samples:
    """The values (n,) of a signal, at the instants of the clock that has its key."""

    name: str
    clock: Any
    values: npt.NDArray[Any]
    unit: str | None = None


def signals_of(items: Iterable[Clock | Samples], wanted: Wanted) -> dict[str, Signal]:
    """Signals by name from clocks and samples, each behind its clock: of a log that is looked at in parts, some of their rows."""
    clocks: dict[Any, Floats] = {}
    result = {}
    for item in items:
        if isinstance(item, Clock):
            clocks[item.key] = item.time[kept_rows(len(item.time), wanted)]
        else:
            values = item.values[kept_rows(len(item.values), wanted)]
            result[item.name] = Signal(clocks[item.clock], values, item.unit)
    return result


@dataclass(frozen=True, eq=False)
class SignalLog:
    """Signals of a log by name: ``names`` are all there are, ``signals`` those that were read.

    ``texts`` says what a signal is of its own accord (a message's comment); ``notes`` are sentences for the user.
    """

    names: tuple[str, ...]
    signals: dict[str, Signal]
    source: str | None = None
    sha256: str | None = None
    notes: tuple[str, ...] = field(default_factory=tuple)

    def table(self, *, release: bool = False) -> LogTable:
        """One table on the union of the instants, NaN where a signal was not measured; texts last until the next.

        Time counts from the first instant; the table's ``start`` says when that was, where stamps count from 1970.
        Stamps that are no finite number are left out and counted; of two values at one instant the later one counts.
        ``release`` takes the signals out of this log one by one as they are spread, so that a long log does not stand in
        memory twice. Raises InputError if no signal that was asked for has a sample.
        """
        if TIME in self.names or TIME in self.signals:
            return self._renamed().table(release=release)
        clocks = {id(s.time): s.time for s in self.signals.values()}
        notes = list(self.notes)
        lost = sum(int(np.sum(~np.isfinite(t))) for t in clocks.values())
        if lost:
            notes.append(f"{lost} stamps are not finite, and their samples were left out.")
        unset = sum(int(np.sum(t < _clock_set_at(t))) for t in clocks.values())
        if unset:
            notes.append(f"{unset} samples were stamped before the logger's clock was set, and left out.")
        orders = {key: _order(t) for key, t in clocks.items()}
        ordered = [clocks[key][order] for key, order in orders.items()]
        base, rows = _cycles(ordered)
        if not len(base):
            if self.signals:
                raise InputError(
                    "has no sample of any known signal", file=self.source, hint="check that it was recorded"
                )
            return LogTable((TIME, *self.names), {}, {}, self.source, self.sha256, tuple(notes), clocked=True)
        place = dict(zip(orders, rows, strict=True))
        disordered = [clocks[key] for key, order in orders.items() if not isinstance(order, slice)]
        back, at = max(map(_set_back, disordered), default=(0.0, 0.0))
        if back > _STEP:
            notes.append(
                f"The clock goes back by {back:.4g} s, {at - base[0]:.4g} s after the start: what was measured before and after "
                "that is mixed; cut the log there."
            )
        start = float(base[0]) if base[0] > SINCE_1970 else None
        base -= base[0]
        replaced = {key: np.zeros(max(len(row) - 1, 0), dtype=np.bool_) for key, row in place.items()}
        units = {name: s.unit for name, s in self.signals.items() if s.unit}
        columns: dict[str, npt.NDArray[Any]] = {TIME: base}
        for name in list(self.signals):
            signal = self.signals.pop(name) if release else self.signals[name]
            order, row = orders[id(signal.time)], place[id(signal.time)]
            values = signal.values[order]
            replaced[id(signal.time)] |= _replaces(values, row)
            columns[name] = _spread(values, row, len(base))
        count = sum(int(np.sum(own)) for own in replaced.values())
        if count:
            notes.append(
                f"{count} samples repeat the time of the one before with another value, and replace it."
            )
        return LogTable(
            (TIME, *self.names), columns, units, self.source, self.sha256, tuple(notes), start, clocked=True
        )

    def instants(self) -> Floats:
        """The union of the signals' instants [s] (n,), as they are stamped."""
        clocks = {id(s.time): s.time for s in self.signals.values()}
        ordered = [clock[_order(clock)] for clock in clocks.values()]
        return _cycles(ordered)[0]

    def _renamed(self) -> SignalLog:
        """The same log, in which a signal ``time`` is ``signal.time``: the table's own time takes that name."""
        names = tuple(_other_time(name) for name in self.names)
        return replace(self, names=names, signals={_other_time(name): s for name, s in self.signals.items()})


def _replaces(values: npt.NDArray[Any], rows: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Whether each of the ``values`` but the first (n - 1,) is of the row (of ``rows``) of the one before, and another."""
    again = rows[1:] == rows[:-1]
    if not again.any():
        return np.asarray(again)
    known = _known(values)
    return np.asarray(again & known[1:] & known[:-1] & (values[1:] != values[:-1]).astype(np.bool_))


def _known(values: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Where values (n,) are measured: no NaN, or no None among texts."""
    return np.asarray(values == values if values.dtype.kind != "O" else values != None)  # noqa: E711  (elementwise)


def _other_time(name: str) -> str:
    return f"signal.{TIME}" if name == TIME else name


def _clock_set_at(time: Floats) -> float:
    """The least stamp that counts: of a clock (n,) most of which counts from 1970, earlier ones are from before it was set."""
    return SINCE_1970 if 2 * np.count_nonzero(time > SINCE_1970) > len(time) else -np.inf


def _set_back(time: Floats) -> tuple[float, float]:
    """By how much [s] a clock (n,) goes back at most from one sample to the next, and the stamp before that."""
    known = time[np.isfinite(time) & (time >= _clock_set_at(time))]
    row = int(np.argmin(np.diff(known))) if len(known) > 1 else 0
    return float(known[row] - known[row + 1] if len(known) > 1 else 0.0), float(
        known[row] if len(known) else 0.0
    )


def _order(time: Floats) -> Ints | slice:
    """Places (m,) of the stamps that count, in the order of time; all of them where they are in order."""
    floor = _clock_set_at(time)
    in_order = bool(np.isfinite(time).all()) and bool((time[1:] >= time[:-1]).all())
    if in_order and not (len(time) and time[0] < floor):
        return slice(None)
    known = np.flatnonzero(np.isfinite(time) & (time >= floor))
    return known[np.argsort(time[known], kind="stable")]


def union(
    clocks: list[Floats], tolerance: float, cycle: float = 0.0
) -> tuple[Floats, list[npt.NDArray[np.int32]]]:
    """The instants (m,) of sorted clocks, and the row (n,) of each of their samples; stamps no more than ``tolerance`` [s] apart are
    one instant, and those no more than ``cycle`` [s] apart where that joins no two of one clock. Frugal, since logs are long.
    """
    if not clocks:
        return np.empty(0), []
    stamps = np.concatenate(clocks)
    if not len(stamps):
        return stamps, [np.empty(0, dtype=np.int32) for _ in clocks]
    order = slice(None) if len(clocks) == 1 else np.argsort(stamps, kind="stable")
    stamps = stamps[order]
    apart = np.empty(len(stamps), dtype=bool)
    apart[0] = True
    np.greater(stamps[1:] - stamps[:-1], max(tolerance, cycle), out=apart[1:])
    row, ends = np.empty(len(stamps), dtype=np.int32), np.cumsum([len(clock) for clock in clocks])[:-1]
    row[order] = np.cumsum(apart, dtype=np.int32)
    twice = [own[1:][own[1:] == own[:-1]] for own in np.split(row, ends)]
    if cycle > tolerance and any(map(len, twice)):  # a burst of late samples
        burst = np.isin(row[order], np.concatenate(twice))
        apart[1:] |= burst[1:] & (stamps[1:] - stamps[:-1] > tolerance)
        row[order] = np.cumsum(apart, dtype=np.int32)
    row -= 1
    del order
    return stamps[apart], np.split(row, ends)


def _cycles(clocks: list[Floats]) -> tuple[Floats, list[npt.NDArray[np.int32]]]:
    """`union` of clocks, a cycle of messages as one instant."""
    spacings = [float(np.median(np.diff(clock))) for clock in clocks if len(clock) > 2]
    shortest = min((s for s in spacings if s > 0), default=0.0)
    return union(clocks, SAME * shortest, CYCLE * shortest)


def _spread(values: npt.NDArray[Any], rows: npt.NDArray[np.int32], length: int) -> npt.NDArray[Any]:
    apart = bool((rows[1:] > rows[:-1]).all())
    if not apart:  # a message without the value, at the instant of one that has it, takes nothing away
        known = _known(values)
        values, rows = values[known], rows[known]
    if values.dtype.kind in "fiub":
        if values.dtype == np.float64 and apart and len(rows) == length:
            return values  # measured at every instant
        result = np.full(length, np.nan)
        result[rows] = values
        return result
    texts = np.full(length, None, dtype=object)
    texts[rows] = values
    last = np.maximum.accumulate(np.where(texts != None, np.arange(length), -1))  # noqa: E711  (elementwise)
    held = texts[np.maximum(last, 0)]
    held[last < 0] = None
    return held

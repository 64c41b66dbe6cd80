"""What a log's stamps need before they are a time base: rows from before its clock was set go, midnights are counted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from terragrip.errors import InputError
from terragrip.formats.table import LogTable
from terragrip.recording.columns import DAY, SINCE_1970
from terragrip.units import UnitError, factor_to

_FIRST = 1000  # rows in which a logger's clock is set, if it was not
_WEEK = 7 * DAY  # s: a time of day, or of a GPS week, is less
_ABOUT = 60.0  # s: what a log may miss around midnight


@dataclass
class Stamps:
    """The stamps of a log in ``column``, in ``unit``, as its blocks come, one after the other."""

    column: str
    unit: str
    _started: bool = False
    _last: float | None = None  # s
    _midnights: float = 0.0  # s that they are to be moved by

    def corrected(self, block: LogTable) -> LogTable:
        """The next block, its stamps a time base; what was done to them is among its notes."""
        if not self._started:
            self._started = len(block.columns[self.column]) > 0
            block = self._since_clock_was_set(block)
        return self._past_midnight(block)

    def _since_clock_was_set(self, table: LogTable) -> LogTable:
        """The table without first rows that were stamped before the logger's clock was set.

        A jump ahead by years within the first rows tells: 0 s, then seconds since 1970.
        """
        stamps = table.columns[self.column][: _FIRST + 1]
        if stamps.dtype.kind not in "fiuM" or len(stamps) < 2:
            return table
        tick = np.timedelta64(1, "s") if stamps.dtype.kind == "M" else 1.0 / self._tick(table)
        with np.errstate(invalid="ignore"):
            steps = np.diff(stamps if stamps.dtype.kind == "M" else stamps.astype(np.float64)) / tick
            jumps = np.flatnonzero(steps > SINCE_1970)
        if not len(jumps):
            return table
        count = int(jumps[-1]) + 1
        rows = "row was" if count == 1 else "rows were"
        note = f"The first {count} {rows} stamped before the logger's clock was set ({stamps[0]}, then {stamps[count]}), and left out."
        left = {name: values[count:] for name, values in table.columns.items()}
        return replace(table, columns=left, notes=(*table.notes, note))

    def _tick(self, table: LogTable) -> float:
        """The seconds of a stamp's unit; raises InputError where the log states another quantity."""
        try:
            return factor_to(self.unit, "s")
        except UnitError as error:
            place, hint = f"column {self.column}", "write its unit, as in 'time [s]' or 'time [ms]'"
            raise InputError(error.problem, file=table.source, place=place, hint=hint) from error

    def _past_midnight(self, table: LogTable) -> LogTable:
        """The table, its stamps counted on where the clock began anew."""
        stamps = table.columns[self.column]
        if stamps.dtype.kind not in "fiu" or not len(stamps):
            return table
        tick = self._tick(table)
        seconds = stamps.astype(np.float64) * tick
        known = np.flatnonzero(np.isfinite(seconds))
        if not len(known):
            return table
        first = seconds[known[0]] if self._last is None else self._last
        back = -np.diff(seconds[known], prepend=first)
        moved = np.zeros(len(stamps))
        # Several at once end a week; and texts count midnights within a block, but not on into the next.
        days = DAY * np.ceil(back / DAY)
        anew = (days > 0) & (days - back < _ABOUT) & (seconds[known] < _WEEK)
        moved[known] = np.where(anew, days, 0.0)
        self._last = float(seconds[known[-1]])
        notes = table.notes
        if moved.any() and not self._midnights:
            notes += ("time begins anew at midnight in the log: what follows counts on from there.",)
        moved = self._midnights + np.cumsum(moved)
        self._midnights = float(moved[-1])
        if not self._midnights:
            return table
        moved /= tick
        counted = stamps + (np.round(moved).astype(np.int64) if stamps.dtype.kind in "iu" else moved)
        return replace(table, columns={**table.columns, self.column: counted}, notes=notes)

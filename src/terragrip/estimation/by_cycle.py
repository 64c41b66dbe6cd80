"""A log with a row for each message of a cycle: estimated cycle by cycle, with a row for each of its rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from terragrip.estimation.estimates import Estimates
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.cycles import cycle_of, cycles_in, has_full, joined_at
from terragrip.recording.schema import CARRIED
from terragrip.recording.survey import BEGINNING, joined


class ByCycle:
    """A log by the cycles of ``cycle`` [s]; its estimates are made by the estimator as of any log, then `spread`."""

    def __init__(self, cycle: float) -> None:
        self.cycle = cycle

    @classmethod
    def of(cls, log: LogBlocks) -> ByCycle | None:
        """The cycles that the first `BEGINNING` rows of a log show, whatever its blocks; None where no rows are to be joined."""
        first: list[Recording] = []
        for block in log.blocks():
            first.append(block)
            if sum(map(len, first)) >= BEGINNING:
                break
        if not first or has_full(first):
            return None
        part = joined(first, first[-1]).select(slice(BEGINNING))
        cycle = cycle_of(part.time, part.channels)
        return cls(cycle) if len(cycles_in(part, cycle)) < len(part) else None

    def log(self, log: LogBlocks) -> LogBlocks:
        """The log with a row for each cycle."""

        def blocks() -> Iterator[Recording]:
            for block in self._whole_cycles(log.blocks()):
                yield joined_at(block, cycles_in(block, self.cycle))

        def whole() -> Recording:
            recording = log.whole()
            return joined_at(recording, cycles_in(recording, self.cycle))

        return LogBlocks(log.rows, blocks, whole, log.from_disk)

    def spread(self, log: LogBlocks, parts: Iterator[Estimates]) -> Iterator[Estimates]:
        """Estimates of the log's own rows: each row has those of its cycle, and what was passed on of its own.

        The log is read once more beside ``parts``: kept from the passes before, its rows would fill the memory.
        """
        for block, part in zip(self._whole_cycles(log.blocks()), parts, strict=True):
            starts = cycles_in(block, self.cycle)
            rows = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(block)))
            of_rows = part.select(rows)
            own = {n: block.channels[n] for n in (*CARRIED, *block.references) if n in part.columns}
            columns = {**of_rows.columns, **own}
            settings = {**part.about["settings"], "cycle": self.cycle}
            about = {**part.about, "settings": settings}
            yield replace(of_rows, time=block.time, columns=columns, labels=dict(block.labels), about=about)

    def _whole_cycles(self, blocks: Iterator[Recording]) -> Iterator[Recording]:
        """The blocks cut so that no cycle is in two of them."""
        whole: Recording | None = None
        for block in blocks:
            if whole is None:
                whole = block
                continue
            apart = np.flatnonzero(np.diff(whole.time, append=block.time[0]) > self.cycle)
            cut = int(apart[-1]) + 1 if len(apart) else 0
            if cut:
                yield whole.select(slice(cut))
            whole = joined([whole.select(slice(cut, None)), block], block)
        if whole is not None:
            yield whole

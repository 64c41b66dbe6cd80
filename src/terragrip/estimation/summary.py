"""The data of a summary of estimates, gathered block by block; `summary_text` writes it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation.engine import EVENTS
from terragrip.estimation.grouped import quantities
from terragrip.recording.plain_units import leapt

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates

STANDSTILL = EVENTS.index("standstill")

_SAMPLE = 20_000  # rows of a block for medians,
_MOST = 200_000  # and rows in all


@dataclass
class Tally:
    """The data of a summary, added up over consecutive blocks of one table of estimates."""

    about: dict[str, Any] = field(default_factory=dict)
    wheels: tuple[str, ...] = ()
    rows: int = 0
    duration: float = 0.0
    distance: float = 0.0
    event_rows: list[int] = field(default_factory=lambda: [0] * len(EVENTS))
    event_starts: list[int] = field(default_factory=lambda: [0] * len(EVENTS))
    nis: float = 0.0
    channels: float = 0.0
    moving: dict[str, float] = field(default_factory=dict)
    sample: dict[str, list[npt.NDArray[Any]]] = field(default_factory=dict)
    _first: float | None = None
    _leapt: float = 0.0
    _last_event: int = 0
    _last_moving: tuple[str, float] | None = None
    _every: int = 1
    _sampled: int = 0

    def count(self, block: Estimates) -> None:
        """Rows, duration, distance, events and NIS of a block that follows the ones before it."""
        if self._first is None:
            self._first, self.about, self.wheels = float(block.time[0]), block.about, block.wheels
        self.rows += len(block)
        self._leapt += leapt(np.concatenate(([self._first + self._leapt + self.duration], block.time)))
        self.duration = float(block.time[-1]) - self._first - self._leapt
        if "distance" in block:
            self.distance = float(np.nanmax(block["distance"], initial=self.distance))
        self._count_events(block.event_codes)
        if "nis" in block and "channels" in block:
            moves = block.event_codes != STANDSTILL  # a machine at rest is quieter than its sensors' noise
            self.nis += float(np.nansum(block["nis"][moves]))
            self.channels += float(np.nansum(block["channels"][moves]))

    def add(self, block: Estimates) -> None:
        """`count` a block, and sample its rows for medians."""
        self.count(block)
        moving = np.flatnonzero(block.event_codes == 0)
        chosen = moving[:: max(1, len(moving) // _SAMPLE)]
        chosen = chosen[:: self._every]
        for name in quantities(block):
            for column in (name, f"{name}_std"):
                self.sample.setdefault(column, []).append(block[column][chosen])
        self.sample.setdefault("label", []).append(block.soil[chosen])
        self._sampled += len(chosen)
        self._count_time(block)
        if self._sampled > _MOST:  # half of them are enough
            self.sample = {name: [np.concatenate(parts)[::2]] for name, parts in self.sample.items()}
            self._every, self._sampled = 2 * self._every, (self._sampled + 1) // 2

    def _count_time(self, block: Estimates) -> None:
        """Add up the time [s] of rows without an event, by label; a row lasts until the next one, at most as long as the gap threshold.

        The duration of the last row follows from the next block.
        """
        longest = self.about.get("settings", {}).get("gap") or 1.0
        if self._last_moving is not None:
            name, begun = self._last_moving
            self.moving[name] = self.moving.get(name, 0.0) + min(float(block.time[0]) - begun, longest)
        lasts = np.minimum(np.diff(block.time, append=block.time[-1]), longest)
        moving = block.event_codes == 0
        names = block.soil
        self._last_moving = (str(names[-1]), float(block.time[-1])) if moving[-1] else None
        for name in dict.fromkeys(names.tolist()):
            self.moving[str(name)] = self.moving.get(str(name), 0.0) + float(
                lasts[moving & (names == name)].sum()
            )

    def _count_events(self, codes: npt.NDArray[np.uint8]) -> None:
        starts = np.flatnonzero(np.diff(codes, prepend=np.uint8(self._last_event)))
        self._last_event = int(codes[-1])
        for code, rows in enumerate(np.bincount(codes, minlength=len(EVENTS))):
            self.event_rows[code] += int(rows)
        for code, count in enumerate(np.bincount(codes[starts], minlength=len(EVENTS))):
            self.event_starts[code] += int(count)

    def text(self, notes: Iterable[str] = (), output: str | None = None) -> str:
        """Distance and time driven, medians with their intervals, assumptions, notes, what to do next; lines of text.

        ``output``: the file of the estimates, for what to do next.
        """
        from terragrip.estimation.summary_text import summary_text

        return summary_text(self, tuple(notes), output)

    @property
    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """The sampled rows of each quantity that is summarised, and ``label``, the soil of each row."""
        return {name: np.concatenate(parts) for name, parts in self.sample.items()}

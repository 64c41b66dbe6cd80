"""The summary of estimates as text, gathered block by block."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation.engine import EVENTS

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates

Floats = npt.NDArray[np.float64]

STANDSTILL = EVENTS.index("standstill")

_SAMPLE = 20_000  # rows a block that medians are taken from,
_MOST = 200_000  # and rows in all
_EXPECTED = (0.7, 1.4)  # of the normalised innovation squared a channel


@dataclass
class Tally:
    """What a summary needs, added up over consecutive blocks of one table of estimates."""

    about: dict[str, Any] = field(default_factory=dict)
    wheels: tuple[str, ...] = ()
    rows: int = 0
    duration: float = 0.0
    distance: float = 0.0
    event_rows: list[int] = field(default_factory=lambda: [0] * len(EVENTS))
    event_starts: list[int] = field(default_factory=lambda: [0] * len(EVENTS))
    nis: float = 0.0
    channels: float = 0.0
    sample: dict[str, list[Floats]] = field(default_factory=dict)
    _first: float | None = None
    _last_event: int = 0
    _every: int = 1
    _sampled: int = 0

    def add(self, block: Estimates) -> None:
        """Count a block that follows the ones before it."""
        if self._first is None:
            self._first, self.about, self.wheels = float(block.time[0]), block.about, block.wheels
        self.rows += len(block)
        self.duration = float(block.time[-1]) - self._first
        if "distance" in block:
            self.distance = float(np.nanmax(block["distance"]))
        self._count_events(block.event_codes)
        if "nis" in block and "channels" in block:
            moves = block.event_codes != STANDSTILL  # a machine at rest is quieter than its sensors' noise
            self.nis += float(np.nansum(block["nis"][moves]))
            self.channels += float(np.nansum(block["channels"][moves]))
        moving = np.flatnonzero(block.event_codes == 0)
        chosen = moving[:: max(1, len(moving) // _SAMPLE)]
        for name in (n for _, n, _ in _quantities(self.wheels) if n in block):
            for column in (name, f"{name}_std"):
                self.sample.setdefault(column, []).append(block[column][chosen[:: self._every]])
        self._sampled += len(chosen[:: self._every])
        if self._sampled > _MOST:  # half of them do as well
            self.sample = {name: [np.concatenate(parts)[::2]] for name, parts in self.sample.items()}
            self._every, self._sampled = 2 * self._every, (self._sampled + 1) // 2

    def _count_events(self, codes: npt.NDArray[np.uint8]) -> None:
        starts = np.flatnonzero(np.diff(codes, prepend=np.uint8(self._last_event)))
        self._last_event = int(codes[-1])
        for code, rows in enumerate(np.bincount(codes, minlength=len(EVENTS))):
            self.event_rows[code] += int(rows)
        for code, count in enumerate(np.bincount(codes[starts], minlength=len(EVENTS))):
            self.event_starts[code] += int(count)

    def text(self, notes: Iterable[str] = ()) -> str:
        """Extent, defects met, consistency, medians with their spreads, and notes; lines of text."""
        lines = [self._extent(), *self._defects(), *self._consistency(), *self._medians()]
        return "\n".join([*lines, *(f"Note: {note}" for note in notes)])

    def _extent(self) -> str:
        smooth = ", smoothed" if self.about.get("smooth") else ""
        method = self.about.get("method", "unknown")
        return (
            f"{self.rows} rows, {self.duration:.1f} s, {self.distance:.1f} m, {len(self.wheels)} wheel{'s' * (len(self.wheels) != 1)}, "
            f"method {method}{smooth}"
        )

    def _defects(self) -> list[str]:
        lines = []
        held = self.about.get("settings", {}).get("held", {})
        if held:
            shown = ", ".join(f"{name} ({1 / period:.3g} Hz)" for name, period in held.items())
            lines.append(f"Held channels, taken as missing between their updates: {shown}")
        met = [
            f"{event} {self.event_starts[code]} ({self.event_rows[code]} rows)"
            for code, event in enumerate(EVENTS)
            if event and self.event_rows[code]
        ]
        return [*lines, f"Events: {', '.join(met) if met else 'none'}"]

    def _consistency(self) -> list[str]:
        if not self.channels:
            return []
        ratio, (low, high) = self.nis / self.channels, _EXPECTED
        verdict = "as expected"
        if not low < ratio < high:
            verdict = "the noise may be set too high" if ratio < 1 else "the noise may be set too low"
        return [f"Normalised innovation squared a channel: {ratio:.2f}, expected 1 ({verdict})"]

    def _medians(self) -> list[str]:
        columns = {name: np.concatenate(parts) for name, parts in self.sample.items()}
        if not any(len(values) for values in columns.values()):
            return ["There is no row without an event."]
        lines = ["Medians (± 1 standard deviation) while moving:"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a column may be all NaN
            for title, name, unit in _quantities(self.wheels):
                if name not in columns:
                    continue
                value, spread = np.nanmedian(columns[name]), np.nanmedian(columns[f"{name}_std"])
                lines.append(f"  {title:<18} {value:8.3f} ± {spread:.3f}{unit}")
        return lines


def _quantities(wheels: tuple[str, ...]) -> list[tuple[str, str, str]]:
    """Title, column and unit of what is summarised."""
    result = [("ground speed", "ground_speed", " m/s"), ("soil resistance", "soil_resistance", "")]
    for quantity in ("adhesion", "slip", "efficiency"):
        result += [(f"{quantity} {wheel}", f"{quantity}_{wheel}", "") for wheel in wheels]
    return result

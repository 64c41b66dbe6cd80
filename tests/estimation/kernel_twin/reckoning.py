"""Ground speed while its sensor is silent, of speeds alone, as the kernel's `reckoning.c` has it, in plain NumPy.

The vehicle drives forward, and all its wheels have one radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SILENCE = 0.5
"""s without a ground speed."""
SLIP_MEMORY, UNEVEN, HILLS = 0.3, 40.0, 1000.0
"""s of the last slip; wheel radii over which it tells of the ground, and over which the usual one is learned at most."""


AGE = 0.288675
"""Of an interval: a rim's sample may be of any instant of it."""


@dataclass
class Reckoning:
    """``radius`` [m], ``standstill`` [m/s], ``gap`` [s]: as the estimator's."""

    radius: float
    standstill: float
    gap: float
    last: float = 0.08
    error: float = 0.0
    """Variance of the last slip."""
    usual: float = 0.08
    apart: float = 0.15**2
    way: float = UNEVEN
    unseen: float = 0.0
    silent: float = 0.0
    interval: float = 0.0
    seen: bool = False

    def speed(self, dt: float, speeds: Floats, rims: Floats) -> tuple[float, float] | None:
        """Before a row of ``speeds`` (1 + wheels,) [m/s], ``rims`` as expected where not measured: the ground speed in place of a silent
        sensor's, and its variance."""
        self.silent += dt
        if np.isfinite(speeds[0]):
            if self.seen:
                self.interval = self.silent
            self.seen, self.silent, self.unseen = True, 0.0, 0.0
            return None
        patience = max(SILENCE, min(2 * self.interval, self.gap))
        if not self.seen or self.silent < patience or not np.isfinite(speeds).any() or dt == 0:
            return None
        rim, square = _mean(speeds, rims)
        self.unseen += abs(rim) * dt / self.radius
        keep = np.exp(-self.unseen / UNEVEN) * self.apart / (self.apart + self.error)
        spread = (1 - keep) * (self.apart + keep * (self.last - self.usual) ** 2)
        aged = (AGE * (rim - np.mean(rims))) ** 2
        return rim * (1 - self.usual - keep * (self.last - self.usual)), square * spread + aged

    def remember(self, dt: float, v: float, variance: float, speeds: Floats, rims: Floats) -> None:
        """After a row whose ground speed was measured: ``v``, its ``variance`` and ``rims`` as estimated."""
        rim, square = _mean(speeds, rims)
        self.error = variance / max(abs(rim), 3 * self.standstill) ** 2
        if rim < 3 * self.standstill:
            return
        slip = max(1 - v / rim, -0.2)
        self.last += dt / (SLIP_MEMORY + dt) * (slip - self.last)
        travelled = rim * max(dt, min(self.interval, self.gap)) / self.radius
        away = (slip - min(max(self.usual, -0.2), 0.8)) * rim / np.sqrt(max(square, rim**2))
        self.way = min(self.way + travelled, HILLS)
        share, most = min(travelled / self.way, 1.0), 2 * np.sqrt(self.apart)
        self.usual += share * float(np.clip(away, -most, most))
        self.apart += share * (away**2 - self.apart)


def _mean(speeds: Floats, rims: Floats) -> tuple[float, float]:
    """Mean and mean square."""
    now = np.where(np.isfinite(speeds[1:]), speeds[1:], rims)
    return float(np.mean(now)), float(np.mean(now**2))

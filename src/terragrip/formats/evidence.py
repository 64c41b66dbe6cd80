"""What the data say of a guess: speeds against positions, rims against the ground, gyros against headings, gravity.

Every check gives a `Finding`: a sentence, and where it can tell the unit, that. None of them needs a vehicle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.formats.derivation import unrolled
from terragrip.physics.geodesy import metres_of
from terragrip.units import STANDARD_GRAVITY, factor_to

Series = tuple[Floats, Floats]
Path = tuple[Floats, Floats, Floats]
"""Begins [s], ends [s] and lengths [m] of straight pieces of what was driven."""

_MOST = 300_000  # samples of a column that are looked at
_SLOWEST = 0.3  # m/s
_ALIKE = 0.5
"""Least correlation of two columns' sizes, or share of their product that has one sign, by which they go together."""
_WINDOW = 2.0  # s over which a path is taken for straight
_SPEED_UNITS = ("m/s", "km/h", "mph", "knots", "cm/s", "mm/s", "ft/s")
_ACCELERATION_UNITS = {"m/s^2": STANDARD_GRAVITY, "g": 1.0, "mg": 1000.0, "cm/s^2": 100 * STANDARD_GRAVITY}
RADII = (0.03, 1.3)  # m, of wheels that drive on ground


@dataclass(frozen=True)
class Finding:
    """What a check found: whether it speaks for the guess, a sentence, and the unit that the sizes tell (None: none)."""

    agrees: bool
    sentence: str
    unit: str | None = None


def sizes(base: str, *units: str) -> dict[str, float]:
    """How many of each unit make one ``base``."""
    return {unit: factor_to(base, unit) for unit in units}


def nearest_unit(ratio: float, units: Mapping[str, float], tolerance: float) -> str | None:
    """The unit whose size is within ``tolerance`` (natural log) of ``ratio``; None if none is."""
    if not np.isfinite(ratio) or ratio <= 0:
        return None
    distance, unit = min((abs(float(np.log(ratio / size))), name) for name, size in units.items())
    return unit if distance < tolerance else None


class Evidence:
    """Columns of a log with their instants [s], to be held against each other.

    ``clocks`` holds the instants (n,) of each column that has some; one without any cannot be checked against time.
    """

    def __init__(self, columns: Mapping[str, Floats], clocks: Mapping[str, Floats]) -> None:
        self._columns = columns
        self._timed = bool(clocks)
        # Without time rows still go together: what needs no seconds is checked by rows.
        self._clocks = (
            clocks
            if clocks
            else {name: np.arange(len(values), dtype=np.float64) for name, values in columns.items()}
        )
        self._known: dict[str, Series | None] = {}

    def series(self, name: str) -> Series | None:
        """Instants that run forward and finite values of a column; None where there are fewer than three."""
        if name not in self._known:
            self._known[name] = self._series(name)
        return self._known[name]

    def _series(self, name: str) -> Series | None:
        clock, values = self._clocks.get(name), self._columns[name]
        if clock is None or len(clock) != len(values):
            return None
        time, values = clock[:_MOST], values[:_MOST]
        known = np.isfinite(time) & np.isfinite(values) & (np.abs(values) < 1e12)
        time, values = time[known], values[known]
        if len(time) < 3:
            return None
        forward = np.concatenate(([True], time[1:] > np.maximum.accumulate(time)[:-1]))
        time, values = time[forward], values[forward]
        return (time, values) if len(time) >= 3 else None

    def _fresh(self, name: str, fewest: int) -> Series | None:
        """The series where its values change; None without time, or where there are fewer."""
        result = self.series(name)
        if result is None or not self._timed:
            return None
        fresh = np.concatenate(([True], np.diff(result[1]) != 0))
        return (result[0][fresh], result[1][fresh]) if fresh.sum() >= fewest else None

    def at(self, name: str, instants: Floats) -> Floats:
        """Values of a column at ``instants`` (m,), on straight lines between its samples; NaN outside, in gaps, and without a series."""
        out = self.series(name)
        if out is None:
            return np.full(len(instants), np.nan)
        time, values = out
        result = np.interp(instants, time, values, left=np.nan, right=np.nan)
        gap = _gap(time)
        place = np.clip(np.searchsorted(time, instants), 1, len(time) - 1)
        off = (
            (time[place] - time[place - 1] > gap) & (instants != time[place]) & (instants != time[place - 1])
        )
        result[off] = np.nan
        return result

    def beyond(self, name: str, others: Sequence[str]) -> float | None:
        """What a column differs by from the sum of ``others``, each times a number, relative to its size; None where too little moves."""
        if (out := self.series(name)) is None:
            return None
        made = np.array([self.at(other, out[0]) for other in others]).T
        known = np.isfinite(made).all(axis=1)
        values, made = out[1][known], made[known]
        if len(values) < 20 * len(others) or not np.ptp(values):
            return None
        rest = values - made @ np.linalg.lstsq(made, values, rcond=None)[0]
        return float(np.sqrt(np.mean(rest**2) / np.mean(values**2)))

    def size(self, name: str) -> float:
        """The 95 % quantile of the absolute values; 0 where there is none."""
        values = np.abs(self._columns[name])
        values = values[np.isfinite(values)]
        return float(np.quantile(values, 0.95)) if len(values) else 0.0

    def is_whole(self, name: str) -> bool:
        """Whether all values are whole numbers."""
        values = self._columns[name]
        values = values[np.isfinite(values)]
        return bool(np.all(values == np.round(values)))

    def displacements(self, pair: tuple[str, str], *, degrees: bool, unit: float = 1.0) -> Path | None:
        """Begins [s], ends [s] and lengths [m] of straight pieces of the path that two position columns describe."""
        first, second = self.series(pair[0]), self.series(pair[1])
        if first is None or second is None or not self._timed:
            return None
        time = first[0]
        other = self.at(pair[1], time)
        known = np.isfinite(other)
        time, a, b = time[known], first[1][known], other[known]
        # Held positions are no new ones.
        moved = np.concatenate(([True], (np.diff(a) != 0) | (np.diff(b) != 0)))
        if moved.mean() < 0.7:  # nor is the first after a gap
            moved &= np.concatenate(([False], np.diff(time) <= _gap(time)))
        time, a, b = time[moved], a[moved], b[moved]
        if len(time) < 3:
            return None
        north, east = metres_of(a * unit, b * unit) if degrees else (a * unit, b * unit)
        begins, ends = _windows(time)
        return time[begins], time[ends], np.hypot(north[ends] - north[begins], east[ends] - east[begins])

    def pieces_over(self, name: str, path: Path) -> tuple[Floats, Floats, Floats] | None:
        """Of a path's pieces within a column's time the integrals of its size, their lengths [m] and how long they last [s]; else None."""
        result = self.series(name)
        begins, ends, lengths = path
        if result is None or not len(lengths):
            return None
        time, values = result
        total = np.concatenate(([0.0], np.cumsum(0.5 * np.abs(values[1:] + values[:-1]) * np.diff(time))))
        inside = (begins >= time[0]) & (ends <= time[-1])
        run = np.interp(ends, time, total) - np.interp(begins, time, total)
        return run[inside], lengths[inside], (ends - begins)[inside]

    def against_path(self, name: str, path: Path, source: str) -> Finding | None:
        """A speed column against a path: its integral over the pieces divided by their lengths tells the unit."""
        pieces = self.pieces_over(name, path)
        if pieces is None:
            return None
        run, driven, lasted = (float(one.sum()) for one in pieces)
        # Of a receiver that stands still, the path is its noise.
        if driven < max(2.0, _SLOWEST * lasted) or not run > 0:
            return None
        ratio = run / driven
        # A short way does not tell miles from kilometres.
        likely = _SPEED_UNITS if driven > 50 else ("m/s", "km/h", "mm/s")
        unit = nearest_unit(ratio, sizes("m/s", *likely), 0.12 if driven > 50 else 0.3)
        if unit is None:
            return Finding(False, f"its integral is {ratio:.3g} times the path of {source}")
        return Finding(True, f"its integral is the path of {source}, in {unit}", unit)

    def against_distance(self, name: str, distance: str, metres: float) -> Finding | None:
        """A speed column against a column of distance run, ``metres`` a count."""
        result = self.series(distance)
        if result is None or not self._timed:
            return None
        time, values = result
        moved = np.concatenate(([True], np.diff(values) > 0))
        time, values = time[moved], values[moved]
        if len(time) < 3:
            return None
        begins, ends = _windows(time)
        return self.against_path(
            name, (time[begins], time[ends], (values[ends] - values[begins]) * metres), distance
        )

    def ratio(self, upper: str, lower: str) -> tuple[float, float] | None:
        """Sum of absolute values of one column over that of another where the latter moves, and their correlation.

        None where both are but noise about zero (a vehicle at rest): neither their sizes nor their signs go together.
        """
        result = self.series(lower)
        if result is None:
            return None
        other = self.at(upper, result[0])
        known = np.isfinite(other)
        signed = (other * result[1])[known]
        a, b = np.abs(other[known]), np.abs(result[1][known])
        if len(b) < 5 or (limit := 0.1 * float(np.quantile(b, 0.95))) <= 0:
            return None
        moving = b > limit
        if moving.sum() < 5 or a[moving].sum() <= 0:
            return None
        alike = correlation(a, b)
        if alike < _ALIKE and abs(signed[moving].sum()) < _ALIKE * np.abs(signed[moving]).sum():
            return None
        return float(a[moving].sum() / b[moving].sum()), alike

    def fit(self, name: str, time: Floats, reference: Floats) -> tuple[float, float] | None:
        """Slope of a column over a ``reference`` (m,) at ``time`` (m,), and their correlation."""
        return slope_of(reference, self.at(name, time))

    def rate_of_angle(self, name: str, *, degrees: bool) -> Series | None:
        """The rate [rad/s] of an angle column that wraps."""
        result = self._fresh(name, 8)
        if result is None:
            return None
        time, angle = result[0], np.unwrap(np.radians(result[1]) if degrees else result[1])
        steps = np.diff(time)
        good = steps <= _gap(time)
        return ((time[1:] + time[:-1]) / 2)[good], (np.diff(angle) / steps)[good]

    def derivative(self, name: str, factor: float = 1.0, *, counts: bool = False) -> Series | None:
        """The derivative of a column times ``factor``, over fresh values; of one that ``counts``, past its overflows."""
        result = self._fresh(name, 10)
        if result is None:
            return None
        time, values = result[0], (unrolled(result[1], None) if counts else result[1]) * factor
        width = max(2, min(len(time) // 6, int(0.3 / max(float(np.median(np.diff(time))), 1e-3))))
        steps = time[width:] - time[:-width]
        good = steps <= width * _gap(time)
        return ((time[width:] + time[:-width]) / 2)[good], ((values[width:] - values[:-width]) / steps)[good]

    def gravity(self, names: tuple[str, str, str]) -> str | None:
        """The unit of three accelerations, by gravity in their sum; None where it does not tell."""
        first = self._columns[names[0]]
        if any(len(self._columns[n]) != len(first) for n in names):
            return None
        size = np.sqrt(sum(self._columns[n] ** 2 for n in names))
        known = size[np.isfinite(size)]
        return nearest_unit(float(np.median(known)), _ACCELERATION_UNITS, 0.25) if len(known) > 4 else None


def slope_of(x: Floats, y: Floats) -> tuple[float, float] | None:
    """Slope of ``y`` (n,) over ``x`` (n,) and their correlation, NaN left out; None of fewer than eight or of what stands still."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) < 8 or not float(np.std(x)) > 0 or not float(np.std(y)) > 0:
        return None
    x, y = x - x.mean(), y - y.mean()
    return float(x @ y / (x @ x)), correlation(x, y)


def correlation(a: Floats, b: Floats) -> float:
    """Pearson's correlation of two (n,); 0 where one of them stands still."""
    if len(a) < 3 or not float(np.std(a)) > 0 or not float(np.std(b)) > 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def _gap(time: Floats) -> float:
    """The longest step between samples that is no gap [s]."""
    return max(5 * float(np.median(np.diff(time))), 1e-9) if len(time) > 1 else 1.0


def _windows(time: Floats) -> tuple[Ints, Ints]:
    """First and last rows of pieces of some seconds without a gap in them."""
    gap = max(_gap(time), 1.5)
    cuts = np.concatenate(([0], np.flatnonzero(np.diff(time) > gap) + 1, [len(time)]))
    begins, ends = [], []
    for low, high in pairwise(cuts):
        at = low
        while at < high - 1:
            to = min(int(np.searchsorted(time[:high], time[at] + _WINDOW)), high - 1)
            to = max(to, at + 1)
            begins.append(at)
            ends.append(to)
            at = to
    return np.array(begins, dtype=np.intp), np.array(ends, dtype=np.intp)

"""Columns of a run as the drive page shows them: limits, measured channels, the filter's consistency; cut to what a screen can show."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.studio.tables import Extremes, are_long, buckets, extremes

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.recording import Recording

Floats = npt.NDArray[np.float64]

LEVEL = 1.959964
"""Standard deviations of a 95 % interval."""
MEASURED = "measured:"
MEAN = 1.0
"""Seconds over which NIS is averaged."""


class Shown:
    """What can be drawn of a table; keeps what long windows need from one to the next.

    A name is a column, its 95 % limit (``slip_rl:low``, ``slip_rl:high``) or a channel of the recording (``measured:ground_speed``).
    Of the filter's consistency: ``nis:mean`` is the sum of NIS over that of the channels within `MEAN` seconds, 1 of an honest filter;
    ``nis:low`` and ``nis:high`` are the 95 % limits of that mean by chi-squared, were the rows independent.
    """

    def __init__(self, table: Estimates) -> None:
        self._table = table
        self._extremes: dict[str, Extremes] = {}
        self._nis: dict[str, Floats] = {}

    def window(
        self, recording: Recording | None, names: list[str], start: float, end: float, width: int
    ) -> tuple[bool, Floats, list[Floats]]:
        """Columns between two times, cut to `width` buckets: (whether cut, time, columns), all of one length.

        Where it is cut, a bucket is two points: its smallest and its largest value, so that no spike is lost. Raises InputError on a
        name that is not there.
        """
        time = self._table.time
        starts = buckets(time, start, end, width)
        first, last = int(starts[0]), int(starts[-1])
        cut = len(starts) - 1 < last - first
        long = are_long(last - first, width)
        result = []
        for name in names:
            values = self._values(recording, name)
            if not cut:
                result.append(values(slice(first, last)).astype(np.float64))
                continue
            if not long:
                low, high = extremes(values(slice(first, last)), starts - first)
            else:
                if name not in self._extremes:
                    self._extremes[name] = Extremes(values(slice(None)))
                low, high = self._extremes[name].of(values, starts)
            pair = {"low": (low, low), "high": (high, high)}.get(name.rpartition(":")[2], (low, high))
            result.append(np.stack(pair, axis=1).ravel())
        if not cut:
            return False, time[first:last], result
        begin = time[starts[:-1]]
        following = np.r_[begin[1:], time[last - 1]]
        return True, np.stack((begin, (begin + following) / 2), axis=1).ravel(), result

    def _values(self, recording: Recording | None, name: str) -> Callable[[slice], Floats]:
        """Gives rows of what a name means."""
        if name.startswith(MEASURED):
            channel = name.removeprefix(MEASURED)
            if recording is None or channel not in recording.channels:
                raise InputError("is not in the recording", place=f"column {name}")
            return recording.channels[channel].__getitem__
        columns = self._table.columns
        column, _, side = name.partition(":")
        if column not in columns or side not in ("", "low", "high", "mean"):
            raise InputError("is not in the estimates", place=f"column {name}")
        if not side:
            return columns[column].__getitem__
        if column == "nis" and "channels" in columns:
            if not self._nis:
                self._nis = consistency(self._table.time, columns["nis"], columns["channels"])
            return self._nis[side].__getitem__
        if side == "mean" or f"{column}_std" not in columns:
            raise InputError("has no interval", place=f"column {name}")
        values, std, sign = columns[column], columns[f"{column}_std"], LEVEL if side == "high" else -LEVEL
        return lambda rows: values[rows] + sign * std[rows]


def consistency(time: Floats, nis: Floats, channels: Floats) -> dict[str, Floats]:
    """NIS over channels, (n,) each, by `MEAN` seconds about each row: mean, low and high (see `Shown`); NaN where nothing was taken.

    A sum of independent NIS is chi-squared with the sum of their channels as degrees of freedom (Bar-Shalom, Li, Kirubarajan 2001,
    section 5.4).
    """
    from scipy.special import chdtri

    bits = np.nan_to_num(channels).astype(np.intp)
    first = np.searchsorted(time, time - MEAN / 2, "left")
    last = np.searchsorted(time, time + MEAN / 2, "right")
    degrees, total = (
        np.concatenate(([0], np.cumsum(values)))
        for values in (bits, np.where(bits > 0, np.nan_to_num(nis), 0.0))
    )
    freedom, summed = degrees[last] - degrees[first], total[last] - total[first]
    count = np.arange(1, int(freedom.max(initial=0)) + 1)
    limits = {
        side: np.concatenate(([np.nan], chdtri(count, tail) / count))
        for side, tail in (("low", 0.975), ("high", 0.025))
    }
    with np.errstate(invalid="ignore"):
        mean = np.where(freedom > 0, summed / freedom, np.nan)
    return {"mean": mean, **{side: limit[freedom] for side, limit in limits.items()}}

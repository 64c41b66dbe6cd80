"""Columns of a run as the drive page shows them: limits, measured channels, the filter's consistency; cut to what a screen can show."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError, suggestion
from terragrip.estimation.consistency import NORMAL_95
from terragrip.recording.stretches import gaps
from terragrip.studio.formulas import evaluate, names
from terragrip.studio.tables import Extremes, are_long, buckets, extremes

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.recording import Recording


MEASURED = "measured:"
FORMULA = "="
"""What the name of a computed signal begins with: ``=slip_rl - slip_rr``."""
MEAN = 1.0
"""Seconds over which NIS is averaged."""
HELD = 8
"""Formulas of a run whose rows are held."""
APART = 1e-9
"""Metres by which rows at a standstill are kept apart, so that each has a place of its own: a millimetre in a million rows."""

Axis = Literal["time", "elapsed", "distance"]
"""What a run is drawn over: time as recorded [s], time since its start [s], distance driven [m]."""
PLACES: dict[str, Axis] = {"axis:time": "time", "axis:elapsed": "elapsed", "axis:distance": "distance"}


class Shown:
    """What can be drawn of a table; keeps what long windows need from one to the next.

    A name is a column, its 95 % limit (``slip_rl:low``, ``slip_rl:high``), a channel of the recording (``measured:ground_speed``), the
    place on an axis (``axis:time``, ``axis:elapsed``, ``axis:distance``) or a formula (``=slip_rl - slip_rr``; see `formulas`).
    Of the filter's consistency: ``nis:mean`` is the sum of NIS over that of the channels within `MEAN` seconds, 1 if the noise is right;
    ``nis:low`` and ``nis:high`` are the 95 % limits of that mean by chi-squared, were the rows independent.
    """

    def __init__(self, table: Estimates) -> None:
        self._table = table
        self._extremes: dict[str, Extremes] = {}
        self._nis: dict[str, Floats] = {}
        self._distance: Floats | None = None
        self._after_hole = np.flatnonzero(gaps(table.time)) + 1
        self._worked_out: OrderedDict[str, Floats] = OrderedDict()

    def along(self, axis: Axis) -> Floats:
        """The place of each row on an axis, (n,), ascending. Raises InputError where there is no ground speed to give a distance.

        The distance is the integral of the estimated ground speed's size (trapezoids; where it is unknown, between its known
        neighbours).
        """
        time = self._table.time
        if axis == "time":
            return time
        if axis == "elapsed":
            return time - time[:1]
        if self._distance is None:
            speed = self._table.columns.get("ground_speed")
            known = np.flatnonzero(np.isfinite(speed)) if speed is not None else np.empty(0, np.intp)
            if speed is None or not known.size:
                raise InputError("has no ground speed, so no distance", hint="choose time since start")
            size = np.interp(time, time[known], np.abs(speed[known]))
            driven = np.cumsum(np.diff(time) * (size[1:] + size[:-1]) / 2)
            self._distance = np.concatenate(([0.0], driven)) + APART * np.arange(len(time))
        return self._distance

    def missing(self, recording: Recording | None, formula: str) -> str | None:
        """Why a formula cannot be worked out of this run, in one line; None where it can."""
        try:
            for name in names(formula):
                self._column(recording, name)
        except InputError as error:
            return str(error)
        return None

    def rows(
        self, recording: Recording | None, wanted: list[str], axis: Axis, start: float, end: float
    ) -> tuple[Floats, list[Floats]]:
        """All rows between two places on an axis, whole: (places, columns). Raises InputError on a name that is not there."""
        place, part = self._part(axis, start, end)
        return place[part], [self._values(recording, name)(part).astype(np.float64) for name in wanted]

    def labels(self, name: str, axis: Axis, start: float, end: float) -> npt.NDArray[np.str_]:
        """As `rows`, of a column of words: ``event`` or a label such as ``soil``; empty where the run has no such label."""
        place, part = self._part(axis, start, end)
        words = (
            self._table[name] if name == "event" or name in self._table.labels else np.full(len(place), "")
        )
        return words[part].astype(str)

    def _part(self, axis: Axis, start: float, end: float) -> tuple[Floats, slice]:
        """The places of all rows on an axis, and which rows lie between two of them."""
        place = self.along(axis)
        first, last = np.searchsorted(place, start, "left"), np.searchsorted(place, end, "right")
        return place, slice(int(first), int(last))

    def window(
        self,
        recording: Recording | None,
        names: list[str],
        start: float,
        end: float,
        width: int,
        axis: Axis = "time",
    ) -> tuple[bool, Floats, list[Floats]]:
        """Columns between two places on an axis, cut to `width` buckets: (whether cut, places, columns), all of one length.

        Where it is cut, a bucket is two points: its smallest and its largest value, so that no spike is lost. A hole in the log is a
        point (cut: a bucket) without values where it begins: nothing is drawn across it. Raises InputError on a name that is not there.
        """
        time = self.along(axis)
        starts = buckets(time, start, end, width)
        first, last = int(starts[0]), int(starts[-1])
        cut = len(starts) - 1 < last - first
        long = are_long(last - first, width)
        holes = self._after_hole[(self._after_hole > first) & (self._after_hole < last)]
        if cut:  # what is shorter than a bucket cannot be seen
            holes = holes[time[holes] - time[holes - 1] > (end - start) / width]
        at = np.searchsorted(starts, holes) if cut else holes - first
        result = []
        for name in names:
            values = self._values(recording, name)
            nothing = values(slice(None))[holes - 1] if name in PLACES else np.nan
            if not cut:
                result.append(np.insert(values(slice(first, last)).astype(np.float64), at, nothing))
                continue
            if not long:
                low, high = extremes(values(slice(first, last)), starts - first)
            else:
                low, high = self._blocks(name, values).of(values, starts)
            pair = {"low": (low, low), "high": (high, high)}.get(name.rpartition(":")[2], (low, high))
            result.append(np.stack([np.insert(one, at, nothing) for one in pair], axis=1).ravel())
        if not cut:
            return False, np.insert(time[first:last], at, time[holes - 1]), result
        begin = np.insert(time[starts[:-1]], at, time[holes - 1])
        following = np.r_[begin[1:], time[last - 1]]
        return True, np.stack((begin, (begin + following) / 2), axis=1).ravel(), result

    def _blocks(self, name: str, values: Callable[[slice], Floats]) -> Extremes:
        """Those of a formula are not kept: what is typed has no end."""
        if name.startswith(FORMULA):
            return Extremes(values(slice(None)))
        if name not in self._extremes:
            self._extremes[name] = Extremes(values(slice(None)))
        return self._extremes[name]

    def _of_formula(self, recording: Recording | None, formula: str) -> Floats:
        rows = self._worked_out.get(formula)
        if rows is None:
            rows = evaluate(formula, self._table.time, lambda name: self._column(recording, name))
            self._worked_out[formula] = rows
            while len(self._worked_out) > HELD:
                self._worked_out.popitem(last=False)
        return rows

    def _column(self, recording: Recording | None, name: str) -> Floats:
        """A column by the name that a formula gives it: of the estimates, else of the recording; ``measured_NAME`` is the recording's
        where both have it. Raises InputError where there is none."""
        channels = {} if recording is None else recording.channels
        known = {**{f"measured_{channel}": rows for channel, rows in channels.items()}, **channels}
        known.update(self._table.columns)
        if name in known:
            return known[name]
        if f"axis:{name}" in PLACES:
            return self.along(PLACES[f"axis:{name}"])
        absent = "" if recording is not None else "the recording is not in this folder"
        raise InputError(
            f"{name} is not a column of this run",
            place="formula",
            hint=suggestion(name, [*known, "time", "elapsed", "distance"], absent),
        )

    def _values(self, recording: Recording | None, name: str) -> Callable[[slice], Floats]:
        """Gives rows of what a name means."""
        if name.startswith(FORMULA):
            return self._of_formula(recording, name.removeprefix(FORMULA)).__getitem__
        if name in PLACES:
            return self.along(PLACES[name]).__getitem__
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
        values, std, sign = (
            columns[column],
            columns[f"{column}_std"],
            NORMAL_95 if side == "high" else -NORMAL_95,
        )
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

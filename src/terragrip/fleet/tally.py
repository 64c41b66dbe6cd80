"""A log's numbers for the fleet's tables and its sample for the soil curves, accumulated block by block."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation.columns import driven_of, wheels_with
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.summary import Tally

if TYPE_CHECKING:
    from terragrip.estimation import Estimates

Array = NDArray[np.float64]

PERIOD = 0.2
"""Interval between the rows that soils are learned from [s]; neighbouring rows carry the same information."""
MEANS = ("ground_speed", "slip", "adhesion", "soil_resistance", "net_traction", "efficiency")
"""Quantities averaged over a log's time without an event; wheel columns are also averaged over the driven wheels."""
POSSIBLE = {
    "ground_speed": (-60.0, 60.0),
    "slip": (-0.25, 1.0),
    "adhesion": (-1.5, 1.5),
    "soil_resistance": (-0.5, 1.0),
    "net_traction": (-1.5, 1.5),
    "efficiency": (-10.0, 1.1),
}
"""Least and greatest mean of a log that a machine can have: a wide margin about what tyres, tracks and soils do, for wrong units and
another machine's vehicle file. Efficiency: near no power a mean is far below zero; none is above one, but for errors."""
_PUSHED = -0.01  # of the weight: some of the tyres' resistance, which is all that is left of torques that are much too small
COUNTED = tuple(name for name in EVENTS if name)


class LogTally:
    """Accumulates the blocks of one log."""

    def __init__(self) -> None:
        self.total = Tally()
        self.notes: dict[str, None] = {}
        self._sums: dict[str, dict[str, Array]] = {}
        self._last: float | None = None  # time
        self._sampled = -np.inf
        self._samples: list[Estimates] = []

    def add(self, block: Estimates) -> None:
        """Add the next block."""
        self._add_means(block)
        self._sample(block)
        self.notes.update(dict.fromkeys(block.notes))
        self.total.count(block)
        self._last = float(block.time[-1])

    def _add_means(self, block: Estimates) -> None:
        """Weight each row by the time since the previous one, limited to the gap threshold."""
        longest = block.about.get("settings", {}).get("gap") or 1.0
        last = block.time[0] if self._last is None else self._last
        durations = np.clip(np.diff(block.time, prepend=last), 0.0, longest)
        distance = block["distance"] if "distance" in block else np.zeros(len(block))
        metres = np.diff(distance, prepend=self.total.distance)
        usable = block.event_codes == 0
        soil = block.soil
        columns = {name: _mean_of(block, name) for name in MEANS}
        for label in dict.fromkeys(soil.tolist()):
            rows = usable & (soil == label)
            sums = self._sums.setdefault(str(label), {name: np.zeros(2) for name in ("moving", *MEANS)})
            sums["moving"] += (durations[rows].sum(), metres[rows].sum())
            for name, values in columns.items():
                known = rows & np.isfinite(values)
                sums[name] += ((values * durations)[known].sum(), durations[known].sum())

    def _sample(self, block: Estimates) -> None:
        """Keep one row per `PERIOD` if the log has soil labels and adhesion."""
        if "soil" not in block.labels or not block.has_adhesion:
            return
        count = np.floor(block.time / PERIOD)
        rows = np.flatnonzero(np.diff(count, prepend=self._sampled) > 0)
        self._sampled = float(count[-1])
        wheels = wheels_with("adhesion", block.columns)
        names = ["distance", "soil_resistance", "ground_speed"]
        names += [name for w in wheels for name in (f"slip_{w}", f"slip_{w}_std", f"adhesion_{w}")]
        thin = block.select(rows)
        columns = {name: thin.columns[name].copy() for name in names}
        self._samples.append(replace(thin, columns=columns, labels={"soil": thin.labels["soil"]}))

    @property
    def sample(self) -> list[Estimates]:
        """Some of the rows and columns of the estimates, in parts; empty if no row is labelled."""
        labelled = any((part.labels["soil"] != "").any() for part in self._samples)
        return self._samples if labelled else []

    def row(self) -> dict[str, Any]:
        """The log's numbers: times [s], distances [m], means over its time without an event, NIS over its expected value (1: the noise
        settings are right), and how often each event began.
        """
        whole = {
            name: sum((one[name] for one in self._sums.values()), np.zeros(2)) for name in ("moving", *MEANS)
        }
        total = self.total
        return {
            "start": total.about.get("recording", {}).get("start"),
            "rows": total.rows,
            "duration": total.duration,
            "distance": total.distance,
            **_means(whole),
            "nis": total.nis / total.channels if total.channels else None,
            **{
                f"{name}_events": count
                for name, count in zip(EVENTS, total.event_starts, strict=True)
                if name
            },
            "soils": ", ".join(sorted(name for name in self._sums if name)),
            "notes": " ".join(self.notes),
        }

    def soil_rows(self) -> list[dict[str, Any]]:
        """The same means, one row per soil label; empty if there are none."""
        return [{"soil": name, **_means(sums)} for name, sums in sorted(self._sums.items()) if name]


def _means(sums: dict[str, Array]) -> dict[str, Any]:
    means = {name: float(sums[name][0] / sums[name][1]) if sums[name][1] > 0 else None for name in MEANS}
    return {"moving_time": float(sums["moving"][0]), "moving_distance": float(sums["moving"][1]), **means}


def _mean_of(block: Estimates, name: str) -> Array:
    """A column, or its mean over the driven wheels that have it; NaN if there is none."""
    if name in block.columns:
        return block.columns[name]
    each = [
        block.columns[f"{name}_{wheel}"] for wheel in driven_of(wheels_with(name, block.columns), block.about)
    ]
    return np.mean(each, axis=0) if each else np.full(len(block), np.nan)


def impossible(row: Mapping[str, Any]) -> str:
    """The means of a log's row that no machine can have, with their values; empty if there are none."""
    where = ""
    wrong = [n for n, (low, high) in POSSIBLE.items() if row[n] is not None and not low <= row[n] <= high]
    pushed = ["adhesion", "soil_resistance"]  # alone the former is a way downhill, the latter a measured pull
    if not wrong and all(row[name] is not None and row[name] < _PUSHED for name in pushed):
        where, wrong = ", but downhill where no pitch is in the log", pushed
    values = " and ".join(f"{name.replace('_', ' ')} {row[name]:.3g}" for name in wrong)
    return f"no machine has a mean {values}{where}: check its vehicle file and units" if wrong else ""


def weighted(rows: Iterable[dict[str, Any]], name: str) -> tuple[float, float]:
    """Mean of a column over rows weighted by moving time, and the standard deviation between rows (NaN for fewer than two)."""
    pairs = [
        (one[name], one["moving_time"]) for one in rows if one[name] is not None and one["moving_time"] > 0
    ]
    if not pairs:
        return float("nan"), float("nan")
    values, weights = np.array(pairs).T
    mean = float(np.average(values, weights=weights))
    spread = (
        float(np.sqrt(np.average((values - mean) ** 2, weights=weights))) if len(values) > 1 else float("nan")
    )
    return mean, spread

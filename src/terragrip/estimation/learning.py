"""Noise and held channels learned while the rows come in, by the functions that learn them from a whole log.

As a log's survey (`terragrip.recording.survey`) samples every 2^k-th chunk of its rows, so does this of the rows so far, with shorter
chunks: after 1, 2, 3, 4, 5, 7, 9, 13, 17 ... chunks the kept ones represent the whole drive, and what they show is reported.
"""

from __future__ import annotations

import math
from array import array
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from terragrip.estimation.noise import sensor_of, settings_in

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.vehicle import Vehicle

SECONDS = 10.0
"""Span of a chunk, or"""
ROWS = 5_000
"""so many rows, whichever comes first: the memory is bounded."""
CHUNKS = 4
"""Chunks that are kept at most."""
WORTH = 0.1
"""A noise that differs by less, relative, from the one in use is not worth a change."""


@dataclass(frozen=True)
class Learned:
    """SDs [SI] by channel and update periods [s], as learned from ``seconds`` of kept rows of the drive so far.

    ``doubts``: sentences on what the rows contradict, by the check of `terragrip.recording.plausibility`, once two evaluations in a row
    have found it. ``absent``: channels without any value in the first rows, once.
    """

    noise: Mapping[str, float]
    held: Mapping[str, float]
    seconds: float
    doubts: Mapping[str, list[str]] = field(default_factory=dict)
    absent: tuple[str, ...] = ()

    def changes(self, estimator: TractionEstimator) -> list[str]:
        """What differs from what the estimator uses, in words; empty where nothing is worth a change."""
        changes = [
            f"noise of {name} {sd:.3g} (was {estimator.noise[name]:.3g})"
            for name, sd in self.noise.items()
            if abs(sd / estimator.noise[name] - 1) > WORTH
        ]
        for name, period in self.held.items():
            before = estimator.held.get(name)
            if before is None or abs(period / before - 1) > WORTH:
                changes.append(f"{name} is held, one value in {period:.3g} s")
        return changes

    def apply(self, estimator: TractionEstimator) -> None:
        """From the next sample on. Where this shows nothing, earlier values stay: a machine at standstill shows no noise."""
        known = {name: sd for name, sd in estimator.noise.items() if name not in estimator.guessed}
        estimator.set_noise({**known, **self.noise}, {**estimator.held, **self.held})


class SettingsLearner:
    """Learns noise and held channels from the rows so far, at set moments.

    ``channels``: the columns that the estimator looks at. ``noise`` and ``held``: what is given and not to be learned anew.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        channels: tuple[str, ...],
        noise: Mapping[str, float],
        held: Mapping[str, float],
    ) -> None:
        self._vehicle, self._channels, self._noise, self._held = vehicle, channels, dict(noise), dict(held)
        self._missing = (math.nan,) * len(channels)
        self._number = 0  # of the chunk that is open
        self._every = 1
        # Evaluations in a row that found something, by check; kept once they were two, and said.
        self._doubtful: dict[str, int] = {}
        self._open = array("d")  # rows one behind the other: time, then the channels
        self._began = math.nan
        self._rows = 0
        self._kept: dict[int, array[float]] = {}

    def used(self, estimator: TractionEstimator) -> tuple[dict[str, float], dict[str, float]]:
        """Of what the estimator uses now, the SDs (where `WORTH` it) and update periods that were learned, neither given nor guessed."""
        given = {*self._noise, *estimator.guessed}
        stated = {
            name: getattr(self._vehicle.sensors, sensor_of(name), None) or 0.0 for name in estimator.noise
        }
        noise = {
            name: sd
            for name, sd in estimator.noise.items()
            if name not in given and abs(sd - stated[name]) > WORTH * stated[name]
        }
        return noise, {name: period for name, period in estimator.held.items() if name not in self._held}

    def add(self, time: float, values: Mapping[str, float]) -> Learned | None:
        """Add a row that the estimator has processed; returns what the rows so far show, where this one ends a chunk that is kept."""
        if self._rows and (time - self._began >= SECONDS or self._rows >= ROWS):
            learned = self._close()
            self._append(time, values)
            return learned
        self._append(time, values)
        return None

    def _append(self, time: float, values: Mapping[str, float]) -> None:
        if not self._rows:
            self._began = time
        self._rows += 1
        if self._number % self._every == 0:
            self._open.extend((time, *map(values.get, self._channels, self._missing)))

    def _close(self) -> Learned | None:
        is_kept = self._number % self._every == 0
        if is_kept:
            self._kept[self._number] = self._open
            if len(self._kept) > CHUNKS:
                self._every *= 2
                self._kept = {k: rows for k, rows in self._kept.items() if k % self._every == 0}
                is_kept = self._number in self._kept
        self._number += 1
        self._open, self._rows = array("d"), 0
        return self._learned() if is_kept else None

    def _learned(self) -> Learned:
        import numpy as np

        from terragrip.recording import Recording, held_periods
        from terragrip.recording.plausibility import warnings_by_check

        table = np.concatenate([np.frombuffer(rows) for rows in self._kept.values()])
        table = table.reshape(-1, 1 + len(self._channels))
        columns = dict(zip(self._channels, np.ascontiguousarray(table[:, 1:].T), strict=True))
        known = {name: values for name, values in columns.items() if not np.isnan(values).all()}
        log = Recording(np.ascontiguousarray(table[:, 0]), known)
        held = {**held_periods(log), **self._held}
        noise, _ = settings_in(log, self._vehicle, sensors=self._noise, held=held)
        seconds = sum(rows[-1 - len(self._channels)] - rows[0] for rows in self._kept.values())
        found = warnings_by_check(log, self._vehicle)
        found.pop("vehicle", None)  # said with the first row: no row is needed
        said = {name: count for name, count in self._doubtful.items() if count >= 2}
        self._doubtful = said | {name: self._doubtful.get(name, 0) + 1 for name in found}
        doubts = {name: notes for name, notes in found.items() if self._doubtful[name] == 2}
        absent = tuple(name for name in self._channels if name not in known and self._number == 1)
        return Learned(noise, held, seconds, doubts, absent)

    def state(self) -> dict[str, Any]:
        """As JSON holds it, to the last bit; without what was given."""
        return {
            "number": self._number,
            "every": self._every,
            "doubtful": self._doubtful,
            "began": None if math.isnan(self._began) else self._began,
            "rows": self._rows,
            "open": _text(self._open),
            "kept": {str(number): _text(rows) for number, rows in self._kept.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from `state`, made by one of the same channels; raises ValueError or LookupError where it is none."""
        self._number, self._every, self._rows = state["number"], state["every"], state["rows"]
        counts = state.get("doubtful")  # a number in records of 27 November 2026 and before
        self._doubtful = dict(counts) if isinstance(counts, dict) else {}
        self._began = math.nan if state["began"] is None else state["began"]
        self._open = _numbers(state["open"])
        self._kept = {int(number): _numbers(text) for number, text in state["kept"].items()}


def _text(rows: array[float]) -> str:
    return b64encode(rows.tobytes()).decode()


def _numbers(text: str) -> array[float]:
    return array("d", b64decode(text))

"""Change points of a whole drive: the most probable segmentation, by ruptures' PELT with a conjugate cost (Killick 2012; Fearnhead 2006).

The penalty comes from the data: the noise of a step is measured on the drive itself, and the price of a change is the chance of one in the
distance that a step covers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.errors import missing_package
from terragrip.ground.causes import LEVELS, OR_TOOL, Pull, cause_of, signs_of
from terragrip.ground.conjugate import Model
from terragrip.ground.noise import noise_of
from terragrip.ground.signals import GROUND, signals_of
from terragrip.ground.steps import A_LENGTH, crossing_variance, steps_of
from terragrip.soil.blocks import Blocks

LENGTH = 30.0
"""Mean way on one ground [m], before anything is known of a drive."""
LEAST = 4
"""Fewest steps of a stretch."""
_AT_ONCE = 512
"""Stretches that end at one block and are weighed together."""
_SEARCHED = 2000
"""Steps searched together, at least: ruptures' time grows with the square of a search's changes."""
_SHIFT = 20.0
"""Moved from every stretch's cost into the penalty: the sum stays, and PELT's pruning, made for costs that no split raises, stays right."""


@dataclass(frozen=True)
class Change:
    """The ground changes at `time` [s], known to `std` [s], with `probability`.

    `shift`: by how many SDs (of a step on one ground) each signal moved. `reported` [s]: when it was known while driving, None afterwards.
    `cause`: `causes.GROUND_ALONE` or `causes.OR_TOOL`; "": read from an older file.
    """

    time: float
    std: float
    probability: float
    shift: Mapping[str, float] = field(default_factory=dict)
    reported: float | None = None
    cause: str = ""

    @property
    def subject(self) -> str:
        """What changed, in words."""
        return "the ground, or a tool," if self.cause == OR_TOOL else "the ground"

    def to_dict(self) -> dict[str, Any]:
        """As ground.json holds it."""
        out: dict[str, Any] = {"time": self.time, "std": self.std, "probability": self.probability}
        if self.reported is not None:
            out["reported"] = self.reported
        if self.cause:
            out["cause"] = self.cause
        return {**out, "shift": dict(self.shift)} if self.shift else out

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Change:
        """Of ground.json (older ones have ``told`` for ``reported``); raises TypeError where it is none."""
        return cls(**{"reported" if name == "told" else name: value for name, value in data.items()})


def changes_of(
    blocks: Blocks,
    names: Sequence[str] = GROUND,
    length: float = LENGTH,
    step: float = 0.0,
    pull: Pull = "measured",
) -> tuple[Change, ...]:
    """The changes of a whole drive.

    `names`: which of `signals.SIGNALS` to look at. `length` [m]: mean way on one ground before the data speak, which with
    the drive's own speed is the price of a change. `step` [m]: way that blocks are put together over (`steps.A_LENGTH` of the vehicle's
    length); 0: none. `pull`: what is known of the drawbar force. Raises InputError where ruptures is not installed.
    """
    steps, _, _ = steps_of(blocks, step)
    every = signals_of(steps, tuple(names))
    is_measured = np.isfinite(every).any(axis=1)
    signals, steps = every[is_measured], steps[is_measured]
    if len(signals) < 2 * LEAST:
        return ()
    driven = float(np.diff(steps.travelled).clip(0).sum())
    chance = float(np.clip(driven / len(signals) / length, 1e-6, 0.5))
    price = -2 * np.log(chance)
    noise = noise_of(signals, names)
    cost = _Cost(signals, Model.of(names, noise))
    ends = [0, *_borders(cost, price), len(signals)]
    signs = signs_of(steps)
    levels = noise_of(signs[:, :2], LEVELS).within
    return tuple(
        _change(
            cost,
            steps,
            dict(zip(names, noise.within, strict=True)),
            (before, border, after),
            step,
            np.exp(-price / 2),
            cause_of(signs[before:border], signs[border:after], levels, pull),
        )
        for before, border, after in zip(ends, ends[1:], ends[2:], strict=False)
    )


class _Cost:
    """Minus twice the log evidence of stretches of the signals; ruptures asks for one at a time, all of one end in turn."""

    model = ""
    min_size = LEAST

    def __init__(self, signals: Floats, model: Model) -> None:
        measured = np.isfinite(signals)
        filled = np.where(measured, signals, 0.0)
        zero = np.zeros((1, signals.shape[1]))
        self._count, self._sum, self._square = (
            np.vstack([zero, np.cumsum(x, axis=0)]) for x in (measured.astype(float), filled, filled**2)
        )
        self._model = model
        self.signal = signals
        self.begin = 0
        self._end, self._costs = -1, np.zeros(0)

    def fit(self, signal: Any) -> _Cost:
        """Nothing to learn: ruptures calls it."""
        return self

    def error(self, start: int, end: int) -> float:
        """Cost of the stretch [start, end) from `begin`, less `_SHIFT`."""
        start, end = self.begin + start, self.begin + end
        if end != self._end:
            first = np.arange(max(end - _AT_ONCE, self.begin), end)
            self._end, self._costs = end, self.of(first, np.full(first.size, end))
        back = end - start
        if back > self._costs.size:
            return float(self.of(np.array([start]), np.array([end]))[0]) - _SHIFT
        return float(self._costs[-back]) - _SHIFT

    def of(self, start: NDArray[np.int64], end: NDArray[np.int64]) -> Floats:
        """Costs of the stretches [start, end), (stretches,)."""
        count, total, square = (x[end] - x[start] for x in (self._count, self._sum, self._square))
        return -2 * self._model.evidence(count, total, square)


def _borders(cost: _Cost, price: float) -> list[int]:
    """The steps before which the ground changes. A long drive is searched piece by piece, each from the last border that the piece before
    found well before its end; without one the next is much longer, so that one ground all the way costs little more than one search."""
    borders: list[int] = []
    steps, size = len(cost.signal), _SEARCHED
    while True:
        begin = borders[-1] if borders else 0
        end = begin + size
        found = _pelt(cost, begin, min(end, steps), price)
        if end >= steps:
            return borders + found
        sure = [k for k in found if k <= end - _SEARCHED // 4]
        borders += sure
        size = _SEARCHED if sure else 4 * size


def _pelt(cost: _Cost, begin: int, end: int, price: float) -> list[int]:
    try:
        from ruptures.detection.pelt import Pelt
    except ImportError:
        raise missing_package("ruptures", "ground", "find the changes of a whole drive") from None
    cost.begin = begin
    search = Pelt(min_size=LEAST, jump=1)
    search.cost = cost
    search.fit(cost.signal[begin:end])
    return [begin + int(k) for k in search.predict(pen=price + _SHIFT)[:-1]]


def _change(
    cost: _Cost,
    steps: Blocks,
    within: Mapping[str, float],
    place: tuple[int, int, int],
    step: float,
    chance: float,
    cause: str,
) -> Change:
    """The change at `border` between its neighbours: where it may lie, and how probable it is that there is one at all."""
    before, border, after = place
    at = np.arange(before + 1, after)
    both = cost.of(np.full(at.size, before), at) + cost.of(at, np.full(at.size, after))
    none = cost.of(np.array([before]), np.array([after]))[0]
    logs = -0.5 * (both - none) + np.log(chance)
    top = logs.max()
    weight = np.exp(logs - top)
    odds = np.log(weight.sum()) + top
    weight /= weight.sum()
    middle, took = 0.5 * (steps.end[at - 1] + steps.start[at]), steps.end[at] - steps.end[at - 1]
    time = float((weight * middle).sum())
    near = slice(max(border - A_LENGTH // 2, 0), border + A_LENGTH // 2 + 1)
    # nothing is crossed between steps, where it stands
    drives = steps.start[near][1:] <= steps.end[near][:-1]
    way, seconds = (float(np.diff(x[near])[drives].sum()) for x in (steps.travelled, steps.end))
    variance = (weight * ((middle - time) ** 2 + took**2 / 12)).sum() + crossing_variance(step, way, seconds)
    shift = {}
    for (name, sd), signal in zip(within.items(), cost.signal.T, strict=True):
        one, other = (part[np.isfinite(part)] for part in (signal[before:border], signal[border:after]))
        if one.size and other.size:
            shift[name] = round(float(other.mean() - one.mean()) / sd, 2)
    return Change(time, float(np.sqrt(variance)), float(1 / (1 + np.exp(-odds))), shift, cause=cause)

"""Change points while driving: Bayesian online change-point detection (Adams and MacKay 2007) with a conjugate model.

The model of one ground is `conjugate.Model`, so that the predictive law is Student's. The hazard is of the distance driven: standing still
changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from terragrip.arrays import Floats
from terragrip.ground.causes import LEVELS, Pull, cause_of, signs_of
from terragrip.ground.changes import LENGTH, Change
from terragrip.ground.conjugate import Model
from terragrip.ground.noise import noise_of
from terragrip.ground.signals import GROUND, signals_of
from terragrip.ground.steps import A_LENGTH, crossing_variance, joined, steps_of
from terragrip.soil.blocks import Blocks

_MOST = 240
"""Run lengths kept, and steps that the noise is measured on: 40 lengths of the vehicle."""
_LEAST = 1e-7
_THRESHOLD = 0.8  # probability at which a change is reported,
_RECENT = 2 * A_LENGTH  # within so many steps
_RUNS = ("_mean", "_count", "_shape", "_scale")
_EACH = ("_probability", "_age")


class OnlineChanges:
    """Receives blocks in order and reports changes; `probability` is that of a change within the last steps.

    `step`, `length` [m], `names` and `pull` as of `changes.changes_of`.
    """

    def __init__(
        self,
        step: float = 0.0,
        length: float = LENGTH,
        names: tuple[str, ...] = GROUND,
        pull: Pull = "measured",
    ) -> None:
        self._step, self._length, self._names, self._pull = step, length, names, pull
        self._signals = np.zeros((0, len(names)))
        self._signs, self._starts = np.zeros((0, 4)), np.zeros(0)
        self._last = -np.inf  # time of the change before
        self._prior()
        self._mean, self._count, self._shape, self._scale = (x[None, :].copy() for x in self._fresh)
        self._probability = np.ones(1)
        self._begin = np.full(1, np.nan)
        self._age = np.zeros(1)
        self._travelled: float | None = None
        self._quiet = 0
        self._pending: Blocks | None = None
        self._from: float | None = None
        self.probability = 0.0

    def update(self, blocks: Blocks) -> list[Change]:
        """Add blocks, one or many; returns the changes that they show."""
        every = blocks if self._pending is None else joined(self._pending, blocks)
        steps, rest, self._from = steps_of(every, self._step, self._from)
        self._pending = rest if len(rest) else None
        result = []
        signals, signs = signals_of(steps, self._names), signs_of(steps)
        for k in range(len(steps)):
            self._signs = np.vstack([self._signs[1 - _MOST :], signs[k]])
            self._starts = np.append(self._starts[1 - _MOST :], steps.start[k])
            change = self._add(
                signals[k], float(steps.start[k]), float(steps.end[k]), float(steps.travelled[k])
            )
            if change is not None:
                result.append(change)
        return result

    def to_dict(self) -> dict[str, Any]:
        """The state as plain values, exact."""
        pending = self._pending
        return {
            **{name: getattr(self, name).tolist() for name in (*_RUNS, *_EACH)},
            "_begin": _plain(self._begin),
            "signals": _plain(self._signals),
            "signs": _plain(self._signs),
            "starts": self._starts.tolist(),
            "last": self._last if np.isfinite(self._last) else None,
            "travelled": self._travelled,
            "quiet": self._quiet,
            "pending": None if pending is None else {k: _plain(v) for k, v in vars(pending).items()},
            "from": self._from,
            "probability": self.probability,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the state of `to_dict`; raises KeyError, TypeError or ValueError where it is none."""
        for name in (*_RUNS, *_EACH, "_begin"):
            setattr(self, name, np.array(state[name], dtype=float))
        self._signals = np.array(state["signals"], dtype=float).reshape(-1, len(self._names))
        self._signs = np.array(state["signs"], dtype=float).reshape(-1, 4)
        self._starts = np.array(state["starts"], dtype=float)
        self._last = -np.inf if state["last"] is None else float(state["last"])
        self._prior()
        self._travelled, self.probability = state["travelled"], float(state["probability"])
        self._quiet, self._from = int(state["quiet"]), state["from"]
        pending: dict[str, Any] | None = state["pending"]
        if pending is not None:
            counts = ("number", "rows", "usable", "streak")
            pending = {k: np.array(v, dtype=np.int64 if k in counts else float) for k, v in pending.items()}
        self._pending = None if pending is None else Blocks(**pending)

    def _prior(self) -> None:
        """The law of a new ground, by the noise of the steps so far."""
        model = Model.of(self._names, noise_of(self._signals, self._names))
        self._weight, self._fresh = model.weight, (model.mean, model.count, model.shape, model.scale)

    def _add(self, x: Floats, start: float, end: float, travelled: float) -> Change | None:
        driven = 0.0 if self._travelled is None else max(travelled - self._travelled, 0.0)
        self._travelled = travelled
        hazard = -np.expm1(-driven / self._length)
        grown = self._probability * (1 - hazard)
        self._probability = np.append(grown, hazard)
        self._begin = np.append(self._begin, start)
        self._age = np.append(self._age + 1, 1)
        for name, prior in zip(_RUNS, self._fresh, strict=True):
            setattr(self, name, np.vstack([getattr(self, name), prior]))
        finite = np.isfinite(x)
        if finite.any():
            self._learn(np.where(finite, x, 0.0), np.where(finite, self._weight, 0.0))
        self._signals = np.vstack([self._signals[1 - _MOST :], x])
        self._prior()
        self._prune()
        return self._report(end, driven)

    def _learn(self, x: Floats, weight: Floats) -> None:
        """Weight the runs by their predictions, then add the block to each."""
        off, degrees = x - self._mean, 2 * self._shape
        square = self._scale * (self._count + 1) / (self._shape * self._count)
        logs = gammaln((degrees + 1) / 2) - gammaln(degrees / 2) - 0.5 * np.log(degrees * np.pi * square)
        logs -= (degrees + 1) / 2 * np.log1p(off**2 / (degrees * square))
        total = (logs * weight).sum(axis=1)
        weighed = self._probability * np.exp(total - total.max())
        self._probability = weighed / weighed.sum()
        self._scale = self._scale + weight * self._count * off**2 / (2 * (self._count + weight))
        self._mean = self._mean + weight * off / (self._count + weight)
        self._count = self._count + weight
        self._shape = self._shape + weight / 2

    def _prune(self) -> None:
        keep = self._probability > _LEAST
        keep[-1] = True
        if len(keep) > _MOST:
            keep[: len(keep) - _MOST] = False
        if not keep.any() or keep.all():
            return
        for name in (*_RUNS, *_EACH, "_begin"):
            setattr(self, name, getattr(self, name)[keep])
        self._probability = self._probability / self._probability.sum()

    def _report(self, now: float, driven: float) -> Change | None:
        self._quiet += 1
        recent = self._age <= min(_RECENT, self._quiet - 1)
        self.probability = float(self._probability[recent].sum())
        if self.probability < _THRESHOLD:
            return None
        weight, at = self._probability[recent] / self.probability, self._begin[recent]
        time = float((weight * at).sum())
        self._quiet = 0
        took = now - float(self._begin[-1])
        variance = (weight * (at - time) ** 2).sum() + took**2 / 12
        std = float(np.sqrt(variance + crossing_variance(self._step, driven, took)))
        within = noise_of(self._signs[:, :2], LEVELS).within
        before, after = self._starts >= self._last, self._starts >= time
        cause = cause_of(self._signs[before & ~after], self._signs[after], within, self._pull)
        self._last = time
        return Change(time, std, self.probability, reported=now, cause=cause)


def _plain(values: NDArray[Any]) -> list[Any]:
    """An array as JSON has it: NaN is null."""
    out = values.astype(object)
    out[~np.isfinite(values)] = None
    return list(out.tolist())

"""Change points while driving: Bayesian online change-point detection (Adams and MacKay 2007) with a conjugate model.

The model of one ground is `conjugate.Model`, so that the predictive law is Student's. The hazard is of the distance driven: standing still
changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import gammaln

from terragrip.arrays import Floats
from terragrip.ground.changes import Change
from terragrip.ground.conjugate import Model
from terragrip.ground.signals import GROUND, signals_of
from terragrip.soil.blocks import PERIOD, Blocks

_MOST = 240
"""Run lengths kept: two minutes; a longer run is as well known as it will ever be."""
_LEAST = 1e-7
_RUNS = ("_mean", "_count", "_shape", "_scale")


@dataclass(frozen=True)
class OnlineSettings:
    """`length` [m]: mean distance on one ground; `threshold`: probability at which a change is reported; `recent` [s]: span searched."""

    length: float = 30.0
    threshold: float = 0.8
    recent: float = 10.0
    names: tuple[str, ...] = GROUND


class OnlineChanges:
    """Receives blocks in order and reports changes; `probability` is that of a change within the last `recent` seconds."""

    def __init__(self, settings: OnlineSettings | None = None) -> None:
        self.settings = settings or OnlineSettings()
        model = Model.of(self.settings.names)
        self._weight = model.weight
        self._prior = (model.mean, model.count, model.shape, model.scale)
        self._mean, self._count, self._shape, self._scale = (x[None, :].copy() for x in self._prior)
        self._probability = np.ones(1)
        self._begin = np.full(1, np.nan)
        self._travelled: float | None = None
        self._quiet_until = -np.inf
        self.probability = 0.0

    def update(self, blocks: Blocks) -> list[Change]:
        """Add blocks, one or many; returns the changes that they show."""
        result = []
        signals = signals_of(blocks, self.settings.names)
        for k in range(len(blocks)):
            change = self._add(
                signals[k], float(blocks.start[k]), float(blocks.end[k]), float(blocks.travelled[k])
            )
            if change is not None:
                result.append(change)
        return result

    def to_dict(self) -> dict[str, Any]:
        """The state as plain values, exact."""
        quiet = None if self._quiet_until == -np.inf else self._quiet_until
        runs = {name: getattr(self, name).tolist() for name in (*_RUNS, "_probability")}
        begin = [None if np.isnan(x) else float(x) for x in self._begin]
        return {
            **runs,
            "_begin": begin,
            "travelled": self._travelled,
            "quiet": quiet,
            "probability": self.probability,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the state of `to_dict`; raises KeyError, TypeError or ValueError where it is none."""
        for name in (*_RUNS, "_probability"):
            setattr(self, name, np.array(state[name], dtype=float))
        self._begin = np.array([np.nan if x is None else x for x in state["_begin"]], dtype=float)
        self._travelled, self.probability = state["travelled"], float(state["probability"])
        self._quiet_until = -np.inf if state["quiet"] is None else float(state["quiet"])

    def _add(self, x: Floats, start: float, end: float, travelled: float) -> Change | None:
        driven = 0.0 if self._travelled is None else max(travelled - self._travelled, 0.0)
        self._travelled = travelled
        hazard = -np.expm1(-driven / self.settings.length)
        grown = self._probability * (1 - hazard)
        self._probability = np.append(grown, hazard)
        self._begin = np.append(self._begin, start)
        for name, prior in zip(_RUNS, self._prior, strict=True):
            setattr(self, name, np.vstack([getattr(self, name), prior]))
        finite = np.isfinite(x)
        if finite.any():
            self._learn(np.where(finite, x, 0.0), np.where(finite, self._weight, 0.0))
        self._prune()
        return self._report(end)

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
        for name in (*_RUNS, "_probability", "_begin"):
            setattr(self, name, getattr(self, name)[keep])
        self._probability = self._probability / self._probability.sum()

    def _report(self, now: float) -> Change | None:
        recent = self._begin > max(now - self.settings.recent, self._quiet_until)
        self.probability = float(self._probability[recent].sum())
        if self.probability < self.settings.threshold:
            return None
        weight, at = self._probability[recent] / self.probability, self._begin[recent]
        time = float((weight * at).sum())
        self._quiet_until = now
        std = float(np.sqrt((weight * (at - time) ** 2).sum() + PERIOD**2 / 12))
        return Change(time, std, self.probability, reported=now)

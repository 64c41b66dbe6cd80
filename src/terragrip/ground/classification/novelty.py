"""How strange a window is, and which share of windows on known grounds is as strange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.ground.classification.neighbours import nearby_mean

LEVELS: Floats = np.r_[0.0, np.geomspace(1e-4, 1.0, 400)]
AMONG = 3
"""The first kinds of oddness: of a place among the grounds' windows. What follows is of a place outside them all."""
OUTSIDE = 3.0
"""Standard deviations over known windows beyond which a distance is no known window's: another machine, speed or unit."""
SPANS: Floats = np.array([0.0, 2.0, 5.0, 10.0, 20.0, 60.0])
"""Lengths of time [s] over which strangeness may be averaged; others lie between these."""


@dataclass(frozen=True)
class Strangeness:
    """What is usual of known windows: ``usual`` (kinds, 2), mean and SD of each kind of oddness; ``levels`` (spans, levels), the
    strangeness, averaged over a span, that a share `LEVELS` of them exceeds."""

    usual: Floats
    levels: Floats

    @classmethod
    def fit(cls, odd: Floats, weight: Floats, groups: Ints, starts: Floats) -> Strangeness:
        """Learn from the oddness (kinds, n) of held-out windows, what each weighs (n,), its recording (n,) and start (n,) [s]."""
        mean = odd @ weight
        spread = np.sqrt((odd - mean[:, None]) ** 2 @ weight)
        usual = np.column_stack([mean, np.where(spread > 1e-9, spread, 1.0)])
        alone = cls(usual, np.empty((0, 0))).of(odd)
        return cls(usual, np.stack([_exceeded(_averaged(alone, groups, starts, s), weight) for s in SPANS]))

    def of(self, odd: Floats) -> Floats:
        """Strangeness (n,) of windows with this oddness (kinds, n).

        Each kind is measured in its own standard deviations over known windows. Among the grounds the sum tells more than any kind;
        outside, where limited features may look like any ground's, the distance beyond `OUTSIDE` counts besides, as much as all of
        those. Files of before 28 November 2026 hold nothing of the outside.
        """
        own = (odd[: len(self.usual)] - self.usual[:, :1]) / self.usual[:, 1:]
        beyond = np.maximum(own[AMONG:] - OUTSIDE, 0.0).sum(axis=0)
        return np.asarray(own[:AMONG].sum(axis=0) + AMONG * beyond)

    def novelty(self, strange: Floats, span: float) -> Floats:
        """Share (n,) of windows on known grounds, from runs not trained on, at least as strange over a span [s]; NaN stays."""
        at = float(np.interp(np.log1p(span), np.log1p(SPANS), np.arange(len(SPANS))))
        low = int(at)
        part = at - low
        levels = (1 - part) * self.levels[low] + part * self.levels[min(low + 1, len(SPANS) - 1)]
        share = np.interp(strange, levels[::-1], LEVELS[::-1])
        return np.where(np.isnan(strange), np.nan, share)


def _averaged(strange: Floats, groups: Ints, starts: Floats, span: float) -> Floats:
    if not span:
        return strange
    result = np.empty(len(strange))
    for group in np.unique(groups):
        mine = np.flatnonzero(groups == group)
        mine = mine[np.argsort(starts[mine], kind="stable")]
        result[mine] = nearby_mean(strange[mine], starts[mine], span / 2)
    return result


def _exceeded(strange: Floats, weight: Floats) -> Floats:
    """The strangeness that each share of `LEVELS` exceeds; falling."""
    order = np.argsort(-strange)
    share = np.cumsum(weight[order])
    levels = np.interp(LEVELS, np.r_[0.0, share], np.r_[strange[order[0]] + 1e-6, strange[order]])
    return np.asarray(np.minimum.accumulate(levels) - 1e-12 * np.arange(len(levels), dtype=float))

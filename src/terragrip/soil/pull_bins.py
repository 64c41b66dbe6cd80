"""Slip bins of pairs sorted by the vehicle's pull: each bin is then a fair sample of the ground.

Slip depends on the ground: under one pull a weak spot slips more than a strong one. Sorted by their own slip, bins of high slip gather
weak spots, and bins at 5 % miss the strongest ground (decision 0075); noise of slip sorts too. The pull does not depend on the spot.
So a pair belongs to the bin of the slip at which the soil's mean curve gives the vehicle's pull, its driven wheels' mean adhesion.
The bin's adhesion is the mean over its metres. Its slip is the mean too, on the scale of the prototype curve g (physics.md 5): a spot of
scale a_i has mu_i = a_i g(s_i). So mean(mu) = a mean(g(s)), whereas the plain mean of s is biased where the curve bends. Random errors
of slip cancel in that mean except for g's bend, which is known: the mean of e^(-k s) under normal errors is e^(k^2 sigma^2 / 2) too large.

Conditions: the pull is given and slip follows, as in the field; where slip is set and the pull follows (a single-wheel test bench), sort
by slip. The curve does not fall within the bins: beyond its maximum one pull has two slips.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Floats
from terragrip.physics.adhesion import PROTOTYPE
from terragrip.soil.bins import PULL, Bins, BinSettings, height_of, slip_of

_WIDEST = 0.1
_ROUNDS = 30
_CLOSE = 1e-4


def bin_by_pull(
    slip: ArrayLike,
    adhesion: ArrayLike,
    pull: ArrayLike,
    metres: ArrayLike,
    cluster: ArrayLike | None = None,
    settings: BinSettings | None = None,
    slip_std: ArrayLike | None = None,
) -> Bins:
    """Sort pairs, each array of shape (n,), into slip bins by the pull.

    pull: the mean adhesion of the vehicle's driven wheels at that instant [-]; metres: distance of the vehicle for the pair [m];
    cluster: integer labels (run) of samples that are not independent (default: one). slip_std: SD of the random part of each slip, 0 where
    it is NaN and at most 0.1 (default: exact). A bin with less than `settings.metres` or `settings.runs`
    (clusters, if there are as many) is joined to the next, the last to the one before. The scale of the sorting curve is the one that
    the resulting bins give (fixed point, physics.md 5's least squares).
    `std` of a bin is the SD of adhesion about the curve through it. Pairs without slip, adhesion, pull or distance, and pulls outside
    the range, are left out and counted. ValueError if the lengths differ.
    """
    chosen = settings or PULL
    columns = [np.ravel(np.asarray(x, dtype=float)) for x in (slip, adhesion, pull, metres)]
    labels = np.zeros(columns[0].size, dtype=np.int64) if cluster is None else np.ravel(np.asarray(cluster))
    if len({labels.size, *(x.size for x in columns)}) > 1:
        raise ValueError(f"columns of {', '.join(str(x.size) for x in (*columns, labels))} pairs")
    good = np.isfinite(columns).all(axis=0) & (columns[3] > 0)
    s, mu, z, dx = (x[good] for x in columns)
    _, compact = np.unique(labels[good], return_inverse=True)
    noise = np.zeros(labels.size) if slip_std is None else np.ravel(np.asarray(slip_std, dtype=float))
    height, clusters = _unbiased(s, noise[good]), int(compact.max()) + 1 if compact.size else 1
    edges, runs = height_of(chosen.edges), min(chosen.runs, clusters)
    cells = edges.size - 1

    def sums(values: Floats) -> Floats:
        result = np.bincount(flat, weights=values[inside], minlength=clusters * cells)
        return result.astype(float).reshape(clusters, cells)

    a = _start(mu, height, dx, edges[0])
    for _ in range(_ROUNDS):
        index = np.searchsorted(a * edges, z, side="right") - 1
        inside = (index >= 0) & (index < cells) & (a > 0)
        flat = compact[inside] * cells + index[inside]
        way, total, heights = sums(dx), sums(mu * dx), sums(height * dx)
        groups = _joined(way, chosen.metres, runs)
        weight, mean, level = (_grouped(x, groups).sum(axis=0) for x in (way, total, heights))
        mean, level = mean / weight, level / weight
        before, a = a, float(mean @ level / max(level @ level, 1e-300)) if groups else a
        if not groups or abs(a - before) < _CLOSE * abs(before):
            break
    group_of = np.full(cells, -1)
    for k, group in enumerate(groups):
        group_of[group] = k
    own = group_of[index[inside]]
    inside[inside] = own >= 0
    own = own[own >= 0]
    through = np.where(level > 0, mean / np.where(level > 0, level, 1.0), 0.0)
    off = mu[inside] - mean[own] - through[own] * (height[inside] - level[own])
    square = np.bincount(own, weights=dx[inside] * off**2, minlength=len(groups))
    return Bins(
        settings=chosen,
        slip=slip_of(level),
        mean=mean,
        std=np.sqrt(square / weight),
        count=np.bincount(own, minlength=len(groups)).astype(np.int64),
        cluster_count=_grouped(way, groups),
        cluster_sum=_grouped(total, groups),
        cluster_slip=_grouped(heights, groups),
        left_out=int(labels.size - own.size),
        reference=a,
    )  # fmt: skip


def _unbiased(slip: Floats, noise: Floats) -> Floats:
    """The prototype's height (n,), corrected at positive slips for the effect of normal errors of SD `noise` (n,)."""
    share, slow, fast = PROTOTYPE["p"], PROTOTYPE["alpha_1"], PROTOTYPE["alpha_2"]
    sd = np.clip(np.nan_to_num(noise), 0.0, _WIDEST)
    freed = 1.0 - sum(
        part * np.exp(rate * slip - (rate * sd) ** 2 / 2) for part, rate in ((share, slow), (1 - share, fast))
    )
    return np.asarray(np.where(slip > 0, freed, height_of(slip)))


def _start(mu: Floats, height: Floats, dx: Floats, lowest: float) -> float:
    """A first scale: of all pairs above the bins' lowest slip, by metres."""
    counts = height > lowest
    below = float((height * dx)[counts].sum())
    return float((mu * dx)[counts].sum()) / below if below > 0 else 1.0


def _joined(way: Floats, metres: float, runs: int) -> list[list[int]]:
    """Neighbouring cells joined, from the lowest up, until each group has `metres` from `runs` clusters; way: (clusters, cells)."""
    groups: list[list[int]] = []
    open_ = []
    for cell in range(way.shape[1]):
        open_.append(cell)
        held = way[:, open_].sum(axis=1)
        if held.sum() >= metres and np.count_nonzero(held) >= runs:
            groups.append(open_)
            open_ = []
    if groups and way[:, open_].sum() > 0:
        groups[-1] += open_
    return groups


def _grouped(values: Floats, groups: Sequence[Sequence[int]]) -> Floats:
    """Columns summed by group: (clusters, cells) to (clusters, groups)."""
    return np.asarray(
        np.stack([values[:, g].sum(axis=1) for g in groups], axis=1) if groups else values[:, :0]
    )

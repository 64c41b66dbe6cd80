"""How good recognition is where labels exist: confusion of soils, and whether probabilities are what they say (reliability)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.ground.result import Timeline

Array = NDArray[np.float64]

_EDGES = (0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.97, 1.0)  # of the bins of probability


@dataclass(frozen=True)
class Confusion:
    """Blocks of half a second by label (rows) and most probable soil (columns): `counts` (labels, soils)."""

    labels: tuple[str, ...]
    soils: tuple[str, ...]
    counts: NDArray[np.int64]

    @property
    def right(self) -> float:
        """Share of blocks whose most probable soil is the label; NaN without any."""
        hits = sum(
            int(self.counts[i, self.soils.index(n)]) for i, n in enumerate(self.labels) if n in self.soils
        )
        total = int(self.counts.sum())
        return hits / total if total else float("nan")


@dataclass(frozen=True)
class ReliabilityBin:
    """Blocks whose stated probability of the most probable soil lies in [lower, upper): the mean of it, the share that was right, and how
    many there are."""

    lower: float
    upper: float
    stated: float
    right: float
    count: int


def merged(timeline: Timeline, together: Mapping[str, str]) -> Timeline:
    """The timeline with soils taken as one: `together` maps a soil to the name of its group (fine and wet, say); probabilities add up."""
    names = tuple(dict.fromkeys(together.get(name, name) for name in timeline.names))
    table = np.zeros((len(timeline.time), len(names)))
    for k, name in enumerate(timeline.names):
        table[:, names.index(together.get(name, name))] += timeline.probabilities[:, k]
    label = np.array([together.get(str(x), str(x)) for x in timeline.label], dtype=object)
    return Timeline(timeline.time, names, table, timeline.known, label)


def confusion(timelines: Iterable[Timeline]) -> Confusion:
    """Confusion of all labelled blocks; where vehicle and tool are on different soils there is no label, and nothing counts.

    Labels and soils in the order of their first appearance.
    """
    pairs = [(str(a), str(b)) for t in timelines for a, b in zip(t.label, t.soil, strict=True) if a]
    labels = tuple(dict.fromkeys(a for a, _ in pairs))
    soils = tuple(dict.fromkeys((*labels, *(b for _, b in pairs))))
    counts = np.zeros((len(labels), len(soils)), dtype=np.int64)
    for a, b in pairs:
        counts[labels.index(a), soils.index(b)] += 1
    used = counts.any(axis=0) | np.isin(soils, labels)
    return Confusion(labels, tuple(s for s, u in zip(soils, used, strict=True) if u), counts[:, used])


def reliability(timelines: Iterable[Timeline]) -> tuple[ReliabilityBin, ...]:
    """The most probable soil's probability against how often it was right, over labelled blocks that tell of the ground.

    Empty bins are left out.
    """
    stated, right = [], []
    for one in timelines:
        rows = one.known & (one.label != "")
        stated.append(one.probabilities[rows].max(axis=1))
        right.append((one.soil == one.label)[rows])
    p, r = (np.concatenate(x) if x else np.zeros(0) for x in (stated, right))
    place = np.clip(np.searchsorted(np.asarray(_EDGES), p, side="right") - 1, 0, len(_EDGES) - 2)
    return tuple(
        ReliabilityBin(
            _EDGES[k], _EDGES[k + 1], float(p[rows].mean()), float(r[rows].mean()), int(rows.sum())
        )
        for k in range(len(_EDGES) - 1)
        if (rows := place == k).any()
    )


def calibration_error(bins: Sequence[ReliabilityBin]) -> float:
    """Expected calibration error: mean over blocks of |stated - right| by bin; NaN without blocks."""
    total = sum(one.count for one in bins)
    return sum(one.count * abs(one.stated - one.right) for one in bins) / total if total else float("nan")

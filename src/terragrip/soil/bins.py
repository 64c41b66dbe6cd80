"""Slip bins: the paper's data preparation (1 % bins from 5 % to 60 %, mean and SD of each), kept by cluster for the bootstrap."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BinSettings:
    """How pairs become bins: width, range of slip, the fewest samples that make a bin. Recorded in every result.

    Slips are fractions. Raises ValueError where the range is empty or the width not positive.
    """

    width: float = 0.01
    lower: float = 0.05
    upper: float = 0.60
    minimum: int = 10

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.upper - self.lower >= self.width and self.minimum >= 1):
            raise ValueError(
                f"slip bins of {self.width:g} from {self.lower:g} to {self.upper:g} with at least {self.minimum} samples are no bins"
            )

    @property
    def edges(self) -> Array:
        """Edges of the bins, shape (bins + 1,)."""
        count = round((self.upper - self.lower) / self.width)
        return np.asarray(self.lower + self.width * np.arange(count + 1), dtype=float)

    def to_dict(self) -> dict[str, float]:
        """The settings as plain numbers."""
        return asdict(self)


PAPER_BINS: Mapping[str, BinSettings] = {"grass": BinSettings(upper=0.40)}
"""The paper's exception: on grass only slips up to 40 % (its section on soil characteristics)."""


@dataclass(frozen=True)
class Bins:
    """Pairs sorted into slip bins. Arrays have shape (bins,); the `cluster_` arrays (clusters, bins).

    A cluster is a set of samples that are not independent of each other: a run, or a stretch of one.
    Bins with fewer than `settings.minimum` samples hold NaN in slip, mean and std.
    """

    settings: BinSettings
    slip: Array
    mean: Array
    std: Array
    count: NDArray[np.int64]
    cluster_count: Array = field(repr=False)
    cluster_sum: Array = field(repr=False)
    cluster_slip: Array = field(repr=False)
    left_out: int = 0

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which bins hold enough samples."""
        return self.count >= self.settings.minimum

    @property
    def clusters(self) -> int:
        """How many clusters have samples in the bins."""
        return int(np.count_nonzero(self.cluster_count.sum(axis=1)))

    def to_list(self) -> list[dict[str, float]]:
        """The used bins as soils.json holds them."""
        rows = zip(self.slip, self.mean, self.std, self.count, strict=True)
        return [
            {"slip": float(s), "mean": float(m), "std": float(d), "count": int(c)}
            for (s, m, d, c), used in zip(rows, self.used, strict=True)
            if used
        ]


def bin_pairs(
    slip: ArrayLike,
    adhesion: ArrayLike,
    cluster: ArrayLike | None = None,
    settings: BinSettings | None = None,
) -> Bins:
    """Sort pairs (slip, adhesion), each of shape (n,), into slip bins; `cluster` (n,) are integer labels (default: one cluster).

    NaN pairs and slips outside the range are left out and counted. ValueError if the lengths differ.
    """
    chosen = settings or BinSettings()
    s, mu = np.ravel(np.asarray(slip, dtype=float)), np.ravel(np.asarray(adhesion, dtype=float))
    if s.shape != mu.shape:
        raise ValueError(f"{s.size} slips but {mu.size} adhesions")
    labels = np.zeros(s.size, dtype=np.int64) if cluster is None else np.ravel(np.asarray(cluster))
    if labels.shape != s.shape:
        raise ValueError(f"{s.size} slips but {labels.size} cluster labels")
    bins = chosen.edges.size - 1
    index = np.floor((s - chosen.lower) / chosen.width + 1e-9)
    inside = np.isfinite(s) & np.isfinite(mu) & (index >= 0) & (index < bins)
    _, compact = np.unique(labels[inside], return_inverse=True)
    clusters = int(compact.max()) + 1 if compact.size else 1
    flat = compact * bins + index[inside].astype(np.int64)

    def sums(values: Array | None) -> Array:
        return (
            np.bincount(flat, weights=values, minlength=clusters * bins).astype(float).reshape(clusters, bins)
        )

    count, total, square, slips = sums(None), sums(mu[inside]), sums(mu[inside] ** 2), sums(s[inside])
    n = count.sum(axis=0)
    enough = n >= chosen.minimum
    safe = np.where(enough, n, np.nan)
    mean = total.sum(axis=0) / safe
    variance = np.maximum(square.sum(axis=0) / safe - mean**2, 0.0) * safe / np.maximum(safe - 1, 1)
    return Bins(
        settings=chosen,
        slip=slips.sum(axis=0) / safe,
        mean=mean,
        std=np.sqrt(variance),
        count=n.astype(np.int64),
        cluster_count=count,
        cluster_sum=total,
        cluster_slip=slips,
        left_out=int(s.size - np.count_nonzero(inside)),
    )

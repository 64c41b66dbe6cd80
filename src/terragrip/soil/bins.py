"""Slip bins: the paper's data preparation (1 % bins from 5 % to 60 %, mean and SD of each), kept by cluster for the bootstrap.

`pull_bins` makes the same `Bins` of pairs sorted by the vehicle's pull.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terragrip.arrays import Bools, Floats
from terragrip.physics.adhesion import CURVES, PROTOTYPE

BY_SLIP, BY_PULL = "slip", "pull"


@dataclass(frozen=True)
class BinSettings:
    """How pairs become bins. Recorded in every result; slips are fractions.

    width, lower, upper: of the bins. by: "slip" sorts each pair by its own slip (the paper); "pull" by the slip at which the soil's mean
    curve gives the vehicle's pull (`pull_bins`). minimum: fewest samples of a bin by slip. metres, runs: shortest distance and
    fewest runs of a bin by pull; smaller bins are joined to the next. With 4 m, on ground that varies over about a metre, the
    standard error of a bin's mean is half of the SD within it or less.
    Raises ValueError where the range is empty, the width not positive, or a minimum below its own limit.
    """

    width: float = 0.01
    lower: float = 0.05
    upper: float = 0.60
    minimum: int = 10
    by: str = BY_SLIP
    metres: float = 4.0
    runs: int = 2

    def __post_init__(self) -> None:
        if self.by not in (BY_SLIP, BY_PULL):
            raise ValueError(f"pairs are sorted by 'slip' or by 'pull', not by {self.by!r}")
        if not (self.width > 0 and self.upper - self.lower >= self.width and self.minimum >= 1):
            raise ValueError(
                f"slip bins of {self.width:g} from {self.lower:g} to {self.upper:g} with at least {self.minimum} samples are no bins"
            )
        if not (self.metres > 0 and self.runs >= 1):
            raise ValueError(f"slip bins of at least {self.metres:g} m from {self.runs} runs are no bins")

    @property
    def least(self) -> float:
        """The smallest weight of a bin: samples by slip, metres by pull."""
        return self.metres if self.by == BY_PULL else float(self.minimum)

    @property
    def least_text(self) -> str:
        """`least` in words."""
        return f"{self.metres:g} m of way" if self.by == BY_PULL else f"{self.minimum} samples"

    @property
    def edges(self) -> Floats:
        """Edges of the bins, shape (bins + 1,)."""
        count = round((self.upper - self.lower) / self.width)
        return np.asarray(self.lower + self.width * np.arange(count + 1), dtype=float)

    def papers(self) -> BinSettings:
        """Of the paper's fit beside these bins: by slip, no narrower than the paper's, and from no lower, since noise sorts there; as they
        are where that leaves none."""
        if self.by == BY_SLIP:
            return self
        lower, width = max(self.lower, PAPER.lower), max(self.width, PAPER.width)
        if self.upper - lower < width:
            lower, width = self.lower, self.width
        return replace(self, by=BY_SLIP, lower=lower, width=width)

    def to_dict(self) -> dict[str, float | str]:
        """The settings as plain numbers and words."""
        return asdict(self)


PAPER = BinSettings()
PULL = BinSettings(by=BY_PULL, width=0.005, lower=0.005)
"""By pull noise of slip sorts nothing, so the low slips count too: most machines work below 10 % of slip."""
PAPER_BINS: Mapping[str, BinSettings] = {"grass": BinSettings(upper=0.40)}
"""The paper's exception: on grass only slips up to 40 % (its section on soil characteristics)."""


def chosen_bins(
    by: str, width: float | None = None, lower: float | None = None, upper: float = PAPER.upper, **other: Any
) -> BinSettings:
    """Settings by pull or by slip; width and lowest slip are the usual ones of that way where None. ValueError as `BinSettings`."""
    usual = PULL if by == BY_PULL else PAPER
    return BinSettings(
        usual.width if width is None else width,
        usual.lower if lower is None else lower,
        upper,
        by=by,
        **other,
    )


@dataclass(frozen=True)
class Bins:
    """Pairs sorted into slip bins. Arrays have shape (bins,); the `cluster_` arrays (clusters, bins).

    A cluster is a set of samples that are not independent of each other: a run, or a stretch of one.
    By slip: bins with too few samples are NaN in slip, mean and std; `cluster_count` gives samples, `cluster_slip` sums of slip.
    By pull: every bin is used; `cluster_count` gives metres, `cluster_slip` sums of slip on `pull_bins`' scale, and `reference` is the
    scale a of the curve that sorted the pulls.
    """

    settings: BinSettings
    slip: Floats
    mean: Floats
    std: Floats
    count: NDArray[np.int64]
    cluster_count: Floats = field(repr=False)
    cluster_sum: Floats = field(repr=False)
    cluster_slip: Floats = field(repr=False)
    left_out: int = 0
    reference: float | None = None

    @property
    def used(self) -> Bools:
        """The bins with enough data."""
        return np.asarray(np.isfinite(self.mean))

    @property
    def weight(self) -> Floats:
        """Samples (by slip) or metres (by pull) of each bin."""
        return np.asarray(self.cluster_count.sum(axis=0))

    def drawn(self, times: Floats, least: float | None = None) -> tuple[Floats, Floats, Bools]:
        """Slip, mean and enough, each (draws, bins), with every cluster counted `times` (draws, clusters).

        `enough`: the bin is used and the draw has `least` of it (default: the settings'); elsewhere slip and mean are meaningless.
        """
        n = times @ self.cluster_count
        enough = self.used & (n >= (self.settings.least if least is None else least))
        safe = np.where(enough, n, 1.0)
        slip = times @ self.cluster_slip / safe
        return slip_of(slip) if self.settings.by == BY_PULL else slip, times @ self.cluster_sum / safe, enough

    @property
    def clusters(self) -> int:
        """The number of clusters with samples in the bins."""
        return int(np.count_nonzero(self.cluster_count.sum(axis=1)))

    def to_list(self) -> list[dict[str, float]]:
        """The used bins in the form of soils.json."""
        columns = {"slip": self.slip, "mean": self.mean, "std": self.std, "count": self.count}
        if self.settings.by == BY_PULL:
            columns["metres"] = self.weight
        return [
            {name: values[i].item() for name, values in columns.items()} for i in np.flatnonzero(self.used)
        ]


def height_of(slip: ArrayLike) -> Floats:
    """The prototype curve of scale 1 at slips of any shape: the scale that slips are averaged on by pull."""
    return CURVES["exponential"].value(slip, {**PROTOTYPE, "a": 1.0})


_SLIPS = np.linspace(0.0, 0.6, 6001)
_HEIGHTS = height_of(_SLIPS)


def slip_of(height: ArrayLike) -> Floats:
    """The slip at which the prototype curve of scale 1 has `height` (any shape), odd; heights above its maximum give 0.6."""
    h = np.asarray(height, dtype=float)
    return np.asarray(np.sign(h) * np.interp(np.abs(h), _HEIGHTS, _SLIPS))


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

    def sums(values: Floats | None) -> Floats:
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

"""Fits of adhesion-slip curves to bins, with intervals from a bootstrap over runs, in scikit-learn's manner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES, CurveModel, effective_parameters
from terragrip.soil.bins import Bins, BinSettings, bin_pairs
from terragrip.soil.forms import Forms, agreeing_forms
from terragrip.soil.identifiability import Identifiability, at_bound, judge, left_open
from terragrip.soil.least_squares import INTERCEPT, solve, starts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from terragrip.soil.library import Soil, SoilLibrary

FREE = "free"
_LARGEST = 1.5
"""Slip above which most rows of a drive never are, as a ratio; in per cent nearly all are."""
BAND = np.round(np.linspace(0.0, 1.0, 101), 3)
"""Slips that a band is written at."""


def _refuse_percent(slip: ArrayLike) -> None:
    """Raise InputError where slips are no ratios: of most rows of a drive none is above 1."""
    known = np.abs(np.asarray(slip, dtype=float))
    known = known[np.isfinite(known)]
    if known.size and (usual := float(np.median(known))) > _LARGEST:
        raise InputError(
            f"a slip of {usual:.3g} is {usual:.0%}", hint="slip is a ratio: divide per cents by 100"
        )


class AdhesionCurve:
    """One adhesion-slip curve, fitted to bin means (paper, section on soil characteristics).

    Parameters
    ----------
    model : a name of `terragrip.physics.adhesion.CURVES`; "exponential" is the paper's eq. 8.
    fixed : parameters kept at a value, e.g. {"p": .52}; None = the model's own choice (the paper's prototype shape), "free" = fix none.
    bounds : (lower, upper) of free parameters, within the model's own; parameters not named keep the model's.
    intercept : also fit a constant, for a sensor that measures net traction (kappa = mu - rho).
    weights : None (the paper: all bins have the same weight) or "count" (by the samples' standard error of the mean).
    bins : BinSettings.
    bootstrap : repetitions for the 95 % intervals, 0 = none. Runs are drawn, not samples: samples of one run are not independent.
    seed : of the bootstrap.
    common_sd : relative SD of an error of adhesion that all runs share (the machine's torque scale). Drawing runs does not show it, so it
        widens the intervals.
    common_slip_sd : SD of an error of slip that all pairs share (zero slip), likewise.
    start : values of free parameters that the fit begins at, in place of the several starts that it tries itself; it then ends in the
        minimum nearest to them, which may be another.

    After `fit`: `parameters_` (all of the model's, and intercept), `free_`, `interval_` {name: (low, high)}, `r2_`, `nrmse_`, `bins_`,
    `identifiability_`, `at_bound_` (free parameters that stopped at a bound: the bound gave the value, not the data, so the
    curve is not identifiable), `notes_` (plain sentences). Where the data do not determine the four parameters of eq. 8 one by one,
    `interval_` has the effective A, k, d instead (physics.md 5).
    """

    def __init__(
        self,
        model: str = "exponential",
        fixed: Mapping[str, float] | str | None = None,
        intercept: bool = False,
        weights: str | None = None,
        bins: BinSettings | None = None,
        bootstrap: int = 1000,
        seed: int = 0,
        common_sd: float = 0.0,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        common_slip_sd: float = 0.0,
        start: Mapping[str, float] | None = None,
    ) -> None:
        if model not in CURVES:
            raise InputError(f"no curve model {model!r}", hint=f"choose one of {', '.join(CURVES)}")
        if weights not in (None, "count"):
            raise InputError(f"no weighting {weights!r}", hint="use None or 'count'")
        self.model, self.fixed, self.intercept, self.weights = model, fixed, intercept, weights
        self.bins, self.bootstrap, self.seed = bins or BinSettings(), bootstrap, seed
        self.common_sd, self.bounds, self.common_slip_sd = common_sd, dict(bounds or {}), common_slip_sd
        self.start = None if start is None else dict(start)
        self.stored: Soil | None = None  # of a fit that was read

    def fit(self, slip: ArrayLike, adhesion: ArrayLike, run: ArrayLike | None = None) -> AdhesionCurve:
        """Fit to pairs, each of shape (n,); `run` (n,) are integer or string labels of samples that are not independent.

        Pairs are sorted by slip; where the settings are by pull, into the paper's bins beside them (`BinSettings.papers`). By pull needs
        the pull: `pull_bins.bin_by_pull` and `fit_bins`.
        Raises InputError where the data have fewer used bins than free parameters, or only one, and on bounds that the model does not have.
        """
        _refuse_percent(slip)
        named = np.ravel(np.asarray(run))
        named = named.astype(str) if named.dtype.kind == "O" else named  # None among names is one too
        labels = None if run is None else np.unique(named, return_inverse=True)[1]
        return self.fit_bins(bin_pairs(slip, adhesion, labels, self.bins.papers()))

    def fit_bins(self, bins: Bins) -> AdhesionCurve:
        """Fit to existing bins. Raises as `fit`."""
        curve = self._bounded(CURVES[self.model])
        held = self._held(curve)
        free = [name for name in curve.names if name not in held] + ([INTERCEPT] if self.intercept else [])
        used = bins.used
        need = max(len(free), 2)
        if np.count_nonzero(used) < need:
            raise InputError(
                f"{np.count_nonzero(used)} slip bins between {bins.settings.lower:.0%} and {bins.settings.upper:.0%} hold "
                f"{bins.settings.least_text} or more, too few to fit {', '.join(free) or 'or judge a curve'}",
                hint="drive at more slips, or widen the bins",
            )
        slip, mean = bins.slip[used], bins.mean[used]
        weights = self._bin_weights(bins)[used]
        best = np.empty(0)
        if free:
            begin = starts(curve, free, mean) if self.start is None else self._start(curve, free)
            many = np.ones((len(begin), 1))
            x, cost = solve(curve, free, held, many * slip, many * mean, many * weights, begin)
            best = x[int(np.argmin(cost))]
        self.free_ = tuple(free)
        self.parameters_: dict[str, Any] = {**held, **dict(zip(free, best.tolist(), strict=True))}
        self.bins_ = bins
        residual = mean - self.predict(slip)
        spread = mean - mean.mean()
        self.r2_ = float(1 - residual @ residual / max(float(spread @ spread), 1e-300))
        self.nrmse_ = float(np.sqrt(np.mean(residual**2)) / max(float(np.ptp(mean)), 1e-300))
        self.identifiability_: Identifiability = judge(curve, self._of_model(), free, slip, self.r2_)
        self.at_bound_ = at_bound(curve, self.parameters_, free)
        self.notes_: list[str] = (
            [] if self.identifiability_.identifiable else [self.identifiability_.sentence]
        )
        self.samples_: Floats | None = None
        self._bin_sd: Floats | None = None  # of the used bins' means, over the bootstrap's draws
        self._forms: Forms | None = None
        self.interval_: dict[str, tuple[float, float]] = {}
        if self.bootstrap and free:
            self._resample(curve, free, held, best)
        for name in free:
            if name in self.interval_ and name != INTERCEPT:
                self.doubt(left_open(name, self.parameters_[name], self.interval_[name]))
        return self

    def doubt(self, sentence: str) -> None:
        """Take the badge from the fit for this reason, and note it; not where it is empty, or another took the badge before."""
        if sentence and self.identifiability_.identifiable:
            self.identifiability_ = self.identifiability_.denied(sentence)
            self.notes_.append(sentence)

    def predict(self, slip: ArrayLike) -> Floats:
        """mu (or kappa, with an intercept) at the slips, same shape. Raises InputError where they are per cents, or before `fit`."""
        _refuse_percent(slip)
        self._refuse_unfitted()
        return CURVES[self.model].value(slip, self._of_model(), self.parameters_.get(INTERCEPT, 0.0))

    @property
    def has_band(self) -> bool:
        """Whether `band` is known: from the bootstrap; for a stored fit as `Soil.has_band`."""
        return self.samples_ is not None or (self.stored is not None and self.stored.has_band)

    def band(self, slip: ArrayLike, level: float = 0.95) -> tuple[Floats, Floats]:
        """Pointwise interval of the soil's curve at slips of any shape: of this form by the bootstrap, and of every other form that
        agrees with the same bins (`soil.forms`), so that beyond the bins it is as wide as soils differ. For a stored fit it is the 95 %
        band of `Soil.band`. Raises ValueError if none is known, InputError before `fit`."""
        self._refuse_unfitted()
        if not self.has_band:
            raise ValueError("this curve was fitted without a bootstrap")
        slips = np.asarray(slip, dtype=float)
        if self.samples_ is None and self.stored is not None:
            return self.stored.band(slips)
        s = slips.ravel()
        assert self.samples_ is not None
        given = {name: self.samples_[:, i, None] for i, name in enumerate(self.free_)}
        intercept = given.pop(INTERCEPT, self.parameters_.get(INTERCEPT, 0.0))
        held = {n: v for n, v in self.parameters_.items() if n not in self.free_ and n != INTERCEPT}
        tail = 50 * (1 - level)
        own, other = (
            np.percentile(values, [tail, 100 - tail], axis=0)
            for values in (
                CURVES[self.model].value(s[None, :], {**held, **given}, intercept),
                self._other_forms().value(s) + self.parameters_.get(INTERCEPT, 0.0),
            )
        )
        low, high = np.minimum(own[0], other[0]), np.maximum(own[1], other[1])
        return low.reshape(slips.shape), high.reshape(slips.shape)

    def _other_forms(self) -> Forms:
        """Curves of all forms that agree with the bins, one for each of the bootstrap's; drawn when they are first asked for."""
        if self._forms is None and self.samples_ is not None and self._bin_sd is not None:
            bins, drop = self.bins_, self.parameters_.get(INTERCEPT, 0.0)
            used = bins.used
            self._forms = agreeing_forms(
                bins.slip[used], bins.mean[used] - drop, self._bin_sd, self.common_slip_sd, self.common_sd,
                len(self.samples_), self.seed,
            )  # fmt: skip
        assert self._forms is not None
        return self._forms

    def peak(self) -> tuple[float, float]:
        """(slip, mu) of the maximum on 0 to 1, without the intercept. Raises InputError before `fit`."""
        self._refuse_unfitted()
        return CURVES[self.model].peak(self._of_model())

    def plot(self) -> Figure:
        """The fitted curve with its bins, as a matplotlib figure; raises InputError before `fit`, or without matplotlib."""
        return self._library().plot()

    def __repr__(self) -> str:
        fitted = [f"{name}={value:.4g}" for name, value in getattr(self, "parameters_", {}).items()]
        return f"<AdhesionCurve {self.model}: {', '.join(fitted) or 'not fitted'}>"

    def _repr_html_(self) -> str:
        return self._library()._repr_html_() if hasattr(self, "bins_") else f"<p>{self.model}, not fitted</p>"

    def _library(self) -> SoilLibrary:
        """The curve as the one soil of a library."""
        from terragrip.soil.library import Soil, SoilLibrary

        return SoilLibrary({"curve": Soil.from_curve("curve", self)})

    def to_dict(self) -> dict[str, Any]:
        """The fit in the form of soils.json (architecture.md, contracts). Raises InputError before `fit`."""
        self._refuse_unfitted()
        band = {}
        if self.samples_ is not None:
            low, high = self.band(BAND)
            band = {
                "band": {"slip": BAND.tolist(), "low": low.round(5).tolist(), "high": high.round(5).tolist()}
            }
        return {
            "model": self.model,
            "parameters": {k: float(v) for k, v in self.parameters_.items()},
            "free": list(self.free_),
            "interval": {k: [float(a), float(b)] for k, (a, b) in self.interval_.items()},
            "r2": self.r2_,
            "nrmse": self.nrmse_,
            "bins": self.bins_.to_list(),
            "settings": self.bins_.settings.to_dict(),
            "clusters": self.bins_.clusters,
            "identifiability": self.identifiability_.to_dict(),
            "notes": list(self.notes_),
            **({"common_slip_sd": self.common_slip_sd} if self.interval_ else {}),
            **band,
        }

    def _refuse_unfitted(self) -> None:
        if not hasattr(self, "parameters_"):
            raise InputError("the curve is not fitted", hint="call fit first")

    def _of_model(self) -> dict[str, float]:
        return {name: value for name, value in self.parameters_.items() if name != INTERCEPT}

    def _held(self, curve: CurveModel) -> dict[str, float]:
        if self.fixed is None:
            return {p.name: p.start for p in curve.parameters if p.name in curve.fixed}
        if isinstance(self.fixed, str):
            if self.fixed != FREE:
                raise InputError(
                    f"fixed={self.fixed!r} is not a choice",
                    hint="give a mapping of names to numbers, or 'free'",
                )
            return {}
        try:
            curve.complete(self.fixed)
        except ValueError as error:
            raise InputError(str(error)) from None
        return {name: float(value) for name, value in self.fixed.items()}

    def _bounded(self, curve: CurveModel) -> CurveModel:
        """The model with this fit's bounds in place of its own."""
        own = {p.name: p for p in curve.parameters}
        for name, (lower, upper) in self.bounds.items():
            if name not in own:
                raise InputError(
                    f"bounds of {name!r}, which the curve model {curve.name} does not have",
                    hint=f"it has {', '.join(own)}",
                )
            if not own[name].lower <= lower < upper <= own[name].upper:
                raise InputError(
                    f"the bounds of {name} are {lower:g} and {upper:g}",
                    hint=f"give a lower and a larger upper one from {own[name].lower:g} to {own[name].upper:g}",
                )
            own[name] = replace(own[name], lower=float(lower), upper=float(upper))
        return replace(curve, parameters=tuple(own.values()))

    def _start(self, curve: CurveModel, free: Sequence[str]) -> Floats:
        """The given start as the one row of (starts, free); what it does not name begins at the model's own start."""
        own = {p.name: p.start for p in curve.parameters} | {INTERCEPT: 0.0}
        given = self.start or {}
        if unknown := sorted(set(given) - set(own)):
            raise InputError(
                f"a start of {unknown[0]!r}", hint=f"the curve model has {', '.join(curve.names)}"
            )
        return np.array([[given.get(name, own[name]) for name in free]], dtype=float)

    def _bin_weights(self, bins: Bins) -> Floats:
        if self.weights is None:
            return bins.used.astype(float)
        with np.errstate(invalid="ignore", divide="ignore"):
            weight = bins.weight / np.maximum(bins.std, 1e-3) ** 2
        return np.where(bins.used, weight / np.nanmax(np.where(bins.used, weight, np.nan)), 0.0)

    def _resample(
        self, curve: CurveModel, free: Sequence[str], held: Mapping[str, float], best: Floats
    ) -> None:
        """Intervals from drawing clusters with replacement, widened by t and n/(n-1) for few clusters."""
        bins = self.bins_
        alive = bins.cluster_count.sum(axis=1) > 0
        clusters = int(np.count_nonzero(alive))
        if clusters < 3:
            ending = ("", "") if clusters == 1 else ("s", "es")
            self.notes_.append(
                f"All samples come from {clusters} run{ending[0]} or stretch{ending[1]} of a run: no interval can be determined; "
                "give the runs, or drive more of them."
            )
            return
        rng = np.random.default_rng(self.seed)
        draws = rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=self.bootstrap).astype(float)
        times = np.zeros((self.bootstrap, alive.size))
        times[:, alive] = draws
        slip, mean, used = bins.drawn(times)
        enough = np.count_nonzero(used, axis=1) >= max(len(free), 2)
        self._bin_sd = _sd_of_bins(mean, used)[bins.used] * np.sqrt(clusters / (clusters - 1))
        slip, mean, weight = slip[enough], mean[enough], (self._bin_weights(bins) * used)[enough]
        widen = _student(clusters - 1) / 1.959964 * np.sqrt(clusters / (clusters - 1))
        shared = rng.standard_normal((2, len(mean), 1)) / widen  # errors that few runs do not make less known
        slip, mean = slip + self.common_slip_sd * shared[1], mean * (1 + self.common_sd * shared[0])
        begin = np.repeat(best[None, :], len(slip), axis=0)
        x, _ = solve(curve, free, held, slip, mean, weight, begin, iterations=25)
        ends = {p.name: (p.lower, p.upper) for p in curve.parameters}
        lower, upper = zip(*(ends.get(name, (-np.inf, np.inf)) for name in free), strict=True)
        self.samples_ = np.clip(best + (x - best) * widen, lower, upper)
        samples = self.samples_
        columns = {name: samples[:, i] for i, name in enumerate(free)}
        if not self.identifiability_.separable and self.model == "exponential":
            columns = effective_parameters({**held, **columns})
        self.interval_ = {
            name: (float(low), float(high))
            for name, (low, high) in ((k, np.percentile(v, [2.5, 97.5])) for k, v in columns.items())
        }

    def unfitted(self, **changes: Any) -> AdhesionCurve:
        """The same curve, unfitted; `changes` are arguments of the constructor."""
        same = {name: getattr(self, name) for name in signature(AdhesionCurve).parameters}
        return AdhesionCurve(**{**same, **changes})


def _sd_of_bins(mean: Floats, used: Bools) -> Floats:
    """SD of each bin's mean (bins,) over draws (draws, bins), and not under that of all: few clusters tell a bin's own badly."""
    count = np.maximum(used.sum(axis=0), 1)
    centre = np.where(used, mean, 0.0).sum(axis=0) / count
    square = np.where(used, (mean - centre) ** 2, 0.0)
    return np.asarray(np.sqrt(np.maximum(square.sum(axis=0) / count, square.sum() / max(used.sum(), 1))))


def _student(freedom: int) -> float:
    """97.5 % point of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))


def explaining(curve: AdhesionCurve) -> AdhesionCurve:
    """The fitted curve. Raises InputError where it explains nothing of its bins (R2 of 0 or less)."""
    if curve.r2_ <= 0:
        raise InputError(
            f"the {curve.model} curve does not explain its {np.count_nonzero(curve.bins_.used)} bins (R2 {curve.r2_:.2f}): "
            "slip may have been too small beside its noise",
            hint="drive at more slip",
        )
    return curve

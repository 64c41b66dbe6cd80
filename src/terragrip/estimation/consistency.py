"""How well estimates agree with observations, and whether a filter's intervals are right.

Pure functions of arrays. A row counts only where every array of the call is finite; no such row at all is an
:class:`~terragrip.errors.InputError`, never a silent NaN.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError

NORMAL_95 = 1.959963984540054
"""Half of a normal distribution's central 95 % interval, in standard deviations."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of predictions with observations over `count` rows (physics.md 5)."""

    count: int
    r2: float
    nrmse: float
    rmse: float
    bias: float

    def to_dict(self) -> dict[str, float]:
        """Plain numbers, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class NisConsistency:
    """Normalised innovation squared against its chi-square law.

    `ratio` is sum(NIS) / sum(channels): 1 for a filter whose noise settings are right, above 1 where
    intervals are too narrow. `within` is the share of rows inside the two-sided interval of `probability`.
    """

    count: int
    ratio: float
    within: float
    probability: float


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of a residual: `autocorrelation[k - 1]` at lag k, the Ljung-Box statistic, its p-value.

    `bound` is the 95 % bound of one autocorrelation of white noise, 1.96 / sqrt(count).
    """

    count: int
    autocorrelation: Floats
    bound: float
    statistic: float
    p_value: float


def agreement(observed: ArrayLike, predicted: ArrayLike, mask: ArrayLike | None = None) -> Agreement:
    """R², NRMSE, RMSE and bias of `predicted` against `observed`, both (n,), in the rows of `mask`.

    R² = 1 - SSE/SST; NRMSE = RMSE / (max - min of the observations); bias = mean(predicted - observed)
    (physics.md 5; paper, section 3). Raises InputError when fewer than two rows are finite or the
    observations do not vary, since then neither figure exists.
    """
    actual, estimated = _finite_rows((observed, predicted), mask, least=2)
    error = estimated - actual
    spread = float(np.ptp(actual))
    if spread == 0.0:
        raise InputError("the observations do not vary, so R² and NRMSE do not exist")
    rmse = float(np.sqrt(np.mean(error**2)))
    r2 = 1.0 - float(np.sum(error**2) / np.sum((actual - actual.mean()) ** 2))
    return Agreement(len(actual), r2, rmse / spread, rmse, float(error.mean()))


def mean_absolute_error(truth: ArrayLike, estimate: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Mean |estimate - truth| over the finite rows of `mask`. Raises InputError when there is none."""
    true, estimated = _finite_rows((truth, estimate), mask, least=1)
    return float(np.mean(np.abs(estimated - true)))


def coverage(
    truth: ArrayLike,
    estimate: ArrayLike,
    std: ArrayLike,
    probability: float = 0.95,
    mask: ArrayLike | None = None,
) -> float:
    """Share of rows whose truth lies in the central normal interval of `probability`, (n,) each.

    The interval is estimate ± z std. Intervals that are right give `probability` back, up to the luck of the few
    constants (gains, offsets) that one run draws. Raises InputError when no row is finite or the
    probability is not inside (0, 1).
    """
    from scipy.special import ndtri

    if not 0.0 < probability < 1.0:
        raise InputError(f"an interval's probability must lie inside 0..1, not {probability}")
    true, estimated, sd = _finite_rows((truth, estimate, std), mask, least=1)
    half = float(ndtri(0.5 + probability / 2.0)) * sd
    return float(np.mean(np.abs(estimated - true) <= half))


def nis_consistency(
    nis: ArrayLike, channels: ArrayLike, probability: float = 0.95, mask: ArrayLike | None = None
) -> NisConsistency:
    """Compare `nis` (n,) with chi-square of `channels` (n,) degrees of freedom.

    Rows without a channel are left out. Raises InputError when no row used a channel.
    """
    from scipy.special import chdtri  # scipy.stats takes half a second to load

    values, degrees = _finite_rows((nis, channels), mask, least=1)
    values, degrees = values[degrees > 0], degrees[degrees > 0]
    if not len(values):
        raise InputError("no row used a measurement, so there is no NIS to judge")
    tail = (1.0 - probability) / 2.0
    low, high = chdtri(degrees, 1.0 - tail), chdtri(degrees, tail)
    within = float(np.mean((values >= low) & (values <= high)))
    return NisConsistency(len(values), float(values.sum() / degrees.sum()), within, probability)


def whiteness(residual: ArrayLike, lags: int = 20) -> Whiteness:
    """Autocorrelation of an evenly sampled `residual` (n,) at 1..lags, and the Ljung-Box test.

    Source: Ljung and Box, Biometrika 65, 1978. A small p-value says that the residual is not white.
    Non-finite rows are dropped, which shifts lags across them: cut the residual at gaps first. Raises
    InputError with fewer than lags + 2 rows or a residual that does not vary.
    """
    from scipy.special import chdtrc

    (values,) = _finite_rows((residual,), None, least=lags + 2)
    centred = values - values.mean()
    power = float(centred @ centred)
    if power == 0.0:
        raise InputError("the residual does not vary, so it has no autocorrelation")
    count = len(centred)
    correlation = np.array([centred[lag:] @ centred[:-lag] / power for lag in range(1, lags + 1)])
    weights = count - np.arange(1, lags + 1)
    statistic = float(count * (count + 2) * np.sum(correlation**2 / weights))
    return Whiteness(count, correlation, 1.96 / np.sqrt(count), statistic, float(chdtrc(lags, statistic)))


def _finite_rows(arrays: tuple[ArrayLike, ...], mask: ArrayLike | None, least: int) -> list[Floats]:
    """The rows where every array is finite (and `mask` holds), as float arrays of one length."""
    columns = [np.asarray(array, dtype=np.float64) for array in arrays]
    if len({column.shape for column in columns}) != 1 or columns[0].ndim != 1:
        raise InputError(f"arrays of one length are needed, not {[column.shape for column in columns]}")
    rows: Bools = np.logical_and.reduce([np.isfinite(column) for column in columns])
    if mask is not None:
        rows &= np.asarray(mask, dtype=np.bool_)
    if int(rows.sum()) < least:
        raise InputError(f"only {int(rows.sum())} rows have numbers in every column; {least} are needed")
    return [column[rows] for column in columns]

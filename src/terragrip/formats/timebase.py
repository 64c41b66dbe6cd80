"""One time base for channels that were stamped late or at other instants."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_SAME = 1e-3  # share of the spacing within which two stamps are one instant


def union(time: Floats, delays: dict[str, float]) -> tuple[Floats, dict[float, npt.NDArray[np.intp]]]:
    """The union of the instants of channels stamped ``delays`` [s] late on ``time`` (n,), and where each stands.

    Returns the instants (m,) and, for each delay, the row (n,) that each of its samples takes. Stamps closer than
    a thousandth of the spacing become one instant, so that rounding makes no rows of its own.
    """
    late = sorted(set(delays.values()))
    if late in ([], [0.0]):
        return time, {delay: np.arange(len(time)) for delay in late}
    tolerance = _SAME * float(np.min(np.diff(time))) if len(time) > 1 else 0.0
    stamps = np.concatenate([time - delay for delay in late])
    order = np.argsort(stamps, kind="stable")
    apart = np.diff(stamps[order]) > tolerance
    group = np.r_[0, np.cumsum(apart)]
    row = np.empty(len(stamps), dtype=np.intp)
    row[order] = group
    instants = stamps[order][np.r_[True, apart]]
    return instants, {delay: row[k * len(time) : (k + 1) * len(time)] for k, delay in enumerate(late)}


def spread(
    values: npt.NDArray[np.generic], rows: npt.NDArray[np.intp], length: int
) -> npt.NDArray[np.generic]:
    """A channel (n,) on the union's instants (length,): NaN, or an empty text, where it was not measured."""
    if len(values) == length and np.array_equal(rows, np.arange(length)):
        return values
    empty = "" if values.dtype.kind == "O" else np.nan
    result = np.full(length, empty, dtype=values.dtype)
    result[rows] = values
    return result

"""A drive cut into pieces of half a minute on one label: what its tables by label, by slip band and by hour are counted from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.report.runs import Run

LENGTH = 30.0
"""Seconds of a piece: longer than an implement, a bump or the filter's memory have an effect, so that pieces count as independent."""
FEWEST = 4.0
"""Pieces (as many of equal length) below which their scatter gives no interval."""
UNSURE = 0.15
"""SD above which a row is no information on slip."""
BANDS = (-np.inf, 0.0, 0.05, 0.10, 0.15, 0.20, 0.30, np.inf)
"""Edges of the slip bands."""
BAND_NAMES = ("under 0", "0 to 5 %", "5 to 10 %", "10 to 15 %", "15 to 20 %", "20 to 30 %", "over 30 %")


@dataclass(frozen=True)
class Blocks:
    """Pieces of one run, (n,) each: label, start [s], time [s] and way [m], means of slip, adhesion and soil resistance over the wheels
    and the rows that know them (NaN where none does), and `bands` (n, len(BAND_NAMES)) [s].

    `began`: clock time of the run's time 0. `slip_sd`, `adhesion_sd` (relative): errors that all its pieces share.
    """

    run: str
    label: NDArray[np.object_]
    start: Floats
    seconds: Floats
    metres: Floats
    slip: Floats
    adhesion: Floats
    resistance: Floats
    bands: Floats
    began: datetime | None
    slip_sd: float
    adhesion_sd: float


@dataclass(frozen=True)
class Share:
    """Totals and means of the pieces of one label (or hour): time [s], way [m], mean and 95 % half width of slip and adhesion, mean
    resistance, seconds by slip band."""

    label: str
    seconds: float
    metres: float
    slip: tuple[float, float]
    adhesion: tuple[float, float]
    resistance: float
    bands: Floats


def blocks_of(run: Run, labels: NDArray[np.object_] | None = None) -> Blocks:
    """The pieces of a run; `labels` (n,) are the soils of its rows unless they are given."""
    names = run.soil if labels is None else labels
    time = run.time
    step = _steps(time)
    change = np.ones(len(time), dtype=bool)
    change[1:] = (names[1:] != names[:-1]) | (np.diff(time // LENGTH) != 0)
    piece = np.cumsum(change) - 1
    count = int(piece[-1]) + 1 if len(piece) else 0

    def total(values: Floats) -> Floats:
        return np.asarray(np.bincount(piece, weights=values, minlength=count), dtype=np.float64)

    def mean(values: Floats) -> Floats:
        known = np.isfinite(values)
        with np.errstate(invalid="ignore", divide="ignore"):
            return total(np.where(known, values, 0.0) * step) / total(known * step)

    slip, adhesion = wheel_mean(run, "slip"), wheel_mean(run, "adhesion")
    resistance = run.estimated("soil_resistance") if "soil_resistance" in run.estimates else None
    way = run.estimated("distance") if "distance" in run.estimates else np.zeros(len(time))
    moved = np.nan_to_num(np.diff(way, prepend=way[:1]))
    known = np.isfinite(slip)
    band = np.clip(
        np.searchsorted(BANDS, np.where(known, slip, 0.0), side="right") - 1, 0, len(BAND_NAMES) - 1
    )
    bands = np.stack(
        [total(np.where(known & (band == i), step, 0.0)) for i in range(len(BAND_NAMES))], axis=1
    )
    first = np.flatnonzero(change)
    return Blocks(
        run.name, names[first], time[first], total(step), total(np.abs(moved)), mean(slip),
        mean(adhesion), mean(np.full(len(time), np.nan) if resistance is None else np.where(known, resistance, np.nan)),
        bands, run.began, _slip_sd(run), _adhesion_sd(run),
    )  # fmt: skip


def shares(every: Sequence[Blocks], order: Sequence[str] | None = None) -> list[Share]:
    """Totals and means of the pieces of all runs by label, in `order`, else the longest first, without those that have no label."""
    labels = {str(name) for one in every for name in one.label if name}
    result = [share_of(label, [(one, one.label == label) for one in every]) for label in labels]
    if order is not None:
        return sorted(result, key=lambda one: order.index(one.label))
    return sorted(result, key=lambda one: (-one.seconds, one.label))


def share_of(label: str, chosen: Sequence[tuple[Blocks, NDArray[np.bool_]]]) -> Share:
    """Totals and means of the chosen pieces."""

    def joined(name: str) -> Floats:
        return np.concatenate([getattr(one, name)[rows] for one, rows in chosen])

    seconds = joined("seconds")
    common = [
        max((getattr(one, name) for one, rows in chosen if rows.any()), default=0.0)
        for name in ("slip_sd", "adhesion_sd")
    ]
    bands = joined("bands")
    known = bands.sum(axis=1)  # a piece of which one second is known has the weight of one second
    slip, half = _mean(joined("slip"), known)
    adhesion, wide = _mean(joined("adhesion"), known)
    resistance, _ = _mean(joined("resistance"), known)
    return Share(
        label, float(seconds.sum()), float(joined("metres").sum()),
        (slip, float(np.hypot(half, 1.96 * common[0]))), (adhesion, float(np.hypot(wide, 1.96 * common[1] * abs(adhesion)))),
        resistance, bands.sum(axis=0),
    )  # fmt: skip


def wheel_mean(run: Run, quantity: str) -> Floats:
    """The mean of a quantity over the driven wheels of a run (n,), without stuck rows and those of a large SD of slip; NaN without any."""
    columns = [f"{quantity}_{wheel}" for wheel in run.driven_wheels if f"{quantity}_{wheel}" in run.estimates]
    if not columns:
        return np.full(len(run.time), np.nan)
    values = np.stack([run.estimated(name) for name in columns])
    sure = np.stack(
        [run.estimated(f"slip_{wheel}_std") < UNSURE for wheel in run.driven_wheels[: len(columns)]]
    )
    known = np.isfinite(values) & sure & ~run.stuck
    count = known.sum(axis=0)
    return np.where(count > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)


def _steps(time: Floats) -> Floats:
    """Seconds that each row stands for (n,): none across a hole in the log."""
    if len(time) < 2:
        return np.zeros(len(time))
    step = np.diff(time)
    usual = float(np.median(step))
    step = np.where(step > max(1.0, 10 * usual), usual, step)
    return np.append(step, usual)


def _mean(values: Floats, weights: Floats) -> tuple[float, float]:
    """Weighted mean of pieces, and its 95 % half width by their scatter (Student's t); NaN where they are fewer than FEWEST."""
    known = np.isfinite(values) & (weights > 0)
    if not known.any():
        return float("nan"), float("nan")
    share = weights[known] / weights[known].sum()
    mean = float(share @ values[known])
    size = 1.0 / float(share @ share)
    if size < FEWEST:
        return mean, float("nan")
    from scipy.special import stdtrit

    variance = float(share @ (values[known] - mean) ** 2) * size / (size - 1)
    return mean, float(stdtrit(size - 1, 0.975) * np.sqrt(variance / size))


def _slip_sd(run: Run) -> float:
    """SD of the zero of slip, which no averaging removes: of the log's own zero, else of the vehicle's radius."""
    zero: dict[str, Any] = run.estimates.attrs.get("zero_slip") or {}
    if zero:
        return float(max(one["std"] for one in zero.values()))
    return float(run.vehicle.uncertainty.wheel_radius or 0.0) if run.vehicle is not None else 0.0


def _adhesion_sd(run: Run) -> float:
    """Relative SD of adhesion by the torque's scale, which no averaging removes."""
    if run.vehicle is None or not run.has_adhesion:
        return 0.0
    from terragrip.soil.estimates import torque_scale_sd

    return torque_scale_sd(run.vehicle)

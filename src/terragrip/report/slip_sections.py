"""Sections of a drive of which slip alone is known: over time, how often which, and where."""

from __future__ import annotations

from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.estimation.rims import DRIVE, calibrated_scale
from terragrip.figures import INK, new_figure, styled
from terragrip.report.field_work import weighted_quantile
from terragrip.report.page import Picture, Section, Table, names, number
from terragrip.report.path import positions
from terragrip.report.runs import Run
from terragrip.report.style import ESTIMATED, name_axis, to_svg
from terragrip.report.timeline import Lane, timeline

_POINTS = 2000
"""Places that a map is drawn with."""
_EDGES = (-0.05, 0.0, 0.05, 0.10, 0.15, 0.20, 0.30, 0.50, 1.0)
_UNSURE = 0.15
"""SD above which a row is no information on slip."""


def of(run: Run) -> tuple[Section, ...]:
    """All sections of a run."""
    return over_time(run), histogram(run), place(run)


def over_time(run: Run) -> Section:
    """Slip of each wheel, and the speeds that it comes from."""
    lanes = [_lane(run, f"slip_{wheel}", f"slip s, {wheel} [%]") for wheel in run.wheels]
    lanes.append(_lane(run, "ground_speed", "ground speed [m/s]"))
    wheels = names(
        [f"wheel {wheel}" if wheel != DRIVE else "the driven wheels as one" for wheel in run.wheels]
    )
    picture = Picture(
        f"slip-{run.name}",
        timeline(run, lanes),
        f"Run {run.name}, from speeds alone: slip of {wheels}, and ground speed (bottom), over time with 95 % intervals. At "
        "standstill slip is undefined.",
        f"Slip and ground speed over time in {run.name}",
    )
    return Section(f"slip-{run.name}", f"Slip in {run.name}", zero_sentence(run), (picture,))


def zero_sentence(run: Run) -> tuple[str, ...]:
    """Where slip counts from, and what the log's own lightest stretches say beside it."""
    zero_slip = run.estimates.attrs.get("zero_slip") or {}
    vehicle = run.vehicle
    speed = (
        "rim speed by the vehicle file's radius"
        if vehicle and vehicle.knows_wheels
        else "speed that the machine reports"
    )
    ratios = [
        f"{one['ratio']:.3f} (SD {one['std']:.3f}) of the {speed}{f' ({wheel})' * (wheel != DRIVE)}"
        + (f"; {one['doubt']}" if one.get("doubt") else "")
        for wheel, one in zero_slip.items()
    ]
    beside = (
        f" Zero slip by the lightest stretches of this log: ground speed {'; '.join(ratios)}."
        if ratios
        else ""
    )
    if vehicle is not None and calibrated_scale(vehicle) is not None:
        return (f"Slip counts from the calibrated {'radius' if vehicle.knows_wheels else 'speed'}.{beside}",)
    if DRIVE in zero_slip:
        return (
            f"Slip counts from the log's own zero: calibrate on a pass without load to make it absolute.{beside}",
        )
    return (f"Slip counts from the radius of the vehicle file.{beside}",)


def histogram(run: Run) -> Section:
    """How much of the way was driven at which slip."""
    title = f"Distribution of slip in {run.name}"
    wheel = run.shown_wheel
    slip, way = _rows(run, wheel)
    if not len(slip) or way.sum() <= 0:
        return Section(
            f"slip-histogram-{run.name}",
            title,
            omitted="Left out: slip is not known on any stretch of the drive.",
        )
    figure = new_figure(height=3.2)
    with styled():
        plot = figure.subplots()
        low, high = np.percentile(slip, [0.3, 99.7])
        share, edges = np.histogram(
            slip, bins=60, range=(min(low, 0.0), max(high, 0.05)), weights=way / way.sum()
        )
        plot.stairs(100 * share, edges, fill=True, color=ESTIMATED, alpha=0.6, linewidth=0)
        plot.axvline(0.0, color=INK, linewidth=0.7)
        name_axis(plot.xaxis, f"slip s, {wheel} [%]")
        plot.set_ylabel("share of the distance [%]")
        drawn = to_svg(figure)
    median, ninety = weighted_quantile(slip, way, 0.5), weighted_quantile(slip, way, 0.9)
    picture = Picture(
        f"slip-histogram-{run.name}",
        drawn,
        f"Run {run.name}: share of the distance driven at each slip. Half of it was below {number(100 * median, 1)} %, nine tenths below "
        f"{number(100 * ninety, 1)} %.",
        f"Histogram of slip by way in {run.name}",
    )
    parts, _ = np.histogram(np.clip(slip, _EDGES[0], _EDGES[-1]), bins=_EDGES, weights=way)
    rows = tuple(
        (
            f"{number(100 * a, 0)} to {number(100 * b, 0)} %",
            number(metres, 0),
            f"{number(100 * metres / way.sum(), 1)} %",
        )
        for a, b, metres in zip(_EDGES, _EDGES[1:], parts, strict=False)
        if metres > 0
    )
    table = Table(
        "Distance by slip; values beyond either end are in the last bin there.",
        ("slip", "way [m]", "share"),
        rows,
    )
    return Section(f"slip-histogram-{run.name}", title, (), (picture, table))


def place(run: Run) -> Section:
    """Slip where it was driven, on a plane by metres east and north."""
    title = f"Slip by place in {run.name}"
    at = positions(run)
    if at is None:
        return Section(
            f"slip-map-{run.name}",
            title,
            omitted="Left out: the log has no positions (latitude and longitude).",
        )
    slip, std = run.estimated(f"slip_{run.shown_wheel}"), run.estimated(f"slip_{run.shown_wheel}_std")
    rows = np.flatnonzero(np.isfinite(slip) & (std < _UNSURE))
    rows = rows[:: max(1, len(rows) // _POINTS)]
    if not len(rows):
        return Section(
            f"slip-map-{run.name}", title, omitted="Left out: slip is not known on any stretch of the drive."
        )
    x, y = (values[rows] for values in at)
    figure = new_figure(height=5.0)
    with styled():
        from matplotlib import colormaps

        plot = figure.subplots()
        shown: Any = plot.scatter(
            x,
            y,
            c=100 * slip[rows],
            s=7,
            cmap=colormaps["cividis"].resampled(32),  # so few that the scale is drawn, not painted
            vmin=0.0,
            vmax=max(5.0, 100 * float(np.percentile(slip[rows], 99))),
        )
        plot.set_aspect("equal", adjustable="datalim")
        plot.set_xlabel("east [m]")
        plot.set_ylabel("north [m]")
        bar = figure.colorbar(shown, ax=plot)
        bar.set_label("slip [%]")
        drawn = to_svg(figure)
    picture = Picture(
        f"slip-map-{run.name}",
        drawn,
        f"Run {run.name}: slip where it was driven, in metres from the first position. Rows whose slip is known to worse than "
        f"{_UNSURE:g} are left out.",
        f"Map of slip in {run.name}",
    )
    return Section(f"slip-map-{run.name}", title, (), (picture,))


def _rows(run: Run, wheel: str) -> tuple[Floats, Floats]:
    """Slip (n,) and the way [m] (n,) of the rows that know it."""
    slip, std = run.estimated(f"slip_{wheel}"), run.estimated(f"slip_{wheel}_std")
    way = np.diff(run.estimated("distance"), prepend=run.estimated("distance")[0])
    rows = np.isfinite(slip) & (std < _UNSURE) & np.isfinite(way)
    return slip[rows], way[rows]


def _lane(run: Run, column: str, label: str) -> Lane:
    """A lane of a column; what is hardly known, at a crawl, does not set its height."""
    values, std = run.estimated(column), run.estimated(f"{column}_std")
    rows = run.moving & np.isfinite(values) & (std < _UNSURE)
    low, high = np.percentile(values[rows], [0.3, 99.7]) if rows.any() else (0.0, 1.0)
    margin = 0.15 * (high - low) or 0.1
    return Lane(label, values, std, limits=(float(low - margin), float(high + margin)))

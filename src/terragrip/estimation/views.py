"""What a notebook shows of estimates: a table as HTML, and figures over time, in the plane of slip and adhesion, on the ground."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.columns import column_named
from terragrip.estimation.consistency import NORMAL_95
from terragrip.estimation.grouped import medians
from terragrip.figures import BLUE, GRID, INK, LINES, MUTED, ORANGE, VERMILLION, notebook_figure, styled
from terragrip.html import figure_of, html_notes, html_table
from terragrip.physics.geodesy import metres_of
from terragrip.recording.clock import clock_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from terragrip.estimation.estimates import Estimates

Kind = Literal["time", "plane", "map"]
_MOST = 4000  # points of a line: more a screen does not show
_EVENT_COLORS = {"stuck": VERMILLION, "immobilization": ORANGE, "push": BLUE}


def html_of(estimates: Estimates) -> str:
    """What was driven, the medians by wheel, and the notes."""
    headline = estimates.summary().splitlines()[0]
    if estimates.start is not None and len(estimates):
        headline += f", from {clock_times(estimates.time[:1], estimates.start).item():%Y-%m-%d %H:%M:%S} UTC"
    middle = medians(estimates, estimates.event_codes == 0)

    def cell(name: str) -> str:
        return figure_of(middle.get(name), middle.get(f"{name}_std"))

    whole = [("ground_speed", "ground speed [m/s]"), ("soil_resistance", "soil resistance [–]")]
    rows: list[Sequence[object]] = [
        (title, cell(name), *[""] * (len(estimates.wheels) - 1)) for name, title in whole if name in estimates
    ]
    for quantity in ("slip", "adhesion", "net_traction", "efficiency"):
        if any(f"{quantity}_{wheel}" in estimates for wheel in estimates.wheels):
            title = f"{quantity.replace('_', ' ')} [–]"
            rows.append((title, *(cell(f"{quantity}_{wheel}") for wheel in estimates.wheels)))
    caption = f"{headline}; medians ± SD while moving without an event"
    return html_table(["", *estimates.wheels], rows, caption) + html_notes(estimates.notes)


def plot(estimates: Estimates, kind: Kind, quantity: str) -> Figure:
    """See `Estimates.plot`."""
    if kind not in _KINDS:
        raise InputError(f"there is no plot {kind!r}", hint=f"take one of {', '.join(_KINDS)}")
    if not len(estimates):
        raise InputError("there is no row to draw", hint="estimate a log that has rows")
    return _KINDS[kind](estimates, quantity)


def _over_time(estimates: Estimates, quantity: str) -> Figure:
    """Ground speed, slip, adhesion and soil resistance, each line with its 95 % interval; events as stripes."""
    shown = [
        name for name in ("ground_speed", "slip", "adhesion", "soil_resistance") if _columns(estimates, name)
    ]
    figure = notebook_figure(9.6, 1.0 + 1.7 * len(shown))
    every = slice(None, None, -(-len(estimates) // _MOST))
    time = estimates.time[every]
    with styled():
        plots = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(plots, shown, strict=True):
            columns = _columns(estimates, name)
            for color, (label, column) in zip(LINES, columns.items(), strict=False):
                values = estimates[column][every]
                if f"{column}_std" in estimates:
                    half = NORMAL_95 * estimates[f"{column}_std"][every]
                    axes.fill_between(
                        time, values - half, values + half, color=color, alpha=0.15, linewidth=0
                    )
                axes.plot(time, values, color=color, label=label)
            _set_limits(axes, [estimates[column][every] for column in columns.values()])
            unit = column_named(next(iter(columns.values()))).unit
            axes.set_ylabel(f"{name.replace('_', ' ')} [{'–' if unit == '1' else unit}]")
            if len(columns) > 1:
                axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        _draw_events(estimates, list(plots))
        start = "" if estimates.start is None else f", from 0 at {estimates.start:%Y-%m-%d %H:%M:%S} UTC"
        plots[-1].set_xlabel(f"time [s]{start}")
    return figure


def _columns(estimates: Estimates, name: str) -> dict[str, str]:
    """Columns of a quantity by label: the vehicle's own, or one a wheel."""
    if name in estimates:
        return {"": name}
    return {wheel: f"{name}_{wheel}" for wheel in estimates.wheels if f"{name}_{wheel}" in estimates}


def _set_limits(axes: Axes, lines: list[Any]) -> None:
    """The middle 99 % of the lines fill the height, so that a wide interval of a moment does not flatten all others."""
    values = np.concatenate(lines)
    values = values[np.isfinite(values)]
    if len(values):
        low, high = np.quantile(values, [0.005, 0.995])
        room = max(0.35 * (high - low), 0.02)
        axes.set_ylim(low - room, high + room)


def _draw_events(estimates: Estimates, plots: list[Any]) -> None:
    codes, events = estimates.event_codes, estimates["event"]
    edges = np.flatnonzero(np.diff(codes, prepend=codes[:1] * 0 - 1, append=codes[-1:] * 0 - 1))
    named = set()
    for first, last in pairwise(edges):
        kind = str(events[first])
        if not kind:
            continue
        color = _EVENT_COLORS.get(kind, MUTED)
        for place, axes in enumerate(plots):
            label = kind if place == 0 and kind not in named else None
            axes.axvspan(
                estimates.time[first],
                estimates.time[last - 1],
                color=color,
                alpha=0.18,
                linewidth=0,
                label=label,
            )
        named.add(kind)
    if named:
        plots[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=8)


def _plane(estimates: Estimates, quantity: str) -> Figure:
    """Adhesion over slip of all wheels where nothing was flagged, by soil where the log names soils."""
    wheels = [w for w in estimates.wheels if f"adhesion_{w}" in estimates]
    if not wheels:
        raise InputError(
            "there is slip but no adhesion to draw over it",
            hint="estimate a log with drive torques, or draw 'time' or 'map'",
        )
    calm = np.flatnonzero(estimates.event_codes == 0)
    calm = calm[:: max(1, len(calm) * len(wheels) // (3 * _MOST))]
    soils = estimates.soil[calm]
    names = sorted(set(soils.tolist()))
    figure = notebook_figure(7.2, 4.6)
    with styled():
        axes = figure.subplots()
        for number, soil in enumerate(names):
            rows = calm[soils == soil]
            slip, adhesion = (
                np.concatenate([estimates[f"{q}_{w}"][rows] for w in wheels]) for q in ("slip", "adhesion")
            )
            axes.plot(
                slip, adhesion, ".", markersize=2.5, alpha=0.35, color=LINES[number % len(LINES)],
                label=soil or "no label", rasterized=True,
            )  # fmt: skip
        axes.axhline(0, color=MUTED, linewidth=0.6)
        axes.axvline(0, color=MUTED, linewidth=0.6)
        axes.set_xlabel("slip s [–]")
        axes.set_ylabel("adhesion µ [–]")
        axes.set_title(f"{len(wheels)} wheels, rows without an event")
        if names not in ([], [""]):
            for handle in axes.legend(markerscale=4).legend_handles:
                if handle is not None:
                    handle.set_alpha(1.0)
    return figure


def _map(estimates: Estimates, quantity: str) -> Figure:
    """The track in metres east and north of its first position, coloured by a quantity, the wheels' mean."""
    if "latitude" not in estimates or "longitude" not in estimates:
        raise InputError("the log has no positions to draw", hint="name latitude and longitude in a profile")
    columns = list(_columns(estimates, quantity).values())
    if not columns:
        known = [q for q in ("slip", "adhesion", "ground_speed", "soil_resistance") if _columns(estimates, q)]
        raise InputError(f"there is no quantity {quantity!r}", hint=f"take one of {', '.join(known)}")
    rows = np.flatnonzero(np.isfinite(estimates["latitude"]) & np.isfinite(estimates["longitude"]))
    rows = rows[:: max(1, len(rows) // (2 * _MOST))]
    if not len(rows):
        raise InputError("no row has a position", hint="draw 'time' or 'plane'")
    north, east = metres_of(estimates["latitude"][rows], estimates["longitude"][rows])
    values = np.mean([estimates[column][rows] for column in columns], axis=0)
    known = np.isfinite(values)
    figure = notebook_figure(7.6, 5.6)
    with styled():
        axes = figure.subplots()
        axes.plot(east[~known], north[~known], ".", color=GRID, markersize=3)
        low, high = np.quantile(values[known], [0.02, 0.98]) if known.any() else (0.0, 1.0)
        drawn = axes.scatter(
            east[known], north[known], c=values[known], s=7, cmap="cividis", vmin=low, vmax=high, linewidths=0
        )
        unit = column_named(columns[0]).unit
        mean = " (mean of the wheels)" if len(columns) > 1 else ""
        bar = figure.colorbar(drawn, ax=axes, extend="both", shrink=0.85)
        bar.set_label(f"{quantity.replace('_', ' ')}{mean} [{'–' if unit == '1' else unit}]", color=INK)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("east [m]")
        axes.set_ylabel("north [m]")
    return figure


_KINDS: dict[str, Callable[[Estimates, str], Figure]] = {"time": _over_time, "plane": _plane, "map": _map}

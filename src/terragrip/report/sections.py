"""Sections of the report: each takes runs and returns prose, figures and tables, or says why it has none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.report.intervals import (
    Coverage,
    coverage_table,
    draw_coverage,
    draw_nis,
    nis_table,
)
from terragrip.report.operating_points import cross_table, draw_crosses, section_crosses, soil_crosses
from terragrip.report.page import Picture, Section, Table, names, number
from terragrip.report.runs import Run, stretches
from terragrip.report.scores import Comparison, TruthScore, method_tables, sensor_table, truth_table
from terragrip.report.timeline import Lane, timeline

if TYPE_CHECKING:
    from terragrip.estimation.calibration import Calibration

HARDLY = 5.0
"""A row whose SD is so many times as wide as the median is hardly known, and does not set a plot's height."""
WIDE = 0.3
"""SD of the online curve's scale beyond which it does not set the plot's height."""
ZOOM_MARGIN = 20.0
"""Seconds shown before and after what a zoom is about."""


def tracking(run: Run, prose: Sequence[str] = ()) -> Section:
    """Traction of one wheel over time against sensor and truth (the paper shows `multi2`), and a zoom."""
    wheel = run.shown_wheel
    lanes = [_lane(run, f"adhesion_{wheel}", f"adhesion µ, {wheel} [–]")]
    measured = run.measured_ratio()
    if measured is not None:
        lanes.insert(0, _lane(run, f"net_traction_{wheel}", f"net traction κ, {wheel} [–]", measured))
    sim = "Simulated run" if run.truth is not None else "Run"
    what = "net traction ratio κ (top) and adhesion µ (bottom)" if len(lanes) > 1 else "adhesion µ"
    sources = _sources(lanes[0])
    whole = Picture(
        f"traction-{run.name}",
        timeline(run, lanes),
        f"{sim} {run.name}, method {run.method}: {what} of wheel {wheel} over time: {sources}."
        + (
            " The strip on top names the soil, grey is a transition (vehicle and tool on different soils)."
            if run.soils
            else ""
        )
        + " At standstill it is held." * (not run.moving.all())
        + (" Shaded: the vehicle is stuck." if run.stuck.any() else ""),
        f"Traction of wheel {wheel} over time in {run.name}: {sources}",
    )
    start, end, about = _zoom(run)
    between = run.clock.span(start, end)
    near = Picture(
        f"traction-{run.name}-zoom",
        timeline(run, lanes, (start, end)),
        f"The same from {between}, around {about}.",
        f"Traction of wheel {wheel} in {run.name}, zoomed to {between}",
    )
    is_shorter = end - start < float(run.time[-1] - run.time[0])
    scored = sensor_table(run)
    shown = (whole, *((near,) if is_shorter else ()), *((scored,) if scored is not None else ()))
    return Section(f"tracking-{run.name}", f"Traction in {run.name}", tuple(prose), shown)


def slip_and_resistance(run: Run) -> Section:
    """Slip of one wheel and soil resistance over time, with intervals and truth."""
    wheel = run.shown_wheel
    lanes = [
        _lane(run, f"slip_{wheel}", f"slip s, {wheel} [%]", never_stuck=True),
        _lane(run, "soil_resistance", "soil resistance ρs [–]", never_stuck=True),
    ]
    sim = "Simulated run" if run.truth is not None else "Run"
    off = " Where the vehicle is stuck, slip leaves the plot towards 100 %." if run.stuck.any() else ""
    picture = Picture(
        f"slip-resistance-{run.name}",
        timeline(run, lanes),
        f"{sim} {run.name}, method {run.method}: slip of wheel {wheel} (top) and soil rolling resistance "
        f"(bottom): {_sources(lanes[0])}. At standstill slip is undefined and the resistance held.{off}",
        f"Slip of wheel {wheel} and soil resistance over time in {run.name}",
    )
    return Section(f"slip-{run.name}", "Slip and soil resistance", (), (picture,))


def online_curve(run: Run, scales: Mapping[str, float], by_whom: str = "of the fits below") -> Section:
    """The scale a of the adhesion curve as it is known while driving (paper, Fig. 2), beside each soil's own.

    `scales`: a by soil, drawn as steps; `by_whom`: whose they are, for the caption.
    """
    title = "The curve, known while driving"
    if "curve_a" not in run.estimates:
        return Section("online", title, omitted="Left out: these estimates contain no online curve.")
    steps = np.array([scales.get(label, np.nan) for label in run.soil], dtype=np.float64)
    estimate, std = run.estimated("curve_a"), run.estimated("curve_a_std")
    known = run.moving & ~run.stuck & (std < WIDE)
    top = np.nanmax(np.concatenate((estimate[known], steps, [0.5])))
    lane = Lane(
        "scale a of the curve [–]",
        estimate,
        std,
        truth=steps if np.isfinite(steps).any() else None,
        limits=(0.0, 1.25 * float(top)),
        reference=f"a {by_whom}",
    )
    beside = f", beside the a {by_whom}" if lane.truth is not None else ""
    picture = Picture(
        f"online-{run.name}",
        timeline(run, [lane]),
        f"{'Simulated run' if run.truth is not None else 'Run'} {run.name}: the scale a of µ(s) = a g(s), learned from single pairs "
        f"of slip and adhesion as they come, with its 95 % interval{beside}. With a the whole curve is known at each instant; "
        "the interval widens where slip is too small to determine a, and restarts where the ground changes.",
        f"Scale of the adhesion curve over time in {run.name}",
    )
    return Section("online", title, (), (picture,))


def methods(
    comparisons: Sequence[Comparison], scores: Sequence[TruthScore], default: str, prose: Sequence[str] = ()
) -> Section:
    """Every method's scores against the sensor and, in simulation, against the truth."""
    title = "Methods compared"
    if not comparisons and not scores:
        return Section(
            "methods", title, omitted="Left out: there is neither a reference force sensor nor a truth."
        )
    tables: list[Picture | Table] = list(method_tables(comparisons, default))
    if scores:
        tables.append(truth_table(scores, default))
    return Section("methods", title, tuple(prose), tuple(tables))


def soils(run: Run, together: Sequence[Run]) -> Section:
    """Crosses of mean and SD: sections of `run`, and by soil over the runs `together`."""
    title = "Operating points by soil"
    quantity = "net_traction" if run.sensor_wheel is not None else "adhesion"
    crosses = section_crosses(run, quantity)
    if not crosses:
        return Section("soils", title, omitted="Left out: no section of these runs carries a soil label.")
    source = next((v for v in ("measured", "estimated") if any(c.source == v for c in crosses)), "estimated")
    pooled = soil_crosses(together, quantity)
    text = names([v for v in ("measured", "estimated", "true") if any(c.source == v for c in pooled)])
    sim = "simulated " if run.truth is not None else ""
    what = "net traction ratio κ" if quantity == "net_traction" else "adhesion µ"
    sections_picture = Picture(
        f"sections-{run.name}",
        draw_crosses(crosses, (source,), what),
        f"Mean ± SD of slip and {what} ({source}) of each section of the {sim}run {run.name} that lies on one "
        f"soil, wheel {run.shown_wheel}; transitions and stuck spells left out.",
        f"Crosses of slip and traction by section of {run.name}",
    )
    pooled_picture = Picture(
        "soils",
        draw_crosses(pooled, ("measured", "estimated", "true"), what),
        f"Mean ± SD of slip and {what} by soil over the {sim}run{'s' * (len(together) > 1)} {names([r.name for r in together])}, "
        f"{text}. "
        + (
            "Measured slip comes from the raw speeds, so its SD holds their noise."
            if run.recording is not None
            else "The sensor's traction is plotted at the estimated slip."
            if run.sensor_wheel is not None
            else ""
        ),
        "Crosses of slip and traction by soil, measured, estimated and true",
    )
    tables = [cross_table(pooled, what)]
    if quantity != "adhesion":
        tables.append(cross_table(soil_crosses(together, "adhesion"), "adhesion µ"))
    return Section("soils", title, (), (sections_picture, pooled_picture, *tables))


def honesty(shown: Run, covered: Sequence[Coverage]) -> Section:
    """Coverage of the intervals (of runs with a truth) and NIS of one run against chi-square."""
    content: list[Picture | Table] = []
    judged = len({item.run for item in covered if item.rows})
    title = "Do the intervals cover the truth?" if judged else "Is the noise set right?"
    if judged:
        content += [
            Picture(
                "coverage",
                draw_coverage(covered),
                f"How often the intervals cover the simulated truth, against the stated probability, over {judged} "
                f"run{'s' if judged > 1 else ''} while the vehicle moves by itself. Above the dashed line they are too wide, below "
                "it too narrow.",
                "Observed against nominal coverage of the intervals",
            ),
            coverage_table(covered),
        ]
    if (np.nan_to_num(shown.estimated("nis")) > 0).any():
        simulated = "the simulated run " if shown.truth is not None else ""
        content += [
            Picture(
                f"nis-{shown.name}",
                draw_nis(shown),
                f"Normalised innovation squared of {simulated}{shown.name}, method {shown.method}, for the "
                "most common numbers of channels used (bars; the last bar holds all beyond), and the "
                "chi-square distribution that it follows when the noise settings are right (line).",
                f"Histogram of NIS of {shown.name} with the chi-square density",
            ),
            nis_table([shown]),
        ]
    if not content:
        return Section("honesty", title, omitted="Left out: no truth, and a method without innovations.")
    return Section("honesty", title, (), tuple(content))


def calibrated(calibration: Calibration) -> Section:
    """What the vehicle's own logs say of its sensors and wheels."""
    rows = tuple(
        (
            item.name,
            number(item.value, 4),
            f"{number(item.interval[0], 4)} to {number(item.interval[1], 4)}",
            item.unit,
        )
        for item in calibration.quantities
    )
    title = "Calibration"
    if not rows:
        return Section("calibration", title, omitted="Left out: the logs gave nothing to calibrate from.")
    table = Table(
        "What `terragrip calibrate` found, with 95 % intervals; every estimate here uses it.",
        ("quantity", "value", "95 % interval", "unit"),
        rows,
    )
    missing = tuple(f"Not found: {item.name} ({item.why})." for item in calibration.unknown)
    return Section("calibration", title, missing, (table,))


def _lane(
    run: Run, column: str, label: str, measured: Floats | None = None, *, never_stuck: bool = False
) -> Lane:
    """A lane of one estimated column, its axis wide enough for nearly all that it shows.

    The rarest 0.3 % at either end may leave the plot, so may what stands still, what is hardly known, as just before a standstill (there
    the interval may span everything) and, with `never_stuck`, what happens while stuck.
    """
    estimate, std, truth = run.estimated(column), run.estimated(f"{column}_std"), run.true(column)
    rows = run.moving & ~run.stuck if never_stuck else run.moving
    usual = std[rows & np.isfinite(std)]
    if len(usual):
        rows = rows & ~(std > HARDLY * np.median(usual))
    sources = [estimate - 1.96 * std, estimate + 1.96 * std, truth, measured]
    known = [v[rows & np.isfinite(v)] for v in sources if v is not None]
    ends = [np.percentile(v, [0.3, 99.7]) for v in known if len(v)]
    limits = None
    if ends:
        low, high = min(e[0] for e in ends), max(e[1] for e in ends)
        margin = 0.06 * (high - low) or 0.1
        limits = (float(low - margin), float(high + margin))
    return Lane(label, estimate, std, measured, truth, limits)


def _sources(lane: Lane) -> str:
    """The sources in a lane, in words."""
    notes = ["the estimate"] + (["its 95 % interval"] if lane.std is not None else [])
    notes += [
        "the simulated force sensor's F_x/F_z" if lane.truth is not None else "the force sensor's F_x/F_z"
    ] * (lane.measured is not None)
    return names(notes + (["the truth"] if lane.truth is not None else []))


def _zoom(run: Run) -> tuple[float, float, str]:
    """The window to look into: around the first stuck spell, else around the middle of the driving."""
    spells = stretches(run.outlier)
    if spells:
        first, last = spells[0]
        about = "the spell in which the vehicle is stuck"
        start, end = float(run.time[first]) - ZOOM_MARGIN, float(run.time[last]) + ZOOM_MARGIN
    else:
        rows = np.flatnonzero(run.moving)
        middle = float(run.time[rows[len(rows) // 2] if len(rows) else len(run.time) // 2])
        start, end, about = middle - ZOOM_MARGIN, middle + ZOOM_MARGIN, "the middle of the driving"
    return max(start, float(run.time[0])), min(end, float(run.time[-1])), about

"""Sections of the report: each takes runs and returns prose, figures and tables, or says why it has none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terragrip.report.intervals import (
    Coverage,
    coverage_table,
    draw_coverage,
    draw_nis,
    nis_table,
)
from terragrip.report.operating_points import cross_table, draw_crosses, section_crosses, soil_crosses
from terragrip.report.page import Picture, Section, Table, names
from terragrip.report.runs import Run, stretches
from terragrip.report.scores import Comparison, TruthScore, method_tables, truth_table
from terragrip.report.timeline import Lane, timeline

ZOOM_MARGIN = 20.0
"""Seconds shown before and after what a zoom is about."""


def tracking(run: Run, prose: Sequence[str] = ()) -> Section:
    """Adhesion of one wheel over time, against sensor and truth (the paper shows `multi2`), and a zoom."""
    wheel = run.shown_wheel
    lane = Lane(
        f"adhesion µ, {wheel} [–]",
        run.estimated(f"adhesion_{wheel}"),
        run.estimated(f"adhesion_{wheel}_std"),
        run.measured_ratio(),
        run.true(f"adhesion_{wheel}"),
    )
    lane = _clipped(lane)
    sim = "Simulated run" if run.truth is not None else "Run"
    voices = _voices(lane)
    whole = Picture(
        f"adhesion-{run.name}",
        timeline(run, [lane]),
        f"{sim} {run.name}, method {run.method}: adhesion of wheel {wheel} over time: {voices}. The strip on "
        "top names the soil, grey is a transition (vehicle and tool on different soils)."
        + (" Shaded: the vehicle is stuck." if run.stuck.any() else ""),
        f"Adhesion of wheel {wheel} over time in {run.name}, estimate against {voices}",
    )
    start, end, about = _zoom(run)
    near = Picture(
        f"adhesion-{run.name}-zoom",
        timeline(run, [lane], (start, end)),
        f"The same from {start:.0f} to {end:.0f} s, around {about}.",
        f"Adhesion of wheel {wheel} in {run.name}, zoomed to {start:.0f} to {end:.0f} s",
    )
    return Section(f"tracking-{run.name}", f"Adhesion in {run.name}", tuple(prose), (whole, near))


def slip_and_resistance(run: Run) -> Section:
    """Slip of one wheel and soil resistance over time, with intervals and truth."""
    wheel = run.shown_wheel
    lanes = [
        Lane(f"slip s, {wheel} [–]", run.estimated(f"slip_{wheel}"), run.estimated(f"slip_{wheel}_std"),
             None, run.true(f"slip_{wheel}")),
        Lane("soil resistance ρs [–]", run.estimated("soil_resistance"), run.estimated("soil_resistance_std"),
             None, run.true("soil_resistance")),
    ]  # fmt: skip
    sim = "Simulated run" if run.truth is not None else "Run"
    picture = Picture(
        f"slip-resistance-{run.name}",
        timeline(run, [_clipped(lane) for lane in lanes]),
        f"{sim} {run.name}, method {run.method}: slip of wheel {wheel} (top) and soil rolling resistance "
        f"(bottom): {_voices(lanes[0])}. At standstill slip is undefined and the resistance held.",
        f"Slip of wheel {wheel} and soil resistance over time in {run.name}",
    )
    return Section(f"slip-{run.name}", "Slip and soil resistance", (), (picture,))


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


def soils(run: Run, together: Sequence[Run], radius: float) -> Section:
    """Crosses of mean and SD: sections of `run`, and by soil over the runs `together`."""
    title = "Operating points by soil"
    crosses = section_crosses(run, radius)
    if not crosses:
        return Section("soils", title, omitted="Left out: no section of these runs carries a soil label.")
    voice = next((v for v in ("measured", "estimated") if any(c.voice == v for c in crosses)), "estimated")
    pooled = soil_crosses(together, radius)
    said = names([v for v in ("measured", "estimated", "true") if any(c.voice == v for c in pooled)])
    sim = "simulated " if run.truth is not None else ""
    sections_picture = Picture(
        f"sections-{run.name}",
        draw_crosses(crosses, (voice,)),
        f"Mean ± SD of slip and adhesion ({voice}) of each section of the {sim}run {run.name} that lies on "
        f"one soil, wheel {run.shown_wheel}; transitions and stuck spells left out.",
        f"Crosses of slip and adhesion by section of {run.name}",
    )
    pooled_picture = Picture(
        "soils",
        draw_crosses(pooled, ("measured", "estimated", "true")),
        f"Mean ± SD of slip and adhesion by soil over the {sim}runs {names([r.name for r in together])}, "
        f"{said}. Measured slip comes from the raw speeds, so its SD holds their noise.",
        "Crosses of slip and adhesion by soil, measured, estimated and true",
    )
    return Section("soils", title, (), (sections_picture, pooled_picture, cross_table(pooled)))


def honesty(shown: Run, covered: Sequence[Coverage]) -> Section:
    """Coverage of the intervals (of runs with a truth) and NIS of one run against chi-square."""
    title = "Are the intervals honest?"
    content: list[Picture | Table] = []
    judged = len({item.run for item in covered if item.rows})
    if judged:
        content += [
            Picture(
                "coverage",
                draw_coverage(covered),
                f"How often the intervals hold the simulated truth, against what they claim, over {judged} "
                f"run{'s' if judged > 1 else ''} while moving. Above the dashed line they are careful, under "
                "it too sure.",
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
                "most common numbers of channels taken (bars; the last bar holds all beyond), and the "
                "chi-square law that it follows when the noise settings are right (line).",
                f"Histogram of NIS of {shown.name} with the chi-square density",
            ),
            nis_table([shown]),
        ]
    if not content:
        return Section("honesty", title, omitted="Left out: no truth, and a method without innovations.")
    return Section("honesty", title, (), tuple(content))


def _clipped(lane: Lane) -> Lane:
    """Axis limits that hold the estimate and the middle 99.8 % of the sensor: spikes may leave."""
    pieces = [lane.estimate]
    if lane.std is not None:
        pieces += [lane.estimate - 1.96 * lane.std, lane.estimate + 1.96 * lane.std]
    if lane.truth is not None:
        pieces.append(lane.truth)
    ends = [np.nanpercentile(piece, [0.1, 99.9]) for piece in pieces if np.isfinite(piece).any()]
    if lane.measured is not None and np.isfinite(lane.measured).any():
        ends.append(np.nanpercentile(lane.measured, [0.1, 99.9]))
    if not ends:
        return lane
    low, high = min(e[0] for e in ends), max(e[1] for e in ends)
    margin = 0.05 * (high - low) or 0.1
    limits = (float(low - margin), float(high + margin))
    return Lane(lane.label, lane.estimate, lane.std, lane.measured, lane.truth, limits)


def _voices(lane: Lane) -> str:
    """Who speaks in a lane, in words."""
    said = ["the estimate"] + (["its 95 % interval"] if lane.std is not None else [])
    said += [
        "the simulated force sensor's F_x/F_z" if lane.truth is not None else "the force sensor's F_x/F_z"
    ] * (lane.measured is not None)
    return names(said + (["the truth"] if lane.truth is not None else []))


def _zoom(run: Run) -> tuple[float, float, str]:
    """The window to look into: around the first stuck spell, else around the middle of the run."""
    spells = stretches(run.stuck)
    if spells:
        first, last = spells[0]
        about = "the spell in which the vehicle is stuck and its tool slides up and pushes"
        start, end = float(run.time[first]) - ZOOM_MARGIN, float(run.time[last]) + ZOOM_MARGIN
    else:
        middle = float(run.time[len(run.time) // 2])
        start, end, about = middle - ZOOM_MARGIN, middle + ZOOM_MARGIN, "the middle of the run"
    return max(start, float(run.time[0])), min(end, float(run.time[-1])), about

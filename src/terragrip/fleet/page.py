"""The fleet's report: one page with tables by vehicle, soil and day, the pooled curves, and the failures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from terragrip.figures import INK, MUTED, new_figure, soil_color, styled
from terragrip.fleet.curves import FleetCurves
from terragrip.fleet.dataset import soil_rows
from terragrip.fleet.doubts import unlike
from terragrip.fleet.tally import weighted
from terragrip.report.curves import maxima
from terragrip.report.page import Headline, Page, Picture, Section, Table, number, percent, render
from terragrip.report.style import to_svg

Row = dict[str, Any]

DIGGING = ("immobilization", "stuck")
MOST = 60
"""The most rows of a table on the page; the Parquet tables hold all."""
SLIPS = np.linspace(0.0, 0.6, 121)


def report_of(notes: Sequence[Row], reasons: Mapping[str, str], curves: FleetCurves) -> str:
    """The report as one self-contained HTML document. Raises InputError if matplotlib or Jinja2 is missing."""
    rows = [{"log": note["log"], **note["summary"]} for note in notes]
    counted = [row for row in rows if not row["left_out"]]
    soils = soil_rows(notes)
    sections = (
        _by_vehicle(counted),
        _by_soil(soils, curves),
        _curves(curves),
        _by_day(counted),
        _left_out(rows),
        _remarks(rows),
        _failures(reasons),
    )
    return render(Page("Fleet report", _lead(rows, reasons), sections, tuple(_headlines(rows, reasons))))


def _lead(rows: Sequence[Row], reasons: Mapping[str, str]) -> str:
    machines, days = {row["vehicle"] for row in rows}, {row["day"] for row in rows if row["day"]}
    text = f"{len(rows)} logs of {len(machines)} vehicle{'s' * (len(machines) != 1)}"
    text += f" on {len(days)} day{'s' * (len(days) != 1)}" if days else ""
    text += f", {min(days)} to {max(days)} (UTC)" if len(days) > 1 else ""
    return (
        f"{text}. {len(reasons)} could not be estimated." if reasons else f"{text}. Every log was estimated."
    )


def _headlines(rows: Sequence[Row], reasons: Mapping[str, str]) -> Iterator[Headline]:
    yield Headline(str(len(rows)), "logs", f"{len(reasons)} failed" if reasons else "none failed")
    rows = [row for row in rows if not row["left_out"]]
    yield Headline(f"{_total(rows, 'moving_time') / 3600:.1f} h", "moving, without an event")
    yield Headline(f"{_total(rows, 'distance') / 1000:.1f} km", "driven")
    yield Headline(percent(weighted(rows, "slip")[0]), "slip", "mean over moving time")
    yield Headline(str(_stuck(rows)), "times stuck or about to be")


def _by_vehicle(rows: Sequence[Row]) -> Section:
    groups = _grouped(rows, "vehicle")
    header = ("vehicle", "logs", "moving, h", "km", *_MEANS, "stuck")
    table = Table(
        "Means over moving time without an event ± standard deviation between logs. Stuck: times stuck or about to be (docs/events.md).",
        header,
        tuple(
            (name, str(len(group)), _hours(group), _kilometres(group), *_means(group), str(_stuck(group)))
            for name, group in groups.items()
        ),
    )
    odd = tuple(
        f"{name} is unlike the other vehicles: {means}. Other ground or other work, or its vehicle file is wrong."
        for name, means in unlike(rows).items()
    )
    return Section("vehicles", "By vehicle", odd, (table,)) if rows else _nothing("vehicles", "By vehicle")


def _by_day(rows: Sequence[Row]) -> Section:
    groups = _grouped(rows, "day")
    header = ("day", "logs", "vehicles", "moving, h", "km", *_MEANS, "stuck")
    listed = [
        (
            str(name or "unknown"), str(len(group)), str(len({row["vehicle"] for row in group})), _hours(group),
            _kilometres(group), *_means(group), str(_stuck(group)),
        )
        for name, group in groups.items()
    ]  # fmt: skip
    caption = "As above, by the UTC day of a log's first row."
    caption += (
        f" The last {MOST} of {len(listed)} days; summary.parquet has all." if len(listed) > MOST else ""
    )
    content = (Table(caption, header, tuple(listed[-MOST:])),)
    return Section("days", "By day", content=content) if rows else _nothing("days", "By day")


def _by_soil(rows: Sequence[Row], curves: FleetCurves) -> Section:
    if not rows:
        return Section("soils", "By soil", omitted="No log has a column soil that labels its ground.")
    learned = curves.pooled.soils
    header = ("soil", "logs", "vehicles", "moving, h", "km", *_MEANS, "best slip")
    listed = []
    for name, group in _grouped(rows, "soil").items():
        best = maxima(learned[name].soil, curves.tire_resistance).efficiency[0] if name in learned else None
        km = f"{sum(row['moving_distance'] for row in group) / 1000:.2f}"
        machines = str(len({row["vehicle"] for row in group}))
        listed.append((name, str(len(group)), machines, _hours(group), km, *_means(group), percent(best)))
    caption = (
        "By the logs' own labels, also where the tool is still on other ground, which a log's own report leaves out. "
        "Best slip: where the pooled curve's tractive efficiency is largest, at the soil's mean resistance"
        f" and the vehicles' mean tire resistance {number(curves.tire_resistance)}. No interval is given here, since machines differ: "
        "'terragrip advise' with soils.json gives one for a single machine."
    )
    return Section("soils", "By soil", content=(Table(caption, header, tuple(listed)),))


def _curves(curves: FleetCurves) -> Section:
    pooled = curves.pooled
    if not pooled.soils:
        why = "; ".join(f"{name}: {reason}" for name, reason in pooled.not_fitted.items())
        return Section(
            "curves", "Adhesion over slip", omitted=why or "No labelled soil to learn a curve from."
        )
    names = list(pooled.soils)
    listed = []
    for name, learned in pooled.soils.items():
        levels = [float(one.soils[name].soil.value(0.2)) for one in curves.each.values() if name in one.soils]
        spread = number(float(np.std(levels, ddof=1))) if len(levels) > 1 else "–"
        listed.append(
            (
                name, learned.soil.model, str(len({part.run for part in learned.pairs})), number(float(learned.soil.value(0.2))),
                str(len(levels)) if levels else "1", spread, number(learned.soil.r2, 2),
            )
        )  # fmt: skip
    table = Table(
        "Pooled over all machines. Spread: standard deviation of µ at 20 % slip between the machines' own curves.",
        ("soil", "model", "logs", "µ at 20 % slip", "machines", "spread", "R²"),
        tuple(listed),
    )
    caption = "Thick: pooled over all machines. Thin: each machine's own curve. Dots: bins of the pooled fit with their SD."
    alt = f"Adhesion over slip of {', '.join(names)}"
    prose = tuple(f"{name}: not fitted, {why}." for name, why in pooled.not_fitted.items())
    return Section(
        "curves", "Adhesion over slip", prose, (Picture("curves", _draw(curves), caption, alt), table)
    )


def _draw(curves: FleetCurves) -> str:
    soils = list(curves.pooled.soils)
    columns = min(3, len(soils))
    lines = -(-len(soils) // columns)
    figure = new_figure(9.6 if columns > 1 else 6.4, 3.0 * lines + 0.2)
    with styled():
        axes = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
        for place, name in enumerate(soils):
            one, color = axes[place // columns][place % columns], soil_color(name, soils)
            soil = curves.pooled.soils[name].soil
            for other in curves.each.values():
                if name in other.soils:
                    one.plot(SLIPS, other.soils[name].soil.value(SLIPS), color=MUTED, linewidth=0.9)
            known = [b for b in soil.bins if b.get("mean") is not None and b.get("slip") is not None]
            one.errorbar(
                [b["slip"] for b in known], [b["mean"] for b in known], yerr=[b.get("std") or 0.0 for b in known],
                fmt="o", color=color, markersize=3, elinewidth=0.7,
            )  # fmt: skip
            one.plot(SLIPS, soil.value(SLIPS), color=INK, linewidth=2.2)
            one.set_title(name)
            one.set_xlim(0, SLIPS[-1])
            one.tick_params(labelbottom=place + columns >= len(soils))
        for place in range(len(soils), lines * columns):
            axes[place // columns][place % columns].set_axis_off()
        figure.supxlabel("slip s [–]", fontsize=9.5)
        figure.supylabel("adhesion µ [–]", fontsize=9.5)
    return to_svg(figure)


def _remarks(rows: Sequence[Row]) -> Section:
    """What the estimates' notes say, the same words with other numbers on one line, the rarest first: a wrong unit is rarely a fleet's."""
    alike: dict[str, list[Row]] = {}
    for row in rows:
        if row["notes"]:
            alike.setdefault(re.sub(r"\d", "", row["notes"]), []).append(row)
    if not alike:
        return Section("notes", "Notes on the logs", omitted="None.")
    listed = sorted(alike.values(), key=len)[:MOST]
    caption = "Logs with the same notes (numbers may differ), the rarest first; check units and signs before you use their means."
    cells = ((", ".join(r["log"] for r in group[:3]), str(len(group)), group[0]["notes"]) for group in listed)
    return Section(
        "notes", "Notes on the logs", content=(Table(caption, ("log", "logs", "notes"), tuple(cells)),)
    )


def _left_out(rows: Sequence[Row]) -> Section:
    """The logs in the data set that no mean counts, and why."""
    listed = tuple((row["log"], row["vehicle"], row["left_out"]) for row in rows if row["left_out"])
    if not listed:
        return Section(
            "left_out", "Logs left out of the means", omitted="None: every mean and curve counts all logs."
        )
    more = f" The first {MOST} of {len(listed)}; summary.parquet has all." if len(listed) > MOST else ""
    caption = f"In no mean, sum or curve of this page; their estimates are in the data set.{more}"
    table = Table(caption, ("log", "vehicle", "why"), listed[:MOST])
    return Section("left_out", "Logs left out of the means", content=(table,))


def _failures(reasons: Mapping[str, str]) -> Section:
    if not reasons:
        return Section("failures", "Logs that failed", omitted="None: every log is in the data set.")
    listed = tuple(reasons.items())[:MOST]
    more = (
        f"The first {MOST} of {len(reasons)}; failures.parquet has all."
        if len(reasons) > MOST
        else "All of them."
    )
    return Section("failures", "Logs that failed", content=(Table(more, ("log", "reason"), listed),))


def _nothing(anchor: str, title: str) -> Section:
    return Section(anchor, title, omitted="No log could be estimated.")


_MEANS = ("speed, m/s", "slip", "resistance", "adhesion", "efficiency")


def _means(rows: Sequence[Row]) -> tuple[str, ...]:
    """The cells of the columns `_MEANS`."""
    speed, *rest = (
        weighted(rows, name) for name in ("ground_speed", "slip", "soil_resistance", "adhesion", "efficiency")
    )
    slip, resistance, adhesion, efficiency = rest
    return (
        _with_spread(*speed, 2), _share(*slip), _with_spread(*resistance, 3), _with_spread(*adhesion, 3), _share(*efficiency),
    )  # fmt: skip


def _with_spread(mean: float, spread: float, digits: int) -> str:
    return number(mean, digits) + (f" ± {number(spread, digits)}" if np.isfinite(spread) else "")


def _share(mean: float, spread: float) -> str:
    if not np.isfinite(spread):
        return percent(mean)
    return f"{number(100 * mean, 1)} ± {number(100 * spread, 1)} %"


def _grouped(rows: Iterable[Row], by: str) -> dict[Any, list[Row]]:
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[by], []).append(row)
    return dict(sorted(groups.items(), key=lambda item: (item[0] is None, item[0])))


def _total(rows: Iterable[Row], name: str) -> float:
    return float(sum(row[name] for row in rows))


def _hours(rows: Iterable[Row]) -> str:
    return f"{_total(rows, 'moving_time') / 3600:.2f}"


def _kilometres(rows: Iterable[Row]) -> str:
    return f"{_total(rows, 'distance') / 1000:.2f}"


def _stuck(rows: Iterable[Row]) -> int:
    return int(sum(row[f"{kind}_events"] for row in rows for kind in DIGGING))

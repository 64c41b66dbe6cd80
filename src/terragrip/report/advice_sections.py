"""The chapter a manager reads: which slip, load and ballast are best on each soil, what it gains, and what is not known."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.figures import BLUE, MUTED, ORANGE, new_figure, styled
from terragrip.report.page import Picture, Section, Table, names, number, percent
from terragrip.report.style import to_svg

if TYPE_CHECKING:
    from terragrip.advice.result import Advice
    from terragrip.advice.samples import GatheredSamples
    from terragrip.advice.slip_only import Rows
    from terragrip.estimation import Estimates
    from terragrip.vehicle import Vehicle

TITLE = "Advice: which slip, and what to do for it"
DRAWN = 4
"""Soils whose curves are drawn: those with the most way."""
CONTROL = Path(__file__).with_name("slip_control.json")
"""Made by benchmarks/bench_slip_control.py --write."""
CONTROLLED = {
    "held-out": "field machines of kinds that nothing was tuned on",
    "second-plant": "machines of a second simulator that shares no formula with the first",
    "campaign": "the paper's robot on the fields of its campaign, runs that tow",
    "tractor": "a mid-size tractor (5.4 t, four driven wheels of two sizes, soils by cone index)",
    "development": "field machines",
}


@dataclass
class GatheredAdvice:
    """The runs of a report for its advice, one by one: those of the first run's vehicle, with torques if it had them; why another is
    left out."""

    vehicle: Vehicle | None = None
    wheels: tuple[str, ...] = ()
    samples: GatheredSamples | None = None
    rows: list[Rows] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    known: Vehicle | None = None

    def add(self, estimates: Estimates, run: str) -> None:
        """Take a run, or note why not."""
        from terragrip.advice.analysis import refuse_other_vehicle
        from terragrip.advice.samples import GatheredSamples, driven_wheels
        from terragrip.advice.slip_only import slip_rows
        from terragrip.estimation.driveline import machine_of

        try:
            vehicle = estimates.vehicle
            if not estimates.has_adhesion:
                if self.samples is not None:
                    raise InputError("it has slip alone, others adhesion too")
                self.known = self.known or vehicle
                self.rows.append(slip_rows(estimates))
                return
            if self.rows:
                raise InputError("it has adhesion, others slip alone")
            machine = machine_of(estimates, vehicle)
            if self.vehicle is None:
                refuse_other_vehicle(estimates, machine)
                self.vehicle, self.samples = machine, GatheredSamples(machine)
                self.wheels = tuple(driven_wheels(estimates, machine))
            elif (machine.wheels, machine.mass) != (self.vehicle.wheels, self.vehicle.mass):
                raise InputError("it is of another vehicle")
            if self.samples is not None:
                self.samples.add(estimates)
        except InputError as error:
            self.left_out[run] = str(error)

    def section(self) -> Section:
        """The chapter, or why there is none."""
        from terragrip.advice.analysis import NO_ROW, advise_samples
        from terragrip.advice.slip_only import advise_rows

        missed = tuple(f"Left out of the advice: {run}, for {why}." for run, why in self.left_out.items())
        if self.rows and self.known is not None:
            return of_slip(advise_rows(self.rows, self.known), missed)
        by_soil = {} if self.samples is None else self.samples.by_soil()
        if self.samples is None or not by_soil:
            why = next(iter(self.left_out.values()), NO_ROW)
            return Section("advice", TITLE, omitted=f"Left out: {why}.")
        vehicle = self.samples.vehicle
        advice, way = advise_samples(by_soil, vehicle, self.wheels)
        return of_soils(advice, way, vehicle.mass, missed)


def of_soils(
    advice: Mapping[str, Advice], way: Mapping[str, float], mass: float, notes: Sequence[str] = ()
) -> Section:
    """The chapter from advice and metres by soil; ``mass`` of the vehicle [kg]."""
    order = sorted(advice, key=lambda name: -way[name])
    prose = (
        "Best efficiency is the slip at which most of the wheels' power becomes pull. Intervals are of 95 % and include "
        "the uncertainties of the drives and of the vehicle file. A gain whose interval reaches below zero is not "
        "advised. All results apply to the ground as it was on these drives.",
        *notes,
    )
    content: list[Picture | Table] = [_slips(advice, order, mass)]
    drawn = [name for name in order if advice[name].curve][:DRAWN]
    if drawn:
        content.append(_picture(advice, drawn))
    content += [one for one in (_actions(advice, order), _missing(advice, order)) if one is not None]
    return Section("advice", TITLE, prose, tuple(content))


def of_slip(advice: Advice, notes: Sequence[str] = ()) -> Section:
    """The chapter where slip alone is known."""
    drive = advice.drive
    if "share_below" not in drive:
        return Section("advice", TITLE, omitted=f"Left out: {'; '.join(advice.missing)}.")
    low, high = drive["band_low"], drive["band_high"]
    prose = (
        f"Slip was within the usual band of {percent(low, 0)} to {percent(high, 0)} (ASABE EP496) in "
        f"{_share(drive, 'within')} of the driving "
        f"time, below in {_share(drive, 'below')}, above in {_share(drive, 'above')}; in parentheses 95 %, by what slip's "
        "zero leaves open. Without a torque, the strength of this ground, its best slip and the efficiency are not known.",
        *notes,
    )
    content = [one for one in (_actions({"": advice}, [""]), _missing({"": advice}, [""])) if one is not None]
    return Section("advice", TITLE, prose, tuple(content))


def control() -> Section:
    """What the set-point of slip does in simulation, as the benchmark measured it."""
    title = "Slip control in simulation"
    if not CONTROL.exists():
        return Section(
            "slip-control", title, omitted="Left out: benchmarks/bench_slip_control.py has not been run."
        )
    parts = json.loads(CONTROL.read_text(encoding="utf-8"))
    tables = tuple(
        Table(
            f"{part['machines']} seeds, {CONTROLLED.get(name, name)}. Medians of the ratios to fixed wheel speed on the same "
            "ground, 95 % intervals.",
            ("task, way", "energy a metre", "ground covered", "time stuck, mean"),
            tuple((f"{row[0]}, {row[1]}", *row[2:]) for row in part["rows"]),
        )
        for name, part in parts.items()
    )
    prose = (
        "The set-point (docs/advice.md) against wheels at a fixed speed and at a fixed torque, in the loop with the estimator. "
        "Digging: into soft ground that "
        "carries less than is asked, where it saves most of the energy by not digging. Work: several soils, hills, draught that "
        "comes and goes, where slip follows the pull and the set-point neither saves nor loses, but on the paper's fields, where it "
        "saves with heavy tools and covers less ground. Figures of benchmarks/bench_slip_control.py, not of this run.",
    )
    return Section("slip-control", title, prose, tables)


def _soil(name: str) -> str:
    return name or "all drives"


def _slips(advice: Mapping[str, Advice], order: Sequence[str], mass: float) -> Table:
    unit, weight = ("kN", mass * 9.80665e-3) if mass > 1000 else ("N", mass * 9.80665)
    digits = 2 if unit == "kN" else 0
    rows = []
    for name in order:
        one, drive = advice[name], advice[name].drive
        best, power = one.best_efficiency, one.best_productivity
        now = [number(drive.get("metres"), 0), percent(drive.get("slip"))]
        if best is None:
            rows.append((_soil(name), *now, "not known", "–", percent(drive.get("efficiency"), 0), "–", "–"))
            continue
        said = [
            _between(best.slip, best.interval),
            "–" if power is None else _between(power.slip, power.interval),
        ]
        there = f"{percent(best.efficiency, 0)} ({_ends(best.efficiency_interval)})"
        pull = (
            f"{number(weight * drive['net_traction'], digits)} → {number(weight * best.net_traction, digits)}"
        )
        rows.append((_soil(name), *now, *said, percent(drive.get("efficiency"), 0), there, pull))
    head = (
        "soil", "way [m]", "slip driven", "slip of best efficiency", "of most pull power", "efficiency driven", "at best",
        f"pull [{unit}], driven → best",
    )  # fmt: skip
    return Table("What was driven, and what would be best, by soil.", head, tuple(rows))


def _actions(advice: Mapping[str, Advice], order: Sequence[str]) -> Table | None:
    rows = []
    for name in order:
        for action in advice[name].actions:
            gain = "–"
            if action.gain is not None and action.interval is not None:
                gain = f"{number(100 * action.gain, 1)} ({number(100 * action.interval[0], 1)} to {number(100 * action.interval[1], 1)})"
            rows.append((_soil(name), action.what, action.why, gain))
    if not rows:
        return None
    return Table(
        "What to do. Gain: points of efficiency with their 95 % interval; a dash means a direction, or no change.",
        ("soil", "do", "why", "gain"),
        tuple(rows),
    )


def _missing(advice: Mapping[str, Advice], order: Sequence[str]) -> Table | None:
    """What is missing, a line a sentence, with the soils that it is of."""
    of: dict[str, list[str]] = {}
    for name in order:
        for sentence in advice[name].missing:
            of.setdefault(sentence, []).append(_soil(name))
    if not of:
        return None
    rows = tuple(
        (sentence, "all" if len(soils) == len(order) else names(soils)) for sentence, soils in of.items()
    )
    return Table("What is not known, and which data would show it.", ("missing", "for"), rows)


def _between(value: float, interval: tuple[float, float]) -> str:
    return f"{percent(value)} ({_ends(interval, 1)})"


def _share(drive: Mapping[str, float], name: str) -> str:
    """A share of the driving time with its interval."""
    share = f"share_{name}"
    return f"{percent(drive[share], 0)} ({_ends((drive[f'{share}_low'], drive[f'{share}_high']))})"


def _ends(interval: tuple[float, float], digits: int = 0) -> str:
    return " to ".join(number(100 * end, digits) for end in interval)


def _picture(advice: Mapping[str, Advice], drawn: Sequence[str]) -> Picture:
    """Efficiency over slip with its band, the best slip with its interval, the slip driven; a plot a soil."""
    columns = min(len(drawn), 2)
    rows = -(-len(drawn) // columns)
    figure = new_figure(9.6, 3.0 * rows)
    with styled():
        plots = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for plot, name in zip(plots.flat, drawn, strict=False):
            one = advice[name]
            best = one.best_efficiency
            if best is None:
                continue
            slip, middle, low, high = (
                [point[key] for point in one.curve]
                for key in ("slip", "efficiency", "efficiency_low", "efficiency_high")
            )
            slips = [100 * s for s in slip]
            plot.fill_between(slips, low, high, color=BLUE, alpha=0.2, linewidth=0, label="95 %")
            plot.plot(slips, middle, color=BLUE, label="efficiency")
            plot.axvspan(
                100 * best.interval[0],
                100 * best.interval[1],
                color=ORANGE,
                alpha=0.25,
                linewidth=0,
                label="best slip, 95 %",
            )
            plot.axvline(100 * best.slip, color=ORANGE, label="best slip")
            plot.axvline(100 * one.drive["slip"], color=MUTED, linestyle="--", label="slip driven, mean")
            plot.set_title(_soil(name))
            plot.set_xlim(0, 100 * slip[-1])
            plot.set_ylim(0, 1)
        for plot in plots.flat[len(drawn) :]:
            plot.set_visible(False)
        for plot in plots[-1]:
            plot.set_xlabel("slip [%]")
        for plot in plots[:, 0]:
            plot.set_ylabel("efficiency [–]")
        handles, labels = plots.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=5)
    shown = (
        ""
        if len(drawn) == len([one for one in advice.values() if one.curve])
        else f" The {DRAWN} soils with the most way."
    )
    return Picture(
        "advice",
        to_svg(figure),
        f"Efficiency over slip according to these drives, with its uncertainty.{shown}",
        "Efficiency over slip with the best slip",
    )

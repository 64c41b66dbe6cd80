"""The summary on top of a report, for readers of nothing else: what was driven, slip by label, what the ground allows, what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from terragrip.report.blocks import Blocks, Share, shares
from terragrip.report.curves import Maxima, SoilCurves, maxima
from terragrip.report.field_work import PARTS, ROAD, STANDING, WORK
from terragrip.report.page import Section, Table, names, number, percent

SENTENCES = 5
"""Soils of which a sentence stands on top; the table holds all."""


@dataclass(frozen=True)
class Driven:
    """A run in a line: name, duration [s], way [m], clock time of its first row and of its last where the log says it."""

    name: str
    duration: float
    distance: float
    began: datetime | None = None

    @property
    def ended(self) -> datetime | None:
        """Clock time of the last row."""
        return self.began + timedelta(seconds=self.duration) if self.began is not None else None


def section(
    driven: Sequence[Driven],
    blocks: Sequence[Blocks],
    curves: Sequence[SoilCurves] = (),
    tire_resistance: float = 0.0,
    warnings: Mapping[str, int] | None = None,
    missing: Sequence[str] = (),
    simulated: bool = False,
) -> Section:
    """The summary of all runs.

    blocks: of every run, by soil label or by `PARTS`; `warnings`: events by kind that a driver acts on; `missing`: what the logs lack, in
    clauses.
    """
    result = [one for one in shares(blocks) if one.label != STANDING]
    by_part = bool(result) and {one.label for one in result} <= set(PARTS)
    prose = [_driven(driven, simulated), *_slips(result, by_part), *_allowed(curves, result, tire_resistance)]
    if warnings is not None:
        said = names([f"{kind} {count} time{'s' * (count > 1)}" for kind, count in sorted(warnings.items())])
        prose.append(
            f"Warnings: {said}."
            if said
            else "No warning: the vehicle did not dig in, get stuck or get pushed."
        )
    if missing:
        prose.append(f"Missing: {'; '.join(missing)}.")
    content = (by_label(shares(blocks), curves, tire_resistance, by_part),) if result else ()
    return Section("summary", "Summary", tuple(prose), content)


def by_label(
    result: Sequence[Share],
    curves: Sequence[SoilCurves] = (),
    tire_resistance: float = 0.0,
    by_part: bool = False,
) -> Table:
    """Time, way, slip and adhesion with intervals by label, beside what the label's curve allows."""
    peaks = {one.name: (maxima(one.learned.soil, tire_resistance), one.sure) for one in curves}
    adhesion = any(np.isfinite(one.adhesion[0]) for one in result)
    rows = []
    for one in result:
        row = [
            one.label,
            number(one.seconds / 60, 1),
            number(one.metres, 0),
            number(_speed(one), 2),
            _per_cent(one.slip),
        ]
        if adhesion:
            row += [_with_half(one.adhesion), number(one.resistance)]
        if peaks:
            row += _peak(*peaks.get(one.label, (None, False)))
        rows.append(tuple(row))
    head = ["what" if by_part else "label", "time [min]", "way [m]", "speed [m/s]", "slip, 95 % interval"]
    head += ["µ, 95 % interval", "mean ρs"] * adhesion
    head += ["best η", "largest µ"] * bool(peaks)
    said = (
        "Work done, classified from the track: straight passes are work, turns between them headland, much faster stretches road."
        if by_part
        else "By label; transitions (vehicle and tool on different ground) are left out."
    )
    return Table(
        f"{said} Means over the driven wheels and over time, stuck spells left out; the interval covers the scatter of half minutes "
        "and their shared errors (zero of slip, scale of the torques)."
        + (" Best η and largest µ: by the label's curve, and the slip where they lie." if peaks else ""),
        tuple(head),
        tuple(rows),
    )


def clock(runs: Sequence[Driven]) -> str:
    """When the runs were, in words; "" where no log says it."""
    began = sorted(one.began for one in runs if one.began is not None)
    if not began:
        return ""
    ended = max(one.ended for one in runs if one.ended is not None)
    zone = " UTC" if began[0].utcoffset() == timedelta(0) else ""
    same = began[0].date() == ended.date()
    return f"{began[0]:%Y-%m-%d %H:%M} to {ended:{'%H:%M' if same else '%Y-%m-%d %H:%M'}}{zone}"


def _driven(runs: Sequence[Driven], simulated: bool) -> str:
    when = clock(runs)
    return f"Driven{' (simulated)' if simulated else ''}: {extent(runs)}{', ' + when if when else ''}."


def extent(runs: Sequence[Driven]) -> str:
    """How many runs, how long and how far, in words."""
    minutes, metres = sum(one.duration for one in runs) / 60, sum(one.distance for one in runs)
    time = f"{number(minutes, 0 if minutes >= 10 else 1)} minutes"
    return f"{len(runs)} run{'s' * (len(runs) != 1)}, {time}, {number(metres, 0)} m"


def _slips(result: Sequence[Share], by_part: bool) -> list[str]:
    known = [one for one in result if np.isfinite(one.slip[0])][:SENTENCES]
    if not known:
        return []
    where = {WORK: "at work", ROAD: "on the road"}
    said = [
        f"{_per_cent(one.slip)} {where.get(one.label, 'on the headland') if by_part else 'on ' + one.label}"
        for one in known
    ]
    return [f"Mean slip with its 95 % interval: {', '.join(said)}."]


def _allowed(curves: Sequence[SoilCurves], result: Sequence[Share], tire_resistance: float) -> list[str]:
    """Where the best efficiency lies on each soil, beside the slip that was driven."""
    driven = {one.label: one.slip[0] for one in result}
    said = []
    for one in curves[:SENTENCES]:
        at, height = maxima(one.learned.soil, tire_resistance).efficiency
        if not np.isfinite(at) or one.learned.soil.resistance is None:
            continue
        beside = driven.get(one.name, np.nan)
        end = f" (driven at {percent(beside, 0)})" if np.isfinite(beside) else ""
        sure = "" if one.sure else ", a hint only"
        said.append(f"{one.name} {percent(at, 0)} with η {number(height, 2)}{end}{sure}")
    return [f"Best tractive efficiency by each curve at a slip of: {'; '.join(said)}."] if said else []


def _speed(one: Share) -> float:
    return one.metres / one.seconds if one.seconds > 0 else np.nan


def _per_cent(pair: tuple[float, float]) -> str:
    mean, half = pair
    if not np.isfinite(mean):
        return "–"
    return (
        f"{percent(mean)} (too short for an interval)"
        if not np.isfinite(half)
        else f"{number(100 * mean, 1)} ± {number(100 * half, 1)} %"
    )


def _with_half(pair: tuple[float, float]) -> str:
    mean, half = pair
    return number(mean) if not np.isfinite(half) else f"{number(mean)} ± {number(half)}"


def _peak(peaks: Maxima | None, sure: bool) -> list[str]:
    if peaks is None:
        return ["–", "–"]
    return [
        f"{number(h, 2)} at {percent(at, 0)}{'' if sure else ', a hint'}" if at == at else "–"
        for at, h in (peaks.efficiency, peaks.adhesion)
    ]

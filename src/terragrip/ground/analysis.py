"""From a table of estimates to the ground of the drive: changes, soils, sections, events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import Estimates
from terragrip.estimation.provenance import measures
from terragrip.ground.causes import OR_TOOL, Pull, pull_of
from terragrip.ground.changes import LENGTH, Change, changes_of
from terragrip.ground.emissions import Emissions
from terragrip.ground.events import events
from terragrip.ground.online_changes import OnlineChanges
from terragrip.ground.recognition import ForwardFilter, by_soil
from terragrip.ground.result import Ground, Timeline
from terragrip.ground.sections import Stretch, sections_of
from terragrip.ground.signals import GROUND
from terragrip.ground.steps import A_LENGTH
from terragrip.ground.unknown import UNKNOWN
from terragrip.soil.blocks import Blocks, estimates_blocks
from terragrip.soil.estimates import whole_length
from terragrip.soil.library import SoilLibrary
from terragrip.soil.signature import maker
from terragrip.soil.transitions import settled

SURE = 0.5
"""Probability from which a change cuts a section."""


@dataclass(frozen=True)
class Settings:
    """Settings of the analysis. `online`: the results while driving (no future samples); `length` [m]: prior mean distance on one
    ground, for changes; `signals`: the signals in which changes are detected."""

    online: bool = False
    length: float = LENGTH
    signals: tuple[str, ...] = GROUND


def analyse(
    estimates: Estimates, library: SoilLibrary | None = None, run: str = "", settings: Settings | None = None
) -> tuple[Ground, Estimates]:
    """The ground of one drive, and the estimates with the columns `soil_estimate` and `soil_probability`.

    Without a library every soil is "unknown": changes, sections and events only. Raises InputError on a table without the columns
    needed, an empty one, or a damaged library.
    """
    chosen = settings or Settings()
    blocks = estimates_blocks(estimates, file=run or None)
    length = whole_length(estimates.vehicle)
    pull = pull_of(estimates.vehicle, measures(estimates.about, "drawbar_force"))
    changes = _changes(blocks, chosen, length / A_LENGTH, pull)
    emissions = Emissions(library.recognisable if library is not None else {}, maker(estimates), length)
    forward = ForwardFilter(emissions).update(blocks)
    probabilities = by_soil(forward.filtered if chosen.online else forward.smoothed(), emissions.states)
    timeline = Timeline(
        blocks.start, emissions.names, probabilities, blocks.known, block_labels(estimates, blocks)
    )
    stretches = _stretches(estimates, changes, timeline)
    sections = sections_of(estimates, stretches, length)
    soils = _soils(timeline) if emissions.soils else ()
    ground = Ground(
        run,
        float(estimates.time[0]),
        float(estimates.time[-1]),
        soils,
        changes,
        sections,
        events(estimates),
        timeline,
        (
            *_notes(emissions, timeline, len(stretches) - len(sections), library),
            *_tool_notes(changes, pull),
        ),
        {"recording": estimates.about.get("recording", {}), "online": chosen.online},
    )
    return ground, with_columns(estimates, blocks, timeline, chosen.online)


def with_columns(estimates: Estimates, blocks: Blocks, timeline: Timeline, online: bool) -> Estimates:
    """The estimates with `soil_estimate` (the most probable soil) and `soil_probability` (its probability) in every row.

    `online`: a row has the result of the block that ended last before it; else that of its own block.
    """
    soil, best = timeline.soil, timeline.probabilities.max(axis=1)
    if online:
        soil, best = (
            np.concatenate(([UNKNOWN], soil[:-1])).astype(object),
            np.concatenate(([np.nan], best[:-1])),
        )
    return replace(
        estimates,
        columns={**estimates.columns, "soil_probability": np.repeat(best, blocks.rows)},
        labels={**estimates.labels, "soil_estimate": np.repeat(soil, blocks.rows)},
    )


def block_labels(estimates: Estimates, blocks: Blocks) -> NDArray[np.object_]:
    """The recording's label in the middle of each block (blocks,), "" where vehicle and tool are on different soils or there is none."""
    one = settled(estimates["distance"], estimates.soil, whole_length(estimates.vehicle))
    labels = np.where(one, estimates.soil, "")
    middle = np.cumsum(blocks.rows) - blocks.rows // 2 - 1
    return np.asarray(labels[middle], dtype=object)


def _soils(timeline: Timeline) -> tuple[str, ...]:
    """The most probable soils of at least a fiftieth of the blocks with evidence, in the order of their appearance."""
    named = timeline.soil[timeline.known]
    return tuple(name for name in dict.fromkeys(named) if (named == name).mean() >= 0.02)


def _changes(blocks: Blocks, settings: Settings, step: float, pull: Pull) -> tuple[Change, ...]:
    if not settings.online:
        return changes_of(blocks, settings.signals, settings.length, step, pull)
    return tuple(OnlineChanges(step, settings.length, settings.signals, pull).update(blocks))


def _stretches(estimates: Estimates, changes: Sequence[Change], timeline: Timeline) -> list[Stretch]:
    """The drive cut at its changes, each piece with the mean of its blocks' probabilities."""
    cuts = [float(change.time) for change in changes if change.probability >= SURE]
    rows = np.searchsorted(estimates.time, cuts)
    borders = sorted({0, *(int(k) for k in rows if 0 < k < len(estimates)), len(estimates)})
    result = []
    for first, last in pairwise(borders):
        inside = (timeline.time >= estimates.time[first]) & (timeline.time <= estimates.time[last - 1])
        certain = inside & timeline.known if (inside & timeline.known).any() else inside
        if not certain.any():
            certain = np.arange(len(timeline.time)) == max(
                int(np.searchsorted(timeline.time, estimates.time[first])) - 1, 0
            )
        mean = timeline.probabilities[certain].mean(axis=0)
        probabilities = {name: round(float(p), 4) for name, p in zip(timeline.names, mean, strict=True)}
        result.append(Stretch(first, last, probabilities))
    return result


def _notes(
    emissions: Emissions, timeline: Timeline, short: int, library: SoilLibrary | None
) -> tuple[str, ...]:
    notes = list(emissions.notes)
    known = timeline.known
    if library is not None and not emissions.soils:
        notes.append("The library holds no soil, so none is named.")
    if library is not None and library.without_curve:
        names = ", ".join(library.without_curve)
        notes.append(f"The library holds no curve of {names}: recognised by resistance and roughness.")
    if not known.any():
        notes.append(
            "No stretch of the drive shows the ground: the vehicle stands or spins, or rows are flagged or lack values throughout."
        )
    elif emissions.soils and (timeline.soil[known] == UNKNOWN).all():
        notes.append("No soil of the library fits any of the drive: all of it is unknown.")
    elif emissions.soils:
        share = float((timeline.soil[known] == UNKNOWN).mean())
        if share >= 0.01:
            notes.append(
                f"No soil of the library fits {100 * share:.0f} % of the drive: there it is unknown."
            )
    if short:
        notes.append(
            f"{short} stretch{'es' * (short > 1)} between changes {'are' if short > 1 else 'is'} too short for vehicle and tool "
            "to be on together, and not a section."
        )
    if 0 < known.mean() < 0.5:
        notes.append(
            f"Only {100 * known.mean():.0f} % of the drive shows the ground; elsewhere the last soil is assumed."
        )
    return tuple(notes)


def _tool_notes(changes: Sequence[Change], pull: Pull) -> tuple[str, ...]:
    count = sum(change.cause == OR_TOOL for change in changes)
    if not count:
        return ()
    why = (
        "the pull changed more than the resistance."
        if pull == "measured"
        else "without drawbar_force its pull is part of soil_resistance. If nothing is towed, write 'uncertainty: {drawbar_force: 0}' in "
        "the vehicle file and estimate again."
    )
    return (
        f"{count} of {len(changes)} changes may be a tool's, lowered or raised, and not the ground's: {why}",
    )

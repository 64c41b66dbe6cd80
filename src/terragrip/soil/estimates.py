"""Soils from files of estimates: one file, one run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.soil.bins import BinSettings
from terragrip.soil.blocks import Blocks, estimates_blocks
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import Campaign, RunPairs, learn_soils, usable_pairs
from terragrip.soil.signature import maker, with_signatures
from terragrip.soil.transitions import settled

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle


def soils_of(
    files: Sequence[str | os.PathLike[str]],
    curve: AdhesionCurve | None = None,
    bins: Mapping[str, BinSettings] | None = None,
    soil: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Campaign:
    """Learn the soils of estimates files (Parquet, written by `terragrip estimate`).

    `soil`: the name of all rows, for logs without labels. Other arguments as `learn_soils`. Raises InputError on a file that is no table
    of estimates, on one file given twice, and where no row is labelled.
    """
    paths = [Path(file) for file in files]
    twins = [
        path for i, path in enumerate(paths) if path.resolve() in {other.resolve() for other in paths[:i]}
    ]
    if twins:
        raise InputError("is given twice", file=twins[0], mend="name each run once")
    parts: list[RunPairs] = []
    blocks: dict[str, list[Blocks]] = {}
    makers: set[str] = set()
    periods, masses, wheels = [], [], 1
    for number, path in enumerate(paths, 1):
        estimates = Estimates.read(path)
        parts += pairs_of(estimates, path.stem, soil)
        for name, found in labelled_blocks(estimates, soil, os.fspath(path)):
            blocks.setdefault(name, []).append(found)
        makers.add(maker(estimates))
        periods.append(float(np.median(np.diff(estimates.time))) if len(estimates) > 1 else np.nan)
        masses.append(estimates.vehicle.mass)
        wheels = max(wheels, len(estimates.wheels))
        if progress:
            progress(number, len(paths) + 1)
    names = ", ".join(path.name for path in paths[:3]) + (
        f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    )
    campaign = learn_soils(
        parts,
        curve,
        bins,
        float(np.median(masses)),
        float(np.nanmedian(periods)),
        wheels,
        source=f"{len(paths)} runs: {names}",
    )
    plain = {name: learned.soil for name, learned in campaign.soils.items()}
    signed = with_signatures(plain, blocks, makers.pop() if len(makers) == 1 else "several methods")
    learned = {name: replace(one, soil=signed[name]) for name, one in campaign.soils.items()}
    if progress:
        progress(len(paths) + 1, len(paths) + 1)
    return replace(campaign, soils=learned)


def labelled_blocks(estimates: Estimates, soil: str | None, file: str) -> Iterator[tuple[str, Blocks]]:
    """Blocks of one table by soil: those of its rows where vehicle and tool are on that soil, for the library's signatures."""
    labels, length = _labels(estimates, soil), whole_length(estimates.vehicle)
    good = settled(estimates["distance"], labels, length)
    for name in sorted(set(labels[good])):
        yield str(name), estimates_blocks(estimates, good & (labels == name), file)


def pairs_of(estimates: Estimates, run: str, soil: str | None = None) -> list[RunPairs]:
    """Usable pairs of one table: vehicle and tool on one soil, no event; `soil` names all rows."""
    columns = {name: estimates[name] for name in estimates.names} | {"soil": _labels(estimates, soil)}
    return usable_pairs(columns, estimates.wheels, whole_length(estimates.vehicle), run)


def _labels(estimates: Estimates, soil: str | None) -> NDArray[np.object_]:
    if soil is not None:
        return np.full(len(estimates), soil, dtype=object)
    return estimates["soil"] if "soil" in estimates.names else np.full(len(estimates), "", dtype=object)


def whole_length(vehicle: Vehicle) -> float:
    """From the front axle to the end of the tool [m]: over this way vehicle and tool come onto a new soil."""
    return (vehicle.wheelbase or 0.0) + (vehicle.hitch_overhang or 0.0) + (vehicle.tool_length or 0.0)

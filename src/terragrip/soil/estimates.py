"""Soils from files of estimates: one file, one run."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.soil.bins import BinSettings
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import Campaign, RunPairs, learn_soils, usable_pairs


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
    periods, masses, wheels = [], [], 1
    for number, path in enumerate(paths, 1):
        estimates = Estimates.read(path)
        parts += pairs_of(estimates, path.stem, soil)
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
    if progress:
        progress(len(paths) + 1, len(paths) + 1)
    return campaign


def pairs_of(estimates: Estimates, run: str, soil: str | None = None) -> list[RunPairs]:
    """Usable pairs of one table: vehicle and tool on one soil, no event; `soil` names all rows."""
    vehicle = estimates.vehicle
    columns = {name: estimates[name] for name in estimates.names}
    if soil is not None:
        columns["soil"] = np.full(len(estimates), soil, dtype=object)
    elif "soil" not in columns:
        columns["soil"] = np.full(len(estimates), "", dtype=object)
    length = (vehicle.wheelbase or 0.0) + (vehicle.hitch_overhang or 0.0) + (vehicle.tool_length or 0.0)
    return usable_pairs(columns, estimates.wheels, length, run)

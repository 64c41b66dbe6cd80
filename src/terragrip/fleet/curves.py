"""Adhesion curves of a fleet: pooled over all machines, and of each machine alone."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.fleet.store import Store
from terragrip.fleet.task import SAMPLES
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.learn import Campaign

MOST_ROWS = 500_000
"""Rows of all logs that curves are learned from; of more, every second, third and so on is taken."""


@dataclass(frozen=True)
class FleetCurves:
    """``pooled`` over all machines; ``each``: of every machine of several, on its own logs. ``tire_resistance``: the machines' mean."""

    pooled: Campaign
    each: Mapping[str, Campaign]
    tire_resistance: float


def learn_curves(
    store: Store, notes: Sequence[Mapping[str, Any]], progress: Callable[[int, int], None] | None = None
) -> FleetCurves:
    """Learn every labelled soil, from the rows that each log left for it (`LogTally`)."""
    sampled = [note for note in notes if note["sample"]]
    by_machine: dict[str, GatheredRuns] = {}
    tires: dict[str, float] = {}
    rows = sum(note["summary"]["moving_time"] for note in sampled) / 0.2
    every = max(1, int(rows // MOST_ROWS) + 1)
    with tempfile.TemporaryDirectory(prefix="terragrip-fleet-") as folder:
        for number, note in enumerate(sampled, 1):
            machine = str(note["summary"]["vehicle"])
            estimates = _sample(store, note, Path(folder) / "sample.parquet").select(slice(None, None, every))
            by_machine.setdefault(machine, GatheredRuns()).add(estimates, note["log"])
            tires[machine] = float(estimates.vehicle.tire_rolling_resistance or 0.0)
            if progress:
                progress(number, len(sampled) + 1)
    every_run = GatheredRuns()
    for gathered in by_machine.values():
        gathered.blocks = {}  # five rows a second tell no roughness: signatures are for `terragrip soils`
        every_run.join(gathered)
    each = {name: _learned(gathered) for name, gathered in by_machine.items()} if len(by_machine) > 1 else {}
    return FleetCurves(_learned(every_run), each, sum(tires.values()) / max(1, len(tires)))


def _learned(gathered: GatheredRuns) -> Campaign:
    return gathered.learn() if gathered.pairs else Campaign({}, {}, ())


def _sample(store: Store, note: Mapping[str, Any], local: Path) -> Estimates:
    name = f"{SAMPLES}/{note['key']}.parquet"
    if store.is_local:
        return Estimates.read(os.path.join(store.url, name))
    content = store.read(name)
    if content is None:
        raise InputError(
            "is missing", file=f"{store.url}/{name}", hint="remove its note in state/logs and run again"
        )
    local.write_bytes(content)
    return Estimates.read(local)

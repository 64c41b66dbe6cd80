"""Adhesion curves of a fleet: pooled over all machines, and per machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.fleet.store import Store
from terragrip.fleet.task import SAMPLES
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.learn import Campaign

MOST_ROWS = 500_000
"""The most rows that curves are learned from; of more, every second, third ... row is used."""


@dataclass(frozen=True)
class FleetCurves:
    """``pooled``: over all machines. ``each``: per machine, empty if there is only one. ``tire_resistance``: the mean over machines."""

    pooled: Campaign
    each: Mapping[str, Campaign]
    tire_resistance: float


def learn_curves(store: Store, notes: Sequence[Mapping[str, Any]]) -> FleetCurves:
    """Learn every labelled soil from the samples that the logs left (`LogTally`). Raises InputError if a sample is damaged."""
    sampled = [note for note in notes if note["sample"]]
    by_machine: dict[str, GatheredRuns] = {}
    tires: dict[str, float] = {}
    rows = sum(note["summary"]["moving_time"] for note in sampled) / 0.2
    every = max(1, int(rows // MOST_ROWS) + 1)
    for note in sampled:
        machine = str(note["summary"]["vehicle"])
        estimates = _sample(store, note).select(slice(None, None, every))
        # five rows a second do not resolve roughness: signatures need `terragrip soils`
        by_machine.setdefault(machine, GatheredRuns()).add(estimates, note["log"], signatures=False)
        tires[machine] = float(estimates.vehicle.tire_rolling_resistance or 0.0)
    every_run = GatheredRuns()
    for gathered in by_machine.values():
        every_run.join(gathered)
    each = {name: _learned(gathered) for name, gathered in by_machine.items()} if len(by_machine) > 1 else {}
    return FleetCurves(_learned(every_run), each, sum(tires.values()) / max(1, len(tires)))


def _learned(gathered: GatheredRuns) -> Campaign:
    return gathered.learn() if gathered.pairs else Campaign({}, {}, ())


def _sample(store: Store, note: Mapping[str, Any]) -> Estimates:
    import pyarrow as pa
    import pyarrow.parquet as pq

    name = f"{SAMPLES}/{note['key']}.parquet"
    content = store.read(name)
    try:
        if content is not None:
            # read_table would first look for a data set around it, which takes twice the time
            return Estimates.from_arrow(
                pq.ParquetFile(pa.BufferReader(content)).read(), f"{store.url}/{name}"
            )
    except pa.ArrowException:
        pass
    raise InputError(
        "is missing or damaged",
        file=f"{store.url}/{name}",
        hint="remove its note in state/logs and run again",
    )

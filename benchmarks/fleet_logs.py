"""Logs of a small simulated fleet: 60 s at 100 Hz each, cut from a few long runs, and their vehicle files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

SECONDS, RATE = 60, 100
RUNS = ("hard-01", "wet-06", "coarse-09", "multi1", "multi2")


def write_logs(folder: Path, count: int, seed: int = 1) -> Path:
    """``count`` logs as Parquet in ``folder``, each with its own cut and noise; the vehicle's file."""
    from terragrip.simulation import Scenario, simulate

    folder.mkdir(parents=True, exist_ok=True)
    draws = np.random.default_rng(seed)
    tables = [simulate(name, seed).recording.to_pandas().reset_index(drop=True) for name in RUNS]
    rows = SECONDS * RATE
    for number in range(count):
        table = tables[number % len(tables)]
        begin = int(draws.integers(0, max(1, len(table) - rows)))
        part = table.iloc[begin : begin + rows].reset_index(drop=True)
        part["time"] -= part["time"].iloc[0]
        part["ground_speed"] += draws.normal(0.0, 0.005, len(part))
        part.to_parquet(folder / f"log-{number:05d}.parquet", index=False)
    vehicle = folder.parent / "vehicle.yaml"
    Scenario.load("multi2").nominal_vehicle().save(vehicle)
    return vehicle

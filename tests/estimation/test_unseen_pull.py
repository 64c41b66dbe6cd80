"""A pull that no cell measures moves load between the axles: intervals of adhesion hold it, and are as before where it is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.drives import WHEELS, Drive, drive, robot

from terragrip.estimation import Estimates, estimate
from terragrip.vehicle import Vehicle


def without_cell(towing: Drive) -> Drive:
    channels = {n: v for n, v in towing.recording.channels.items() if n != "drawbar_force"}
    return replace(towing, recording=replace(towing.recording, channels=channels))


def held(towing: Drive, estimates: Estimates) -> float:
    """Share of rows, after the first 5 s, whose interval of adhesion holds the truth."""
    late, inside = towing.recording.time > 5, []
    for wheel in WHEELS:
        error = estimates[f"adhesion_{wheel}"] - towing.truth[f"adhesion_{wheel}"]
        inside.append(np.abs(error)[late] < 1.96 * estimates[f"adhesion_{wheel}_std"][late])
    return float(np.mean(inside))


@pytest.mark.parametrize("spread", [0.0, 0.01])
def test_adhesion_holds_where_a_pull_is_not_measured(spread: float) -> None:
    towing = drive(20.0, rate=50.0)  # it pulls a quarter of its weight
    vehicle = robot(uncertainty={"drive_torque_gain": 0.02, "vertical_load": spread})
    assert held(without_cell(towing), estimate(without_cell(towing).recording, vehicle)) > 0.9


def test_a_measured_pull_and_a_vehicle_without_a_hitch_know_their_loads() -> None:
    towing, bare = drive(20.0, rate=50.0), without_cell(drive(20.0, rate=50.0))
    no_hitch: Vehicle = robot(hitch_height=0.0)

    def width(log: Drive, vehicle: Vehicle) -> float:
        return float(np.median(estimate(log.recording, vehicle)["adhesion_fl_std"]))

    assert width(bare, no_hitch) < 1.1 * width(towing, robot()) < 0.5 * width(bare, robot())

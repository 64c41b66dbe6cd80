"""A pull that no cell measures: it moves load between the axles, which intervals of adhesion hold; it looks like soil resistance, and the
vehicle file says how large it may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.drives import WHEELS, Drive, drive, robot

from terragrip.estimation import Estimates, estimate
from terragrip.recording import Recording
from terragrip.recording.checks import NOTHING_TOWED
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

    assert max(width(bare, no_hitch), width(towing, robot())) < 0.2 * width(bare, robot())


def test_a_pull_that_the_file_states_is_in_the_intervals_and_changes_no_estimate() -> None:
    """Nothing in the log tells it from soil resistance: a quarter of the weight made an efficiency of .13 of one of .64."""
    towing = without_cell(drive(20.0, rate=50.0))
    known = {"drive_torque_gain": 0.02}
    silent, stated = (
        estimate(towing.recording, robot(uncertainty=known | pull)) for pull in ({}, {"drawbar_force": 250.0})
    )
    late = towing.recording.time > 5
    for name in ("soil_resistance", "efficiency_rl"):
        np.testing.assert_array_equal(silent[name], stated[name])

        def held(estimates: Estimates, name: str = name) -> float:
            error = np.abs(estimates[name] - towing.truth[name])[late]
            return float(np.mean(error < 1.96 * estimates[f"{name}_std"][late]))

        assert held(silent) < 0.6
        assert held(stated) == 1.0


def test_what_the_file_says_of_a_pull_settles_the_note_and_shows_the_efficiency() -> None:
    towing = without_cell(drive(20.0, rate=50.0))
    silent, nothing, cell = (
        estimate(
            Recording.from_frame(log.to_pandas()), robot(uncertainty={"drawbar_offset": 3.0} | pull)
        ).summary()
        for log, pull in (
            (towing.recording, {}),
            (towing.recording, {"drawbar_force": 0.0}),
            (drive(20.0, rate=50.0).recording, {"drawbar_force": 100.0}),
        )
    )
    assert NOTHING_TOWED in silent
    assert "efficiency  " not in silent
    assert NOTHING_TOWED not in nothing + cell
    assert "efficiency  " in nothing
    assert "drawbar_offset" not in nothing
    assert "drawbar_offset ±3 N" in cell
    assert "drawbar_force" not in cell

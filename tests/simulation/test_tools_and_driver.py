"""Slack tow bars, tools that run up, soft spots and the driver."""

from __future__ import annotations

import numpy as np
import pytest

ROLLER = {"mass": 100, "length": 2.0, "dig_in": 60, "slack": 0.03}


def test_bar_carries_nothing_within_its_play_and_pulls_or_pushes_beyond(quiet, drive):
    trace = drive(quiet(tools=[ROLLER], speed=[[0, 0], [1, 0.8], [4, 0.8], [4.05, 0]], duration=7))
    gap = trace["position"] - 0.10 - trace["tool1_position"] - 2.0
    force = trace["drawbar"]
    loose = np.abs(gap) < 0.015
    assert loose.any()
    assert np.all(force[loose] == 0)
    assert np.all(force[gap > 0.015] >= 0)
    assert np.all(force[gap < -0.015] <= 0)
    assert force[(trace["time"] > 2.5) & (trace["time"] < 4)].mean() == pytest.approx(60, rel=0.05)
    assert force[trace["time"] > 4].min() < -100  # it runs up and pushes


def test_a_stiff_bar_stretches_by_force_over_stiffness(quiet, drive):
    trace = drive(quiet(tools=[ROLLER | {"dig_in": 200}]))
    gap = trace["position"][-1] - 0.10 - trace["tool1_position"][-1] - 2.0
    assert gap == pytest.approx(0.015 + 200 / 4e4, abs=1e-5)


def test_the_second_tool_hangs_on_the_first(quiet, drive):
    trace = drive(quiet(tools=[ROLLER, {"mass": 50, "length": 1.5, "dig_in": 90}]))
    assert trace["bar2"][-1] == pytest.approx(90, rel=1e-3)
    assert trace["drawbar"][-1] == pytest.approx(150, rel=1e-3)


def test_draught_grows_with_speed_and_added_load_lies_in_place(quiet, drive):
    tool = {
        "mass": 60,
        "length": 2.0,
        "dig_in": 100,
        "draught_speed": 0.5,
        "added": [[0, 0], [1, 80], [30, 80]],
    }
    trace = drive(quiet(tools=[tool], duration=12))
    assert trace["tool1_position"][-1] > 1.5
    assert trace["drawbar"][-1] == pytest.approx(180 * (1 + 0.5 * trace["speed"][-1]), rel=1e-3)


def test_reverse(quiet, drive):
    """Backwards: tool pushed away, adhesion and slip positive in the direction of travel."""
    from terragrip.simulation.truth import truth_frame

    trace = drive(quiet(speed=[[0, 0], [1, -0.5]], duration=3))
    truth = truth_frame(trace, trace).iloc[-1]
    assert truth.true_ground_speed < -0.3
    assert truth.true_drawbar_force < -150
    assert truth.true_adhesion_rr > 0.15
    assert truth.true_slip_rr > 0.05
    assert truth.true_soil_resistance == pytest.approx(0.12, rel=1e-3)
    assert not truth.push  # against travel, not against the machine's back


def test_a_vehicle_that_slides_back_is_driven_forward_by_wheels_that_spin_forward(quiet, drive):
    """Too steep for its ground: µ and slip keep the sign that they have on its curve."""
    from terragrip.simulation.truth import truth_frame

    steep = {"segments": [{"soil": "even", "length": 60}], "slope": {"mean": 0.12}}
    slippery = {"even": {"curve": {"name": "exponential", "a": 0.2}, "resistance": 0.01}}
    trace = drive(quiet(soils=slippery, tools=[], route=steep, driver={"acts": False}, duration=3))
    truth = truth_frame(trace, trace).iloc[-1]
    assert truth.true_ground_speed < -0.3
    assert truth.true_slip_rr > 0.1
    assert truth.true_adhesion_rr > 0.09


HOLE = {"at": 3.0, "length": 0.3, "rear": 2.2, "adhesion_loss": 0.2}


def test_stuck_for_good_without_driver(quiet, drive):
    trace = drive(quiet(soft_spots=[HOLE], driver={"acts": False}, duration=20))
    assert np.all(trace["assist"] == 0)
    assert abs(trace["speed"][-1]) < 1e-3
    assert trace["wheel_speed"][-1].mean() * 0.2 > 0.5
    # Everything the wheels give goes into the soil, the tool and nothing else.
    given = (trace["adhesion"][-1] * trace["load"][-1]).sum()
    assert given == pytest.approx(trace.rolling_force[-1].sum() + trace["drawbar"][-1], rel=1e-3)


def test_driver_frees_the_machine_in_order(quiet, drive):
    trace = drive(quiet(soft_spots=[HOLE | {"wear": 2.0}], duration=25))
    mode = trace["driver_mode"].astype(int)
    changes = mode[np.flatnonzero(np.diff(mode)) + 1].tolist()
    assert changes[:3] == [1, 2, 3]
    assert changes[-1] == 0
    assert trace["speed"][-1] > 0.3
    command = trace["command"] * 0.2
    assert command[mode == 1] == pytest.approx(0.6 * 1.4)
    assert command[mode == 2] == pytest.approx(0.6 * 0.5)
    assert 0 < trace["assist"].max() <= 400


def test_the_wheel_sensor_reads_little_or_less_while_torque_is_high(quiet, drive):
    """The paper's outlier (its section on traction estimation; physics.md 7)."""
    trace = drive(
        quiet(tools=[ROLLER | {"slack": 0.015}], soft_spots=[HOLE], driver={"acts": False}, duration=10)
    )
    assert trace["drawbar"].min() < -50
    stuck = trace["time"] > 9
    assert trace["adhesion"][stuck, 3].mean() > 0.25
    assert trace.wheel_force_x[stuck, 3].mean() < 0.0


def test_a_spot_by_time_comes_just_before_the_wheels(quiet, drive):
    trace = drive(quiet(soft_spots=[{"at_time": 4.0, "ahead": 0.25, "length": 0.4, "rear": 0.1}]))
    k = np.searchsorted(trace["time"], 4.0 - 1e-9)
    assert np.isnan(trace["spot1"][k - 1])
    assert trace["spot1"][-1] == pytest.approx(trace["position"][k] + 0.25)
    assert trace["resistance"][:, 1].max() > 0.12 + 0.08
    assert trace["resistance"][:, 0].max() < 0.1201

"""What happens on a drive is told in time, and with its reason."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation import TractionEstimator, estimate
from terragrip.estimation.engine import EVENTS, digging_score, watch_limits
from terragrip.estimation.reference.immobilization import SIGNS, Row, Watch, rows_of
from terragrip.ground.events import events
from terragrip.recording import Recording
from terragrip.simulation import simulate
from terragrip.simulation.soft_spots import healthy_drive, soft_spot_drive


def full_stop(truth):
    """When it first stands with turning wheels [s]."""
    rim = 0.2 * truth[[c for c in truth if c.startswith("true_wheel_speed_")]].mean(axis=1)
    held = (truth["true_ground_speed"] < 0.03) & (rim > 0.15) & (truth["true_distance"] > 6)
    return float(truth["time"][held].iloc[0])


@pytest.fixture(scope="module")
def soft():
    """A drive into a soft spot, without a drawbar cell, and its estimates."""
    result = simulate(soft_spot_drive(1002, drawbar=False))
    return result, estimate(result.recording, result.vehicle)


@pytest.mark.parametrize(("curve", "rate"), [("prototype", 100.0), ("prototype", 10.0), ("peaking", 10.0)])
def test_a_soft_spot_is_warned_of_before_the_vehicle_stands(curve, rate):
    result = simulate(soft_spot_drive(1002, curve, rate=rate, drawbar=False))
    found = events(estimate(result.recording, result.vehicle))
    stop = full_stop(result.truth)
    warned = [e.start for e in found if e.kind == "immobilization" and e.start < stop]
    assert warned
    assert result.truth["true_distance"][result.truth["time"] >= warned[0]].iloc[0] > 6  # not before the spot
    stuck = [e for e in found if e.kind == "stuck"]
    assert len(stuck) == 1
    assert abs(stuck[0].start - stop) < 1.5


def test_hills_hits_and_stops_are_not_called_stuck():
    warned = 0
    for seed in range(1004, 1008):
        result = simulate(healthy_drive(seed, duration=60.0))
        assert not result.truth["stuck"].any()
        kinds = [e.kind for e in events(estimate(result.recording, result.vehicle))]
        assert "stuck" not in kinds
        warned += kinds.count("immobilization")
    assert warned == 0


def told_by(drive):
    """Times at which the twin warns of a drive: slip as it is asked for, at a steady .6 m/s of the rims."""
    watch, found = Watch(watch_limits()), []
    for k in range(3000):
        t, slip, ahead = 0.01 * k, *drive(0.01 * k)
        row = Row(t, slip, 0.01, 0.25 * ahead, 0.25, 0.125 * (1 + ahead), 0.1, 0.6, 0.6 * (1 - slip))
        if watch.take(row) == "immobilization":
            found.append(t)
    return found


def test_slip_that_rises_warns_sooner_where_the_leading_wheels_lose_adhesion():
    def slip(t):
        return 0.06 + min(0.1 * max(t - 25.0, 0.0), 0.8)

    alone = told_by(lambda t: (slip(t), 1.0))
    with_asymmetry = told_by(lambda t: (slip(t), 1 - 0.25 * min(max(t - 25.0, 0.0), 1.0)))
    assert 25 < with_asymmetry[0] < alone[0] - 0.3 < 30


def test_a_steady_drive_and_a_short_hit_are_no_warning():
    assert told_by(lambda t: (0.06, 1.0)) == []
    assert told_by(lambda t: (0.06 + 0.12 * (25 < t < 25.3), 1.0)) == []


def test_a_vehicle_that_stands_at_once_is_stuck_without_a_warning():
    assert told_by(lambda t: (0.06 if t < 25 else 1.0, 1.0)) == []


def test_the_score_rises_with_slip_and_falls_with_grip():
    calm = dict.fromkeys(SIGNS, 0.0) | {"slip": 0.1, "slip_calm": 0.1}
    rng = np.random.default_rng(0)
    for _ in range(200):
        signs = {name: value + rng.normal(0, 0.1) for name, value in calm.items()}
        for name in ("slip", "slip_calm", "slip_rise", "slip_unusual"):
            assert digging_score((signs | {name: signs[name] + 0.1}).values()) >= digging_score(
                signs.values()
            )
        for name in ("asymmetry_change", "asymmetry_level", "asymmetry_unusual", "grip_unusual"):
            assert digging_score((signs | {name: signs[name] + 0.1}).values()) <= digging_score(
                signs.values()
            )


def test_the_reason_names_signals_thresholds_and_values(soft):
    _, table = soft
    found = {e.kind: e for e in events(table)}
    warning = found["immobilization"]
    row = np.searchsorted(table.time, warning.start)
    slip = np.mean([table[f"slip_{w}"][row] for w in table.wheels])
    for part in (
        f"to {slip:.0%}",
        "ground speed",
        "wheels",
        "because",
        "usual",
        f"above {watch_limits()['warn']:g}",
    ):
        assert part in warning.why
    assert "stuck where ground speed stays below 10%" in found["stuck"].why


def test_the_events_are_in_order_and_cover_every_flagged_row(soft):
    _, table = soft
    found = events(table)
    assert [e.start for e in found] == sorted(e.start for e in found)
    for row in np.flatnonzero(table.event_codes):
        kind = EVENTS[table.event_codes[row]]
        assert any(e.kind == kind and e.start <= table.time[row] <= e.end for e in found)


def test_the_kernel_and_its_twin_flag_the_same_rows(soft):
    result, table = soft
    watch = Watch(watch_limits())
    measured = np.isfinite(result.recording.channels["ground_speed"])
    told = [watch.take(row) for row in rows_of(table, measured)]
    assert {"immobilization", "stuck"} <= set(told)
    for ours, kernel in zip(told, table["event"], strict=True):
        if kernel not in ("gap", "standstill"):
            assert ours == (kernel if kernel in ("immobilization", "stuck") else "")


def test_sample_by_sample_and_across_a_snapshot_the_events_are_the_same(soft):
    result, table = soft
    estimator = TractionEstimator.for_recording(result.recording, result.vehicle)
    middle = int(np.argmax(table["event"] == "immobilization")) - 20
    told = []
    for k, row in enumerate(result.recording.to_pandas().to_dict("records")):
        if k == middle:
            estimator = TractionEstimator.restore(estimator.snapshot())
        told.append(estimator.update(row).event)
    assert told == list(table["event"])


def test_a_tool_that_runs_up_is_a_push():
    log = simulate("constant").recording
    channels = dict(log.channels)
    pushed = (log.time >= 20) & (log.time < 21)
    channels["drawbar_force"] = np.where(pushed, -80.0, channels["drawbar_force"])
    vehicle = simulate("constant").vehicle
    found = [
        e for e in events(estimate(Recording(time=log.time, channels=channels), vehicle)) if e.kind == "push"
    ]
    assert len(found) >= 1
    assert 20 <= found[0].start < 20.3
    assert "pushes from behind" in found[0].why


def test_an_empty_table_has_no_events(soft):
    _, table = soft
    none = type(table)(
        table.time[:0], {k: v[:0] for k, v in table.columns.items()}, table.event_codes[:0], {}, table.about
    )
    assert events(none) == ()

"""What happens on a drive is told in time, and with its reason."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation import TractionEstimator, estimate
from terragrip.estimation.engine import EVENTS, watch_limits
from terragrip.estimation.reference.immobilization import Watch
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


def test_a_hit_that_the_vehicle_recovers_from_is_no_warning_and_one_that_it_does_not_is():
    limits = watch_limits()

    def told(recovers):
        watch, flags = Watch(limits), []
        for k in range(1000):
            t = 0.01 * k
            since = max(t - 8.0, 0.0)
            slip = 0.06 + (0.14 * min(since / 0.3, 1.0))
            if recovers and since > 0.3:
                slip = 0.06 + 0.14 * max(1 - (since - 0.3) / 0.6, 0.0)
            elif since > 0.3:
                slip += 0.1 * (since - 0.3)
            flags.append(watch.look(t, slip, 0.01, 0.25, 0.6, 0.6 * (1 - slip)))
        return flags

    assert set(told(recovers=True)) == {""}
    late = told(recovers=False)
    assert 8.0 + limits["duration"] <= 0.01 * late.index("immobilization") < 9.5


def test_the_reason_names_signals_thresholds_and_values(soft):
    _, table = soft
    found = {e.kind: e for e in events(table)}
    warning = found["immobilization"]
    row = np.searchsorted(table.time, warning.start)
    slip = np.mean([table[f"slip_{w}"][row] for w in table.wheels])
    for part in (f"to {slip:.0%}", "ground speed", "wheels", f"{watch_limits()['slip']:.0%}", "adhesion"):
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
    watch, radius = Watch(watch_limits()), float(result.vehicle.wheel_radius[0])
    measured = np.isfinite(result.recording.channels["ground_speed"])
    mean = {
        name: np.mean([table[template.format(w)] for w in table.wheels], axis=0)
        for name, template in {
            "slip": "slip_{}", "sd": "slip_{}_std", "adhesion": "adhesion_{}", "wheel": "wheel_speed_{}",
        }.items()
    }  # fmt: skip
    told = [
        watch.look(t, s, sd, mu, radius * abs(w), v) if seen else None
        for t, s, sd, mu, w, v, seen in zip(
            table.time, mean["slip"], mean["sd"], mean["adhesion"], mean["wheel"], table["ground_speed"], measured,
            strict=True,
        )
    ]  # fmt: skip
    judged = [
        (a, b)
        for a, b in zip(told, table["event"], strict=True)
        if a is not None and b not in ("gap", "standstill")
    ]
    assert {"immobilization", "stuck"} <= {a for a, _ in judged}
    for ours, kernel in judged:
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

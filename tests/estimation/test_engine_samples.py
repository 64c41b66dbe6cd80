"""Engine torque sample by sample: the digits of the whole log, and what is kept of the rows before."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.estimation.engine_estimator import _MAGIC, EngineEstimator, live_estimator, restored
from terragrip.estimation.engine_torque import TAIL
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.sealed import seal, unseal

pytestmark = pytest.mark.usefixtures("unchecked")

NOISE = {
    "ground_speed": 0.02,
    "drawbar_force": 50.0,
    "drive_torque": 100.0,
    "wheel_speed": 0.02,
}


def tractor(**driveline: Any) -> tg.Vehicle:
    axles = {"front": {"mass": 2500, "wheels": ["fl", "fr"]}, "rear": {"mass": 3500, "wheels": ["rl", "rr"]}}
    line = {"efficiency": 0.85, "accessory_power": 8000.0, "reference_torque": 700.0, **driveline}
    base = {
        "mass": 6000,
        "wheelbase": 2.6,
        "center_of_gravity_height": 0.9,
        "hitch_height": 0.5,
        "axles": axles,
    }
    return tg.Vehicle.from_dict({**base, "wheel": {"radius": 0.8, "inertia": 50}, "driveline": line})


def work(share: bool = False) -> tg.Recording:
    """12 s at 10 Hz, 2 m/s by some 100 kW, a gear shift after 6 s, the engine's torque every other row."""
    draws, time = np.random.default_rng(3), 0.1 * np.arange(120)
    ratio = np.where(time < 6, 80.0, 65.0)
    engine = (2.0 + 0.1 * np.sin(time)) / 0.8 * ratio
    torque = np.where(np.arange(120) % 2, np.nan, 100e3 / engine + draws.standard_normal(120))
    told = {"engine_torque_share": torque / 800.0 + 0.08} if share else {"engine_torque": torque}
    if share:
        told["engine_reference_torque"] = np.where(np.arange(120) == 30, 800.0, np.nan)
        told["engine_friction_share"] = np.where(np.arange(120) == 50, 0.08, np.nan)
    noise = 0.01 * draws.standard_normal((2, 120))
    return tg.Recording(
        time,
        {"ground_speed": 2.0 + noise[0], "wheel_based_speed": 2.1 + noise[1], "engine_speed": engine, **told,
         "drawbar_force": np.full(120, 20e3)},
    )  # fmt: skip


def rows_of(log: tg.Recording) -> list[tuple[float, dict[str, float]]]:
    return [(float(t), {n: float(v[k]) for n, v in log.channels.items()}) for k, t in enumerate(log.time)]


def test_samples_give_the_digits_of_the_whole_log_across_a_snapshot() -> None:
    log, vehicle = work(), tractor()
    whole = tg.estimate(log, vehicle, "kalman", sensors=NOISE, held={})
    live = live_estimator(
        vehicle, "kalman", tuple(log.channels), sensors=NOISE, held={}, driveline=whole.about["driveline"]
    )
    assert isinstance(live, EngineEstimator)
    for k, (time, sample) in enumerate(rows_of(log)):
        if k == 70:
            live = restored(live.snapshot())
        estimate = live.update_at(time, sample)
        for name in live.columns:
            np.testing.assert_array_equal(estimate[name], whole[name][k], f"{name}, row {k}")
    assert np.isfinite(whole["adhesion_driven"][20:50]).all()
    assert np.isnan(whole["adhesion_driven"][60:70]).all()  # of the shift


def test_events_are_those_of_the_whole_log() -> None:
    log, vehicle = work(), tractor()
    drives = log.time < 8
    speeds = ("ground_speed", "wheel_based_speed")
    stops = log.with_channels(**{n: np.where(drives, log.channels[n], 0.0) for n in speeds})
    whole = tg.estimate(stops, vehicle, "kalman", sensors=NOISE, held={})
    live = live_estimator(
        vehicle, "kalman", tuple(log.channels), sensors=NOISE, held={}, driveline=whole.about["driveline"]
    )
    events = [live.update_at(time, sample).event for time, sample in rows_of(stops)]
    assert events == whole["event"].tolist()
    assert "standstill" in events


@pytest.mark.parametrize("change", [{}, {"time": -1.0}, {"time": np.nan}, {"engine_speed": np.inf}])
def test_a_refused_sample_leaves_no_row_behind(change: dict[str, float]) -> None:
    """The sample before once more, as of another gear; an earlier one; one of no instant; one that cannot be."""
    log = work()
    rows = rows_of(log)[:44]
    tried, untouched = (
        live_estimator(tractor(), "kalman", tuple(log.channels), sensors=NOISE, held={}) for _ in range(2)
    )
    for time, sample in rows[:41]:
        tried.update_at(time, sample)
        untouched.update_at(time, sample)
    wrong = {**rows[40][1], "time": rows[40][0], "engine_speed": 300.0, **change}
    with pytest.raises(InputError):
        tried.update_at(wrong.pop("time"), wrong)
    for time, sample in rows[41:]:
        assert str(tried.update_at(time, sample).to_dict()) == str(
            untouched.update_at(time, sample).to_dict()
        )


def test_a_bus_may_tell_its_reference_torque_and_friction_late() -> None:
    log = work(share=True)
    live = live_estimator(tractor(), "kalman", tuple(log.channels), sensors=NOISE, held={})
    assert isinstance(live, EngineEstimator)
    seen = []
    for time, sample in rows_of(log):
        live.update_at(time, sample)
        engine = live.machine.engine
        seen.append(
            (engine.reference, round(engine.share, 4), "engine_friction_share" in live.machine.channels)
        )
    assumed, told = round(float(np.hypot(0.02, 0.04)), 4), 0.02
    assert seen[29] == (700.0, assumed, False)
    assert seen[30] == (800.0, assumed, False)
    assert seen[49] == (800.0, assumed, False)
    assert seen[50] == seen[-1] == (800.0, told, True)
    assert "drive_torque_driven" not in live.converted  # of the last row no torque is known
    fixed = EngineEstimator(live.machine, tuple(log.channels), "kalman", sensors=NOISE, held={}, fixed=True)
    fixed.update_at(0.0, {**rows_of(log)[0][1], "engine_reference_torque": 5.0})
    assert fixed.machine.engine.reference == 800.0


def test_other_machines_get_the_plain_estimator() -> None:
    assert (
        type(live_estimator(tractor(), "kalman", ("ground_speed", "wheel_speed_fl"), sensors={}, held={}))
        is TractionEstimator
    )


def test_a_snapshot_holds_the_seconds_that_a_rows_torque_depends_on() -> None:
    log, sizes = work(), {}
    made = live_estimator(tractor(), "kalman", tuple(log.channels), sensors=NOISE, held={})
    for turn in range(3):
        for time, sample in rows_of(log):
            made.update({**sample, "time": time + 12.0 * turn})
        sizes[turn] = len(made.snapshot())
    assert TAIL < 12.0
    assert sizes[2] == pytest.approx(sizes[0], rel=0.01)


def test_a_snapshot_with_another_number_of_channels_is_refused() -> None:
    log = work()
    made = live_estimator(tractor(), "kalman", tuple(log.channels), sensors=NOISE, held={})
    for time, sample in rows_of(log)[:5]:
        made.update({**sample, "time": time})
    about = json.loads(unseal(_MAGIC, made.snapshot()))
    about["given"] = [*about["given"], "pitch"]
    with pytest.raises(InputError, match="snapshot is damaged"):
        restored(seal(_MAGIC, json.dumps(about).encode()))

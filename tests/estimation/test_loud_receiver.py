"""A receiver that is noisier for a part of the drive, as without its correction or its view: slip's interval follows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation import Estimates, TractionEstimator, estimate
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, families

KINDS = [("robot", "saturating", "even"), ("tractor", "sinkage", "plain"), ("light", "brixius", "plain")]


def drawn(kind: tuple[str, str, str], rate: float) -> SimulationResult:
    return families.draw(families.Kind(*kind), 9_870_000, rate=rate)


def with_noise(result: SimulationResult, times: float, begin: float) -> Recording:
    """The log with a ground speed of so many times its noise from a share of the drive on."""
    log = result.recording
    noise = times * result.vehicle.sensors.ground_speed * np.random.default_rng(1).standard_normal(len(log))
    late = log.time > begin * log.time[-1]
    return log.with_channels(ground_speed=np.where(late, log["ground_speed"] + noise, log["ground_speed"]))


def held(result: SimulationResult, estimates: Estimates, begin: float) -> float:
    """Share of moving rows from there on whose slip lies in its 95 % interval, of the driven wheels."""
    time = result.recording.time
    rows = (np.abs(result.truth["true_ground_speed"].to_numpy()) > 0.1) & (time > begin * time[-1])
    vehicle, inside = result.vehicle, []
    for wheel, driven in zip(vehicle.wheels, vehicle.driven, strict=True):
        if driven:
            error = np.abs(estimates[f"slip_{wheel}"] - result.truth[f"true_slip_{wheel}"].to_numpy())
            inside.append((error <= 1.96 * estimates[f"slip_{wheel}_std"])[rows])
    return float(np.mean(inside))


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_slip_is_held_where_the_receiver_is_noisy(kind: tuple[str, str, str], alone: bool) -> None:
    """With eight times the noise slip held in 43 (by speeds alone) to 92 % of the rows there."""
    result = drawn(kind, 20.0)
    log = with_noise(result, 8.0, 0.7)
    if alone:
        channels = {n: v for n, v in log.channels.items() if not n.startswith("drive_torque")}
        log = replace(log, channels=channels)
    assert held(result, estimate(log, result.vehicle), 0.72) > 0.85


def test_it_is_as_sure_as_before_once_the_receiver_is_good_again() -> None:
    result = drawn(KINDS[0], 20.0)
    log, time = result.recording, result.recording.time
    middle = (time > 0.4 * time[-1]) & (time < 0.6 * time[-1])
    noisy = np.where(middle, with_noise(result, 8.0, 0.0)["ground_speed"], log["ground_speed"])
    good, bad = (estimate(one, result.vehicle) for one in (log, log.with_channels(ground_speed=noisy)))
    name = f"slip_{result.vehicle.driven_wheels[0]}_std"
    late = time > 0.7 * time[-1]
    np.testing.assert_allclose(np.nanmedian(bad[name][late]), np.nanmedian(good[name][late]), rtol=0.1)
    assert np.nanmedian(bad[name][middle]) > 1.5 * np.nanmedian(good[name][middle])


def test_what_it_knows_of_the_noise_outlasts_a_restart() -> None:
    result = drawn(KINDS[0], 20.0)
    log = with_noise(result, 8.0, 0.5)
    whole = TractionEstimator.for_recording(log, result.vehicle)
    begun = TractionEstimator.for_recording(log, result.vehicle)
    half = np.arange(len(log)) < 0.8 * len(log)
    begun.update_block(log.select(half))
    rest = TractionEstimator.restore(begun.snapshot()).update_block(log.select(~half))
    name = f"slip_{result.vehicle.driven_wheels[0]}_std"
    np.testing.assert_array_equal(rest[name], whole.update_block(log)[name][~half])

"""Wheel speeds of uneven teeth are noisier than a vehicle file says, and slip less sure than its interval: a note says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from development_machine import machine
from terragrip.recording import Recording, unit_warnings
from terragrip.simulation import SimulationResult, families


def toothed(result: SimulationResult, unevenness: float) -> Recording:
    """The log with each wheel's speed by the time from tooth to tooth of 20, ``unevenness`` (SD) of their spacing unlike."""
    log, rng = result.recording, np.random.default_rng(1)
    channels = dict(log.channels)
    for wheel in result.vehicle.wheels:
        speed = log[f"wheel_speed_{wheel}"]
        spacing = 1.0 + unevenness * rng.standard_normal(20)
        turned = np.cumsum(np.nan_to_num(speed)) * float(np.median(np.diff(log.time)))
        teeth = np.floor(turned * 20 / (2 * np.pi)).astype(int) % 20
        channels[f"wheel_speed_{wheel}"] = speed / spacing[teeth]
    return replace(log, channels=channels)


@pytest.mark.parametrize("number", [1, 14, 20])
def test_uneven_teeth_are_named_as_noise_and_nothing_else_is(number: int) -> None:
    """'In starts and stops ... check the mass' was all that was said, where slip's interval held in 45 % of the rows."""
    result = machine(number)
    (note,) = unit_warnings(toothed(result, 0.06), result.vehicle)
    assert "times what the vehicle file states, as of uneven teeth of an encoder" in note
    assert "'sensors: {wheel_speed: " in note
    assert unit_warnings(toothed(result, 0.0), result.vehicle) == []


def test_the_noise_of_a_coarse_log_is_its_rounding() -> None:
    """The estimator adds that to what is stated by itself."""
    result = machine(7)
    step = 8 * result.vehicle.sensors.wheel_speed
    coarse = {
        n: step * np.round(v / step) if n.startswith("wheel_speed") else v
        for n, v in result.recording.channels.items()
    }
    assert not any(
        "uneven teeth" in note
        for note in unit_warnings(replace(result.recording, channels=coarse), result.vehicle)
    )


def test_speeds_of_another_scale_are_no_noise() -> None:
    """A motor's speed as a wheel's was said to have 'uneven teeth', too: 20 times the noise is 20 times the speed."""
    result = machine(1)
    motors = {n: 20 * v if n.startswith("wheel_speed") else v for n, v in result.recording.channels.items()}
    notes = unit_warnings(replace(result.recording, channels=motors), result.vehicle)
    assert any("times the ground speed: check units, gear ratio and radius" in note for note in notes)
    assert not any("uneven teeth" in note for note in notes)


@pytest.mark.parametrize("held", [False, True])
def test_wheels_at_5_hz_among_faster_channels_move_between_their_samples(held: bool) -> None:
    """The rows of a log at 10 Hz were taken for the wheels' samples: right logs of three machines had 'uneven teeth'."""
    kind = families.Kind("robot", "saturating", "multirate", "rolling")
    result = families.draw(kind, 91007, rate=5.0, task="healthy")
    log = result.recording
    if held:
        last = {
            n: pd.Series(v).ffill().to_numpy() for n, v in log.channels.items() if n.startswith("wheel_speed")
        }
        log = log.with_channels(**last)
    assert not any("uneven teeth" in note for note in unit_warnings(log, result.vehicle))

"""Wheels with few teeth, whose speed is the pulses counted in each row: slip came out as -1.09 ± .01 where it was .1."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from drives import WHEELS, Drive, Floats, drive, robot
from terragrip.errors import InputError
from terragrip.estimation import estimate
from terragrip.formats import Profile
from terragrip.recording import Recording
from terragrip.recording.counted import counted_warnings


def counted(one: Drive, teeth: int) -> Recording:
    """The drive's log with each wheel's pulses counted from row to row."""
    channels, time = dict(one.recording.channels), one.recording.time
    for k, wheel in enumerate(WHEELS):
        angle = 0.3 * k + np.cumsum(channels[f"wheel_speed_{wheel}"] * np.gradient(time))
        pulses = np.floor(angle * teeth / (2 * np.pi))
        channels[f"wheel_speed_{wheel}"] = (
            2 * np.pi / teeth * np.diff(pulses, prepend=pulses[0]) / np.gradient(time)
        )
    return Recording(time, channels)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("teeth", "rate"), [(8, 100.0), (20, 100.0), (8, 10.0)])
def test_counted_pulses_are_refused_with_the_line_that_helps(teeth: int, rate: float) -> None:
    one = drive(90.0, rate=rate)
    log = counted(one, teeth)
    with pytest.raises(InputError, match="pulses counted in each row") as refused:
        estimate(log, robot())
    window = re.search(r"window: [\d.]+ s", str(refused.value))
    assert window is not None
    channels: dict[str, object] = {name: {"from": name} for name in log.channels}
    channels |= {f"wheel_speed_{w}": {"from": f"wheel_speed_{w}", "window": window[0][8:]} for w in WHEELS}
    table = pd.DataFrame({"time": log.time, **log.channels})
    derived = Profile.from_dict({"channels": channels}).apply(table)
    assert counted_warnings(derived) == []
    result = estimate(derived, robot())
    known = np.isfinite(result["slip_rr"]) & (result["event"] == "")
    assert known.mean() > 0.9
    error = (result["slip_rr"] - one.truth["slip_rr"])[known]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.mean(np.abs(error) < 1.96 * result["slip_rr_std"][known]) > 0.88


def stops(time: Floats) -> Floats:
    """Half of the time it stands: an even drive of one speed, to and fro."""
    return np.where(time % 4 < 2, 0.6, 0.0)


def test_stops_zeros_for_what_was_not_there_and_fine_teeth_are_no_counted_pulses() -> None:
    one = drive(60.0)
    time, rims = one.recording.time, {w: one.recording.channels[f"wheel_speed_{w}"] for w in WHEELS}
    gone = {f"wheel_speed_{w}": np.where(np.arange(len(time)) % 3 > 0, 0.0, rim) for w, rim in rims.items()}
    stopping = {f"wheel_speed_{w}": stops(time) / 0.2 for w in WHEELS} | {"ground_speed": stops(time)}
    for changed in (gone, stopping, counted(one, 600).channels):
        assert counted_warnings(Recording(time, {**one.recording.channels, **changed})) == []


def test_the_last_digit_of_a_free_wheel_that_stands_while_others_spin_is_no_counted_pulse() -> None:
    """A simulated machine that was stuck for six minutes: what is at speed, by the ground speed, is a coarse receiver's noise."""
    rng, time = np.random.default_rng(0), np.arange(6000) * 0.01
    free, driven = (0.135 * np.round(rng.normal(mean, 0.1, 6000) / 0.135) for mean in (0.0, 1.75))
    ground = np.where(time < 2, 0.3, np.repeat(0.036 * np.round(rng.normal(0.0, 0.04, 600) / 0.036), 10))
    log = Recording(time, {"ground_speed": ground, "wheel_speed_f": free, "wheel_speed_r": driven})
    assert np.count_nonzero(free) < 0.9 * len(free)
    assert counted_warnings(log) == []


def test_a_derived_speed_is_as_uncertain_as_it_says() -> None:
    """The vehicle file states the sensor's noise; what a profile derives from it may err by more."""
    log = drive(30.0).recording
    derived = Recording(log.time, log.channels, noise={"wheel_speed_rr": 0.2})
    slips = [estimate(one, robot())["slip_rr_std"] for one in (log, derived)]
    assert np.nanmedian(slips[1]) > 1.5 * np.nanmedian(slips[0])

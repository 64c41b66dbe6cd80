"""Wheel speeds by the time between pulses, which keep their last value while the vehicle stands."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.counted import waiting_warnings

TIME = 0.05 * np.arange(2400)
SPEED = np.clip(np.sin(TIME / 5) + 0.4, 0, None)  # stands for 9 s of each 31
NOISE = 0.02 * np.random.default_rng(4).standard_normal((3, len(TIME)))


def log(keeps: bool, digits: int = 6, ground: np.ndarray = SPEED) -> Recording:
    wheels = {}
    for wheel, noise in zip("lr", NOISE, strict=False):
        rim = np.round(5 * SPEED + np.abs(noise) + 0.3, digits)
        last = np.maximum.accumulate(np.where(SPEED > 0, np.arange(len(TIME)), 0))
        wheels[f"wheel_speed_{wheel}"] = rim[last] if keeps else np.where(SPEED > 0, rim, 0.0)
    return Recording(TIME, {"ground_speed": ground + NOISE[2], **wheels})


def test_a_last_pulse_that_is_kept_at_stops_is_named() -> None:
    """15 of 16 simulated machines behind such counters were stuck at ordinary stops, for up to 9 s, without a word."""
    notes = [n for n in unit_warnings(log(True), None) if "for the next pulse" in n]
    assert len(notes) == 1
    assert notes[0].startswith("wheel_speed_l, wheel_speed_r: while the vehicle stands each keeps one value")


@pytest.mark.parametrize(
    "right",
    [
        log(False),
        log(True, digits=1),  # coarse: a wheel that spins evenly keeps a value, too
        log(True, ground=np.ones(len(TIME))),  # held while it drives
    ],
)
def test_others_are_not(right: Recording) -> None:
    assert waiting_warnings(right) == []


def test_a_logger_that_hangs_while_it_rolls_waits_for_no_pulse() -> None:
    """Four wheels kept a value each at one slow place, and a stop was said to look stuck."""
    rng = np.random.default_rng(5)
    rows = np.arange(len(TIME))
    hung = (TIME > 37.0) & (TIME < 39.5)
    last = np.where(hung, np.argmax(hung), rows)
    speed = np.abs(np.sin(TIME / 12)) + 0.02
    wheels = {
        f"wheel_speed_{w}": 5 * speed + 0.01 * rng.standard_normal(len(TIME)) for w in ("fl", "fr", "rl")
    }
    channels = {"ground_speed": speed + 0.001 * rng.standard_normal(len(TIME)), **wheels}
    assert waiting_warnings(Recording(TIME, {n: v[last] for n, v in channels.items()})) == []
    kept = {n: v[last] if n in wheels else v for n, v in channels.items()}
    assert len(waiting_warnings(Recording(TIME, kept))) == 1

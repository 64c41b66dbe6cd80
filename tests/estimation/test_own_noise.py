"""What noise makes of an adhesion is counted once: not as an unseen load besides, and a log's rounding beside the sensor's own."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.drives import WHEELS, Drive, drive, robot

from terragrip.estimation import TractionEstimator, estimate
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("unchecked")

STATED = {"wheel_speed": 0.09, "ground_speed": 0.06, "drive_torque": 3.0, "drawbar_force": 12.0}


def noisy() -> tuple[Drive, Vehicle]:
    """Even ground, and sensors three times as noisy as usual; nothing else is unknown."""
    return drive(40.0, noise=3.0, seed=5), robot(sensors=STATED, uncertainty={})


def test_on_even_ground_the_spread_is_little_more_than_the_error() -> None:
    made, vehicle = noisy()
    estimates, late = estimate(made.recording, vehicle), made.recording.time > 10
    error = np.stack([estimates[f"adhesion_{w}"] - made.truth[f"adhesion_{w}"] for w in WHEELS])[:, late]
    spread = np.stack([estimates[f"adhesion_{w}_std"] for w in WHEELS])[:, late]
    assert np.sqrt(np.mean(spread**2)) < 1.5 * np.std(error)
    assert np.mean(np.abs(error) <= 1.96 * spread) >= 0.95


def rounded(made: Drive, channel: str, step: float) -> Drive:
    """The drive with a channel as multiples of ``step``."""
    values = np.round(made.recording[channel] / step) * step
    return replace(made, recording=made.recording.with_channels(**{channel: values}))


def test_a_rounded_channel_has_both_errors_and_the_others_the_stated_one() -> None:
    made, vehicle = noisy()
    found = TractionEstimator.for_recording(rounded(made, "drive_torque_fl", 6.0).recording, vehicle).noise
    assert found["drive_torque_fl"] == pytest.approx(math.hypot(3.0, 6.0 / math.sqrt(12)))
    assert found["drive_torque_fr"] == pytest.approx(3.0, rel=1e-6)


def test_what_the_call_gives_is_taken_as_it_is() -> None:
    made, vehicle = noisy()
    recording = rounded(made, "drive_torque_fl", 6.0).recording
    estimator = TractionEstimator.for_recording(recording, vehicle, sensors={"drive_torque": 2.0})
    assert estimator.noise["drive_torque_fl"] == 2.0

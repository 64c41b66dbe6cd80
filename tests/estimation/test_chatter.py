"""A wheel that chatters from one sample to the next: its adhesion is not followed, half a sample late, and the interval holds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.estimation.drives import INERTIA, RADIUS, WHEELS, Drive, drive, robot

from terragrip.estimation import estimate

pytestmark = pytest.mark.usefixtures("unchecked")

RATE = 50.0


def chattering(period: float, size: float = 0.5) -> Drive:
    """The drive with wheel speeds that swing by ``size`` [rad/s] with a ``period`` of so many samples, and the adhesions that do that."""
    plain = drive(20.0, rate=RATE)
    angle = 2 * np.pi / period
    phase = angle * np.arange(len(plain.recording.time)) + 0.3
    channels, truth = dict(plain.recording.channels), dict(plain.truth)
    for wheel in WHEELS:
        channels[f"wheel_speed_{wheel}"] = channels[f"wheel_speed_{wheel}"] + size * np.cos(phase)
        load = plain.truth["vertical_load_front" if wheel.startswith("f") else "vertical_load_rear"] / 2
        rate_of_change = -size * angle * RATE * np.sin(phase)
        truth[f"adhesion_{wheel}"] = truth[f"adhesion_{wheel}"] - INERTIA * rate_of_change / (RADIUS * load)
    return replace(plain, recording=replace(plain.recording, channels=channels), truth=truth)


def errors(made: Drive) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Of the adhesions after 5 s (n, wheels): errors, their stated SDs, and what the truth does about its course."""
    estimates, late = estimate(made.recording, robot()), made.recording.time > 5
    calm = drive(20.0, rate=RATE).truth
    error, spread, swing = (
        np.stack(columns, axis=1)[late]
        for columns in (
            [estimates[f"adhesion_{w}"] - made.truth[f"adhesion_{w}"] for w in WHEELS],
            [estimates[f"adhesion_{w}_std"] for w in WHEELS],
            [made.truth[f"adhesion_{w}"] - calm[f"adhesion_{w}"] for w in WHEELS],
        )
    )
    return error, spread, swing


@pytest.mark.parametrize("period", [2.05, 2.2])
def test_chatter_is_not_followed_late_and_the_interval_holds_it(period: float) -> None:
    error, spread, swing = errors(chattering(period))
    assert np.std(error) < 1.03 * np.std(swing)
    assert np.mean(np.abs(error) <= 1.96 * spread) >= 0.9


@pytest.mark.parametrize("period", [4.0, 6.0])
def test_an_oscillation_of_four_samples_and_more_is_followed(period: float) -> None:
    error, _, swing = errors(chattering(period))
    assert np.std(error) < 0.9 * np.std(swing)


def test_white_noise_that_the_file_understates_is_no_chatter() -> None:
    """Four times the stated noise of the wheel speeds: adhesion's spread says nothing of a swing."""
    made = drive(20.0, rate=RATE)
    rng = np.random.default_rng(1)
    noisy = {
        name: made.recording[name] + 0.12 * rng.standard_normal(len(made.recording))
        for name in (f"wheel_speed_{wheel}" for wheel in WHEELS)
    }
    _, spread, _ = errors(replace(made, recording=made.recording.with_channels(**noisy)))
    assert np.mean(spread) < 0.03


def test_two_samples_at_nearly_one_instant_are_no_chatter() -> None:
    """A bus that gives its last frame again, 1 us later with new noise: adhesion's spread stays what it was."""
    plain = drive(20.0, rate=RATE).recording
    time = np.insert(plain.time, 501, plain.time[500] + 1e-6)
    doubled = replace(
        plain, time=time, channels={name: np.insert(c, 501, c[501]) for name, c in plain.channels.items()}
    )
    spread = [estimate(one, robot())["adhesion_fl_std"][520:] for one in (plain, doubled)]
    np.testing.assert_allclose(np.median(spread[1]), np.median(spread[0]), rtol=0.05)
    assert np.max(spread[1]) < 1.5 * np.max(spread[0])

"""Load that a stiff chassis shifts from one diagonal to the other is no adhesion; what axles and sides do differently is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.estimation.drives import MASS, RADIUS, TIRE, WHEELS, Drive, drive, robot

from terragrip.estimation import Estimates, estimate

WEIGHT = MASS * 9.81 / 4
LAYOUT = {"diagonal": (1, -1, -1, 1), "side": (1, -1, 1, -1), "axle": (1, 1, -1, -1)}


def shifted(pattern: str, by: NDArray[np.float64]) -> Drive:
    """The drive with wheel loads that differ by a pattern, ``by`` (n,) of a quarter of the weight; nothing but torque tells."""
    plain = drive(20.0)
    channels = dict(plain.recording.channels)
    for wheel, sign in zip(WHEELS, LAYOUT[pattern], strict=True):
        force = (plain.truth[f"adhesion_{wheel}"] + TIRE) * sign * by * WEIGHT
        channels[f"drive_torque_{wheel}"] = channels[f"drive_torque_{wheel}"] + RADIUS * force
    return replace(plain, recording=replace(plain.recording, channels=channels))


def swing(made: Drive, pattern: str) -> float:
    """SD of the pattern in the estimated adhesions over their mean, after the first 5 s."""
    estimates, late = estimate(made.recording, robot()), made.recording.time > 5
    mu = np.stack([estimates[f"adhesion_{w}"][late] for w in WHEELS])
    return float(np.std(np.array(LAYOUT[pattern]) @ mu / 4) / np.mean(mu))


def bumps(made: Drive) -> NDArray[np.float64]:
    """30 % to and fro, once on four wheel radii of way."""
    return np.asarray(0.3 * np.sin(2 * np.pi * 0.6 * made.recording.time / (4 * RADIUS)))


def test_of_a_diagonals_bumps_little_is_left() -> None:
    by = bumps(drive(20.0))
    assert swing(shifted("diagonal", by), "diagonal") < 0.25 * np.std(by)


@pytest.mark.parametrize("pattern", ["side", "axle"])
def test_sides_and_axles_may_differ_at_once(pattern: str) -> None:
    by = bumps(drive(20.0))
    assert swing(shifted(pattern, by), pattern) > 0.75 * np.std(by)


def test_what_a_diagonal_always_does_is_adhesion() -> None:
    made = shifted("diagonal", np.full(len(drive(20.0).recording.time), 0.1))
    estimates, late = estimate(made.recording, robot()), made.recording.time > 10
    mu = np.stack([estimates[f"adhesion_{w}"][late] for w in WHEELS])
    assert np.mean(np.array(LAYOUT["diagonal"]) @ mu / 4) > 0.09 * np.mean(mu)


def test_the_thrust_of_all_wheels_stays() -> None:
    """Shifted loads keep their sum, so soil resistance and the force of all wheels together are those without bumps."""
    made, plain = shifted("diagonal", bumps(drive(20.0))), drive(20.0)
    with_bumps, without = (estimate(one.recording, robot()) for one in (made, plain))
    late = made.recording.time > 5

    def thrust(estimates: Estimates) -> NDArray[np.float64]:
        mu = np.stack([estimates[f"adhesion_{w}"][late] for w in WHEELS])
        return np.asarray(np.array([27, 27, 42.5, 42.5]) @ mu / MASS)

    assert np.std(thrust(with_bumps) - thrust(without)) < 0.05 * np.mean(thrust(without))


def test_a_diagonal_that_slips_more_is_higher_on_the_curve() -> None:
    """Wheels share a curve: at one torque a wheel that slips more bears less, so that its adhesion is larger."""
    plain = drive(30.0)
    by = 0.03 * np.sin(2 * np.pi * 0.6 * plain.recording.time / (8 * RADIUS))
    channels = dict(plain.recording.channels)
    for wheel, sign in zip(WHEELS, LAYOUT["diagonal"], strict=True):
        channels[f"wheel_speed_{wheel}"] = channels[f"wheel_speed_{wheel}"] * (1 + sign * by)
    made = replace(plain, recording=replace(plain.recording, channels=channels))
    estimates, late = estimate(made.recording, robot()), made.recording.time > 10
    mu, slip = (np.stack([estimates[f"{name}_{w}"][late] for w in WHEELS]) for name in ("adhesion", "slip"))
    pattern, told = (np.array(LAYOUT["diagonal"]) @ one / 4 for one in (mu, slip))
    secant = mu.mean() / slip.mean()
    assert np.corrcoef(pattern, told)[0, 1] > 0.7
    assert 0.2 * secant < np.std(pattern) / np.std(told) < 0.7 * secant

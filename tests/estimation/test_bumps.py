"""Soil resistance: what it really does over a few metres is no error of its estimate, and what bumps do to the estimate is one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.estimation.drives import RADIUS, Drive, drive, robot

from terragrip.estimation import Estimates, estimate

pytestmark = pytest.mark.usefixtures("unchecked")

SPEED, SECONDS = 0.6, 60.0


def steady(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return SPEED + 0.0 * time


def soft(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """A resistance that rises and falls by a fifth over 30 wheel radii."""
    return 0.08 + 0.016 * np.sin(2 * np.pi * SPEED * time / (30 * RADIUS))


def errors_and_spreads(made: Drive, estimates: Estimates) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    late = made.recording.time > 15
    error = estimates["soil_resistance"] - made.truth["soil_resistance"]
    return error[late], estimates["soil_resistance_std"][late]


def test_on_even_ground_a_soil_that_changes_is_followed_and_is_no_error() -> None:
    made = drive(SECONDS, rate=50.0, speed=steady, resistance=soft, imu=True)
    error, spread = errors_and_spreads(made, estimate(made.recording, robot(uncertainty={})))
    assert np.sqrt(np.mean(spread**2)) < 2.2 * np.std(error)
    assert np.mean(np.abs(error) <= 1.96 * spread) >= 0.94


def test_bumps_which_hold_the_wheels_back_are_in_the_interval() -> None:
    """Gradients of ground whose height is correlated over half a radius: no sensor reads them, and soil is what it was."""
    rng = np.random.default_rng(2)
    made = drive(SECONDS, rate=50.0, speed=steady)
    way = np.arange(0.0, 1.2 * SPEED * SECONDS, 0.01)
    length = 0.5 * RADIUS / 0.01  # samples
    kernel = np.exp(-0.5 * (np.arange(-60, 61) / length) ** 2)
    height = np.convolve(rng.standard_normal(len(way)), kernel, "same")
    gradient = np.gradient(height, way)
    gradient *= 0.03 / np.std(gradient)
    rough = drive(
        SECONDS, rate=50.0, speed=steady, resistance=lambda t: 0.08 + np.interp(SPEED * t, way, gradient)
    )
    seen = replace(rough, truth=made.truth)
    error, spread = errors_and_spreads(seen, estimate(rough.recording, robot(uncertainty={})))
    assert np.std(error) > 0.006  # they are seen
    assert np.mean(np.abs(error) <= 1.96 * spread) >= 0.92


def test_the_zero_of_a_drawbar_cell_counts_where_there_is_one() -> None:
    made = drive(30.0, rate=50.0)
    alone = {name: values for name, values in made.recording.channels.items() if name != "drawbar_force"}

    def spread(channels: dict[str, NDArray[np.float64]], offset: float) -> float:
        vehicle = robot(uncertainty={"drawbar_offset": offset}, hitch_height=0.0)
        found = estimate(replace(made.recording, channels=channels), vehicle)
        return float(np.median(found["soil_resistance_std"][1000:]))

    assert spread(made.recording.channels, 30.0) > 0.02  # of a weight of 1363 N
    assert spread(alone, 30.0) == spread(alone, 0.1)

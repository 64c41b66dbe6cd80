"""Stretches of track without a label: what their slips have in common is no curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation.calibration import calibrate, radii
from terragrip.simulation import Scenario, simulate
from terragrip.vehicle import Vehicle
from window_table import LOAD, stating, table

N = 200


def rolled(vehicle: Vehicle, label: str, seed: int) -> radii.Rolling:
    """Level ground without a pull, firm and soft by turns every 40 m: soft soil asks for .08 of thrust at C = 5, firm for .03 at C = 12."""
    draws = np.random.default_rng(seed)
    soft = np.arange(N) // 20 % 2 == 1
    adhesion = np.where(soft, 0.08, 0.03)[:, None] * np.ones(4) + 0.004 * draws.standard_normal((N, 1))
    slip = -0.6 / np.where(soft, 5.0, 12.0)[:, None] * np.log1p(-adhesion / 0.6)
    omega = 1 / 0.2 / (1 - slip) * (1 + 0.003 * draws.standard_normal((N, 1)))
    data = table(
        N, length=2.0, wheel_speed=omega, torque=0.2 * LOAD * (adhesion + 0.02) + 0.2 * 2.0 * omega,
        drawbar=np.zeros(N), soil=np.full(N, label, dtype=object),
    )  # fmt: skip
    found = radii.rolling_radii(data, vehicle, np.arange(N) // 5, ["log"])
    assert isinstance(found, radii.Rolling)
    return found


def test_soft_soil_that_asks_for_more_thrust_makes_no_curve(vehicle: Vehicle) -> None:
    """With a label the two soils count as one curve (three times too flat): the radius is .4 to .6 % too large, three to seven SDs."""
    sure = stating(vehicle, drive_torque_offset=0.01, drive_torque_gain=0.01)
    for seed in range(4):
        found, one = rolled(sure, "", seed), rolled(sure, "field", seed)
        assert abs(found.radius[0] / 0.2 - 1) < 2 * found.std[0]
        assert one.radius[0] / 0.2 - 1 > 3 * one.std[0]
        assert found.std[0] > 1.5 * one.std[0]


@pytest.mark.parametrize("seed", [0, 1])
def test_rows_are_whitened_for_an_offset_that_a_stretch_shares(seed: int) -> None:
    """Products of the rows are those with (I + σ² u uᵀ)⁻¹, and the offset is its best estimate."""
    draws = np.random.default_rng(seed)
    rows, effect = draws.normal(size=(12, 2, 3)), draws.normal(size=(12, 2))
    stretch, std = np.repeat([0, 1, 2], 4), np.array([0.0, 0.3, 2.0])
    found, offset = radii._less_offsets(rows, effect, stretch, std)
    for label in range(3):
        own, u = rows[stretch == label].reshape(-1, 3), effect[stretch == label].ravel()
        inverse = np.linalg.inv(np.eye(len(u)) + std[label] ** 2 * np.outer(u, u))
        white = found[stretch == label].reshape(-1, 3)
        np.testing.assert_allclose(white.T @ white, own.T @ inverse @ own, atol=1e-10)
        assert offset[label] == pytest.approx(std[label] ** 2 * u @ inverse @ own[:, -1])


def test_stretches_are_twenty_metres_or_a_fortieth_of_the_way() -> None:
    data = table(60, soil=np.array([""] * 50 + ["clay"] * 10, dtype=object))
    stretch = radii._stretches(data)
    np.testing.assert_array_equal(stretch[:50], 1 + np.arange(50) // 20)
    assert (stretch[50:] == 0).all()
    far = table(4000, length=1.0)
    assert radii._stretches(far).max() in (40, 41)


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", [1, 3])
def test_a_soil_that_lasts_for_half_a_log_without_labels_is_in_the_interval(seed: int) -> None:
    """Hard ground, then grass, on which it takes more and slips more (simulation; the radius is .2 m): one curve through both made .2052 m
    of it, surely. With labels it is right."""
    drive = {
        "name": "two soils",
        "vehicle": "innok-heros-444",
        "route": {
            "segments": [{"soil": "hard", "length": 45}, {"soil": "grass", "length": 75}],
            "slope": {"sd": "0.6 deg", "length": 8},
        },
        "tools": [],
        "speed": [
            [0, "off"],
            [8, 0],
            [9, 0.5],
            [60, 0.5],
            [61, 0.8],
            [100, 0.8],
            [101, 0.6],
            [150, 0.6],
            [151, 0],
        ],
        "sensors": {"use": "robot"},
        "duration": 152,
    }
    result = simulate(Scenario.from_dict(drive), seed)
    for labels, sure in (({}, False), (result.recording.labels, True)):
        found = calibrate(replace(result.recording, labels=labels), result.vehicle)
        radii = [quantity for quantity in found.quantities if quantity.key == "wheel_radius"]
        assert bool(radii) or not sure
        assert all(low < 0.2 < high for low, high in (quantity.interval for quantity in radii))

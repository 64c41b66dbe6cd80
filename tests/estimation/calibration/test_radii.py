"""Rolling radii from zero-pull passes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from terragrip.estimation import calibrate
from terragrip.estimation.calibration.radii import WINDOW, Rolling, rolling_radii
from terragrip.estimation.calibration.result import Unknown
from terragrip.estimation.calibration.windows import windows
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from window_table import table

pytestmark = pytest.mark.usefixtures("unchecked")

WHEELS = ("fl", "fr", "rl", "rr")
Make = Callable[..., Recording]


def free_pass(
    drive: Make, radius: float, seed: int = 0, noise: float = 0.0, slip: float = 0.013
) -> Recording:
    """Nothing towed: the wheels pull the vehicle's own resistance alone (slip 1.3 %, adhesion 0.06)."""
    # The conftest's rims turn at the nominal radius: a larger wheel drives faster at the same slip.
    rim = 1 - (1 - slip) * radius / 0.2
    log = drive(60, radius=radius, slip=(rim, rim), resistance=0.0, seed=seed, noise=noise)
    return log.with_channels(drawbar_force=4 * noise * np.random.default_rng(seed).standard_normal(len(log)))


def test_the_radius_comes_out_with_the_slip_taken_off(drive: Make, vehicle: Vehicle) -> None:
    logs = [free_pass(drive, 0.206), drive(120, radius=0.206, slip=(0.0, 0.25))]
    result = calibrate(logs, vehicle)
    for wheel in WHEELS:
        quantity = result[f"wheel_radius {wheel}"]
        assert quantity.value == pytest.approx(0.206, rel=1e-3)
        low, high = quantity.interval
        assert low < 0.206 < high
        assert quantity.std < 0.004 * 0.206
    # Without the correction it would be 1.3 % off.
    assert "slip of 1." in result["wheel_radius fl"].sentence
    assert result.apply(vehicle).wheel_radius == pytest.approx([0.206] * 4, rel=1e-3)


def test_intervals_of_the_radius_hold(drive: Make, vehicle: Vehicle) -> None:
    z = []
    for seed in range(5):
        logs = [
            free_pass(drive, 0.197, seed, noise=1.0),
            drive(120, radius=0.197, slip=(0.0, 0.25), seed=seed, noise=1.0, patches=0.05),
        ]
        quantity = calibrate(logs, vehicle)["wheel_radius rl"]
        z.append((quantity.value - 0.197) / (quantity.factor * quantity.std))
    assert np.all(np.abs(z) < 1)


def test_a_pass_alone_keeps_the_curve_open_and_says_so_in_the_interval(drive: Make, vehicle: Vehicle) -> None:
    alone = calibrate(free_pass(drive, 0.2), vehicle)["wheel_radius fl"]
    both = calibrate([free_pass(drive, 0.2), drive(120, slip=(0.0, 0.25))], vehicle)["wheel_radius fl"]
    assert alone.interval[0] < 0.2 < alone.interval[1]
    assert alone.std > 2 * both.std
    # A vehicle file knows no degrees of freedom: it gets the width of the interval.
    low, high = alone.interval
    assert alone.spread == pytest.approx((high - low) / 2 / 1.96, rel=1e-3)


def test_a_wheel_with_a_radius_of_its_own(drive: Make, vehicle: Vehicle) -> None:
    odd = [0.2, 0.2, 0.2, 0.201]
    logs = [free_pass(drive, 0.2), drive(240, radius=odd, slip=(0.0, 0.3), standing=10)]
    result = calibrate(logs, vehicle)
    ratio = result["wheel_radius rr"].value / result["wheel_radius rl"].value
    assert 1.003 < ratio < 1.007


def test_a_radius_vaguer_than_the_vehicle_file_is_left_out(drive: Make, vehicle: Vehicle) -> None:
    logs = [free_pass(drive, 0.2), drive(120, slip=(0.0, 0.25))]
    data = vehicle.to_dict()
    data["uncertainty"] = {**data["uncertainty"], "wheel_radius": 1e-5}
    result = calibrate(logs, Vehicle.from_dict(data))
    assert "wheel_radius fl" not in result
    assert result.apply(vehicle).wheel_radius == pytest.approx([0.2] * 4, rel=0)
    assert any(u.name == "wheel_radius" and "the vehicle file states" in u.why for u in result.unknown)


def test_gains_that_the_file_knows_better_move_no_radius(drive: Make, vehicle: Vehicle) -> None:
    data = vehicle.to_dict()
    data["uncertainty"] = {**data["uncertainty"], "drive_torque_gain": 1e-6}
    logs = [free_pass(drive, 0.2), drive(120, radius=[0.2, 0.2, 0.2, 0.201], slip=(0.0, 0.3))]
    result = calibrate(logs, Vehicle.from_dict(data))
    assert "drive_torque_gain rr" not in result
    assert result["wheel_radius rr"].value == result["wheel_radius rl"].value
    assert "over slip" not in result["wheel_radius rr"].sentence


def test_without_a_zero_pull_pass_there_is_a_reason(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(drive(120, slip=(0.1, 0.3)), vehicle)
    assert "wheel_radius fl" not in result
    assert any(u.name == "wheel_radius" and "zero pull" in u.why for u in result.unknown)


def test_driven_wheels_that_always_pull_hard_have_no_radius(vehicle: Vehicle) -> None:
    """Nothing is towed, but on soft ground the driven axle pushes the other one as hard all along."""
    data = vehicle.to_dict()
    data["axles"]["front"]["driven"] = False
    torque = np.array([0.0, 0.0, 30.0, 30.0]) * np.ones((60, 1))
    passes = table(60, slip=0.0, drawbar=np.zeros(60), torque=torque)
    result = rolling_radii(passes, Vehicle.from_dict(data), np.arange(60), [""])
    assert isinstance(result, Unknown)
    assert result.why == "no zero-pull window has a plausible adhesion"


def test_a_soil_without_a_zero_pull_pass_says_nothing(drive: Make, vehicle: Vehicle) -> None:
    """Work on a third soil, whose curve no pass at zero pull ties to a radius, moves neither radius nor interval."""
    logs = []
    for k, soil in enumerate("ac"):
        free = free_pass(drive, 0.2, k)
        logs += [Recording(free.time, free.channels, {"soil": np.full(len(free), soil, dtype=object)})]
        logs += [drive(40, slip=(0.0, 0.25), soil=soil, seed=k)]
    worked = drive(40, slip=(0.12, 0.18), radius=0.19, soil="b")

    def rolling(logs: list[Recording]) -> Rolling:
        table = windows(logs, vehicle, WINDOW)
        stretch = 1000 * table.recording + np.floor(table.position[:, 0] / 4.0).astype(int)
        result = rolling_radii(table, vehicle, stretch, [""] * len(logs))
        assert isinstance(result, Rolling)
        return result

    alone, beside = rolling(logs), rolling([*logs, worked])
    np.testing.assert_allclose(beside.radius, alone.radius, rtol=1e-9)
    np.testing.assert_allclose(beside.std, alone.std, rtol=1e-9)


def test_unequal_radii_leave_what_is_known_of_the_machine(drive: Make, vehicle: Vehicle) -> None:
    unequal = dict(zip(WHEELS, (0.94, 1.0, 1.0, 1.03), strict=True))

    def worn(log: Recording) -> Recording:
        """A wheel of k times the radius turns 1/k times as fast, by k times the torque."""
        speeds = {f"wheel_speed_{w}": log[f"wheel_speed_{w}"] / k for w, k in unequal.items()}
        return log.with_channels(
            **speeds, **{f"drive_torque_{w}": log[f"drive_torque_{w}"] * k for w, k in unequal.items()}
        )

    data = vehicle.to_dict()
    vehicle = Vehicle.from_dict({**data, "uncertainty": {**data["uncertainty"], "wheel_radius": 0.05}})
    for seed in range(4):
        logs = [
            free_pass(drive, 0.2, seed, noise=1.0),
            drive(240, slip=(0.0, 0.25), seed=seed, noise=1.0, patches=0.05, standing=10),
        ]
        logs = [log.with_channels(angular_velocity_z=np.zeros(len(log))) for log in logs]
        equal, result = (calibrate(these, vehicle) for these in (logs, [worn(log) for log in logs]))
        known, own = ([c[f"wheel_radius {wheel}"] for wheel in WHEELS] for c in (equal, result))
        common = [
            q.value / k / before.value for q, k, before in zip(own, unequal.values(), known, strict=True)
        ]
        assert np.mean(common) == pytest.approx(1.0, abs=0.3 * known[0].std / known[0].value)

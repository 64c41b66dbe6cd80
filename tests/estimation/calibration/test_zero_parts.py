"""Zeros, windows and loads of a calibration, step by step, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.estimation.calibration.windows import Windows, wheel_loads, windows
from terragrip.estimation.calibration.zeros import drawbar_zero, inclination_zeros, torque_zeros
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from window_table import LOAD, stating, stopped

WHEELS = ("fl", "fr", "rl", "rr")


@pytest.mark.parametrize(("reads", "known"), [(0.9, False), (0.85, True), (-0.85, True)])
def test_a_torque_zero_is_less_than_three_of_its_errors(vehicle: Vehicle, reads: float, known: bool) -> None:
    """The vehicle states .29 N m; a twentieth of the torque of driving, 10, is .5."""
    windows = stopped((0, 10), (20, 30))
    torque = np.where(windows.ground_speed[:, None] == 0, reads, 10.0) * np.ones(4)
    found, unknown = torque_zeros(
        replace(windows, torque=torque), stating(vehicle, drive_torque_offset=0.29), ["a"], 0.1
    )
    assert [q.wheel for q in found] == (list(WHEELS) if known else [])
    assert len(unknown) == (0 if known else 4)
    assert all(q.value == pytest.approx(reads) for q in found)
    assert all(f"reads {reads:.2f} N m" in u.why for u in unknown)
    idle = replace(windows, torque=torque * [[1, 1, 1, 0]])
    vague = torque_zeros(
        replace(idle, torque=np.where(torque == 10, 20.0, torque)), stating(vehicle), ["a"], 0.1
    )[0]
    assert len(vague) == 4  # a twentieth of 20 is 1


@pytest.mark.parametrize(("reads", "source"), [(13.0, "stops"), (14.5, "free"), (-14.5, "free")])
def test_a_bar_is_slack_below_a_hundredth_of_the_weight(vehicle: Vehicle, reads: float, source: str) -> None:
    """13.7 N; where it is more, driving in which it does not move says more, if that is less."""
    windows = stopped((0, 10))
    bar = np.where(windows.ground_speed == 0, reads, 4.0)
    (zero,), unknown = drawbar_zero(replace(windows, drawbar=bar), stating(vehicle), ["a"], 1.0)
    assert zero.value == pytest.approx(reads if source == "stops" else 4.0)
    assert ("the bar is slack" in zero.sentence) is (source == "stops")
    assert not unknown
    stated = drawbar_zero(replace(windows, drawbar=bar), stating(vehicle, drawbar_offset=5.0), ["a"], 1.0)[0]
    assert stated[0].value == pytest.approx(reads)
    taut = drawbar_zero(
        replace(windows, drawbar=np.where(bar == 4.0, 50.0, bar)), stating(vehicle), ["a"], 1.0
    )
    assert (not taut[0] and f"it reads {reads:.1f} N" in taut[1][0].why) is (source == "free")
    for nothing in (np.zeros(40), np.full(40, np.nan)):
        assert drawbar_zero(replace(windows, drawbar=nothing), vehicle, ["a"], 1.0)[0] == []


def inclined(reads: float, pitch: float | None = None, apart: float = 40.0) -> Windows:
    windows = stopped((0, 10), (15, 26))
    windows = replace(
        windows, position=windows.position * apart / (windows.position[15] - windows.position[0])
    )
    more = {} if pitch is None else {"pitch": np.full(40, pitch)}
    return replace(windows, acceleration=np.full(40, reads), acceleration_count=np.full(40, 25.0), **more)


@pytest.mark.parametrize("pitch", [None, 0.01])
@pytest.mark.parametrize("stated", [{}, {"slope": 0.02, "acceleration_bias": 0.05}])
def test_what_an_accelerometer_rests_at_is_split_by_the_priors(
    vehicle: Vehicle, pitch: float | None, stated: dict[str, float]
) -> None:
    """Stops in two places, 18 windows of 25 samples with noise of .1: bias over 9.8 slope, or over 9.8 times the pitch sensor's zero."""
    reads = 0.12
    found, unknown = inclination_zeros(inclined(reads, pitch), stating(vehicle, **stated), ["a"], 0.1)
    total = reads - (0.0 if pitch is None else GRAVITY * np.sin(pitch))
    own = stated.get("acceleration_bias", 0.3)
    other = GRAVITY * (
        stated.get("slope", np.radians(0.5)) / np.sqrt(2) if pitch is None else np.radians(0.2)
    )
    share, error = own**2 / (own**2 + other**2), 0.1 / np.sqrt(450)
    left = own * other / np.hypot(own, other)
    assert found[0].key == "acceleration_bias_x"
    assert found[0].value == pytest.approx(share * total)
    assert found[0].std == pytest.approx(np.hypot(share * error, left))
    if pitch is None:
        assert [u.name for u in unknown] == ["pitch_offset"]
    else:
        assert found[1].value == pytest.approx(-(1 - share) * total / GRAVITY)
        assert found[1].std == pytest.approx(np.hypot((1 - share) * error, left) / GRAVITY)


@pytest.mark.parametrize(("apart", "places"), [(15.0, 1), (25.0, 2)])
@pytest.mark.parametrize(("reads", "own"), [(0.3, 0.1), (0.5, 0.3)])
def test_a_bias_beyond_three_priors_is_of_an_unknown_mounting_or_hill(
    vehicle: Vehicle, reads: float, own: float, apart: float, places: int
) -> None:
    """An outsider's machines that began each log on one slope had biases .49 and .31 m/s² off, stated to .09 and .07: three stops in one
    place counted as three slopes, and what the stated slope did not explain as a bias alone."""
    other = (GRAVITY * 0.01 if own == 0.1 else 0.3) / np.sqrt(places)
    ((bias,), _) = inclination_zeros(
        inclined(reads, apart=apart), stating(vehicle, slope=0.01, acceleration_bias=0.1), ["a"], 0.1
    )
    assert bias.value == pytest.approx(reads * own**2 / (own**2 + other**2))
    assert bias.std == pytest.approx(own * other / np.hypot(own, other), rel=0.01)


def test_stops_of_two_logs_may_be_in_one_place(vehicle: Vehicle) -> None:
    windows = replace(inclined(0.1), recording=np.repeat([0, 1], [12, 28]))
    ((bias,), _) = inclination_zeros(
        windows, stating(vehicle, slope=0.01, acceleration_bias=0.1), ["a", "b"], 0.1
    )
    assert bias.value == pytest.approx(0.1 * 0.1**2 / (0.1**2 + (GRAVITY * 0.01) ** 2))


def test_windows_are_means_rates_and_hubs(vehicle: Vehicle) -> None:
    """Three windows of 2 s at 10 Hz: speed 1 + t/10, wheels at 5 v, turning left at .2 rad/s on a slope of .1."""
    time = 100.0 + 0.1 * np.arange(60)
    speed = 1.0 + 0.1 * (time - 100.0)
    channels = {"ground_speed": speed, "pitch": np.full(60, 0.1), "angular_velocity_z": np.full(60, 0.2)}
    channels |= {f"wheel_speed_{w}": 5.0 * speed for w in WHEELS}
    channels |= {
        f"drive_torque_{w}": np.where(np.arange(60) % (k + 1) == 0, 10.0 + k, np.nan)
        for k, w in enumerate(WHEELS)
    }
    data = windows(
        [Recording(time, channels, {"soil": np.repeat(np.array(["a", "b"], object), [25, 35])})], vehicle, 2.0
    )
    mean = np.array([1.095, 1.295, 1.495])
    np.testing.assert_allclose(data.ground_speed, mean)
    np.testing.assert_allclose(data.start, [100.0, 102.0, 104.0])
    np.testing.assert_allclose(data.wheel_acceleration, 0.5)
    np.testing.assert_allclose(data.kinematic_push, 0.1 + GRAVITY * np.sin(0.1))
    np.testing.assert_allclose(data.push, data.kinematic_push)
    np.testing.assert_allclose(data.hub_speed, mean[:, None] + 0.2 * 0.25 * np.array([-1, 1, -1, 1]))
    np.testing.assert_allclose(data.position, 2 * np.cumsum(mean)[:, None] - [0.0, 0.0, 0.6, 0.6])
    np.testing.assert_array_equal(data.torque_count, [5, 5, 5])  # of the wheel with the fewest
    np.testing.assert_array_equal((data.count, data.drawbar_count), ([20, 20, 20], [0, 0, 0]))
    np.testing.assert_allclose(data.torque, [[10.0, 11.0, 12.0, 13.0]] * 3)
    assert data.soil.tolist() == ["a", "", "b"]
    assert np.all(data.drawbar == 0)
    measured = Recording(time, {**channels, "acceleration_x": np.where(time < 102, 0.7, np.nan)})
    np.testing.assert_allclose(windows([measured], vehicle, 2.0).push, [0.7, *data.push[1:]])
    again = windows([Recording(time, channels)] * 2, vehicle, 2.0)
    assert again.recording.tolist() == [0, 0, 0, 1, 1, 1]


def test_a_window_without_rows_has_no_soil(vehicle: Vehicle) -> None:
    time = np.array([0.0, 1.0, 5.0])
    channels = {"ground_speed": np.ones(3)} | {f"wheel_speed_{w}": np.ones(3) for w in WHEELS}
    channels |= {f"drive_torque_{w}": np.ones(3) for w in WHEELS}
    data = windows([Recording(time, channels, {"soil": np.array(["a", "a", "b"], object)})], vehicle, 2.0)
    assert data.soil.tolist() == ["a", "", "b"]
    np.testing.assert_array_equal(data.count, [2, 0, 1])


def test_no_wheel_goes_below_a_fiftieth_of_its_static_load(vehicle: Vehicle) -> None:
    one, tall = (
        np.ones(1),
        Vehicle.from_dict({**vehicle.to_dict(), "center_of_gravity_height": 0.3, "hitch_height": 0.25}),
    )
    loads = [
        wheel_loads(tall, drawbar=0 * one, push=push * one, slope=0 * one, spin_torque=0 * one, lateral=side * one,
                    measured=np.full((1, 2), np.nan))[0]
        for push, side in ((0.0, 0.0), (20.0, 0.0), (0.0, 20.0), (0.0, 1.0))
    ]  # fmt: skip
    np.testing.assert_allclose(loads[0], LOAD)
    np.testing.assert_allclose(loads[1][:2], 0.02 * LOAD[:2])
    np.testing.assert_allclose(loads[2][[0, 2]], 0.02 * LOAD[[0, 2]])
    lean = 0.3 / 0.5 / GRAVITY  # of an axle's load, from left to right
    np.testing.assert_allclose(loads[3], LOAD * (1 + 2 * lean * np.array([-1, 1, -1, 1])), rtol=1e-6)

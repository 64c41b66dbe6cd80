"""The torque scale: a factor common to all wheels, from mass and drawbar."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.estimation import identify_torque_scale
from terragrip.estimation.calibration.torque_scale import _Balance, _jackknife, _window_length
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.simulation import simulate
from terragrip.vehicle import Vehicle

Make = Callable[..., Recording]


def test_from_the_drawbar(drive: Make, vehicle: Vehicle) -> None:
    scale = identify_torque_scale(drive(gain=0.8), vehicle)
    assert scale.value == pytest.approx(0.8, rel=0.01)
    assert scale.interval[0] < 0.8 < scale.interval[1]
    # Resistance that might grow with slip is considered: no drawbar tells a scale to a per cent.
    assert 0.01 < scale.std < 0.06


def test_soils_that_no_label_tells_apart_do_not_make_it_sure_and_wrong() -> None:
    """A tool that pulls harder where the wheels sink deeper, on four grounds: the scale is 1, and came out as 1.4 to 1.5."""
    result = simulate("multi1", 31)
    bare = Recording(result.recording.time, dict(result.recording.channels))
    scale = identify_torque_scale(bare, result.vehicle)
    assert scale.interval[0] < 1 < scale.interval[1]
    assert "'soil' column" in scale.sentence


def test_loads_that_each_last_for_half_a_minute_are_not_told_from_soils_without_a_label(
    vehicle: Vehicle,
) -> None:
    """On one soil, but nothing says so: the reason and its fix are told, and the label suffices."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 300.0, 0.05)
    pull = np.repeat(rng.uniform(50.0, 400.0, 10), 600)
    omega = 1 / (0.98 - pull / (140 * GRAVITY * 4)) / 0.2
    wheel = (pull / 4 + (0.06 + 0.02) * 35 * GRAVITY + 2 * omega) * 0.2
    channels = {"ground_speed": np.ones(len(t)), "drawbar_force": pull}
    for name in ("fl", "fr", "rl", "rr"):
        channels |= {f"wheel_speed_{name}": omega, f"drive_torque_{name}": wheel}
    noisy = {
        name: values + 0.01 * np.mean(values) * rng.standard_normal(len(t))
        for name, values in channels.items()
    }
    with pytest.raises(InputError, match=r"soils of unlike resistance.*constant: field"):
        identify_torque_scale(Recording(t, noisy), vehicle)
    one = Recording(t, noisy, labels={"soil": np.full(len(t), "field", dtype=object)})
    scale = identify_torque_scale(one, vehicle)
    assert scale.value == pytest.approx(1.0, abs=0.02)
    assert "soil" not in scale.sentence


def hilly(rng: np.random.Generator, scale: float, *, push_noise: float, pitch_noise: float) -> Recording:
    """A free vehicle over hills: torque in an unknown unit, accelerometer and pitch each with slow errors."""
    t = np.arange(0.0, 400.0, 0.05)

    def slow(spread: float) -> np.ndarray:
        nodes = np.arange(0.0, 404.0, 4.0)
        return np.interp(t, nodes, spread * rng.standard_normal(len(nodes)))

    slope = slow(0.04)
    v = 1.0 + slow(0.2)
    a = np.gradient(v, t)
    force = 140 * (a + GRAVITY * np.sin(slope)) + 0.08 * 140 * GRAVITY + 4 * 2 * v / 0.2
    omega = v / 0.2 / 0.97
    spin = 4 * 0.15 * np.gradient(omega, t) / 0.2
    torque = scale * (force + spin) * 0.2 / 4
    channels = {
        "ground_speed": v,
        "acceleration_x": a + GRAVITY * np.sin(slope) + slow(push_noise),
        "pitch": slope + slow(pitch_noise),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        channels[f"wheel_speed_{wheel}"] = omega
        channels[f"drive_torque_{wheel}"] = torque
    return Recording(t, channels)


def test_a_scale_whose_interval_holds_nothing_is_not_told(drive: Make, vehicle: Vehicle) -> None:
    """A mild drive on a slope that nobody knows: 1.8 +- 9 was a result."""
    log = drive(gain=0.8)
    told = identify_torque_scale(log, vehicle)
    unsure = Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": {"drawbar_gain": 0.6}})
    assert told.interval[0] > 0
    with pytest.raises(InputError, match="only: an interval that includes 0"):
        identify_torque_scale(log, unsure)


def test_two_measures_of_the_push_undo_each_others_errors(vehicle: Vehicle) -> None:
    z, direct = [], []
    for seed in range(12):
        log = hilly(np.random.default_rng(seed), 0.05, push_noise=0.4, pitch_noise=0.04)
        scale = identify_torque_scale(log, vehicle)
        z.append((scale.value - 0.05) / scale.std)
        alone = Recording(log.time, {n: x for n, x in log.channels.items() if n != "pitch"})
        direct.append(identify_torque_scale(alone, vehicle).value)
    # The accelerometer alone, as noisy as the signal, would halve the scale.
    assert np.mean(direct) < 0.035
    assert abs(np.mean(z)) < 0.8
    assert np.mean(np.abs(z) < 2) >= 0.9


def test_stale_torques_do_not_bend_it(vehicle: Vehicle) -> None:
    log = hilly(np.random.default_rng(3), 12.0, push_noise=0.0, pitch_noise=0.0)
    latest = np.arange(len(log)) // 20 * 20  # fresh once a second
    stale = log.with_channels(
        **{name: x[latest] for name, x in log.channels.items() if name.startswith("drive_torque")}
    )
    scale = identify_torque_scale(stale, vehicle)
    assert scale.interval[0] < 12.0 < scale.interval[1]
    assert scale.value == pytest.approx(12.0, rel=0.05)


def test_reverse_counts_too(vehicle: Vehicle) -> None:
    log = hilly(np.random.default_rng(4), 1.0, push_noise=0.0, pitch_noise=0.0)
    odd = ("ground_speed", "wheel_speed_", "drive_torque_", "acceleration_x", "pitch")
    back = log.with_channels(**{n: -x for n, x in log.channels.items() if n.startswith(odd)})
    both = identify_torque_scale([log, back], vehicle)
    assert both.value == pytest.approx(1.0, abs=0.02)
    assert both.samples == pytest.approx(2 * identify_torque_scale(log, vehicle).samples, rel=0.02)
    assert [part.source for part in both.evidence] == [
        log.source or "recording 1",
        back.source or "recording 2",
    ]


def test_it_refuses_what_tells_nothing(drive: Make, vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="too few"):
        identify_torque_scale(drive(10), vehicle)
    rng = np.random.default_rng(0)
    log = hilly(rng, 1.0, push_noise=0.5, pitch_noise=0.05)
    shuffled = log.with_channels(pitch=np.roll(log["pitch"], 3000))
    with pytest.raises(InputError, match="an interval that includes 0"):
        identify_torque_scale(shuffled, vehicle)
    flat = {"ground_speed": 1.0, "acceleration_x": 0.0, "pitch": 0.0}
    calm = log.with_channels(**{name: np.full(len(log), value) for name, value in flat.items()})
    with pytest.raises(InputError, match="do not vary"):
        identify_torque_scale(calm, vehicle)


def test_a_window_spans_two_updates_of_the_slowest_torque() -> None:
    """Other channels may be slower: no window waits for them."""
    time = np.arange(0.0, 60.0, 0.1)

    def every(rows: int) -> np.ndarray:
        return np.where(np.arange(len(time)) % rows == 0, 1.0, np.nan)

    quick = Recording(time, {"drive_torque_l": every(2), "ground_speed": every(100)})
    slow = Recording(time, {"drive_torque_l": every(2), "drive_torque_r": every(15)})
    once = Recording(time, {"drive_torque_l": every(2), "drive_torque_r": every(10_000)})
    assert _window_length([quick]) == 1.0
    assert _window_length([quick, slow]) == pytest.approx(3.0)
    assert _window_length([once]) == 1.0
    twice = np.full(len(time), np.nan)
    twice[[0, 40]] = 1.0
    assert _window_length([Recording(time, {"drive_torque_l": twice})]) == pytest.approx(8.0)


def test_a_gain_of_the_drawbar_and_a_slope_that_nothing_measures_widen_the_interval(
    drive: Make, vehicle: Vehicle
) -> None:
    log = drive(gain=0.8, slip=(0.02, 0.18))  # all windows count

    def std(**known: float) -> float:
        data = vehicle.to_dict()
        data["uncertainty"] = {**data["uncertainty"], **known}
        return identify_torque_scale(log, Vehicle.from_dict(data)).std / 0.8

    exact = std(drawbar_gain=0.0, slope=0.0)
    assert np.sqrt(std(drawbar_gain=0.03, slope=0.0) ** 2 - exact**2) == pytest.approx(0.03, rel=0.02)
    assert std() == pytest.approx(
        std(drawbar_gain=0.01, slope=float(np.radians(0.5))), rel=1e-9
    )  # unless stated
    one, two = (np.sqrt(std(drawbar_gain=0.0, slope=x) ** 2 - exact**2) for x in (0.01, 0.02))
    assert two == pytest.approx(2 * one, rel=1e-6)
    # 0.3 of the slope's force goes with the pull: over the spread of pull and acceleration
    force = log["drawbar_force"] + 140 * np.gradient(log["ground_speed"], log.time)
    assert one == pytest.approx(0.3 * 140 * GRAVITY * 0.01 / float(np.std(force)), rel=0.05)
    level = log.with_channels(pitch=np.zeros(len(log)))
    data = {
        **vehicle.to_dict(),
        "uncertainty": {**vehicle.to_dict()["uncertainty"], "drawbar_gain": 0.0, "slope": 0.1},
    }
    assert identify_torque_scale(level, Vehicle.from_dict(data)).std / 0.8 == pytest.approx(exact, rel=0.05)


def test_the_inertia_of_the_wheels_is_a_loss_by_itself(vehicle: Vehicle) -> None:
    """Starts and stops on level ground; to spin the wheels up takes as much as to move the vehicle: 4 J/r² = m."""
    data = vehicle.to_dict()
    data["wheel"] = {**data["wheel"], "inertia": 140.0 / 4 * 0.2**2}
    t = np.arange(0.0, 200.0, 0.05)
    v = 1.5 + 0.8 * np.sin(t / 4)
    omega = v / 0.2
    force = 2 * 140 * np.gradient(v, t) + 0.08 * 140 * GRAVITY + 4 * 2.0 * omega
    channels = {"ground_speed": v}
    for wheel in ("fl", "fr", "rl", "rr"):
        channels |= {f"wheel_speed_{wheel}": omega, f"drive_torque_{wheel}": 0.7 * force * 0.2 / 4}
    scale = identify_torque_scale(Recording(t, channels), Vehicle.from_dict(data))
    assert scale.value == pytest.approx(0.7, rel=0.02)  # rates of windows of a second


def test_of_a_short_log_two_windows_at_a_time_are_left_out() -> None:
    """24 windows whose errors come in pairs: the jackknife of twelve lines without a pair each."""
    rng = np.random.default_rng(14)
    force = rng.normal(0, 100, 24)
    thrust = 0.8 * force + np.repeat(rng.normal(0, 20, 12), 2)
    rows = _Balance(thrust, np.zeros(24), force, force, np.ones((24, 1)), np.zeros(24), True, np.zeros(24))
    keep = [np.delete(np.arange(24), [2 * k, 2 * k + 1]) for k in range(12)]
    slopes = [np.polyfit(force[rest], thrust[rest], 1)[0] for rest in keep]
    expected = np.sqrt(11 / 12 * np.sum((slopes - np.mean(slopes)) ** 2))
    assert _jackknife(rows, np.ones(24)) == pytest.approx(expected, rel=1e-9)


def graded(seed: int, *, growth: float, pulled: float) -> Recording:
    """Hills on which the resistance goes with the grade (.08 + growth sinθ), and a bar whose pull changes by ``pulled`` of the weight."""
    rng = np.random.default_rng(seed)
    log = hilly(rng, 1.0, push_noise=0.05, pitch_noise=0.003)
    nodes = np.arange(0.0, 408.0, 8.0)
    pull = 140 * GRAVITY * np.interp(log.time, nodes, np.abs(pulled * rng.standard_normal(len(nodes))))
    more = 140 * GRAVITY * growth * np.sin(log["pitch"]) + pull
    torques = {n: x + more * 0.2 / 4 for n, x in log.channels.items() if n.startswith("drive_torque")}
    return log.with_channels(drawbar_force=pull, **torques)


@pytest.mark.parametrize("growth", [-0.2, 0.0, 0.2])
def test_resistance_that_goes_with_the_grade_does_not_make_it_sure_and_wrong(
    vehicle: Vehicle, growth: float
) -> None:
    """Without a pull the grade alone tells the scale, and the interval says so; a pull that changes tells it."""
    for seed in range(4):
        alone = identify_torque_scale(graded(seed, growth=growth, pulled=0.0), vehicle)
        assert alone.interval[0] < 1.0 < alone.interval[1]
        assert "level ground" in alone.sentence
        pulling = identify_torque_scale(graded(seed, growth=growth, pulled=0.15), vehicle)
        assert pulling.interval[0] < 1.0 < pulling.interval[1]
        assert pulling.std < 0.6 * alone.std


@pytest.mark.parametrize("without", [(), ("acceleration_x",), ("acceleration_x", "pitch"), ("pitch",)])
def test_braking_that_is_shorter_than_the_windows_does_not_make_it_larger(
    vehicle: Vehicle, without: tuple[str, ...]
) -> None:
    """From .6 m/s up to 4.2 in 6 s and down in one or two, without end: it was 1.3 to 1.6, with pitch sure of it."""
    t = np.arange(0.0, 160.0, 0.01)
    for smooth in (0.3, 1.0):
        many = max(1, round(smooth / 0.01))
        phase = np.arange(-2.0, 162.0, 0.01) % 7.0
        saw = np.where(phase < 6.0, 0.6 + 0.6 * phase, 4.2 - 3.6 * (phase - 6.0))
        v = np.convolve(saw, np.full(many, 1 / many), "same")[200 : 200 + len(t)]
        a, omega = np.gradient(v, t), v / 0.2 / 0.97
        force = 140 * a + 150.0 + 0.08 * 140 * GRAVITY + 0.02 * 140 * GRAVITY + 4 * 2.0 * omega
        torque = (force + 4 * 0.15 * np.gradient(omega, t) / 0.2) * 0.2 / 4
        rng = np.random.default_rng(1)
        channels = {
            "ground_speed": v + 0.02 * rng.standard_normal(len(t)),
            "drawbar_force": 150.0 + 4.0 * rng.standard_normal(len(t)),
            "acceleration_x": a + 0.1 * rng.standard_normal(len(t)),
            "pitch": 0.002 * rng.standard_normal(len(t)),
        }
        for wheel in ("fl", "fr", "rl", "rr"):
            channels[f"wheel_speed_{wheel}"] = omega + 0.03 * rng.standard_normal(len(t))
            channels[f"drive_torque_{wheel}"] = torque + rng.standard_normal(len(t))
        log = Recording(t, {name: values for name, values in channels.items() if name not in without})
        scale = identify_torque_scale(log, vehicle)
        assert scale.value == pytest.approx(1.0, abs=0.06)
        assert scale.interval[0] < 1.0 < scale.interval[1]

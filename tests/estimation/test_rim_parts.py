"""Rims, noise, and what a log without torques tells, step by step, on signals whose every number is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import terragrip as tg
from rear_tractor import G, tractor
from terragrip._kernel import lib
from terragrip.errors import InputError
from terragrip.estimation.noise import channel_noise, sensor_of
from terragrip.estimation.rims import (
    DRIVE,
    Rim,
    at_zero,
    calibrated_scale,
    rims_of,
    slots_in,
    slots_out,
    speed_settings,
    speeds_alone,
    supposed_radius,
)
from terragrip.estimation.settings import Thresholds
from terragrip.estimation.slip_only import (
    _dead_band,
    _notes,
    slip_reference_in,
)
from terragrip.estimation.zero_slip import REMEDY, Zero
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

TIME = np.arange(0.0, 60.0, 0.5)


def test_wheels_with_a_speed_are_rims_with_the_radii_of_the_file() -> None:
    rims = rims_of(tractor(), ("ground_speed", "wheel_speed_rr", "wheel_speed_fl"))
    assert [(r.wheel, r.channel, r.scale, r.radius, r.spread, r.side) for r in rims] == [
        ("fl", "wheel_speed_fl", 1.0, 0.5, 0.02, 0.8), ("rr", "wheel_speed_rr", 1.0, 0.8, 0.02, -0.8),
    ]  # fmt: skip
    known = tractor(uncertainty={"wheel_radius": 0.004})
    assert rims_of(known, ("wheel_speed_fl",))[0].spread == 0.004
    with pytest.raises(InputError, match=r"column wheel_speed_x.*no wheel x.*fl, fr, rl, rr"):
        rims_of(tractor(), ("wheel_speed_x",), "l.csv")


def test_a_drive_trains_speed_is_one_rim_of_the_driven_wheels() -> None:
    (rim,) = rims_of(tractor(), ("wheel_based_speed",))
    assert rim == Rim(DRIVE, "wheel_based_speed", 0.8, 0.8, 0.03, 0.0, True)
    assert rims_of(tractor(uncertainty={"wheel_radius": 0.01}), ("wheel_based_speed",))[0].spread == 0.01
    calibrated = tractor(calibration={"wheel_radius": {"rl": 0.84, "rr": 0.76 * 1.1}})
    scale = (0.84 + 0.76 * 1.1) / 1.6
    assert calibrated_scale(calibrated) == pytest.approx(scale)
    (rim,) = rims_of(calibrated, ("wheel_based_speed",))
    assert (rim.scale, rim.radius, rim.spread) == (0.8, pytest.approx(0.8 * scale), 0.02)
    assert calibrated_scale(tractor(calibration={"wheel_radius": {"rl": 0.84}})) is None
    bare = {"mass": 6000, "wheelbase": 2.8, "center_of_gravity_height": 1.0,
            "axles": {"front": {"mass": 2500, "wheels": ["fl"]}, "rear": {"mass": 3500, "wheels": ["rl"]}}}  # fmt: skip
    unknown = Vehicle.from_dict(bare)
    assert (supposed_radius(unknown), calibrated_scale(unknown)) == (1.0, None)
    assert not rims_of(unknown, ("wheel_based_speed",))[0].has_radius
    gained = Vehicle.from_dict({**bare, "calibration": {"wheel_based_speed_gain": 1.25}})
    assert calibrated_scale(gained) == pytest.approx(0.8)
    zero = at_zero(rim, Zero(0.5, 0.01, 9))
    assert (zero.radius, zero.spread) == (pytest.approx(0.4 * scale), 0.01)


@pytest.mark.parametrize(
    ("channels", "alone"),
    [
        (("wheel_based_speed", "ground_speed"), True), (("wheel_speed_rl", "ground_speed"), True), (("ground_speed",), False),
        (("wheel_speed_rl",), False), (("wheel_speed_rl", "ground_speed", "drive_torque_rl"), False),
    ],
)  # fmt: skip
def test_speeds_stand_alone_where_no_torque_does(channels: tuple[str, ...], alone: bool) -> None:
    assert speeds_alone(channels, tractor()) is alone
    data = tractor().to_dict()
    data["axles"]["rear"]["driven"] = False
    assert not speeds_alone(channels, Vehicle.from_dict(data))


def test_settings_and_columns_of_rims() -> None:
    rims = rims_of(tractor(), ("wheel_speed_rl", "wheel_speed_fr"))
    noise = {
        "wheel_speed_rl": 0.3, "wheel_speed_fr": 0.2, "ground_speed": 0.05, "angular_velocity_z": 0.01, "ground_speed_delay": 0.15,
    }  # fmt: skip
    s = speed_settings(
        tractor(),
        rims,
        noise=noise,
        held={"ground_speed": 0.2},
        thresholds=Thresholds(gap=7.0),
        dead_band=0.3,
    )
    assert (s.machine.wheels, s.machine.mass) == (2, 6000.0)
    assert [s.rolling_radius[i] for i in (0, 1)] == [0.5, 0.8] == [s.machine.radius[i] for i in (0, 1)]
    assert [s.wheel_share[i] for i in (0, 1)] == [0.5, 0.5]
    assert [s.wheel_side[i] for i in (0, 1)] == [-0.8, 0.8]
    assert [(s.wheel_axle[i], bool(s.powered[i])) for i in (0, 1)] == [(0, False), (1, True)]
    assert [s.noise[lib.TG_WHEEL_SPEED + i] for i in (0, 1)] == [0.2, 0.3]
    assert (s.noise[lib.TG_GROUND_SPEED], s.noise[lib.TG_YAW_RATE], s.dead_band, s.gap) == (
        0.05,
        0.01,
        0.3,
        7.0,
    )
    assert (s.held_period[lib.TG_GROUND_SPEED], s.held_period[lib.TG_WHEEL_SPEED]) == (0.2, 0.0)
    assert s.uncertainty.wheel_radius == 0.02
    assert s.ground_speed_delay == 0.15
    assert s.watch.warn == pytest.approx(2 / 3 * lib.tg_default_settings().watch.warn)
    drive = rims_of(tractor(), ("wheel_based_speed",))
    s = speed_settings(
        tractor(),
        drive,
        noise={**noise, "wheel_based_speed": 0.4},
        held={},
        thresholds=Thresholds(),
        dead_band=0.0,
    )
    assert (s.gain[lib.TG_WHEEL_SPEED], s.noise[lib.TG_WHEEL_SPEED]) == (0.8, 0.5)
    assert slots_in(rims) == {
        "wheel_speed_fr": lib.TG_WHEEL_SPEED, "wheel_speed_rl": lib.TG_WHEEL_SPEED + 1, "ground_speed": lib.TG_GROUND_SPEED,
        "angular_velocity_z": lib.TG_YAW_RATE,
    }  # fmt: skip
    slots = slots_out(rims)
    for name, first in (
        ("wheel_speed", lib.TG_OUT_WHEEL_SPEED),
        ("slip", lib.TG_OUT_SLIP),
        ("zero_slip_radius", lib.TG_OUT_ZERO_SLIP_RADIUS),
    ):
        assert [slots[f"{name}_{w}"] for w in ("fr", "rl")] == [first, first + 1]
        assert f"{name}_rl_std" in slots
    assert slots["slip_rl_std"] == lib.TG_OUT_SLIP_STD + 1
    assert len(set(slots.values())) == len(slots)
    bare = slots_out([replace(drive[0], has_radius=False)])
    assert "slip_drive" in bare
    assert not any(name.startswith(("wheel_speed", "zero_slip")) for name in bare)


def test_wheels_that_stand_for_several_shift_loads_less() -> None:
    plain = lib.tg_default_settings()
    for together, memory in ((1, plain.tuned.uneven_memory), (4, 1e9)):
        from terragrip._kernel import ffi

        s = ffi.new("tg_settings *", plain)
        given = {} if together == 1 else {"together": together}  # a wheel stands for itself
        Thresholds(standstill_speed=0.25, **given).put(s)
        assert s.tuned.uneven_memory == memory
        assert (s.standstill_speed, s.gap) == (0.25, plain.gap)


def test_noise_of_a_channel_is_given_stated_or_guessed_from_the_size() -> None:
    vehicle = tractor(sensors={"ground_speed": 0.07})
    channels = ("wheel_speed_rl", "ground_speed", "drive_torque_rl", "drawbar_force", "acceleration_y", "roll", "angular_velocity_z",
                "mass", "hitch_load", "vertical_load_rear", "wheel_based_speed", "pitch")  # fmt: skip
    noise, guessed = channel_noise(vehicle, channels, {"drawbar_force": 9.0, "pitch": 0.5})
    radius, weight = 0.65, 6000 * G
    expected = {
        "wheel_speed_rl": 0.02 / radius, "ground_speed": 0.07, "drive_torque_rl": 0.01 * weight * radius, "drawbar_force": 9.0,
        "acceleration_y": 0.3, "roll": 0.5, "angular_velocity_z": 0.01, "mass": 60.0, "hitch_load": 0.02 * weight,
        "vertical_load_rear": 0.02 * weight, "wheel_based_speed": 0.02, "pitch": 0.5,
        "ground_speed_delay": 0.0,
    }  # fmt: skip
    assert noise == pytest.approx(expected)
    assert set(guessed) == set(channels) - {"ground_speed", "drawbar_force", "roll", "pitch"}
    assert channel_noise(vehicle, ("wheel_speed_rl",), {"wheel_speed": 0.5, "wheel_speed_rl": 0.25})[0] == {
        "wheel_speed_rl": 0.25,
        "ground_speed_delay": 0.0,
    }
    assert [sensor_of(n) for n in ("vertical_load_rear", "acceleration_x", "altitude")] == [
        "vertical_load",
        "acceleration",
        "altitude",
    ]
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="noise of pitch is"):
            channel_noise(vehicle, channels, {"pitch": wrong})
    with pytest.raises(InputError, match=r"no sensor 'pich'.*did you mean pitch"):
        channel_noise(vehicle, channels, {"pich": 1.0})


def log_of(**channels: np.ndarray) -> Recording:
    return Recording(100.0 + TIME, channels)


RIMS = rims_of(tractor(), ("wheel_speed_rl", "wheel_speed_rr"))


@pytest.mark.parametrize(
    ("rows", "slow", "band"), [(4, 0.4, 0.0), (5, 0.4, 0.4), (20, 0.7, 0.5), (20, 0.09, 0.0)]
)
def test_rims_that_read_zero_while_the_vehicle_moves_have_a_dead_band(
    rows: int, slow: float, band: float
) -> None:
    still = np.arange(120) < rows
    ground = np.where(still, -slow, 2.0)
    ground[3] = np.nan
    speeds = {"wheel_speed_rl": np.where(still, 0.0, 2.5), "wheel_speed_rr": np.where(still, np.nan, 2.5)}
    result, count = _dead_band(log_of(ground_speed=ground, **speeds), RIMS)
    assert (result, count) == (pytest.approx(band), rows if band else 0)
    turning = {**speeds, "wheel_speed_rr": np.full(120, 2.5)}
    assert _dead_band(log_of(ground_speed=ground, **turning), RIMS) == (0.0, 0)
    once = np.where(np.arange(120) == 50, 2.0, np.nan)
    assert _dead_band(log_of(ground_speed=once, **speeds), RIMS) == (0.0, 0)
    assert _dead_band(log_of(ground_speed=np.full(120, np.nan), **speeds), RIMS) == (0.0, 0)


REST = "from 12 windows of the lightest work (the vehicle file says 0.8000 m)"


def test_where_slip_counts_from_is_said_of_wheel_and_drive() -> None:
    wheel = RIMS[0]
    drive = Rim(DRIVE, "wheel_based_speed", 0.8, 0.82, 0.03, 0.0)
    zero = Zero(0.975, 0.0025, 12)
    assert _notes(wheel, None, False) == []
    assert _notes(drive, None, True)[0].endswith(
        "slip counts from the speed that the machine reports, to about 3%."
    )
    assert _notes(wheel, zero, False) == [
        "Zero-slip radius of wheel rl in this log: 0.7800 ± 0.0020 m, "
        + REST
        + ". Slip counts from the file's; 'terragrip calibrate' takes this one."
    ]
    assert _notes(drive, zero, True) == [
        "Zero-slip radius of the drive in this log: 0.7800 ± 0.0020 m, " + REST + ". Slip counts from there."
    ]
    assert "(before calibration 0.8000 m)." in _notes(drive, zero, False)[0]
    assert _notes(replace(drive, has_radius=False), replace(zero, doubt="why"), True) == [
        "Zero-slip ground speed in this log: 0.9750 ± 0.0025 of the speed that the machine reports, from 12 windows of the "
        "lightest work; why."
    ]


def test_a_remedy_is_told_once_and_a_drives_speed_beside_wheels_is_not_used() -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    speeds = {f"wheel_speed_{w}": 2.0 * wave / r for w, r in (("rl", 0.8), ("rr", 0.8))}
    log = log_of(ground_speed=2.0 * wave, wheel_based_speed=2.0 * wave, **speeds)
    reference = slip_reference_in(log, tractor())
    assert sum(REMEDY in note for note in reference.notes) == 1
    assert sum("radius of wheels rl, rr in this log" in note for note in reference.notes) == 1
    assert any("wheel_based_speed is not used" in note for note in reference.notes)
    assert [rim.radius for rim in reference.rims] == [0.8, 0.8]  # the file's stand
    drive = slip_reference_in(log_of(ground_speed=1.96 * wave, wheel_based_speed=2.0 * wave), tractor())
    assert drive.rims[0].radius == pytest.approx(0.98 * 0.8, rel=1e-6)
    assert drive.zero[DRIVE].ratio == pytest.approx(0.98)
    own = {"calibration": {"wheel_radius": {"rl": 0.81, "rr": 0.81}}}
    kept = slip_reference_in(log_of(ground_speed=1.96 * wave, wheel_based_speed=2.0 * wave), tractor(**own))
    assert kept.rims[0].radius == pytest.approx(0.81)


def test_a_calibrated_machine_is_not_asked_for_a_pass_without_load() -> None:
    """Field work alone: the log shows no zero, which matters only where no calibration gives it."""
    wave = 1 + 1e-3 * np.sin(TIME)
    bus = log_of(ground_speed=1.84 * wave, wheel_based_speed=2.0 * wave)
    wheels = log_of(ground_speed=1.84 * wave, wheel_speed_rl=2.5 * wave, wheel_speed_rr=2.5 * wave)
    own = {"calibration": {"wheel_radius": {"rl": 0.81, "rr": 0.81}}}
    for log in (bus, wheels):
        assert any(REMEDY in note for note in slip_reference_in(log, tractor()).notes)
        assert not any("Zero-slip" in note for note in slip_reference_in(log, tractor(**own)).notes)


def test_a_public_estimate_takes_the_same_zero() -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    result = tg.estimate(log_of(ground_speed=1.96 * wave, wheel_based_speed=2.0 * wave), tractor())
    assert result.about["zero_slip"]["drive"]["ratio"] == pytest.approx(0.98)


def test_an_estimator_for_a_log_takes_the_logs_zero_unless_one_is_given() -> None:
    wave = 1 + 1e-3 * np.sin(TIME)
    log = log_of(ground_speed=1.96 * wave, wheel_based_speed=2.0 * wave)
    own = tg.TractionEstimator.for_recording(log, tractor())
    assert own.slip_reference is not None
    assert own.slip_reference.rims[0].radius == pytest.approx(0.98 * 0.8, rel=1e-6)
    given = slip_reference_in(log_of(ground_speed=1.98 * wave, wheel_based_speed=2.0 * wave), tractor())
    other = tg.TractionEstimator.for_recording(log, tractor(), slip_reference=given)
    assert other.slip_reference is given

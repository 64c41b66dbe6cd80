"""The zero of slip: one procedure for estimate and calibrate, honest where field work and light work look alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.estimation import calibrate
from terragrip.estimation.zero_slip import zero_of
from terragrip.formats.reading import read_table


def tractor(**more: object) -> tg.Vehicle:
    axles = {
        "front": {"mass": 2500, "wheels": ["fl", "fr"], "driven": False},
        "rear": {"mass": 3500, "wheels": ["rl", "rr"]},
    }
    base = {"mass": 6000, "wheelbase": 2.8, "center_of_gravity_height": 1.0, "axles": axles}
    return tg.Vehicle.from_dict({**base, "wheel": {"radius": 0.8, "inertia": 50}, **more})


def log_of(slip: np.ndarray, scale: float, seed: int, speed: float | np.ndarray = 2.0) -> tg.Recording:
    """A drive at 5 Hz whose machine supposes a radius ``scale`` times the true one (simulated)."""
    draws, time = np.random.default_rng(seed), np.arange(len(slip)) / 5
    v = speed * (1 + 0.1 * np.sin(time / 9))
    return tg.Recording.from_frame(
        {
            "time": time,
            "ground_speed": v + 0.03 * draws.standard_normal(len(time)),
            "wheel_based_speed": scale * v / (1 - slip) + 0.01 * draws.standard_normal(len(time)),
        }
    )


def field_day(seed: int, light: float = 0.25) -> np.ndarray:
    """Slip of beds and headlands, at 5 Hz; ``light``: share of the time on the headland."""
    draws = np.random.default_rng(seed)
    beds = np.repeat(draws.uniform(0.05, 0.16, 12), 400)
    inside = np.arange(len(beds)) % 400
    return np.where(inside < 400 * (1 - light), beds + 0.01 * np.sin(inside / 30), 0.004)


@pytest.mark.sample(5)
@pytest.mark.parametrize("seed", range(1000, 1006))
@pytest.mark.parametrize("light", [0.15, 0.4])
def test_light_work_is_found_in_a_field_day(seed: int, light: float) -> None:
    scale = 0.97 + 0.01 * (seed - 1000)
    zero = zero_of([log_of(field_day(seed, light), scale, seed)], "wheel_based_speed", 1.0)
    assert zero is not None
    assert not zero.doubt
    assert zero.ratio == pytest.approx((1 - 0.004) / scale, abs=3 * zero.std)
    assert zero.std < 0.013


def slip_of_its_own(mobility: float) -> float:
    """Slip at zero net traction by ASABE D497's gross traction and motion resistance ratios."""
    slip = np.linspace(0, 0.2, 20001)
    gross = 0.88 * (1 - np.exp(-0.1 * mobility)) * (1 - np.exp(-7.5 * slip)) + 0.04
    return float(slip[np.argmax(gross >= 1 / mobility + 0.04 + 0.5 * slip / np.sqrt(mobility))])


@pytest.mark.parametrize("mobility", [13, 20, 30, 55])
def test_headlands_where_wheels_slip_to_carry_the_vehicle_alone(mobility: float) -> None:
    slip = np.where(field_day(1000) == 0.004, slip_of_its_own(mobility), field_day(1000) + 0.03)
    estimates = tg.estimate(log_of(slip, 1.02, 1000), tractor())
    moving = estimates["event"] == ""
    error = estimates["slip_drive"][moving] - slip[moving]
    assert np.mean(np.abs(error) < 1.96 * estimates["slip_drive_std"][moving]) > 0.92


def test_a_road_counts_before_the_field() -> None:
    """A minute and a half on the road beside hours on soft ground."""
    headland, road = slip_of_its_own(13), slip_of_its_own(80)
    slip = np.where(field_day(1000) == 0.004, headland, field_day(1000) + 0.03)
    speed = np.r_[np.full(450, 6.0), np.full(len(slip), 2.0)]
    zero = zero_of([log_of(np.r_[np.full(450, road), slip], 1.03, 1000, speed)], "wheel_based_speed", 1.0)
    assert zero is not None
    assert not zero.doubt
    assert zero.ratio == pytest.approx(1 / 1.03, abs=2 * zero.std)
    assert zero.std < 0.005


def test_estimate_and_calibrate_give_one_answer() -> None:
    log = log_of(field_day(1000), 1.02, 1000)
    estimates = tg.estimate(log, tractor())
    calibration = calibrate(log, tractor())
    zero = estimates.about["zero_slip"]["drive"]
    assert calibration["wheel_radius rl"].value == zero["ratio"] * 0.8
    assert calibration["wheel_radius rl"].std == zero["std"] * 0.8


def test_field_work_alone_is_not_called_light() -> None:
    """Work at 10 % slip and nothing else: neither a radius of .72 m nor a slip of 0 is claimed."""
    log = log_of(np.full(3000, 0.1), 1.0, 1001)
    estimates = tg.estimate(log, tractor())
    assert "or, as likely, field work" in " ".join(estimates.notes)
    moving = estimates["event"] == ""
    error = estimates["slip_drive"][moving] - 0.1
    assert np.mean(np.abs(error) < 1.96 * estimates["slip_drive_std"][moving]) > 0.95
    calibration = calibrate(log, tractor())
    assert not calibration.quantities
    assert "record 40 s without load" in calibration.unknown[0].why


def test_the_lighter_of_two_loads_is_not_called_light_for_sure() -> None:
    """Work at 5 and 12 % slip and nothing else, by the right radius: the interval holds both, and a note says why it is wide."""
    log = log_of(np.repeat([0.05, 0.12, 0.05, 0.12], 800), 1.0, 1004)
    estimates = tg.estimate(log, tractor())
    assert "another radius or, as likely, lighter field work" in " ".join(estimates.notes)
    moving = estimates["event"] == ""
    error = estimates["slip_drive"] - np.repeat([0.05, 0.12, 0.05, 0.12], 800)
    assert np.mean(np.abs(error) < 1.96 * estimates["slip_drive_std"], where=moving) > 0.95


def test_rows_that_the_user_calls_light_are_taken() -> None:
    slip = np.r_[np.full(1500, 0.1), np.full(1500, 0.0)]
    log = log_of(slip, 0.93, 1002)  # a radius that nobody would guess
    calibration = calibrate(log, tractor(), light=[(305.0, 600.0)])
    radius = calibration["wheel_radius rl"]
    assert radius.value == pytest.approx(0.8 / 0.93, abs=3 * radius.std)
    assert radius.std < 0.003


def test_one_level_of_slip_is_said_to_be_one() -> None:
    log = log_of(np.full(3000, 0.0), 1.02, 1003)
    zero = zero_of([log], "wheel_based_speed", 1.0)
    assert zero is not None
    assert "light work cannot be distinguished from field work" in zero.doubt
    assert abs(zero.ratio - 1 / 1.02) < 1.96 * zero.std
    assert zero.std > 0.02


def test_a_radius_in_doubt_comes_with_its_doubt_and_what_it_rests_on() -> None:
    """One level of slip again, the machine's radius too small, the clock at 100 s: 600 s are 119 whole windows of 5 s and a rest."""
    log = log_of(np.full(3000, 0.0), 0.98, 1003)
    calibration = calibrate(replace(log, time=log.time + 100.0), tractor())
    radius = calibration["wheel_radius rl"]
    assert radius.value == pytest.approx(0.8 / 0.98, rel=0.002)
    assert radius.std > 0.02 * 0.8
    assert "light work cannot be distinguished from field work" in radius.sentence
    (rests_on,) = radius.evidence
    assert (rests_on.start, rests_on.end) == (100.0, pytest.approx(699.8))
    assert radius.samples == 119


@pytest.mark.parametrize("front", [0.8, 0.55])
def test_of_a_wheel_only_straight_windows_count(front: float) -> None:
    """A minute straight on and a minute in a bend: the left wheels run slower there, and nothing but their speeds says so; a tractor's
    smaller front wheels turn faster all the time."""
    time = np.arange(0.0, 120.0, 0.2)
    bend = np.where(time < 60, 0.0, 0.06)
    columns = {"time": time, "ground_speed": np.full(len(time), 2.0)}
    for wheel, side in (("fl", 1), ("fr", -1), ("rl", 1), ("rr", -1)):
        columns[f"wheel_speed_{wheel}"] = 2.0 * (1 - side * bend) / (front if wheel[0] == "f" else 0.8)
    radii = {"fl": front, "fr": front, "rl": 0.8, "rr": 0.8}
    zero = zero_of([tg.Recording.from_frame(columns)], "wheel_speed_fl", front, radii=radii)
    assert zero is not None
    assert zero.windows == 12
    assert zero.ratio == pytest.approx(1.0, abs=1e-9)


def test_the_inner_wheels_of_slow_wide_turns_are_no_light_work() -> None:
    """An outsider's six-wheeled, skid-steered machine of 2 m track (simulation): 5 % of the hub's way in turns of .04 rad/s, one side,
    was the right wheels' radius, 6 % too large with an SD of 1.4 %.
    """
    time = np.arange(0.0, 300.0, 0.2)
    draws = np.random.default_rng(4)
    turn = -0.045 * (time % 50 > 40)
    v = 1.0 + 0.1 * np.sin(time / 9)
    slip = 0.03 + 0.01 * np.repeat(draws.uniform(-1, 1, 60), 25)
    hubs = {"fl": v - turn, "fr": v + turn, "rl": v - turn, "rr": v + turn}
    rims = {
        f"wheel_speed_{w}": h / (1 - slip) / 0.8 + 0.01 * draws.standard_normal(len(time))
        for w, h in hubs.items()
    }
    noise = 0.02 * draws.standard_normal(len(time))
    log = tg.Recording.from_frame(
        {"time": time, "ground_speed": v + noise, "angular_velocity_z": turn, **rims}
    )
    radii = {q.wheel: q for q in calibrate(log, tractor(track=2)).quantities if q.key == "wheel_radius"}
    for wheel in hubs:
        assert radii[wheel].value == pytest.approx(0.8 * 0.97, abs=0.008), wheel


def test_a_road_is_light_work() -> None:
    zero = zero_of([log_of(np.full(3000, 0.0), 1.02, 1004, speed=12.0)], "wheel_based_speed", 1.0)
    assert zero is not None
    assert not zero.doubt
    assert zero.ratio == pytest.approx(1 / 1.02, abs=3 * zero.std)


def test_measured_field_hour(shared: Callable[[str], Path]) -> None:
    """New Holland T7 (PROVENANCE): by hand .079 working and .001 turning, without any flag within .012."""
    table = read_table(shared("data/tractor_t7/session2_hour.csv.gz")).columns
    rim, ground = table["CAN1.CCVS1.WheelBasedVehicleSpeed"] / 3.6, table["CAN2.gnss_speed.Speed"]
    columns = {"time": np.arange(len(rim), dtype=float), "wheel_based_speed": rim, "ground_speed": ground}
    columns |= {"latitude": table["CAN2.gnss_pos.Latitude"], "longitude": table["CAN2.gnss_pos.Longitude"]}
    log = tg.Recording.from_frame(columns)
    estimates = tg.estimate(log, tractor())
    state = np.array(table["STATE"]).astype(str)
    for name, slip in (("W", 0.079), ("T", 0.001)):
        rows = (state == name) & (rim > 0.5)
        assert np.nanmedian(estimates["slip_drive"][rows]) == pytest.approx(slip, abs=0.012)
    calibration = calibrate(log, tractor())["wheel_radius rl"]
    assert calibration.value == estimates.about["zero_slip"]["drive"]["ratio"] * 0.8
    assert calibration.interval[0] < 1.005 * 0.8 < calibration.interval[1]
    moving = rim > 0.5
    assert np.mean(estimates["event"][moving] == "outlier") < 0.01
    assert np.nanmax(np.abs(estimates["ground_speed"] - ground)[moving]) < 0.15
    assert not [note for note in estimates.notes if "km/h" in note or "wrong sign" in note]


def test_light_rows_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import pandas as pd

    from terragrip.cli import main

    log = log_of(np.r_[np.full(1500, 0.1), np.full(1500, 0.0)], 0.93, 1002)
    pd.DataFrame({"time": log.time, **log.channels}).to_csv(tmp_path / "log.csv", index=False)
    tractor().save(tmp_path / "v.yaml")
    words = [
        "calibrate",
        str(tmp_path / "log.csv"),
        "--vehicle",
        str(tmp_path / "v.yaml"),
        "-o",
        str(tmp_path / "c.yaml"),
    ]
    assert main([*words, "--light", "305:600"]) == 0
    assert tg.Vehicle.load(tmp_path / "c.yaml").wheel_radius[2] == pytest.approx(0.8 / 0.93, abs=0.006)
    capsys.readouterr()
    for wrong in ("305", "600:305", "a:b"):
        assert main([*words, "--light", wrong]) == 2
        assert "--light: " in capsys.readouterr().err
    assert main([*words, "--light", "1:2", "--light", "3:4"]) == 2
    assert "give at most one per log" in capsys.readouterr().err

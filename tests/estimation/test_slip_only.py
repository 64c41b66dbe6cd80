"""Slip from speeds alone: against a dense oracle, against truth, and on measured logs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.formats.reading import read_table
from terragrip.formats.signals import Signal, SignalLog
from terragrip.simulation import families


def robot(radius: float = 0.2, **more: object) -> tg.Vehicle:
    axles = {
        "front": {"mass": 30, "wheels": ["fl", "fr"]},
        "rear": {"mass": 30, "wheels": ["rl", "rr"]},
    }
    base = {"mass": 60, "wheelbase": 0.6, "center_of_gravity_height": 0.3, "axles": axles}
    return tg.Vehicle.from_dict({**base, "wheel": {"radius": radius, "inertia": 0.1}, **more})


def speeds_of(slip: float, seed: int = 1000, gap: bool = False) -> tg.Recording:
    draws = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.05)
    v = np.clip(np.minimum(time - 5, 0.8), 0, None)
    columns = {"time": time, "ground_speed": v + 0.01 * draws.standard_normal(len(time))}
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = v / (1 - slip) / 0.2 + 0.03 * draws.standard_normal(len(time))
    if gap:
        hole = (time > 30) & (time < 34)
        columns = {k: c if k == "time" else np.where(hole, np.nan, c) for k, c in columns.items()}
    return tg.Recording.from_frame(columns)


def test_wheels_standstill_gap_and_intervals() -> None:
    estimates = tg.estimate(speeds_of(0.1, gap=True), robot(uncertainty={"wheel_radius": 0.001}))
    assert estimates.wheels == ("fl", "fr", "rl", "rr")
    event = estimates["event"]
    assert set(event[estimates.time < 4]) == {"standstill"}
    assert np.isnan(estimates["slip_fl"][estimates.time < 4]).all()
    assert np.sum(event == "gap") >= 2
    moving = (estimates.time > 8) & (event == "")
    for wheel in estimates.wheels:
        error, spread = estimates[f"slip_{wheel}"][moving] - 0.1, estimates[f"slip_{wheel}_std"][moving]
        assert np.sqrt(np.mean(error**2)) < 0.02
        assert 0.85 < np.mean(np.abs(error) < 1.96 * spread) <= 1.0


@pytest.mark.parametrize("smooth", [False, True])
def test_parts_of_a_log_are_what_the_whole_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, smooth: bool
) -> None:
    log = speeds_of(0.1, gap=True)
    whole = tg.estimate(log, robot(), smooth=smooth)
    for rows in (40, 641):  # the gap begins in row 601 and ends in row 680
        monkeypatch.setattr("terragrip.from_log.ROWS", rows)
        tg.estimate_file(log, robot(), tmp_path / "parts.parquet", smooth=smooth)
        parts = tg.Estimates.read(tmp_path / "parts.parquet")
        assert parts["event"].tolist() == whole["event"].tolist()
        for name in whole.columns:
            assert np.array_equal(parts[name], whole[name], equal_nan=True), name


def test_an_outlier_is_flagged_and_a_leap_is_followed() -> None:
    log = speeds_of(0.0)
    speed = log["ground_speed"].copy()
    speed[700] = 5.0
    speed[900:] += 2.0
    wheels = {
        f"wheel_speed_{w}": log[f"wheel_speed_{w}"] + np.where(np.arange(1200) >= 900, 10.0, 0.0)
        for w in ("fl", "fr", "rl", "rr")
    }
    estimates = tg.estimate(log.with_channels(ground_speed=speed, **wheels), robot())
    assert estimates["event"][700] == "outlier"
    assert estimates["ground_speed"][700] == pytest.approx(0.8, abs=0.1)
    assert estimates["ground_speed"][-1] == pytest.approx(2.8, abs=0.1)


def test_hub_speeds_in_a_turn() -> None:
    time = np.arange(0, 30, 0.05)
    v, yaw, track = np.full(600, 1.0), np.full(600, 0.4), 0.6
    rims = {
        w: (v - yaw * side * track / 2) / 0.2 for w, side in (("fl", 1), ("fr", -1), ("rl", 1), ("rr", -1))
    }
    columns = {"time": time, "ground_speed": v, "angular_velocity_z": yaw}
    log = tg.Recording.from_frame(columns | {f"wheel_speed_{w}": rim for w, rim in rims.items()})
    estimates = tg.estimate(log, robot(track=track), sensors={"ground_speed": 0.01, "wheel_speed": 0.01})
    for wheel in estimates.wheels:
        assert estimates[f"slip_{wheel}"][-1] == pytest.approx(0, abs=1e-3)


def test_slip_of_both_sides_in_a_turn() -> None:
    """True slip .2 of both wheels, 1 m/s, 1 rad/s to the left, track 1 m; the wheel speeds are those that were measured."""
    time = np.arange(0, 30, 0.05)
    left, right = 0.5 / 0.8 / 0.2, 1.5 / 0.8 / 0.2
    columns = {"time": time, "ground_speed": 1.0 + 0 * time, "angular_velocity_z": 1.0 + 0 * time}
    columns |= {"wheel_speed_l": left + 0 * time, "wheel_speed_r": right + 0 * time}
    machine = tg.Vehicle.from_dict(
        {"mass": 60, "track": 1.0, "axles": {"only": {"mass": 60, "wheels": ["l", "r"]}}, "wheel": {"radius": 0.2, "inertia": 0.1}}
    )  # fmt: skip
    estimates = tg.estimate(
        tg.Recording.from_frame(columns),
        machine,
        sensors={"ground_speed": 0.01, "wheel_speed": 0.01},
        held={},
    )
    for wheel, speed in (("l", left), ("r", right)):
        assert estimates[f"slip_{wheel}"][-1] == pytest.approx(0.2, abs=1e-6)
        assert estimates[f"wheel_speed_{wheel}"][-1] == pytest.approx(speed, abs=1e-6)


def test_manoeuvres_at_1_hz_are_motion_not_outliers() -> None:
    """A tractor on the headland: .3 to 1.3 m/s² from second to second (simulated)."""
    draws, time = np.random.default_rng(1000), np.arange(600.0)
    change = np.where((time % 40 > 20) & (draws.random(600) < 0.4), draws.uniform(-1.3, 1.3, 600), 0)
    speed = 0.5 + np.abs(np.cumsum(change) % 8 - 4)
    columns = {
        "time": time,
        "ground_speed": speed + 0.02 * draws.standard_normal(600),
        "wheel_speed_fl": (speed / 0.95 + 0.01 * draws.standard_normal(600)) / 0.2,
    }
    estimates = tg.estimate(
        tg.Recording.from_frame(columns),
        robot(),
        sensors={"ground_speed": 0.02, "wheel_speed": 0.05},
        held={},
    )
    assert np.mean(estimates["event"] == "outlier") < 0.01
    error = estimates["ground_speed"] - speed
    assert np.max(np.abs(error)) < 0.1
    assert 0.9 < np.mean(np.abs(error) < 1.96 * estimates["ground_speed_std"]) < 0.99


def test_a_dead_band_leaves_slip_open() -> None:
    """The bus reads 0 below .3 m/s while the vehicle creeps; slip is 5 % everywhere (simulated)."""
    draws, time = np.random.default_rng(1000), np.arange(0, 400, 0.1)
    speed = 1.0 + 0.9 * np.sin(time / 15)
    rim = speed / 0.95 + 0.01 * draws.standard_normal(len(time))
    rim[rim < 0.3] = 0
    columns = {
        "time": time,
        "ground_speed": speed + 0.02 * draws.standard_normal(len(time)),
        "wheel_based_speed": rim,
    }
    log = tg.Recording.from_frame(columns)
    estimates = tg.estimate(
        log, robot(calibration={"wheel_radius": dict.fromkeys(("fl", "fr", "rl", "rr"), 0.2)})
    )
    blind = rim == 0
    assert blind.mean() > 0.08
    assert np.isnan(estimates["slip_drive"][blind]).mean() > 0.99
    assert set(estimates["event"][blind]) <= {"gap", "standstill"}
    assert np.nanmax(np.abs(estimates["slip_drive"] - 0.05)) < 0.25
    sentence = " ".join(estimates.notes)
    assert "cannot measure less, so slip is missing there" in sentence


def test_a_stop_while_no_ground_speed_comes_is_no_dead_band() -> None:
    """The receiver is silent while the machine stops: its speed before and after says nothing of the stop (simulated)."""
    draws, time = np.random.default_rng(1000), np.arange(0, 200, 0.1)
    speed = 1.5 * np.clip(np.abs(time % 50 - 25) - 5, 0, 4) / 4
    ground = speed + 0.02 * draws.standard_normal(len(time))
    ground[np.abs(time % 50 - 25) < 8] = np.nan
    log = tg.Recording.from_frame({"time": time, "ground_speed": ground, "wheel_based_speed": speed / 0.95})
    estimates = tg.estimate(log, robot())
    assert not any("cannot measure less" in note for note in estimates.notes)


def test_rims_that_read_0_at_a_driving_speed_are_no_dead_band() -> None:
    """Single positions that jump by metres make a speed at rest; nothing slow is hidden from the wheels (simulated)."""
    draws, time = np.random.default_rng(1000), np.arange(0, 200, 0.1)
    rim = np.where(time % 50 < 25, 1.0, 0.0)
    ground = np.where(rim > 0, 0.95, np.abs(0.8 + 0.4 * draws.standard_normal(len(time))))
    log = tg.Recording.from_frame({"time": time, "ground_speed": ground, "wheel_based_speed": rim})
    notes = " ".join(tg.estimate(log, robot()).notes)
    assert "or the ground speed is wrong at rest" in notes
    assert "cannot measure less" not in notes


def test_an_engines_torque_that_is_not_used_is_named() -> None:
    """The summary said that adhesion needs a torque; the log had the engine's."""
    log = speeds_of(0.1)
    engine = {"engine_speed": np.full(len(log), 150.0), "engine_torque": np.full(len(log), 50.0)}
    assert any("'driveline'" in note for note in tg.estimate(log.with_channels(**engine), robot()).notes)
    assert not any("'driveline'" in note for note in tg.estimate(log, robot()).notes)


def test_the_slip_of_free_wheels_is_none() -> None:
    """A tricycle whose driven front wheel the profile lacked was estimated by its two rear wheels: slip -.005, 'of the driven wheels'."""
    data = robot().to_dict()
    data["axles"]["front"]["driven"] = True
    data["axles"]["rear"]["driven"] = False
    log = speeds_of(0.1)
    kept = {n: v for n, v in log.channels.items() if n not in ("wheel_speed_fl", "wheel_speed_fr")}
    with pytest.raises(
        InputError, match="column wheel_speed_fl: is missing: the log has speeds of free wheels alone"
    ):
        tg.estimate(tg.Recording(log.time, kept), tg.Vehicle.from_dict(data))


def test_some_torques_missing_is_an_error_not_slip() -> None:
    log = speeds_of(0.1)
    with pytest.raises(InputError, match="drive_torque_fr: is missing, but the wheel fr is driven"):
        tg.estimate(log.with_channels(drive_torque_fl=np.ones(len(log))), robot())
    with pytest.raises(InputError, match="the vehicle has no wheel fl"):
        tg.estimate(
            log,
            tg.Vehicle.from_dict(
                {
                    "mass": 9,
                    "axles": {"a": {"mass": 9, "wheels": ["x"]}},
                    "wheel": {"radius": 0.2, "inertia": 1},
                }
            ),
        )


@pytest.mark.parametrize(("standing", "said"), [(0.2, True), (0.9, True), (1.0, False)])
def test_a_wheel_that_turns_against_the_travel_is_named(standing: float, said: bool) -> None:
    """Rows in which the wheel reads 0 say nothing of its way, however many they are."""
    log = speeds_of(0.0)
    turning = np.arange(len(log)) >= standing * len(log)
    backward = np.where(turning, -log["ground_speed"] / 0.2, 0.0)
    notes = tg.estimate(log.with_channels(wheel_speed_fl=backward), robot()).notes
    assert any("Against the direction of travel: wheel_speed_fl." in note for note in notes) == said


def test_measured_car_on_a_road_does_not_slip(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/comma2k19_example")

    def load(name: str) -> np.ndarray:
        return np.load(folder / f"{name}.npy")

    time, speeds = load("processed_log__CAN__wheel_speed__t"), load("processed_log__CAN__wheel_speed__value")
    velocity = load("global_pose__frame_velocities")
    signals = {
        f"wheel_speed_{w}": Signal(time, speeds[:, k] / 0.33) for k, w in enumerate(("fl", "fr", "rl", "rr"))
    }
    signals["ground_speed"] = Signal(load("global_pose__frame_times"), np.linalg.norm(velocity, axis=1))
    log = tg.Recording.from_frame(SignalLog(tuple(signals), signals).table().columns)
    estimates = tg.estimate(log, robot(0.33))
    for wheel in estimates.wheels:
        assert np.nanmedian(estimates[f"slip_{wheel}"]) == pytest.approx(0, abs=0.01)
        # The car's speeds in m/s carry its own radius, which is about 1 % small.
        assert estimates.about["zero_slip"][wheel]["ratio"] == pytest.approx(1.01, abs=0.005)


def test_measured_rover(shared: Callable[[str], Path]) -> None:
    """By the radius of the rover's own odometry, GNSS covers 7 % more than the wheels roll (PROVENANCE)."""
    excess = 1.07
    log = shared("data/pathfinder_rover/test17run_odom_gps_10hz.csv.gz")
    wheels = ("fl", "fr", "rl", "rr")
    table = read_table(log).columns
    turning = np.mean([np.abs(table[f"w_{w}"]) for w in wheels], axis=0)
    straight = (np.abs(table["odom_wz"]) < 0.02) & (turning > 1)
    radius = float(np.median(np.abs(table["odom_vx"])[straight] / turning[straight]))
    path = {"derivative_of": ["gps_e", "gps_n"], "unit": "m", "window": "2 s"}
    speeds = {f"wheel_speed_{w}": {"from": f"w_{w}", "sign": -1 if w in ("fl", "rl") else 1} for w in wheels}
    profile = tg.Profile.from_dict({"time": {"from": "time_s"}, "channels": {**speeds, "ground_speed": path}})
    estimates = tg.estimate(profile.apply(read_table(log)), robot(radius))
    moving = estimates["event"] == ""
    covered = np.sum(estimates["ground_speed"][moving])
    rolled = np.sum(np.mean([np.abs(estimates[f"wheel_speed_{w}"][moving]) for w in wheels], axis=0)) * radius
    assert covered / rolled == pytest.approx(excess, abs=0.03)
    slips = np.concatenate([estimates[f"slip_{w}"][moving] for w in wheels])
    assert np.nanmedian(slips) == pytest.approx(1 / excess - 1, abs=0.04)
    turned = {"channels": {**{f"wheel_speed_{w}": f"w_{w}" for w in wheels}, "ground_speed": path}}
    estimated = tg.estimate(
        tg.Profile.from_dict({"time": {"from": "time_s"}, **turned}).apply(read_table(log)), robot(radius)
    )
    assert any(
        "Against the direction of travel: wheel_speed_fl, wheel_speed_rl." in note for note in estimated.notes
    )


@pytest.mark.parametrize(("noise", "most"), [(0.01, 0.1), (0.003, 0.3)])
@pytest.mark.parametrize("seed", range(4))
def test_the_ground_speed_is_followed_where_all_wheels_lose_hold_together(
    seed: int, noise: float, most: float
) -> None:
    """A vehicle digs in within .6 s, rims going on, read to ``noise`` [m/s]; the receiver is four times slower than the wheels. From .3 s
    after the stop on it is known to stand: with rims read to 3 mm/s the estimate stayed at .65 m/s for good."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 12.0, 0.01)
    speed = 0.72 * np.clip((10.6 - time) / 0.6, 0.0, 1.0)
    names = [f"wheel_speed_{w}" for w in ("fl", "fr", "rl", "rr")]
    channels = {name: (0.77 + rng.normal(0, noise, len(time))) / 0.2 for name in names}
    measured = np.where(np.arange(len(time)) % 4 == 0, speed + rng.normal(0, 0.04, len(time)), np.nan)
    vehicle = robot(sensors={"ground_speed": 0.04, "wheel_speed": noise / 0.2})
    estimates = tg.estimate(tg.Recording(time=time, channels={**channels, "ground_speed": measured}), vehicle)
    assert np.abs(estimates["ground_speed"][(time > 10.9) & (time < 11.4)]).max() < most


@pytest.mark.parametrize("stands", [False, True])
def test_a_turnabout_on_slick_ground_is_not_stuck(stands: bool) -> None:
    """Windows of 2 s, 10 s apart: rims turn about within .3 s while the vehicle still goes the other way and slows by 1.2 m/s². It was
    called stuck half a second after the rims had turned. Where it comes to stand while they spin it is, half a second later."""
    rng = np.random.default_rng(7)
    since = np.arange(0.0, 2.5, 0.05)
    rim = np.interp(since, [0.3, 0.6], [-1.5, 1.5])
    speed = np.interp(since, [0.45, 0.45 + 1.4 / 1.2, 0.45 + 2.8 / 1.2], [-1.4, 0.0, 0.0 if stands else 1.4])
    time = (12.0 * np.arange(20)[:, None] + since).ravel()
    names = [f"wheel_speed_{w}" for w in ("fl", "fr", "rl", "rr")]
    channels = {name: (np.tile(rim, 20) + rng.normal(0, 0.01, len(time))) / 0.2 for name in names}
    channels["ground_speed"] = np.tile(speed, 20) + rng.normal(0, 0.01, len(time))
    vehicle = robot(sensors={"ground_speed": 0.01, "wheel_speed": 0.05})
    estimates = tg.estimate(tg.Recording(time=time, channels=channels), vehicle)
    stuck = (estimates["event"] == "stuck").reshape(20, -1)
    if not stands:
        assert not stuck.any()
        return
    assert stuck.any(axis=1).all()
    first = since[np.argmax(stuck, axis=1)]
    assert (np.abs(first - (0.45 + 1.4 / 1.2 + 0.5)) < 0.2).all()


@pytest.mark.parametrize(
    ("radius", "factor", "asked"), [(0.3, 3.6 * 0.3, True), (0.3, 1.0, False), (0.28, 1.0, False)]
)
def test_a_zero_slip_radius_of_rims_in_kmh_is_asked_for(radius: float, factor: float, asked: bool) -> None:
    """A car's wheels in km/h read as rad/s: slip was .08 too high, and 'calibrate' was offered for the radius of 1/3.6 m."""
    draws = np.random.default_rng(7)
    time = np.arange(0, 240, 0.1)
    v = 1.5 + 0.3 * np.sin(time / 5)
    slip = np.where(time % 40 < 20, 0.001, 0.08)
    columns = {"time": time, "ground_speed": v + 0.01 * draws.standard_normal(len(time))}
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = factor * v / (1 - slip) / radius
    notes = tg.estimate(tg.Recording.from_frame(columns), robot(radius)).notes
    question = "is the wheel speed its rim's in km/h? Then give 'scale: 0.92593, unit: rad/s' in a profile"
    assert any(question in note for note in notes) == asked


def test_a_zero_slip_radius_near_the_one_of_kmh_by_chance_is_not_asked_for() -> None:
    """Of a right log of a simulated machine the radius came to .277 +- .009 m, where the file says .282: wheels in km/h were asked for."""
    kind, seed = list(families.machines("development", 8, 9779000))[7]
    result = families.draw(kind, seed, rate=100.0)
    log = result.recording
    speeds = {name: values for name, values in log.channels.items() if "drive_torque" not in name}
    notes = tg.estimate(tg.Recording(log.time, speeds), result.vehicle).notes
    assert any("Zero-slip radius" in note for note in notes)
    assert not any("km/h" in note for note in notes)

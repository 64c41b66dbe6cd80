"""Speeds and rates of turn that positions or wheels contradict are reported, by whoever reads the log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.estimation import calibrate
from terragrip.formats import inspect
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.track import track_of

Columns = dict[str, np.ndarray]
TRACK = 1.5  # m


def field(seed: int = 1000) -> Columns:
    """Beds with headland turns to either side at 5 Hz, 2 m/s, slip of 5 %, GNSS to 2 cm (simulated)."""
    draws, time = np.random.default_rng(seed), np.arange(0, 400, 0.2)
    turn = np.where(time % 50 > 40, np.pi / 10, 0.0) * np.where(time % 100 > 50, 1, -1)
    speed = 2.0 + 0.2 * np.sin(time / 9)
    course = np.cumsum(turn) * 0.2
    east, north = (np.cumsum(speed * f(course)) * 0.2 for f in (np.cos, np.sin))
    radius = 6_378_137.0
    columns = {
        "time": time,
        "ground_speed": speed + 0.02 * draws.standard_normal(len(time)),
        "angular_velocity_z": turn + 0.01 * draws.standard_normal(len(time)),
        "latitude": np.degrees((north + 0.02 * draws.standard_normal(len(time))) / radius),
        "longitude": 11 + np.degrees((east + 0.02 * draws.standard_normal(len(time))) / radius),
    }
    for wheel, side in (("fl", 1), ("fr", -1), ("rl", 1), ("rr", -1)):
        rim = (speed - side * TRACK / 2 * turn) / 0.95
        columns[f"wheel_speed_{wheel}"] = (rim + 0.01 * draws.standard_normal(len(time))) / 0.6
    return columns


def machine() -> tg.Vehicle:
    axles = {"front": {"mass": 1500, "wheels": ["fl", "fr"]}, "rear": {"mass": 1500, "wheels": ["rl", "rr"]}}
    return tg.Vehicle.from_dict(
        {"mass": 3000, "wheelbase": 2.0, "track": TRACK, "center_of_gravity_height": 0.8, "axles": axles,
         "wheel": {"radius": 0.6, "inertia": 20}}
    )  # fmt: skip


def of_drive(columns: Columns, factor: float = 1.0) -> Columns:
    """The same with the drive train's speed [m/s, times ``factor`` ] in place of the wheels."""
    kept = {n: v for n, v in columns.items() if not n.startswith("wheel_speed")}
    rim = 0.6 * np.mean([v for n, v in columns.items() if n.startswith("wheel_speed")], axis=0)
    return kept | {"wheel_based_speed": factor * rim}


def test_a_track_gives_speed_and_turn() -> None:
    columns = field()
    track = track_of(Recording.from_frame(columns))
    assert track is not None
    straight = np.abs(track.turn) < 0.1
    assert np.median(track.speed) == pytest.approx(np.median(columns["ground_speed"]), abs=0.02)
    assert np.nanmedian(np.abs(track.turn[~straight])) == pytest.approx(np.pi / 10, abs=0.03)
    time = columns["time"]
    agree = np.corrcoef(track.at("turn", time)[20:-20], columns["angular_velocity_z"][20:-20])[0, 1]
    assert agree > 0.95


def test_right_channels_say_nothing() -> None:
    assert unit_warnings(Recording.from_frame(field()), machine()) == []
    assert unit_warnings(Recording.from_frame(of_drive(field())), machine()) == []


@pytest.mark.parametrize(
    ("channel", "factor", "expected"),
    [
        (
            "wheel_based_speed",
            3.6,
            "wheel_based_speed is 3.79 times the ground speed: wheel_based_speed may be in km/h",
        ),
        (
            "wheel_based_speed",
            1 / 3.6,
            "ground_speed may be in km/h, or wheel_based_speed was converted from km/h",
        ),
        ("ground_speed", 3.6, "times the speed of the positions: it may be in km/h"),
        (
            "ground_speed",
            1 / 3.6,
            "times the speed of the positions: it was converted from km/h",
        ),
    ],
)
def test_kmh_is_told_in_both_directions(channel: str, factor: float, expected: str) -> None:
    columns = of_drive(field())
    columns[channel] = columns[channel] * factor
    log = Recording.from_frame(columns)
    assert any(expected in notes for notes in unit_warnings(log, None))
    assert any(expected in note for note in tg.estimate(log, machine()).notes)
    assert any(expected in note for note in calibrate(log, machine()).notes)


def test_a_scale_of_units_is_no_radius() -> None:
    """A drive in km/h must not be taken for a wheel of .17 m."""
    estimates = tg.estimate(Recording.from_frame(of_drive(field(), 3.6)), machine())
    assert estimates.about["zero_slip"]["drive"]["ratio"] == 1
    assert "check the units" in " ".join(estimates.notes)
    calibration = calibrate(Recording.from_frame(of_drive(field(), 3.6)), machine())
    assert not calibration.quantities
    assert "check the units" in calibration.unknown[0].why


@pytest.mark.parametrize("vehicle", [machine(), None])
def test_exchanged_coordinates_turn_no_gyroscope(vehicle: tg.Vehicle | None) -> None:
    """They move the positions half as far again, and their turns to the other side: 'sign: -1' was advised for the gyroscope."""
    columns = field()
    latitude, longitude = 50 + columns["latitude"], 10 + (columns["longitude"] - 11) / np.cos(np.radians(50))
    assert (
        unit_warnings(Recording.from_frame(columns | {"latitude": latitude, "longitude": longitude}), vehicle)
        == []
    )
    (note,) = unit_warnings(
        Recording.from_frame(columns | {"latitude": longitude, "longitude": latitude}), vehicle
    )
    assert note.endswith("that latitude and longitude are not exchanged.")


def test_an_inverted_yaw_rate_is_noticed_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import pandas as pd

    columns = field()
    columns["angular_velocity_z"] = -columns["angular_velocity_z"]
    log = Recording.from_frame(columns)
    expected = (
        "angular_velocity_z is of the wrong sign: the positions and the wheels' speeds turn the other way"
    )
    assert any(expected in note for note in tg.estimate(log, machine()).notes)
    assert any(expected in note for note in calibrate(log, machine()).notes)
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    assert any(expected in note for note in inspect(tmp_path / "log.csv", vehicle=machine()).warnings)
    # Without a vehicle the positions alone speak.
    assert any("wrong sign: the positions turn" in note for note in inspect(tmp_path / "log.csv").warnings)
    # Without positions the wheels alone do, and either may be wrong.
    where = ("latitude", "longitude")
    alone = Recording.from_frame({name: values for name, values in columns.items() if name not in where})
    or_else = "If its sign is right, left and right wheels are exchanged."
    assert [or_else in note for note in unit_warnings(alone, machine()) if "wrong sign" in note] == [True]
    assert not any(or_else in note for note in unit_warnings(log, machine()))
    machine().save(tmp_path / "v.yaml")
    words = [
        "calibrate",
        str(tmp_path / "log.csv"),
        "--vehicle",
        str(tmp_path / "v.yaml"),
        "-o",
        str(tmp_path / "c.yaml"),
    ]
    assert main(words) == 0
    assert expected in capsys.readouterr().out


def test_wheels_exchanged_from_side_to_side_are_told_apart_from_a_yaw_rate() -> None:
    columns = field()
    for left, right in (("fl", "fr"), ("rl", "rr")):
        a, b = f"wheel_speed_{left}", f"wheel_speed_{right}"
        columns[a], columns[b] = columns[b], columns[a]
    notes = unit_warnings(Recording.from_frame(columns), machine())
    assert notes == [
        "angular_velocity_z turns with the positions and against the wheels' speeds: left and right wheels may be exchanged."
    ]


@pytest.mark.parametrize("position", [True, False])
def test_slip_alone_turns_by_the_positions(position: bool) -> None:
    """5 % slip everywhere, headland turns of .3 rad/s and no gyroscope."""
    columns = {n: v for n, v in field().items() if n != "angular_velocity_z"}
    turning = np.abs(field()["angular_velocity_z"]) > 0.2
    if not position:
        columns = {n: v for n, v in columns.items() if n not in ("latitude", "longitude")}
    estimates = tg.estimate(Recording.from_frame(columns), machine())
    sentence = " ".join(estimates.notes)
    error = np.abs(estimates["slip_fl"][turning] - 0.05)
    if position:
        assert "The rate of turn is that of the positions" in sentence
        assert np.median(error) < 0.02
    else:
        assert "no signal shows how fast the machine turned" in sentence
        assert np.median(error) > 0.1


def test_poor_positions_of_a_slow_robot_are_no_wrong_unit() -> None:
    """.2 m/s and positions that jump by a metre: their speed is mostly noise."""
    draws, time = np.random.default_rng(1000), np.arange(0, 600, 1.0)
    columns = {
        "time": time,
        "ground_speed": 0.2 + 0.01 * draws.standard_normal(600),
        "wheel_based_speed": 0.21 + 0.01 * draws.standard_normal(600),
        "latitude": np.degrees((0.2 * time + draws.standard_normal(600)) / 6_378_137.0),
        "longitude": 11 + np.degrees(draws.standard_normal(600) / 6_378_137.0),
    }
    log = Recording.from_frame(columns)
    track = track_of(log)
    assert track is not None
    assert np.median(track.speed) > 0.4
    assert np.isnan(track.turn).all()
    assert unit_warnings(log, None) == []


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
@pytest.mark.parametrize(("scale", "said"), [(1.0, False), (0.98, False), (0.95, True), (0.9, True)])
def test_a_ground_speed_five_per_cent_low_is_seen_by_the_positions(
    scale: float, said: bool, seed: int
) -> None:
    """By those of a receiver without corrections, too: half a metre that wanders over half a minute. Slip would be .05 too large."""
    columns, draws = field(seed), np.random.default_rng(seed + 1)
    for name in ("latitude", "longitude"):
        error = np.interp(columns["time"], np.arange(0, 420, 15.0), 0.5 * draws.standard_normal(28))
        columns[name] = columns[name] + np.degrees(error / 6_378_137.0)
    columns["ground_speed"] = scale * columns["ground_speed"]
    notes = unit_warnings(Recording.from_frame(columns), machine())
    assert any(f"move {1 / scale:.3g}"[:8] in note for note in notes) is said
    assert said or notes == []


@pytest.mark.parametrize("value", [0.0, -0.02])
def test_a_gyroscope_that_never_changes_is_named_where_the_wheels_turn(value: float) -> None:
    """Turns on the spot had a slip of .99 each, surely: the hubs were taken to stand still."""
    columns = field()
    columns["angular_velocity_z"] = np.full(len(columns["time"]), value)
    assert "its sensor is dead" in " ".join(unit_warnings(Recording.from_frame(columns), machine()))
    straight = {n: v for n, v in columns.items() if n not in ("latitude", "longitude")}
    pace, draws = straight["wheel_speed_fl"], np.random.default_rng(3)
    for wheel in ("fl", "fr", "rl", "rr"):
        straight[f"wheel_speed_{wheel}"] = pace + 1e-4 * draws.standard_normal(len(pace))
    assert unit_warnings(Recording.from_frame(straight), machine()) == []

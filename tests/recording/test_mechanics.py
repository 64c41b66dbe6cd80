"""What the motion contradicts is reported: signs, units and scales of torque, acceleration, pitch, radius and mass."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.simulation import families
from terragrip.simulation.campaign import simulate_campaign
from terragrip.vehicle import Vehicle

Columns = dict[str, np.ndarray]
WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, G = 800.0, 0.35, 9.80665


def machine(**more: object) -> Vehicle:
    axles = {"front": {"mass": 350, "wheels": ["fl", "fr"]}, "rear": {"mass": 450, "wheels": ["rl", "rr"]}}
    base = {"mass": MASS, "wheelbase": 1.3, "track": 1.1, "center_of_gravity_height": 0.5, "axles": axles}
    return Vehicle.from_dict({**base, "wheel": {"radius": RADIUS, "inertia": 4}, **more})


def drive(seed: int = 0, *, hills: float = 0.05) -> Columns:
    """Five minutes of a mass on hills by Newton's second law (50 Hz): thrust, slip in proportion to it, and what sensors show."""
    draws = np.random.default_rng(seed)
    time = np.arange(0, 300, 0.02)
    speed = 1.2 + 0.4 * np.sin(time / 7) + 0.15 * np.sin(time / 2.3)
    change = np.gradient(speed, time)
    yaw, way = 0.2 * np.sin(time / 11), np.cumsum(speed) * 0.02
    pitch = hills * np.sin(way / 6)
    roll = hills * np.cos(way / 9)
    specific = change + G * np.sin(pitch)
    thrust = MASS * (specific + 0.07 * G)
    result = {
        "time": time,
        "ground_speed": speed + 0.02 * draws.standard_normal(len(time)),
        "acceleration_x": specific + 0.05 + 0.2 * draws.standard_normal(len(time)),
        "acceleration_y": speed * yaw + G * np.sin(roll) + 0.2 * draws.standard_normal(len(time)),
        "acceleration_z": G + 0.2 * draws.standard_normal(len(time)),
        "angular_velocity_z": yaw + 0.01 * draws.standard_normal(len(time)),
        "pitch": pitch + 0.005 * draws.standard_normal(len(time)),
        "roll": roll + 0.005 * draws.standard_normal(len(time)),
    }
    for k, wheel in enumerate(WHEELS):
        side = 0.55 if k % 2 else -0.55
        hub = speed + side * yaw
        slip = thrust / (MASS * G) / 6
        torque = RADIUS * (thrust / 4 + 150 * yaw * np.sign(side)) + 4 / RADIUS * change
        result[f"wheel_speed_{wheel}"] = hub / (1 - slip) / RADIUS + 0.02 * draws.standard_normal(len(time))
        result[f"drive_torque_{wheel}"] = torque + 3 * draws.standard_normal(len(time))
    return result


def notes_on(columns: Columns, vehicle: Vehicle | None = None) -> str:
    return " ".join(unit_warnings(Recording.from_frame(columns), vehicle or machine()))


def scaled(columns: Columns, factors: dict[str, float]) -> Columns:
    return {
        n: v * next((f for start, f in factors.items() if n.startswith(start)), 1.0)
        for n, v in columns.items()
    }


def without(columns: Columns, *names: str) -> Columns:
    return {n: v for n, v in columns.items() if n not in names}


def exchanged(columns: Columns, a: str, b: str) -> Columns:
    return {**columns, a: columns[b], b: columns[a]}


SENSORS = {
    "all": (),
    "no pitch": ("pitch", "roll"),
    "no accelerometer": ("acceleration_x", "acceleration_y", "acceleration_z"),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("hills", [0.0, 0.05, 0.15])
@pytest.mark.parametrize("missing", SENSORS)
def test_a_right_log_is_left_alone(missing: str, hills: float) -> None:
    assert notes_on(without(drive(hills=hills), *SENSORS[missing])) == ""


def test_real_doubts_of_mass_and_torque_are_left_alone() -> None:
    """A mass 30 % off and torques 20 % off are what `uncertainty` and `calibrate` are for."""
    columns = scaled(drive(), {"drive_torque": 0.8})
    heavy = machine(
        mass=1040,
        axles={"front": {"mass": 455, "wheels": ["fl", "fr"]}, "rear": {"mass": 585, "wheels": ["rl", "rr"]}},
    )
    assert notes_on(columns, heavy) == ""


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({"drive_torque": 1 / 30}, "torques over the wheel radius are 0.03"),
        ({"drive_torque": 2.5}, "torques over the wheel radius are 2.5"),
        ({"drive_torque": -1.0}, "drive torques fall where the vehicle is driven harder"),
        (
            {"drive_torque_fl": -1.0, "drive_torque_rl": -1.0},
            "drive_torque_fl, drive_torque_rl: the other wheels",
        ),
        ({"acceleration_x": -1.0}, "acceleration_x is not the change of ground speed but its opposite"),
        ({"acceleration_x": 1 / G}, "it may be in g"),
        ({"pitch": -1.0}, "pitch falls where the accelerometer shows a climb"),
        ({"wheel_speed": 2.0, "drive_torque": 0.5}, "they roll 0.17"),
        ({"angular_velocity_z": 180 / np.pi}, "it may be in deg/s"),
        ({"drive_torque_rr": 0.0}, "drive_torque_rr (0) never changes"),
        ({"wheel_speed_fl": 0.0}, "wheel_speed_fl (0) never changes"),
    ],
)
def test_a_mistake_is_named(factors: dict[str, float], expected: str) -> None:
    assert expected in notes_on(scaled(drive(), factors))


def test_a_rate_of_turn_in_degrees_is_named_straight_ahead_too() -> None:
    """On a run of 34 s it made a slip of .20 one of .34 without a word: without a turn nothing was in proportion to it."""
    noise = np.random.default_rng(5).standard_normal((5, 15000))
    straight = drive() | {"angular_velocity_z": -0.006 + 0.002 * noise[4]}
    for k, wheel in enumerate(WHEELS):
        both = straight["wheel_speed_fl"] + straight["wheel_speed_fr"]
        straight |= {f"wheel_speed_{wheel}": both / 2 + 0.02 * noise[k]}
    assert notes_on(straight) == ""
    assert "it may be in deg/s" in notes_on(scaled(straight, {"angular_velocity_z": 180 / np.pi}))


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({"drive_torque": 1 / 30}, "torques over the wheel radius are 0.03"),
        ({"drive_torque": -1.0}, "acceleration_x go against each other"),
        ({"drive_torque_fl": -1.0, "drive_torque_rl": -1.0}, "drive_torque_fl, drive_torque_rl"),
        ({"acceleration_x": -1.0}, "acceleration_x go against each other"),
    ],
)
def test_a_slope_that_nothing_shows_hides_no_mistake(factors: dict[str, float], expected: str) -> None:
    assert expected in notes_on(scaled(without(drive(), "pitch", "roll"), factors))


def test_without_an_accelerometer_the_ground_speed_tells() -> None:
    columns = without(drive(hills=0.0), "acceleration_x", "acceleration_y", "acceleration_z", "pitch", "roll")
    assert "torques over the wheel radius are 0.03" in notes_on(scaled(columns, {"drive_torque": 1 / 30}))
    assert "drive torques fall" in notes_on(scaled(columns, {"drive_torque": -1.0}))


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        (("acceleration_x", "acceleration_y"), "the two axes may be exchanged"),
        (("pitch", "roll"), "climbs that vary with roll and not with pitch"),
    ],
)
def test_exchanged_axes_are_named(axes: tuple[str, str], expected: str) -> None:
    assert expected in notes_on(exchanged(drive(), *axes))


def test_a_diameter_for_a_radius_is_named() -> None:
    notes = notes_on(drive(), machine(wheel={"radius": 2 * RADIUS, "inertia": 4}))
    assert "not the diameter" in notes
    assert "slip by 0.5" in notes


def test_a_mass_in_the_wrong_unit_is_named() -> None:
    axles = {"front": {"mass": 35, "wheels": ["fl", "fr"]}, "rear": {"mass": 45, "wheels": ["rl", "rr"]}}
    assert "the force that moves 80 kg" in notes_on(drive(), machine(mass=80, axles=axles))


def test_a_short_log_says_nothing() -> None:
    assert notes_on({n: v[:200] for n, v in scaled(drive(), {"drive_torque": -1.0}).items()}) == ""


def pulling() -> Columns:
    """The same drive with a tool behind it that takes a fifth of the weight, more or less."""
    columns = drive()
    pull = MASS * G * (0.2 + 0.05 * np.sin(columns["time"] / 5))
    torques = {n: v + RADIUS * pull / 4 for n, v in columns.items() if n.startswith("drive_torque")}
    return {**columns, **torques, "drawbar_force": pull}


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({}, ""),
        (
            {"drawbar_force": -1.0},
            "drawbar_force is -0.2 of the weight on average: a backward pull is positive",
        ),
        ({"drawbar_force": 1e-3}, "it may be in kN"),
        ({"drawbar_force": 3.0}, "leaves nothing to drive the vehicle"),
        ({"drive_torque": 1e-3}, "leaves nothing to drive the vehicle"),
    ],
)
def test_a_pull_that_cannot_be_is_named(factors: dict[str, float], expected: str) -> None:
    notes = notes_on(scaled(pulling(), factors))
    assert expected in notes
    assert bool(notes) == bool(expected)


def test_a_gyroscope_of_the_wrong_sign_is_named_alone() -> None:
    """In turns of 12 s the hubs were on the wrong side of the rims, and ground speed or the wheels' speeds were called wrong."""
    columns = without(drive(), "acceleration_y", "roll")
    time = columns["time"]
    yaw = np.where(time % 40 < 12, 0.25, 0.0) * np.where(time % 80 < 40, 1, -1)
    for k, wheel in enumerate(WHEELS):
        columns[f"wheel_speed_{wheel}"] += (
            (0.55 if k % 2 else -0.55) * (yaw - 0.2 * np.sin(time / 11)) / RADIUS
        )
    turned = columns | {
        "angular_velocity_z": -yaw + 0.01 * np.random.default_rng(2).standard_normal(len(time))
    }
    assert notes_on(turned).startswith("angular_velocity_z is of the wrong sign")


def test_a_cell_with_nothing_towed_is_not_in_kilonewtons() -> None:
    """A cell's noise of .4 % of the weight comes to less than a thousandth in the mean over a second: 'unit: kN' was advised."""
    columns = drive()
    noise = np.random.default_rng(9).normal(0, 0.004 * MASS * G, len(columns["time"]))
    assert notes_on({**columns, "drawbar_force": noise}) == ""


@pytest.mark.parametrize("sensors", SENSORS)
def test_a_trailer_that_pushes_downhill_is_no_wrong_sign(sensors: str) -> None:
    """'sign: -1' was advised for a cell, and for torques, that read right; with the other sign it is advised still."""
    columns = drive()
    time = columns["time"]
    steep = -0.1 - 0.04 * np.sin(np.cumsum(columns["ground_speed"]) * 0.02 / 6)
    specific = np.gradient(1.2 + 0.4 * np.sin(time / 7) + 0.15 * np.sin(time / 2.3), time) + G * np.sin(steep)
    pull, thrust = (1.2 * MASS * (specific + 0.03 * G), MASS * (specific + 0.05 * G))
    torque = RADIUS * (thrust + pull) / 4
    columns |= {f"drive_torque_{w}": torque for w in WHEELS}
    columns |= {"pitch": steep, "acceleration_x": specific, "drawbar_force": pull}
    columns = without(columns, *SENSORS[sensors])
    assert notes_on(columns) == ""
    uphill = scaled(columns, {"pitch": -1.0, "acceleration_x": -1.0, "drive_torque": -1.0})
    assert "drawbar_force" in notes_on(uphill)


@pytest.mark.parametrize(
    "stated",
    [
        {"uncertainty": {"drawbar_offset": "20 N"}},
        {"uncertainty": {"drawbar_gain": 0.02}},
        {"sensors": {"drawbar_force": "5 N"}},
        {"calibration": {"drawbar_offset": "20 N"}},
        {},
    ],
)
def test_a_cell_of_the_vehicle_file_that_reads_0_throughout_is_named(stated: dict[str, object]) -> None:
    columns = drive()
    notes = notes_on(
        {**columns, "drawbar_force": np.zeros(len(columns["time"]))}, machine(hitch_height=0.3, **stated)
    )
    assert ("exactly 0 in all rows" in notes) is bool(notes) is bool(stated)


def test_a_drawbar_force_of_one_value_is_named() -> None:
    columns = drive()
    notes = notes_on(
        {**columns, "drawbar_force": np.full(len(columns["time"]), 40.0)}, machine(hitch_height=0.3)
    )
    assert "drawbar_force is 40 N in all rows: a cell's zero with nothing towed" in notes


@pytest.mark.parametrize(
    ("bias", "expected"), [(1.0, "reads 1"), (-1.0, "reads -0.9"), (0.45, "reads 0.5"), (0.25, "")]
)
def test_an_accelerometer_that_is_tilted_is_named(bias: float, expected: str) -> None:
    columns = drive()
    notes = notes_on({**columns, "acceleration_x": columns["acceleration_x"] + bias})
    assert expected in notes
    assert bool(notes) == bool(expected)


def test_radii_that_are_exchanged_are_named_and_slip_is_not() -> None:
    """Front wheels of .35 m that are stated as .45 m; then wheels of .35 m of which the front ones slip by 10 % more."""
    axles = {
        "front": {"mass": 350, "wheels": ["fl", "fr"], "wheel": {"radius": 0.45, "inertia": 4}},
        "rear": {"mass": 450, "wheels": ["rl", "rr"]},
    }
    assert "The rims of the axle front go 1.29 times" in notes_on(drive(), machine(axles=axles))
    assert "the axle" not in notes_on(scaled(drive(), {"wheel_speed_f": 1.1}))


@pytest.mark.parametrize(("run", "seed"), [("hard-09", 0), ("fine-09", 0), ("fine-08", 1)])
def test_axles_that_share_a_pull_and_wheels_that_dig_in_are_no_wrong_sign(run: str, seed: int) -> None:
    """Runs of the demonstration's campaign (simulation): the front wheels' share of the pull falls as the rear's grows, or the vehicle
    slows down the harder it is driven."""
    ((_, result),) = simulate_campaign([run], seed=seed, workers=1)
    assert unit_warnings(result.recording, result.vehicle) == []


def test_without_an_accelerometer_the_thrust_tells_the_pitchs_sign() -> None:
    columns = without(drive(), "acceleration_x", "acceleration_y", "acceleration_z")
    assert notes_on(columns) == ""
    assert notes_on(scaled(columns, {"pitch": -1.0})).startswith(
        "pitch falls where the wheels are driven harder"
    )


def test_the_thrust_that_is_told_beside_a_pull_is_the_whole_one_on_a_climb() -> None:
    """What lifts the vehicle was left out of 'the drive torques over the wheel radius'."""
    columns = scaled(pulling(), {"drawbar_force": 3.0})
    columns["pitch"] = columns["pitch"] + 0.1
    columns["acceleration_x"] = columns["acceleration_x"] + 0.1 * G
    for wheel in WHEELS:
        columns[f"drive_torque_{wheel}"] = columns[f"drive_torque_{wheel}"] + RADIUS * MASS * G * 0.1 / 4
    thrust = sum(np.mean(columns[f"drive_torque_{wheel}"]) for wheel in WHEELS) / RADIUS / MASS / G
    told = notes_on(columns).split("over the wheel radius are ")[1].split()[0]
    assert float(told) == pytest.approx(thrust, abs=0.015)


def test_resistances_that_change_with_the_slope_are_no_scale_of_torques() -> None:
    """A light machine on hills, whose accelerometer agrees with ground speed and pitch: nothing says that a torque is wrong."""
    drawn = families.draw(families.Kind("light", "saturating", "multirate", "rigid"), 9515, rate=50.0)
    assert unit_warnings(drawn.recording, drawn.vehicle) == []


def test_a_torque_that_fails_after_a_second_leaves_no_warning_of_numpy() -> None:
    """'Mean of empty slice' stood on the terminal, with the path of our file."""
    columns = drive()
    columns["drive_torque_rr"] = np.where(columns["time"] < 1, columns["drive_torque_rr"], np.nan)
    assert notes_on(columns) == ""

"""Starts and stops show which of mass, torques, drawbar force and accelerometer does not go with the others."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.forces import Range
from terragrip.simulation import simulate
from terragrip.vehicle import Vehicle

G, MASS, RADIUS, INERTIA = 9.80665, 600.0, 0.4, 3.0
Columns = dict[str, np.ndarray]


def machine(mass: float = MASS) -> Vehicle:
    axles = {
        "front": {"mass": 0.45 * mass, "wheels": ["fl", "fr"]},
        "rear": {"mass": 0.55 * mass, "wheels": ["rl", "rr"]},
    }
    return Vehicle.from_dict(
        {
            "mass": mass,
            "wheelbase": 1.2,
            "track": 1.0,
            "center_of_gravity_height": 0.4,
            "hitch_height": 0.3,
            "axles": axles,
            "wheel": {"radius": RADIUS, "inertia": INERTIA},
        }
    )


def drive(seed: int = 0) -> Columns:
    """Two minutes at 20 Hz by Newton's second law: steps between three speeds and stops, a drag behind, ground that resists more here
    than there. Between its starts and stops nothing is calmer: rims and drag are steady."""
    draws = np.random.default_rng(seed)
    time = np.arange(0, 120, 0.05)
    levels = np.repeat([0.0, 1.0, 1.6, 0.0, 1.3, 0.7, 1.5, 0.0, 1.6, 1.0, 1.4, 0.0], 10)
    rim = np.interp(time, np.arange(120) + 0.5, levels)
    moving = rim > 0.02
    rough = np.interp(time, np.arange(0, 121, 4.0), draws.standard_normal(31))
    pull = (
        moving * MASS * G * (0.15 + 0.05 * np.interp(time, np.arange(0, 121, 3.0), draws.standard_normal(41)))
    )
    speed = rim * (1 - 0.04 - 0.005 * rough)
    change = np.gradient(speed, time)
    thrust = MASS * change + pull + moving * MASS * G * (0.06 + 0.01 * rough)

    def noisy(values: np.ndarray, size: float) -> np.ndarray:
        return values + size * draws.standard_normal(len(time))

    result = {
        "time": time,
        "ground_speed": noisy(speed, 0.02),
        "acceleration_x": noisy(change, 0.1),
        "drawbar_force": noisy(pull, 20.0),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        result[f"wheel_speed_{wheel}"] = noisy(rim / RADIUS, 0.02)
        spun = INERTIA * np.gradient(rim, time) / RADIUS
        result[f"drive_torque_{wheel}"] = noisy(RADIUS * thrust / 4 + spun, 5.0)
    return result


def notes(columns: Columns, vehicle: Vehicle | None) -> list[str]:
    return unit_warnings(Recording.from_frame(columns), vehicle)


def times(columns: Columns, name: str, factor: float) -> Columns:
    return {n: v * factor if n.startswith(name) else v for n, v in columns.items()}


@pytest.mark.parametrize("seed", range(4))
def test_a_right_drive_and_usual_errors_are_left_alone(seed: int) -> None:
    columns = drive(seed)
    assert notes(columns, machine()) == []
    assert notes(times(columns, "drive_torque", 1.1), machine(0.9 * MASS)) == []
    assert notes(columns, None) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_trailer_on_hills_that_nothing_measures_is_no_wrong_unit(seed: int) -> None:
    """Its pull goes with the slope as the thrust does, so that this seemed to go with the pull alone, by twice of it."""
    columns = drive(seed)
    time, draws = columns["time"], np.random.default_rng(seed)
    rim = np.interp(
        time, np.arange(120) + 0.5, np.repeat([0.0, 1, 1.6, 0, 1.3, 0.7, 1.5, 0, 1.6, 1, 1.4, 0], 10)
    )
    slope = 0.1 * np.interp(time, np.arange(0, 121, 4.0), draws.standard_normal(31))
    specific = np.gradient(rim, time) + (rim > 0.02) * G * (slope + 0.05)
    columns["drawbar_force"] = MASS * specific + 20 * draws.standard_normal(len(time))
    for wheel in ("fl", "fr", "rl", "rr"):
        spun = INERTIA * np.gradient(rim, time) / RADIUS
        columns[f"drive_torque_{wheel}"] = (
            RADIUS * 2 * MASS * specific / 4 + spun + 5 * draws.standard_normal(len(time))
        )
    del columns["acceleration_x"]
    assert not any("In starts and stops" in note for note in notes(columns, machine()))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("name", "factor", "cause"),
    [
        ("mass", 1.6, "check the mass, or brakes that the torques do not contain (give a channel 'brake')."),
        ("mass", 1 / 1.6, "check the mass."),
        ("drive_torque", 1.5, "check the torques' scale"),
        ("drive_torque", 1 / 1.5, "check the torques' scale"),
        ("drawbar_force", 1.6, "drawbar"),
        ("drawbar_force", 1 / 1.6, "check the scale of drawbar_force."),
    ],
)
def test_which_of_three_is_off_is_named(name: str, factor: float, cause: str, seed: int) -> None:
    columns = drive(seed)
    vehicle = machine(factor * MASS) if name == "mass" else machine()
    (note,) = notes(columns if name == "mass" else times(columns, name, factor), vehicle)
    assert cause in note


@pytest.mark.parametrize("known", [True, False])
def test_a_dead_accelerometer_has_neither_sign_nor_unit(known: bool) -> None:
    """Of one value its slope was 1e-16 with an error as small: 'write sign: -1' was advised, or 'unit: g'."""
    columns = drive()
    columns["acceleration_x"] = np.full(len(columns["time"]), 0.02)
    (note,) = notes(columns, machine() if known else None)
    assert note.startswith("acceleration_x (0.02) never changes")


def test_a_torque_of_a_wrong_sign_is_named_alone() -> None:
    """The sum of all is off, too: the scale of all, the mass and the drawbar force were to be checked."""
    (note,) = notes(times(drive(), "drive_torque_fl", -1.0), machine())
    assert note.startswith("drive_torque_fl falls where that of the axle's other wheel rises")


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_with_nothing_towed_has_no_scale(seed: int) -> None:
    """It shows noise, with which no thrust goes: 'check the scale of drawbar_force' was said of right calibration drives."""
    columns = drive(seed)
    rigid = {n: v - RADIUS * columns["drawbar_force"] / 4 * ("torque" in n) for n, v in columns.items()}
    noise = np.random.default_rng(seed).normal(0, 0.004 * MASS * G, len(columns["time"]))
    assert notes(rigid | {"drawbar_force": noise}, machine()) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_trailer_that_only_starts_show_is_no_mass_of_the_machine(seed: int) -> None:
    """On hard level ground its inertia is all that it pulls with, and that changes at once: its cell counted as noise, and .7 of the
    machine's mass as missing in the file."""
    draws = np.random.default_rng(seed)
    time = np.arange(0, 120, 0.05)
    rim = np.interp(time, np.arange(160) * 0.75, draws.uniform(0.7, 1.6, 160))
    change = 0.97 * np.gradient(rim, time)
    pull = 0.7 * MASS * change
    thrust = MASS * change + pull + 0.06 * MASS * G

    def noisy(values: np.ndarray, size: float) -> np.ndarray:
        return values + size * draws.standard_normal(len(time))

    columns = {
        "time": time,
        "ground_speed": noisy(0.97 * rim, 0.01),
        "acceleration_x": noisy(change, 0.1),
        "drawbar_force": noisy(pull, 20.0),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = noisy(rim / RADIUS, 0.01)
        spun = INERTIA * np.gradient(rim / RADIUS, time)
        columns[f"drive_torque_{wheel}"] = noisy(thrust * RADIUS / 4 + spun, 1.0)
    assert notes(columns, machine()) == []


@pytest.mark.parametrize("seed", range(3))
def test_torques_in_pound_feet_are_named_where_nothing_is_towed(seed: int) -> None:
    """Given as N m they are .74 of what starts and stops need. Too large ones may pull a trailer that is not in the log."""
    columns = drive(seed)
    rigid = {n: v for n, v in columns.items() if n != "drawbar_force"}
    rigid |= {n: v - RADIUS * columns["drawbar_force"] / 4 for n, v in rigid.items() if "torque" in n}
    assert notes(rigid, machine()) == []
    assert notes(times(rigid, "drive_torque", 1.5), machine()) == []
    (note,) = notes(times(rigid, "drive_torque", 1 / 1.356), machine())
    assert "times the force that moves 600 kg: check the torques' scale" in note


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("factor", "cause"), [(-1.0, "its opposite"), (1 / G, "it may be in g")])
def test_an_accelerometer_needs_no_torque_to_be_wrong(factor: float, cause: str, known: bool) -> None:
    """And no lively drive: its noise is a fifth of what a start shows."""
    columns = {n: v for n, v in drive().items() if not n.startswith(("drive_torque", "drawbar"))}
    assert notes(columns, machine() if known else None) == []
    (note,) = notes(times(columns, "acceleration_x", factor), machine() if known else None)
    assert cause in note


def test_what_slows_the_vehicle_and_not_the_rims_says_nothing_of_the_mass() -> None:
    """Hits: the speed falls while the thrust rises, which a plain regression takes for a mass below 0."""
    columns = drive()
    time = columns["time"]
    hit = np.sum([np.exp(-(((time - at) / 0.5) ** 2)) for at in range(12, 120, 9)], axis=0)
    moving = columns["ground_speed"] > 0.4
    columns["ground_speed"] = columns["ground_speed"] * (1 - 0.2 * hit)
    columns["acceleration_x"] = columns["acceleration_x"] + np.gradient(
        -0.2 * hit * columns["ground_speed"], time
    )
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"drive_torque_{wheel}"] = (
            columns[f"drive_torque_{wheel}"] + moving * hit * 0.1 * RADIUS * MASS * G / 4
        )
    assert notes(columns, machine()) == []


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("delay", [0.4, 1.2])
def test_a_receiver_that_filters_its_speed_accuses_neither_mass_nor_accelerometer(
    delay: float, known: bool
) -> None:
    """Its speed changes less than the vehicle's."""
    columns = drive()
    if not known:
        del columns["acceleration_x"]
    speed = columns["ground_speed"]
    for row in range(1, len(speed)):
        speed[row] = speed[row - 1] + 0.05 / delay * (speed[row] - speed[row - 1])
    assert notes(columns, machine()) == []


def test_a_speed_in_kmh_accuses_not_the_accelerometer() -> None:
    (note,) = notes(times(drive(), "ground_speed", 3.6), machine())
    assert "ground_speed may be in km/h" in note


@pytest.mark.parametrize(
    ("low", "high", "off"),
    [(0.9, 1.1, False), (1.4, 1.6, True), (1.2, 2.0, False), (0.5, 0.7, True), (-2.0, -1.0, True)],
)
def test_a_factor_is_off_where_all_of_its_interval_is(low: float, high: float, off: bool) -> None:
    assert Range((low + high) / 2, low, high).is_off(1.3) is off


def steady(seed: int, towed: float = 1.0, governor: tuple[float, float] = (100.0, 40.0)) -> Columns:
    """140 s at one speed by Newton's second law: a stiff speed controller (its integral and proportional gain by the mass: ``governor``),
    pull (times ``towed``) and ground that change, and so rims that hardly do."""
    draws, step = np.random.default_rng(seed), 0.01
    time = np.arange(0, 160, step)
    weight = MASS * G
    pull = towed * weight * (0.15 + 0.05 * np.interp(time, np.arange(0, 164, 3.0), draws.standard_normal(55)))
    load = pull + weight * (0.06 + 0.06 * np.tanh(draws.standard_normal(40)[(time / 6).astype(int)]))
    speed, rim, thrust = np.empty((3, len(time)))
    now, held, push = 1.2, 0.21 * weight, 0.21 * weight
    for k in range(len(time)):
        rim[k] = now / (1 - push / (8 * weight))
        held += governor[0] * MASS * (1.25 - rim[k]) * step
        push = held + governor[1] * MASS * (1.25 - rim[k])
        now += step * (push - load[k]) / MASS
        speed[k], thrust[k] = now, push
    columns = {
        "time": (time, 0.0),
        "ground_speed": (speed, 0.003),
        "acceleration_x": (np.gradient(speed, step), 0.05),
        "drawbar_force": (pull, 20.0),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        columns[f"wheel_speed_{wheel}"] = (rim / RADIUS, 0.005)
        spun = INERTIA * np.gradient(rim, step) / RADIUS
        columns[f"drive_torque_{wheel}"] = (RADIUS * thrust / 4 + spun, 2.0)
    return {n: (v + size * draws.standard_normal(len(time)))[1000::5] for n, (v, size) in columns.items()}


@pytest.mark.parametrize("towed", [1.0, 0.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_load_that_slows_the_rims_shows_no_mass(seed: int, towed: float) -> None:
    """Without starts and stops the rims change by the load alone: 'check the mass' was said of 8 of 8 such right drives, and of 4 of 4 with
    a cell that tows nothing."""
    assert notes(steady(seed, towed), machine()) == []


@pytest.mark.parametrize("droop", [10.0, 2.5])
@pytest.mark.parametrize("seed", range(2))
def test_under_a_governor_with_droop_the_load_slows_the_rims(seed: int, droop: float) -> None:
    """Without accelerometer and cell torques were said to change by .01 times what moves the mass, of 12 of 12 such right drives."""
    columns = steady(seed, 0.0, (0.0, droop))
    del columns["acceleration_x"], columns["drawbar_force"]
    assert notes(columns, machine()) == []


def test_one_start_alone_shows_nothing() -> None:
    """Exact channels, one start with a tool that digs in meanwhile: nothing shows the scatter from start to start."""
    run = simulate("constant", 7)
    assert unit_warnings(run.recording, run.vehicle) == []

"""A force whose zero moves, or that is lost, in the middle of a drive by Newton's second law is named; forces that leap are not."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.leaps import leap_warnings
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

G, RADIUS, WHEELS = 9.80665, 0.2, ("fl", "fr", "rl", "rr")
TIME = np.arange(0, 120, 0.05)
TORQUES = tuple(f"drive_torque_{wheel}" for wheel in WHEELS)


def drive(
    vehicle: Vehicle, pull: np.ndarray | None = None, *, coasting: tuple[float, float] | None = None
) -> dict[str, np.ndarray]:
    """Two minutes at 20 Hz: a command that drives the machine towards .7 m/s, a pull, resistance of .08 of the weight (simulated)."""
    draws = np.random.default_rng(20)
    drawn = 250 + 60 * np.sin(TIME / 4) if pull is None else pull
    weight, speed, thrust = vehicle.mass * G, np.full(len(TIME), 0.7), np.zeros(len(TIME))
    for k in range(len(TIME)):
        on = coasting is None or not coasting[0] <= TIME[k] < coasting[1]
        wanted = 0.7 + 0.1 * np.sin(TIME[k] / 3)
        thrust[k] = on * (drawn[k] + 0.08 * weight + 2 * vehicle.mass * (wanted - speed[k]))
        if pull is not None and k:  # the drive answers the pull within half a second, as slip grows
            thrust[k] = thrust[k - 1] + 0.1 * (thrust[k] - thrust[k - 1])
        if k + 1 < len(TIME):
            speed[k + 1] = speed[k] + 0.05 * (thrust[k] - drawn[k] - 0.08 * weight) / vehicle.mass
    columns = {"time": TIME, "ground_speed": speed + 0.01 * draws.standard_normal(len(TIME))}
    front = (54 * G - drawn * 0.25 / 0.638 - vehicle.mass * np.gradient(speed, TIME) * 0.3 / 0.638) / weight
    for wheel in WHEELS:
        share = (front if wheel.startswith("f") else 1 - front) / 2  # as the loads
        columns[f"drive_torque_{wheel}"] = RADIUS * thrust * share + 0.5 * (
            thrust > 0
        ) * draws.standard_normal(len(TIME))
        columns[f"wheel_speed_{wheel}"] = speed / RADIUS / (
            1 - thrust / weight / 2
        ) + 0.03 * draws.standard_normal(len(TIME))
    columns["drawbar_force"] = drawn + 3 * draws.standard_normal(len(TIME))
    return columns


def notes(columns: dict[str, np.ndarray], vehicle: Vehicle) -> list[str]:
    return list(unit_warnings(Recording.from_frame(columns), vehicle))


def changed(
    columns: dict[str, np.ndarray], names: tuple[str, ...], gain: float, offset: float
) -> dict[str, np.ndarray]:
    late = TIME >= 60
    return columns | {name: np.where(late, gain * columns[name] + offset, columns[name]) for name in names}


def test_a_right_drive_has_no_leap(vehicle: Vehicle) -> None:
    assert notes(drive(vehicle), vehicle) == []


@pytest.mark.parametrize(
    ("names", "gain", "offset"),
    [
        (("drawbar_force",), 1.0, 80.0),
        (("drawbar_force",), 1.0, -80.0),
        (TORQUES, 1.0, 6.0),
        (TORQUES, 0.5, 0.0),
        (TORQUES[:1], 1.0, 15.0),
    ],
)
def test_a_zero_that_moves_is_named(
    vehicle: Vehicle, names: tuple[str, ...], gain: float, offset: float
) -> None:
    """Soil resistance was .06 off behind a moved zero of the drawbar, .12 behind one of all torques, surely and without a word."""
    found = notes(changed(drive(vehicle), names, gain, offset), vehicle)
    (note,) = (note for note in found if "neither the motion nor another force answers" in note)
    assert note.startswith(", ".join(names))
    assert " at 59.98 s" in note


def test_a_drawbar_cell_or_torques_that_fall_to_0_are_named(vehicle: Vehicle) -> None:
    """Soil resistance was .27 too high behind a drawbar cell that was unplugged, -.3 behind torques that were 0, without a word."""
    pulled = notes(changed(drive(vehicle), ("drawbar_force",), 0.0, 0.0), vehicle)
    assert any(note.startswith("drawbar_force is exactly 0 from 60 to 120 s while") for note in pulled)
    driven = notes(changed(drive(vehicle), TORQUES, 0.0, 0.0), vehicle)
    assert any(
        note.startswith(f"{', '.join(TORQUES)} are exactly 0 from 60 to 120 s while") for note in driven
    )


def test_a_tool_that_comes_in_or_out_at_once_and_a_vehicle_that_coasts_are_no_errors(
    vehicle: Vehicle,
) -> None:
    """The pull leaps by a fifth of the weight, and is exactly 0 without the tool; with its torques off a vehicle slows down."""
    beds = np.where(TIME % 40 > 20, 250.0, 0.0)
    tooled = drive(vehicle, beds)
    tooled["drawbar_force"] = np.where(beds > 0, tooled["drawbar_force"], 0.0)
    assert notes(tooled, vehicle) == []
    coasting = drive(vehicle, np.zeros(len(TIME)), coasting=(60, 60.6))
    del coasting["drawbar_force"]
    assert notes(coasting, vehicle) == []


def test_a_drive_that_answers_a_tool_by_a_leap_is_no_moved_zero(vehicle: Vehicle) -> None:
    """A tool drops in at 60 s, onto ground that resists by .06 more; .1 s later the torques leap, by less than the pull: 'drive_torque_rl,
    drive_torque_rr leap ... their zero moved' came on 2 of 30 right logs of an outsider's tractors."""
    columns, weight = drive(vehicle, np.zeros(len(TIME))), vehicle.mass * G
    columns["drawbar_force"] += 0.1 * weight * (TIME > 59.99)
    softer = 0.06 * weight * np.clip((TIME - 60) / 0.3, 0, 1)
    thrust = weight * np.interp(TIME, [60.08, 60.09, 60.3, 60.6], [0, 0.06, 0.1, 0.16])
    columns["ground_speed"] += (
        np.cumsum(thrust - softer - 0.1 * weight * (TIME > 59.99)) * 0.05 / vehicle.mass
    )
    columns |= {name: columns[name] + thrust * RADIUS / 4 for name in TORQUES}
    assert leap_warnings(Recording.from_frame(columns), vehicle) == []


def test_a_start_into_softer_ground_is_no_moved_zero(
    vehicle: Vehicle,
) -> None:
    """Its first sample leaps by .05 of the weight, and the ground resists by .06 more: 'their zero moved' was said."""
    columns, weight = drive(vehicle, np.zeros(len(TIME))), vehicle.mass * G
    start = 0.2 * weight * np.interp(TIME, [59.98, 59.99, 60.12, 60.4, 60.6, 60.8], [0, 0.25, 0.25, 1, 1, 0])
    softer = 0.06 * weight * np.clip((TIME - 61) / 0.3, 0, 1)
    speed = columns["ground_speed"] + np.cumsum(start) * 0.05 / vehicle.mass
    torques = {name: columns[name] + (start + softer) * RADIUS / 4 for name in TORQUES}
    wheels = {
        f"wheel_speed_{w}": columns[f"wheel_speed_{w}"] * speed / columns["ground_speed"] for w in WHEELS
    }
    moved = {"ground_speed": speed} | torques | wheels
    assert leap_warnings(Recording.from_frame(columns | moved), vehicle) == []


def test_a_torque_in_coarse_steps_has_one_step_more_and_no_moved_zero(vehicle: Vehicle) -> None:
    """A pull that grows slowly, torques in steps of 20 N m: where one changes, the motion does not answer."""
    columns = drive(vehicle, 150 + 1.5 * TIME)
    coarse = {name: 20 * np.round(columns[name] / 20) for name in TORQUES}
    assert not any("leaps" in note for note in notes(columns | coarse, vehicle))


def test_a_wheel_on_rough_ground_whose_soil_changes_is_no_moved_zero(vehicle: Vehicle) -> None:
    """A wheel's torque leaps all the time where the ground is rough; there resistance falls by .04, and all torques with it."""
    columns = drive(vehicle)
    falls = 0.04 * vehicle.mass * G * np.clip((TIME - 59.9) / 0.3, 0, 1) * RADIUS / 4  # N m a wheel
    shifts = np.random.default_rng(3).normal(0, 4.0, (4, len(TIME))) * ((TIME > 55) & (TIME < 75))
    near = np.abs(TIME - 59.97) < 0.2
    shifts[:, near] = 6 * np.outer([-1, 1, 0, 0], np.sign(TIME[near] - 59.97))  # from wheel to wheel
    right = columns | {name: columns[name] - falls + own for name, own in zip(TORQUES, shifts, strict=True)}
    assert notes(right, vehicle) == []


def test_a_torque_that_leaps_where_the_axles_other_one_follows_is_the_grounds() -> None:
    """Both double in seconds, one of them by a leap (a right simulated drive)."""
    drawn = families.draw(families.Kind("light", "brixius", "uncoupled"), 91014, rate=20.0)
    assert leap_warnings(drawn.recording, drawn.vehicle) == []


@pytest.mark.parametrize("slip", [0.1, 0.02])  # of a combine, and of small machines on stiff ground
def test_wheels_that_slip_less_as_they_push_less_are_on_firmer_ground(slip: float, vehicle: Vehicle) -> None:
    """From 60 s on the ground resists by .08 of the weight less, on one sample: outsiders' machines had 'their zero moved'."""
    columns, less = drive(vehicle), 0.08 * vehicle.mass * G * (TIME > 59.99)
    rims = {n: columns[n] * (1 - slip * (TIME > 59.99)) for n in columns if n.startswith("wheel_speed_")}
    torques = {name: columns[name] - less * RADIUS / 4 for name in TORQUES}
    assert leap_warnings(Recording.from_frame(columns | torques), vehicle) != []
    assert leap_warnings(Recording.from_frame(columns | torques | rims), vehicle) == []

"""Masses, or torques, of two axles exchanged, on simulated machines of 17 kg to 11 t at several rates (development kinds)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.axles import _pulls
from terragrip.recording.mechanics import Means
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

Case = tuple[families.Kind, int, float]
UNEQUAL: list[Case] = [
    (families.Kind("light", "sinkage", "even"), 4, 20.0),
    (families.Kind("tractor", "saturating", "even"), 8316, 20.0),
    (families.Kind("light", "saturating", "multirate"), 15, 50.0),
    (families.Kind("robot", "saturating", "multirate"), 7, 1.0),
]
EQUAL: list[Case] = [
    (families.Kind("tractor", "brixius", "multirate"), 0, 10.0),
    (families.Kind("robot", "brixius", "plain"), 23, 10.0),
]


@cache
def drive(kind: families.Kind, seed: int, rate: float) -> tuple[Recording, Vehicle]:
    result = families.draw(kind, seed, rate=rate, duration=1500.0 if rate == 1 else 300.0)
    return result.recording, result.vehicle


def exchanged(vehicle: Vehicle) -> Vehicle:
    """The vehicle with the masses of its lightest and its heaviest axle exchanged."""
    tree = vehicle.model_dump(mode="json", exclude_unset=True)
    by_mass = sorted(tree["axles"].values(), key=lambda axle: axle["mass"])
    by_mass[0]["mass"], by_mass[-1]["mass"] = by_mass[-1]["mass"], by_mass[0]["mass"]
    return Vehicle.from_dict(tree)


def said(log: Recording, vehicle: Vehicle) -> list[str]:
    return [note for note in unit_warnings(log, vehicle) if "times as much for its load as" in note]


@pytest.mark.sample(2)
@pytest.mark.parametrize("case", [*UNEQUAL, *EQUAL])
def test_a_right_vehicle_file_is_left_alone(case: Case) -> None:
    assert said(*drive(*case)) == []


@pytest.mark.parametrize("case", UNEQUAL)
def test_exchanged_masses_are_named(case: Case) -> None:
    log, vehicle = drive(*case)
    (note,) = said(log, exchanged(vehicle))
    light = min(vehicle.axles, key=lambda name: vehicle.axles[name].mass)
    assert f"as its slip and that of {light} allow," in note, "the light axle is taken for the heavy one"
    assert "check the masses of the axles" in note


@pytest.mark.parametrize("case", [*UNEQUAL[:2], *EQUAL])
def test_ballast_that_the_file_does_not_know_is_named(case: Case) -> None:
    """Two fifths of an axle's mass on the other one: adhesion was held in 7 to 69 % of the rows, without a word."""
    log, vehicle = drive(*case)
    tree = vehicle.to_dict()
    first, second = list(tree["axles"].values())[:2]
    moved = 0.4 * first["mass"]
    first["mass"], second["mass"] = first["mass"] - moved, second["mass"] + moved
    (note,) = said(log, Vehicle.from_dict(tree))
    assert "check the masses of the axles" in note


def test_radii_that_the_file_hardly_knows_explain_as_much() -> None:
    log, vehicle = drive(*UNEQUAL[0])
    unsure = vehicle.uncertainty.model_copy(update={"wheel_radius": 0.1})
    assert said(log, exchanged(vehicle).model_copy(update={"uncertainty": unsure})) == []


def test_exchanged_torques_of_axles_look_alike_and_are_named_too() -> None:
    log, vehicle = drive(*UNEQUAL[2])
    moved = log.with_channels(
        drive_torque_1=log.channels["drive_torque_2"], drive_torque_2=log.channels["drive_torque_1"]
    )
    assert len(said(moved, vehicle)) == 1


def test_exchanged_masses_that_hardly_differ_are_left_alone() -> None:
    log, vehicle = drive(*EQUAL[0])
    assert said(log, exchanged(vehicle)) == []


def test_an_unmeasured_pull_may_have_moved_the_load() -> None:
    """Without a drawbar force the rear axle may carry what a tool adds: no sentence where that explains the thrusts."""
    log, vehicle = drive(families.Kind("tractor", "saturating", "uncoupled"), 1, 10.0)
    assert said(log, vehicle) == []


Curve = Callable[[np.ndarray], np.ndarray]


def rising(slip: np.ndarray) -> np.ndarray:
    return 0.6 * np.tanh(6 * slip)


def unlike_slips(curve: Curve = rising) -> tuple[dict[str, np.ndarray], Vehicle]:
    """A robot whose axles slip by .14 and .09 on one curve and pull a cell (simulated from the equations)."""
    vehicle = Vehicle.from_dict(
        {"mass": 180, "wheelbase": 0.7, "track": 0.6, "center_of_gravity_height": 0.28, "hitch_height": 0.25,
         "axles": {"front": {"mass": 80, "wheels": ["fl", "fr"]}, "rear": {"mass": 100, "wheels": ["rl", "rr"]}},
         "wheel": {"radius": 0.22, "inertia": 0.35}}
    )  # fmt: skip
    draws = np.random.default_rng(7)
    time = np.arange(0, 200, 0.05)
    speed = 1 + 0.02 * np.sin(time / 9)
    slip = {"f": 0.14 + 0.02 * np.sin(time / 7), "r": 0.09 + 0.015 * np.sin(time / 7)}
    adhesion = {end: curve(own) for end, own in slip.items()}
    pull = 180 * 9.81 * 0.24 * np.ones(len(time))
    for _ in range(20):  # loads and pull of one another
        moved = pull * 0.25 / 0.7
        load = {"f": 80 * 9.81 - moved, "r": 100 * 9.81 + moved}
        pull = sum(adhesion[e] * load[e] for e in load) - 0.05 * 180 * 9.81 - 180 * np.gradient(speed, time)
    columns = {"time": time, "ground_speed": speed, "drawbar_force": pull + draws.normal(0, 5, len(time))}
    for wheel in ("fl", "fr", "rl", "rr"):
        end = wheel[0]
        columns[f"wheel_speed_{wheel}"] = speed / (1 - slip[end]) / 0.22 + draws.normal(0, 0.02, len(time))
        columns[f"drive_torque_{wheel}"] = 0.22 * adhesion[end] * load[end] / 2 + draws.normal(
            0, 1, len(time)
        )
    return columns, vehicle


@pytest.mark.parametrize(
    ("moved", "causes"),
    [
        (("wheel_speed", "drive_torque"), "check the axle of each torque, or the axle of each wheel."),
        (("drive_torque",), "check the masses of the axles, or the axle of each torque."),
        ((), None),
    ],
)
def test_axles_that_slip_unlike_are_held_against_one_rising_curve(
    moved: tuple[str, ...], causes: str | None
) -> None:
    """Front and rear wheels exchanged made the front's adhesion .49 for .35, surely; only like slips were compared."""
    columns, vehicle = unlike_slips()
    right = dict(columns)
    for name in moved:
        for side in ("l", "r"):
            columns[f"{name}_f{side}"], columns[f"{name}_r{side}"] = (
                right[f"{name}_r{side}"],
                right[f"{name}_f{side}"],
            )
    notes = said(Recording.from_frame(columns), vehicle)
    if causes is None:
        assert notes == []
        return
    (note,) = notes
    assert note.startswith("The axle front pulls")
    assert note.endswith(causes)


@pytest.mark.parametrize("curve", [lambda slip: 3 * slip, lambda slip: 0.4 + 0 * slip])
def test_at_unlike_slips_a_straight_and_a_flat_curve_are_right_too(curve: Curve) -> None:
    columns, vehicle = unlike_slips(curve)
    assert said(Recording.from_frame(columns), vehicle) == []


@pytest.mark.parametrize("climb", [None, 0.5])
def test_an_unmeasured_pull_is_at_most_what_motion_and_slope_leave_of_the_thrust(
    vehicle: Vehicle, columns: dict[str, np.ndarray], climb: float | None
) -> None:
    """Newton's second law, of 139 kg; [m/s²]."""
    rows = np.ones(50, dtype=bool)
    slope = None if climb is None else np.full(50, climb)
    means = Means(np.arange(50), np.arange(50.0), rows, np.full(50, 0.1), np.ones(50), slope)
    log = Recording.from_frame({n: v for n, v in columns.items() if n != "drawbar_force"})
    none, most = _pulls(log, vehicle, means, np.full(50, 300.0))
    assert not none.any()
    assert most == pytest.approx(300.0 - 139 * (0.1 + (climb or 0.0)))

"""Masses, or torques, of two axles exchanged, on simulated machines of 17 kg to 11 t at several rates (development kinds)."""

from __future__ import annotations

from functools import cache

import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

Case = tuple[families.Kind, int, float]
UNEQUAL: list[Case] = [
    (families.Kind("light", "sinkage", "even"), 4, 20.0),
    (families.Kind("robot", "saturating", "even"), 17, 10.0),
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
    return [note for note in unit_warnings(log, vehicle) if note.startswith("At equal slip the axle")]


@pytest.mark.parametrize("case", [*UNEQUAL, *EQUAL])
def test_a_right_vehicle_file_is_left_alone(case: Case) -> None:
    assert said(*drive(*case)) == []


@pytest.mark.parametrize("case", UNEQUAL)
def test_exchanged_masses_are_named(case: Case) -> None:
    log, vehicle = drive(*case)
    (note,) = said(log, exchanged(vehicle))
    light = min(vehicle.axles, key=lambda name: vehicle.axles[name].mass)
    assert f"times as much for its load as {light}," in note, "the light axle is taken for the heavy one"
    assert "check the masses of the axles" in note


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

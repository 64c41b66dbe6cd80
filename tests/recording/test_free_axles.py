"""Speeds of a free and a driven axle that are exchanged, on simulated machines (development kinds)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.axles import free_axle_warnings
from terragrip.simulation import families
from terragrip.vehicle import Vehicle

MACHINES = [
    (families.Kind("light", "saturating", "plain"), 34021, 10.0),  # wheels of one size
    (families.Kind("light", "saturating", "even"), 36048, 50.0),
    (families.Kind("robot", "brixius", "even"), 31006, 20.0),  # of two sizes
    (families.Kind("tractor", "sinkage", "multirate"), 31005, 100.0),
]


def exchanged(log: Recording, vehicle: Vehicle) -> Recording:
    """The log with the speeds of the first driven and the first free axle exchanged."""
    driven, free = (next(a for a in vehicle.axles.values() if a.driven is on) for on in (True, False))
    channels = dict(log.channels)
    for one, other in zip(driven.wheels, free.wheels, strict=True):
        a, b = f"wheel_speed_{one}", f"wheel_speed_{other}"
        channels[a], channels[b] = log.channels[b], log.channels[a]
    return replace(log, channels=channels, delay=None)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("kind", "seed", "rate"), MACHINES)
def test_speeds_of_a_free_axle_and_a_driven_one_that_are_exchanged_are_named(
    kind: families.Kind, seed: int, rate: float
) -> None:
    drawn = families.draw(kind, seed, rate=rate)
    assert unit_warnings(drawn.recording, drawn.vehicle) == []
    notes = unit_warnings(exchanged(drawn.recording, drawn.vehicle), drawn.vehicle)
    assert any("which is driven" in note and "may be exchanged" in note for note in notes)
    speeds = {n: v for n, v in drawn.recording.channels.items() if not n.startswith("drive_torque")}
    alone = exchanged(replace(drawn.recording, channels=speeds), drawn.vehicle)
    assert any("may be exchanged" in note for note in unit_warnings(alone, drawn.vehicle))


def test_a_free_wheels_radius_that_is_a_quarter_off_is_named() -> None:
    drawn = families.draw(families.Kind("tractor", "saturating", "even", "rolling"), 31016, rate=20.0)
    data = drawn.vehicle.to_dict()
    free = next(a for a in data["axles"].values() if a.get("driven") is False)
    free["wheel"] = {**data.get("wheel", {}), **(free.get("wheel") or {})}
    free["wheel"]["radius"] *= 1.25
    (note,) = unit_warnings(drawn.recording, Vehicle.from_dict(data))
    assert "1.25 times as fast as the ground, though nothing drives them" in note


def test_the_free_wheels_of_a_machine_that_digs_in_have_no_wrong_scale() -> None:
    """It hardly moves, so that they go .05 to .34 times as fast as the ground, by the noise of both; driven rims 34 times (simulation)."""
    dug_in = families.draw(families.Kind("robot", "saturating", "multirate"), 83151, rate=10.0)
    assert free_axle_warnings(dug_in.recording, dug_in.vehicle) == []


def rolling(radius: float, slip: float, *, turning: float = 0.0) -> list[str]:
    """What is said of a free front axle whose ``radius`` the file states as 0.3 m, as that of the driven rear wheels, which slip.

    For a share of the time, ``turning``, the vehicle turns, and the steered front wheels go a longer way.
    """
    time = np.arange(0.0, 60.0, 0.1)
    speed, turn = 1 + 0.1 * np.sin(time), 0.3 * (time % 10 < 10 * turning)
    channels = {"ground_speed": speed}
    for side, sign in (("l", -1), ("r", 1)):
        hub = speed * (1 + sign * turn)
        channels[f"wheel_speed_f{side}"] = hub * np.where(turn > 0, 1.05, 1.0) / radius
        channels[f"wheel_speed_r{side}"] = hub / (1 - slip) / 0.3
    axles = {
        "front": {"mass": 50, "wheels": ["fl", "fr"], "driven": False},
        "rear": {"mass": 50, "wheels": ["rl", "rr"]},
    }
    shape = {"wheelbase": 1.0, "track": 0.6, "center_of_gravity_height": 0.3}
    vehicle = Vehicle.from_dict(
        {"mass": 100, "axles": axles, "wheel": {"radius": 0.3, "inertia": 0.1}, **shape}
    )
    return free_axle_warnings(Recording(time, channels), vehicle)


@pytest.mark.parametrize(
    ("radius", "slip", "said"),
    [
        (0.3, 0.05, ""),
        (0.285, 0.01, "may be exchanged"),  # as the driven wheels' speeds would show a slip of 5 %
        (0.285, 0.04, ""),  # a radius within 5 %
        (0.24, 0.1, "1.25 times as fast as the ground, though"),  # exchanged the front wheels would slip, too
        (
            0.375,
            0.05,
            "0.8 times as fast as the ground, though",
        ),  # exchanged it would be the driven ones that lag
        (np.inf, 0.05, ""),  # a sensor that reads 0 tells no radius
    ],
)
def test_a_free_axle_is_held_against_the_ground_and_the_driven_one(
    radius: float, slip: float, said: str
) -> None:
    notes = " ".join(rolling(radius, slip))
    assert said in notes
    assert bool(said) is bool(notes)


def test_what_steered_wheels_do_in_turns_counts_for_nothing() -> None:
    assert rolling(0.3, 0.01, turning=0.6) == []

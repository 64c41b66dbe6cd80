"""Speeds of a free and a driven axle that are exchanged, on simulated machines (development kinds)."""

from __future__ import annotations

from dataclasses import replace

import pytest

from terragrip.recording import Recording, unit_warnings
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

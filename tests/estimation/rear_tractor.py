"""A tractor of which every number is known."""

from __future__ import annotations

from typing import Any

from terragrip.vehicle import Vehicle

G = 9.80665


def tractor(**more: Any) -> Vehicle:
    """Rear driven; rear wheels of .8 and .9 m, front of .5 m."""
    axles = {
        "front": {
            "mass": 2500,
            "wheels": ["fl", "fr"],
            "driven": False,
            "wheel": {"radius": 0.5, "inertia": 10},
        },
        "rear": {"mass": 3500, "wheels": ["rl", "rr"], "wheel": {"radius": 0.8, "inertia": 50}},
    }
    base = {
        "mass": 6000,
        "wheelbase": 2.8,
        "track": 1.6,
        "center_of_gravity_height": 1.0,
        "hitch_height": 0.5,
        "axles": axles,
    }
    return Vehicle.from_dict({**base, **more})

"""The development machines that several files of this room look at, each simulated once in a process."""

from __future__ import annotations

from functools import cache

from terragrip.simulation import SimulationResult, families


@cache
def machine(number: int, chassis: families.Chassis = "sprung") -> SimulationResult:
    """One of 24 at 20 Hz; not to be changed."""
    kind, seed = list(families.machines("development", 24, chassis=chassis))[number]
    return families.draw(kind, seed, rate=20.0)

"""Grounds drawn at random: four families of adhesion curves with their resistance and roughness (R)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from terragrip.physics.adhesion import CURVES, brixius_mobility_number
from terragrip.simulation.family_machines import Machine
from terragrip.units import STANDARD_GRAVITY

Tree = dict[str, Any]
WORKING_SLIP = 0.2


class NoSinkage:
    """Firm ground: no soft spot, however long the way is."""

    resistance = 0.0
    sinkage = 0.0
    adhesion_fall = 0.0
    loosening = 0.0

    def __call__(self, length: float) -> list[Tree]:
        """The soft spots of a way of ``length`` [m]."""
        return []


class Sinkage(NoSinkage):
    """Slip-sinkage all the way: one soft spot that holds the whole of it, where slip digs wheels in."""

    def __init__(self, rng: np.random.Generator, scale: float) -> None:
        self.resistance = rng.uniform(0.02, 0.06)
        self.sinkage = rng.uniform(1.0, 4.0)
        self.adhesion_fall = rng.uniform(0.1, 0.35)
        self.loosening = rng.uniform(0.0, 1.5)
        self.length = rng.uniform(0.4, 1.5) * scale

    def __call__(self, length: float) -> list[Tree]:
        return [
            {
                "at": 0.5 * length,
                "length": 4.0 * length,
                "edge": 0.1 * length,
                "front": self.resistance,
                "rear": self.resistance,
                "sinkage": self.sinkage,
                "sinkage_length": self.length,
                "loosening": self.loosening,
                "adhesion_fall": self.adhesion_fall,
            }
        ]


def draw_soils(rng: np.random.Generator, curve: str, machine: Machine) -> tuple[Tree, NoSinkage]:
    """Two to four soils of a family (a name of ``SOILS_OF``) as a scenario writes them, and their slip-sinkage."""
    spots = Sinkage(rng, machine.scale) if curve == "sinkage" else NoSinkage()
    count = int(rng.integers(2, 5))
    return {f"soil{k + 1}": _soil(rng, curve, machine) for k in range(count)}, spots


def capacity(soil: Tree, spots: NoSinkage) -> float:
    """Pull over weight that a soil bears at 20 % of slip, wheels sunk in as that slip makes them."""
    model = CURVES[soil["curve"]["name"]]
    figures = {key: value for key, value in soil["curve"].items() if key != "name"}
    slip = WORKING_SLIP / (1 + spots.loosening)
    adhesion = float(model.positive(np.array([slip]), model.complete(figures))[0])
    adhesion *= 1 - spots.adhesion_fall * WORKING_SLIP
    sunk = spots.resistance * (1 + spots.sinkage * WORKING_SLIP)
    return adhesion - float(soil["resistance"]) - WORKING_SLIP * float(soil["resistance_slip"]) - sunk


def _soil(rng: np.random.Generator, curve: str, machine: Machine) -> Tree:
    form, resistance, by_slip = SOILS_OF[curve](rng, machine)
    return {
        "curve": form,
        "resistance": resistance,
        "resistance_slip": by_slip,
        "adhesion_variation": rng.uniform(0.03, 0.12),
        "resistance_variation": rng.uniform(0.05, 0.15),
        "draught_variation": rng.uniform(0.05, 0.15),
        "correlation_length": rng.uniform(0.6, 1.5) * machine.scale,
        "roughness": rng.uniform(0.0003, 0.002) * machine.scale,
    }


def _saturating(rng: np.random.Generator, machine: Machine) -> tuple[Tree, float, float]:
    """The paper's form (eq. 8) at another rate, or Burckhardt's with little fall."""
    if rng.uniform() < 0.5:
        form = {"name": "exponential", "a": rng.uniform(0.7, 1.4), "alpha_2": -rng.uniform(6.0, 25.0)}
    else:
        rise = rng.uniform(0.35, 0.75)
        form = {
            "name": "burckhardt",
            "c1": rise,
            "c2": rng.uniform(6.0, 30.0),
            "c3": rise * rng.uniform(0.0, 0.1),
        }
    return form, rng.uniform(0.04, 0.1), rng.uniform(0.0, 0.06)


CONE_INDICES = (1e5, 3e6)  # Pa
MOBILITIES = (10.0, 80.0)


def _brixius(rng: np.random.Generator, machine: Machine) -> tuple[Tree, float, float]:
    """Brixius by cone index, 100 kPa to 3 MPa; of those the mobility numbers 10 to 80 (physics.md 5).

    To a machine so light or so heavy that none of them has such a number, any of these, evenly in its logarithm.
    """
    load = machine.corner_mass * STANDARD_GRAVITY
    width, diameter = 0.5 * machine.radius, 2 * machine.radius

    def form(mobility: float) -> tuple[Tree, float, float]:
        return {"name": "brixius", "mobility": mobility}, 1 / mobility, 0.5 / np.sqrt(mobility)

    softest, hardest = (
        brixius_mobility_number(cone_index, width, diameter, load, 0.2 * width, width)
        for cone_index in CONE_INDICES
    )
    if softest >= MOBILITIES[1] or hardest <= MOBILITIES[0]:
        return form(float(np.exp(rng.uniform(*np.log(MOBILITIES)))))
    while True:
        cone_index = float(np.exp(rng.uniform(*np.log(CONE_INDICES))))
        mobility = brixius_mobility_number(cone_index, width, diameter, load, 0.2 * width, width)
        if MOBILITIES[0] <= mobility <= MOBILITIES[1]:
            return form(mobility)


def _sinking(rng: np.random.Generator, machine: Machine) -> tuple[Tree, float, float]:
    """Burckhardt's falling form; slip-sinkage lowers it further and raises the resistance."""
    rise = rng.uniform(0.5, 0.8)
    form = {
        "name": "burckhardt",
        "c1": rise,
        "c2": rng.uniform(8.0, 25.0),
        "c3": rise * rng.uniform(0.05, 0.25),
    }
    return form, rng.uniform(0.03, 0.08), rng.uniform(0.02, 0.1)


def _peaking(rng: np.random.Generator, machine: Machine) -> tuple[Tree, float, float]:
    """Pacejka's form with a clear peak between 5 and 25 % of slip and a fall behind it."""
    form = {
        "name": "pacejka",
        "B": rng.uniform(7.0, 20.0),
        "C": rng.uniform(1.5, 1.85),
        "D": rng.uniform(0.4, 0.7),
        "E": rng.uniform(-0.5, 0.5),
    }
    return form, rng.uniform(0.03, 0.1), rng.uniform(0.02, 0.1)


SOILS_OF: dict[str, Callable[[np.random.Generator, Machine], tuple[Tree, float, float]]] = {
    "saturating": _saturating,
    "brixius": _brixius,
    "sinkage": _sinking,
    "peaking": _peaking,
}
"""By family of curves: (curve, resistance, resistance per unit of slip) of one soil."""

"""Development machines on grounds whose curve is no exponential: what leaving a family of curves out would show, were not all of
ours exponentials (docs/decisions/0156). Forms of the literature that rise slower or sharper; the held-out one is not among them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import MappingProxyType
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from terragrip.physics.adhesion import CURVES, CurveModel, Parameter
from terragrip.simulation import SimulationResult, families, family_soils, scenario, terrain
from terragrip.simulation.families import Kind
from terragrip.simulation.family_machines import Machine

Floats = NDArray[np.float64]


def _contact(x: Floats) -> Floats:
    """Janosi and Hanamoto's shear, slip that grows along an evenly loaded contact patch; slope 1 at 0 as all of these."""
    x = np.maximum(2 * x, 1e-9)
    return 1 + np.expm1(-x) / x


RISES: dict[str, tuple[Callable[[Floats], Floats], float]] = {
    "contact": (_contact, 1.4),
    "brush": (lambda x: 1 - (1 - np.minimum(x / 3, 1.0)) ** 3, 0.6),
    "hyperbola": (lambda x: x / (1 + x), 1.8),
    "tanh": (np.tanh, 0.6),
}
"""Rise by name, and by what the rate is scaled so that slips of three quarters of the height are about the exponential's."""


def _model(name: str) -> CurveModel:
    rise = RISES[name][0]

    def value(s: Floats, q: dict[str, Floats]) -> Floats:
        return np.asarray(q["A"] * rise(q["k"] * s) * (1 - q["f"] * s))

    def slope(s: Floats, q: dict[str, Floats]) -> Floats:
        below = np.maximum(s - 1e-5, 0)
        return np.asarray((value(s + 1e-5, q) - value(below, q)) / (s + 1e-5 - below))

    figures = (("A", 1e-3, 5.0, 0.5), ("k", 0.5, 200.0, 10.0), ("f", -1.0, 1.0, 0.0))
    parameters = tuple(Parameter(key, "1", low, high, start, "") for key, low, high, start in figures)
    return CurveModel(name, parameters, value, slope, "")  # type: ignore[arg-type]


EVERY = MappingProxyType({**CURVES, **{name: _model(name) for name in RISES}})


def machines(count: int, first: int) -> Iterator[tuple[Kind, int]]:
    """Development kinds, the name of a rise in the place of the family of curves."""
    for k, (kind, seed) in enumerate(families.machines("development", count, first)):
        yield Kind(kind.mass, list(RISES)[k % len(RISES)], kind.sensors), seed


def draw(kind: Kind, seed: int, rate: float) -> SimulationResult:
    """A work drive on such ground; soils drawn about as widely as the saturating ones."""
    faster = RISES[kind.curve][1]

    def soil(rng: np.random.Generator, machine: Machine) -> tuple[dict[str, object], float, float]:
        form = {"name": kind.curve, "A": rng.uniform(0.35, 0.8), "k": faster * rng.uniform(6, 25)}
        form["f"] = 0.0 if rng.uniform() < 0.5 else rng.uniform(0.1, 0.5)
        return form, rng.uniform(0.03, 0.12), rng.uniform(0.0, 0.2)

    with (
        patch.object(family_soils, "CURVES", EVERY),
        patch.object(terrain, "CURVES", EVERY),
        patch.object(scenario, "CURVES", EVERY),
        patch.dict(family_soils.SOILS_OF, {"saturating": soil}),
    ):
        return families.draw(Kind(kind.mass, "saturating", kind.sensors), seed, rate=rate)

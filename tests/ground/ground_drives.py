"""Drives of a made-up robot: tables of estimates whose soils are known because they are drawn here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.vehicle import Vehicle

RATE = 20.0
WHEELS = ("fl", "fr", "rl", "rr")
VEHICLE: dict[str, Any] = {
    "name": "robot",
    "mass": "139 kg",
    "wheelbase": "0.64 m",
    "center_of_gravity_height": "0.3 m",
    "hitch_height": "0.25 m",
    "hitch_overhang": "0.1 m",
    "tool_length": "2.0 m",
    "axles": {
        "front": {"mass": "54 kg", "wheels": ["fl", "fr"]},
        "rear": {"mass": "85 kg", "wheels": ["rl", "rr"]},
    },
    "wheel": {"radius": "0.2 m", "inertia": "0.27 kg m^2"},
    "tire_rolling_resistance": 0.03,
    "uncertainty": {"drawbar_force": 0},
}
"""Tows nothing, by its file and by the channels of `drive`."""


@dataclass(frozen=True)
class Ground:
    """A soil as it is drawn: scale of the curve, rho_s, its SD from half second to half second, and within one; slip in the mean."""

    a: float
    resistance: float
    varies: float = 0.01
    rough: float = 0.003
    slip: float = 0.145


GRASS, FINE, COARSE = Ground(0.4, 0.07), Ground(0.85, 0.12), Ground(0.9, 0.14, 0.03, 0.015)


def drive(
    seed: int,
    pieces: Sequence[tuple[str, Ground, float]],
    speed: float = 0.6,
    wander: float = 0.1,
    **about: Any,
) -> Estimates:
    """Estimates along pieces (label, ground, seconds) at constant speed; slip wanders by `wander` about its mean."""
    rng = np.random.default_rng(seed)
    rows = [int(seconds * RATE) for *_, seconds in pieces]
    n = sum(rows)
    time = np.arange(n) / RATE
    label = np.concatenate(
        [np.full(k, name, dtype=object) for (name, *_), k in zip(pieces, rows, strict=True)]
    )

    def each(pick: str) -> np.ndarray:
        return np.concatenate(
            [np.full(k, getattr(ground, pick)) for (_, ground, _), k in zip(pieces, rows, strict=True)]
        )

    slow = np.repeat(rng.standard_normal(n // 10 + 1), 10)[:n]
    resistance = each("resistance") + each("varies") * slow + each("rough") * rng.standard_normal(n)
    slip = each("slip") + wander * np.sin(time / 7 + seed)
    columns = {
        "distance": speed * time,
        "ground_speed": np.full(n, speed),
        "soil_resistance": resistance,
        "soil_resistance_std": np.full(n, 0.005),
        "vertical_load_front": np.full(n, 500.0),
        "vertical_load_rear": np.full(n, 860.0),
    }
    for wheel in WHEELS:
        mu = (
            CURVES["exponential"].value(slip, {"a": 1.0})
            * each("a")
            * (1 + 0.05 * np.repeat(rng.standard_normal(n // 10 + 1), 10)[:n])
        )
        columns |= {
            f"slip_{wheel}": slip + 0.002 * rng.standard_normal(n),
            f"slip_{wheel}_std": np.full(n, 0.002),
            f"adhesion_{wheel}": mu + 2 * each("rough") * rng.standard_normal(n),
            f"adhesion_{wheel}_std": np.full(n, 0.01),
        }
    made = {
        "method": "bank",
        "smooth": False,
        "vehicle": Vehicle.from_dict(VEHICLE).to_dict(),
        "settings": {"channels": ["ground_speed"]},
        **about,
    }
    return Estimates(time, columns, np.zeros(n, dtype=np.uint8), {"soil": label}, made)


def thinned(estimates: Estimates, every: int) -> Estimates:
    """Each `every`-th row: the same drive by a slower logger."""
    return replace(
        estimates,
        time=estimates.time[::every],
        columns={name: values[::every] for name, values in estimates.columns.items()},
        event_codes=estimates.event_codes[::every],
        labels={name: values[::every] for name, values in estimates.labels.items()},
    )


def stopped(estimates: Estimates, at: float, seconds: float) -> Estimates:
    """The same drive with a standstill of some seconds at a moment [s], in which nothing shows slip and adhesion."""
    row, rows = int(at * RATE), int(seconds * RATE)

    def held(values: np.ndarray, value: Any = None) -> np.ndarray:
        return np.insert(values, row, np.full(rows, values[row] if value is None else value))

    at_rest = {
        n: 0.0 if n == "ground_speed" else np.nan
        for n in estimates.columns
        if n.startswith(("slip", "adhesion", "ground"))
    }
    return replace(
        estimates,
        time=np.arange(len(estimates) + rows) / RATE,
        columns={n: held(v, at_rest.get(n)) for n, v in estimates.columns.items()},
        event_codes=held(estimates.event_codes),
        labels={n: held(v) for n, v in estimates.labels.items()},
    )

"""Drives of the families' machines into soft ground that stops most of them, for the warning of immobilization (R).

The machine, its sensors, soils and tool are those of :func:`terragrip.simulation.families.scenario`; the drive is a steady command
into one soft spot as in :mod:`terragrip.simulation.soft_spots`, its lengths scaled as the machine's (its times as their roots).
"""

from __future__ import annotations

import numpy as np

from terragrip.physics.adhesion import CURVES
from terragrip.simulation.families import Kind, scenario
from terragrip.simulation.family_machines import ROBOT_MASS
from terragrip.simulation.family_soils import WORKING_SLIP
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Scenario, SoftSpot
from terragrip.simulation.simulate import SimulationResult, simulate

SOFTNESS = (0.9, 1.5)
"""What the spot asks for over what it bears, before wheels sink in by slip."""


def stop_drive(
    kind: Kind, seed: int, rate: float | None = None, *, drawbar: bool = False
) -> SimulationResult:
    """A machine of a kind, at a steady command into one soft spot; most stop in it, some pass.

    ``rate`` [1/s] as for :func:`terragrip.simulation.families.draw`; ``drawbar``: with the cell that the kind may have.
    Raises InputError on a kind that there is not.
    """
    return simulate(stop_scenario(kind, seed, rate, drawbar=drawbar), seed)


def healthy_drive(
    kind: Kind, seed: int, rate: float | None = None, *, drawbar: bool = False
) -> SimulationResult:
    """The machine's own drive of :func:`terragrip.simulation.families.draw`: rough, with loads, hills, stops and starts.

    Arguments and errors as for :func:`stop_drive`.
    """
    drive = scenario(kind, seed, rate=rate)
    return simulate(drive if drawbar else _without_drawbar(drive), seed)


def stop_scenario(kind: Kind, seed: int, rate: float | None = None, *, drawbar: bool = False) -> Scenario:
    """The scenario that :func:`stop_drive` simulates. Raises as it does."""
    base = scenario(kind, seed, rate=rate)
    rng = stream(seed, f"family stop {kind}")
    scale = float(np.cbrt(float(base.nominal_vehicle().mass) / ROBOT_MASS))
    beat = float(np.sqrt(scale))
    speed = float(rng.choice([value for _, value in base.speed if value not in ("off", 0.0)]))
    length = rng.uniform(3.0, 8.0) * scale
    begin = speed * beat * rng.uniform(4.0, 15.0)
    bears, resistance = _bears(base)
    pull = max(
        (t.mass * max(t.friction.values(), default=0.0) for t in base.tools if isinstance(t.friction, dict)),
        default=0.0,
    ) / float(base.nominal_vehicle().mass)
    loss = rng.uniform(0.05, 0.35)
    added = max(rng.uniform(*SOFTNESS) * bears * (1 - loss) - resistance - pull, 0.01)
    share = rng.uniform(0.35, 0.65)
    spot = SoftSpot(
        at=begin + 0.5 * length,
        length=length,
        edge=rng.uniform(0.2, 0.5) * length,
        front=2 * share * added,
        rear=2 * (1 - share) * added,
        sinkage=rng.uniform(0.2, 1.0),
        sinkage_length=rng.uniform(0.4, 1.5) * scale,
        loosening=rng.uniform(1.0, 3.0),
        adhesion_loss=loss,
        adhesion_fall=rng.uniform(0.1, 0.5),
    )
    duration = min(3 * beat + (begin + 1.5 * length) / speed + 10 * beat, 200.0)
    drive = base.model_copy(
        update={
            "soft_spots": (*base.soft_spots, spot),
            "tools": tuple(tool.model_copy(update={"added": ()}) for tool in base.tools),
            "speed": ((0.0, "off"), (2 * beat, 0.0), (3 * beat, speed), (duration, speed)),
            "duration": duration,
            "name": f"{base.name}-stop",
        }
    )
    return drive if drawbar else _without_drawbar(drive)


def _without_drawbar(drive: Scenario) -> Scenario:
    return drive.model_copy(update={"sensors": drive.sensors.model_copy(update={"drawbar_force": None})})


def _bears(base: Scenario) -> tuple[float, float]:
    """Adhesion at WORKING_SLIP and resistance of the drive's soils, their means."""
    adhesions = []
    for soil in base.soils.values():
        model = CURVES[soil.curve["name"]]
        figures = {key: value for key, value in soil.curve.items() if key != "name"}
        adhesions.append(float(model.positive(np.array([WORKING_SLIP]), model.complete(figures))[0]))
    sunk = sum(spot.front for spot in base.soft_spots)
    return float(np.mean(adhesions)), float(np.mean([s.resistance for s in base.soils.values()])) + sunk

"""What a chassis that resists warp makes of the heights under its wheels (R; docs/decisions/0144)."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats
from terragrip.simulation.fields import Field
from terragrip.simulation.route import Path
from terragrip.simulation.scenario import Scenario
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

LEAST_LOAD = -0.9  # relative: a wheel that a hill all but lifts


def warp_stiffness(vehicle: Vehicle, torsion: float) -> Floats:
    """Forces that corner heights cause through a chassis that resists what is no heave, pitch or roll (n, n) [N/m].

    ``torsion`` is the force at each wheel of a two-axle, four-wheel chassis per metre of one diagonal over the other.
    """
    ahead = vehicle.axle_to_rear[vehicle.wheel_axle]
    swings = [
        np.where(vehicle.wheel_axle == k, vehicle.wheel_side, 0.0) for k in np.flatnonzero(vehicle.pivoting)
    ]
    rigid = np.stack([np.ones(len(ahead)), ahead - ahead.mean(), vehicle.wheel_side, *swings], axis=1)
    return 4.0 * torsion * (np.eye(len(ahead)) - rigid @ np.linalg.pinv(rigid))


def hill_loads(scenario: Scenario, vehicle: Vehicle, path: Path, hills: Field, height: float) -> Floats:
    """What hills that twist and bend under the wheels add to each wheel's load at rest (wheels, n), relative, at its own places.

    ``height`` [m] is the SD of ``hills``. Quasi-static, since hills are long: tyre and chassis are springs in a row.
    """
    robot, axle, sides = scenario.robot, vehicle.wheel_axle, vehicle.wheel_side
    ahead = vehicle.axle_to_rear[axle]
    track = {y: height * hills.at(*path.beside(y)) for y in set(sides)}
    under = np.stack([np.interp(path.x + x, path.x, track[y]) for x, y in zip(ahead, sides, strict=True)])
    stiff = robot.tire_stiffness / (robot.tire_stiffness + 4.0 * robot.chassis_torsion)
    force = stiff * warp_stiffness(vehicle, robot.chassis_torsion) @ under
    at_rest = STANDARD_GRAVITY * (vehicle.axle_mass / np.bincount(axle))[axle]
    relative = np.maximum(force / at_rest[:, None], LEAST_LOAD)
    return np.stack([np.interp(path.x - x, path.x, one) for x, one in zip(ahead, relative, strict=True)])

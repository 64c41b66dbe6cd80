"""From an engine's torque to the sum of its wheels' torques: power through gears, less what else takes power (R)."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats


def wheel_torque(engine_torque: Floats, ratio: Floats, efficiency: float) -> Floats:
    """Sum of the driven wheels' torques (n,) [N m] of the torque (n,) [N m] that goes into the gears.

    ``ratio`` (n,): engine speed over wheel speed, negative in reverse. Power is lost whichever way it goes: when the ground drives the
    engine, the wheels give more than the engine takes. The engine turns one way, so that its torque's sign says which way power goes.
    """
    return ratio * engine_torque * np.where(engine_torque > 0, efficiency, 1 / efficiency)


def torque_into_gears(
    engine_torque: Floats,
    engine_speed: Floats,
    engine_acceleration: Floats,
    *,
    other_power: Floats,
    engine_inertia: float,
) -> Floats:
    """Torque (n,) [N m] left for the gears: the engine's, less that of what else it drives and of its own acceleration (n,) [rad/s²].

    ``other_power`` (n,) [W], of accessories and a PTO, is divided by ``engine_speed`` (n,) [rad/s], NaN where that is not positive.
    """
    speed = np.where(engine_speed > 0, engine_speed, np.nan)
    left: Floats = engine_torque - other_power / speed - engine_inertia * engine_acceleration
    return left


def torque_spread(
    engine_speed: Floats, ratio: Floats, efficiency: float, torque_std: float, power_std: Floats
) -> Floats:
    """SD (n,) [N m] of the sum of wheel torques by the engine torque's [N m] and by ``power_std`` (n,) [W] of the rest: constants."""
    speed = np.where(engine_speed > 0, engine_speed, np.nan)
    spread: Floats = efficiency * np.abs(ratio) * np.hypot(torque_std, power_std / speed)
    return spread

"""Slip of a driven wheel (paper eq. 6)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

STANDSTILL_SPEED = 0.05
"""Default speed [m/s] up to which vehicle and wheel count as standing."""


def slip(
    wheel_speed: ArrayLike,
    ground_speed: ArrayLike,
    rolling_radius: ArrayLike,
    *,
    standstill_speed: float = STANDSTILL_SPEED,
) -> NDArray[Any]:
    """Slip s between -1 (locked wheel) and 1 (spinning on the spot), paper eq. 6.

    s = 1 - |v|/(r|ω|) if |v| <= r|ω|, else -1 + r|ω|/|v|. ASABE S296 calls it slip or travel reduction ratio,
    there over a zero condition of the user's choice, here over the rolling radius.

    Parameters
    ----------
    wheel_speed: ω, rad/s, any shape. ground_speed: v, m/s. rolling_radius: r, m. They broadcast.
    standstill_speed: m/s; where both |v| and r|ω| are at or under it, slip is undefined and the
        result is NaN.

    Returns
    -------
    The broadcast shape. As in the paper only magnitudes enter: a wheel that turns against the travel gets the
    slip of one that turns with it.
    """
    travel = np.abs(np.asarray(ground_speed))
    rim = np.abs(np.asarray(rolling_radius) * np.asarray(wheel_speed))
    travel, rim = np.broadcast_arrays(travel, rim)
    faster = np.maximum(travel, rim)
    moving = faster > standstill_speed  # also False for NaN and for 0/0
    change = (rim - travel) / np.where(moving, faster, 1)
    return np.where(moving, change, np.nan)


def middle_speed(
    there: ArrayLike, yaw_rate: ArrayLike, *, ahead: float = 0.0, side: float = 0.0
) -> NDArray[Any]:
    """Speed along the vehicle [m/s] of the middle that it turns about, from that of a receiver (rigid body), the broadcast shape.

    ``there``: the receiver's speed √((v - side yaw_rate)² + (ahead yaw_rate)²) [m/s], of the sign of the travel; ``yaw_rate`` [rad/s], left
    positive; ``ahead``, ``side`` [m]: where it is, to the left positive.
    """
    speed, yaw = np.asarray(there), np.asarray(yaw_rate)
    along = np.sqrt(np.maximum(speed**2 - (ahead * yaw) ** 2, 0.0))
    return np.asarray(np.copysign(along, speed) + side * yaw)


def hub_speed(along: ArrayLike, across: ArrayLike) -> NDArray[Any]:
    """Speed of the hub of a steered wheel, which points along its way [m/s, of the sign of ``along``], any shape.

    ``along`` the vehicle: v - side x yaw rate; ``across`` it: how far ahead of the axle that does not steer, times the yaw rate; 0 of a
    wheel that does not steer.
    """
    return np.asarray(np.copysign(np.hypot(along, across), along))

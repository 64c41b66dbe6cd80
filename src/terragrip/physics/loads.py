"""Vertical loads of axles and wheels from plain mechanics (physics.md 3).

The paper takes the front load as an input whose source is not public. A measured axle load, where there is
one, replaces these formulas.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

GRAVITY = 9.80665
"""Standard gravity, m/s²."""


def axle_loads(
    axle_mass: ArrayLike,
    axle_position: ArrayLike,
    *,
    center_of_gravity_height: float,
    hitch_height: float = 0.0,
    hitch_overhang: float = 0.0,
    drawbar: ArrayLike = 0.0,
    hitch_load: ArrayLike = 0.0,
    acceleration: ArrayLike = 0.0,
    slope: ArrayLike = 0.0,
    spin_torque: ArrayLike = 0.0,
    gravity: float = GRAVITY,
) -> NDArray[Any]:
    """Vertical load of each axle, N, along the normal of the ground (physics.md 3).

    Two axles, moments about the rear contact, L the wheelbase, l_r from there to the centre of gravity::

        F_zf L = m g cosθ l_r - m (dv/dt + g sinθ) h - F_dx h_d - F_dz c - Σ J dω/dt
        F_zr   = m g cosθ + F_dz - F_zf

    One axle carries the whole weight and the hitch load; moments go into the hitch. More than two axles are a
    rigid body on equal springs: each axle carries its own mass, and the change is a straight line over its
    position, fixed by the sum and the moment (R). For two axles that is the formula above.

    Parameters
    ----------
    axle_mass: (axles,) kg, weighed on each axle of the level, standing, uncoupled vehicle, front to rear.
    axle_position: (axles,) m ahead of the rear axle, which is 0; none rises. The two of a bogie, which shares its load evenly: that
        of its pivot.
    center_of_gravity_height, hitch_height: h and h_d, m above ground. hitch_overhang: c, m behind the rear
        axle.
    drawbar: F_dx, N, backward pull positive. hitch_load: F_dz, N, downwards positive.
    acceleration: dv/dt, m/s². slope: θ, rad, uphill positive. spin_torque: Σ J dω/dt, N m. These five
        broadcast.

    Returns
    -------
    (..., axles): the broadcast shape of the last five, then the axles. A negative value says that the axle
    would lift: it is not clipped here.

    Raises
    ------
    ValueError: masses and positions differ in number, a mass is not positive, or positions rise or do not end at 0.
    """
    mass = np.asarray(axle_mass)
    position = np.asarray(axle_position)
    if mass.ndim != 1 or mass.shape != position.shape or mass.size == 0:
        raise ValueError(f"one mass and one position an axle, got shapes {mass.shape} and {position.shape}")
    if not np.all(mass > 0):
        raise ValueError(f"axle masses must be positive, got {mass}")
    if position[-1] != 0 or not np.all(np.diff(position) <= 0) or (position.size > 1 and position[0] == 0):
        raise ValueError(f"axle positions must fall from front to rear and end at 0, got {position}")

    drawbar, hitch_load, acceleration, slope, spin_torque = (
        np.asarray(value)[..., np.newaxis]
        for value in (drawbar, hitch_load, acceleration, slope, spin_torque)
    )
    static = mass * gravity * np.cos(slope)
    hanging = hitch_load * point_load_shares(position, -hitch_overhang)
    if mass.size == 1:
        shape = np.broadcast_shapes(
            *(v.shape for v in (drawbar, hitch_load, acceleration, slope, spin_torque))
        )
        return np.broadcast_to(static + hanging, shape).copy()
    moment = (  # about the rear contact, nose down positive, of all that is added to the static weight
        -np.sum(mass) * (acceleration + gravity * np.sin(slope)) * center_of_gravity_height
        - drawbar * hitch_height
        - spin_torque
    )
    return static + hanging + moment * load_levers(position)


def point_load_shares(axle_position: ArrayLike, position: float) -> NDArray[Any]:
    """Part of a vertical force that each axle carries (axles,): x/L and 1 - x/L of two (physics.md 3).

    Of any number 1/n + lever (x - mean position). ``axle_position``: (axles,) m ahead of the rear axle. ``position``: x, where the
    force acts, likewise: behind the rear axle it is negative, and so is the front axle's part. A single axle carries all.
    """
    axles = np.asarray(axle_position, dtype=float)
    return 1 / axles.size + load_levers(axles) * (position - np.mean(axles))


def load_levers(axle_position: ArrayLike) -> NDArray[Any]:
    """Load that each axle gains per N m of nose-down moment (axles,) [1/m]: ±1/L of two axles (physics.md 3).

    ``axle_position``: (axles,) m ahead of the rear axle. A single axle gains none: the hitch takes moments.
    """
    position = np.asarray(axle_position, dtype=float)
    offset = position - np.mean(position)
    return offset / np.sum(offset**2) if position.size > 1 else np.zeros(1)


def wheel_shares(
    wheels: Sequence[int],
    *,
    center_of_gravity_height: float,
    track: float | None,
    axle_mass: ArrayLike,
    pins: Mapping[int, float] | None = None,
    gravity: float = GRAVITY,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Of every wheel (n,): its share of its axle's load, and what it loses of that per m/s² to the left [s²/m].

    ``wheels``: how many each axle has, front to rear. ``track`` [m]; None: nothing is known of the sides, no share changes.
    So that a load is axle_load (share - lateral a_y), as :func:`lateral_shares` has it. ``pins``: by an axle's index the height [m] of
    the pin on which it pivots; it holds the moment of what it carries (``axle_mass`` (axles,) [kg]) from there down, an axle of one wheel
    none, and the other axles the rest (physics.md 3).
    """
    level = np.concatenate([np.full(count, 1 / count) for count in wheels])
    if track is None:
        return level, np.zeros_like(level)
    mass = np.asarray(axle_mass, dtype=float)
    own = {k: 0.0 for k, count in enumerate(wheels) if count == 1} | dict(pins or {})
    rigid = np.array([k not in own for k in range(len(wheels))])
    rest = sum(mass[k] * (center_of_gravity_height - height) for k, height in own.items())
    held = center_of_gravity_height + (rest / mass[rigid].sum() if rigid.any() else 0.0)
    leaning = [
        lateral_shares(count, 1.0, center_of_gravity_height=own.get(k, held), track=track, gravity=gravity)
        for k, count in enumerate(wheels)
    ]
    return level, level - np.concatenate(leaning)


def lateral_shares(
    wheels: int,
    lateral_acceleration: ArrayLike,
    *,
    center_of_gravity_height: float,
    track: float,
    gravity: float = GRAVITY,
) -> NDArray[Any]:
    """Each wheel's share of its axle's load, left to right: 1/2 ∓ (a_y/g) h/track (physics.md 3).

    Parameters
    ----------
    wheels: on the axle, from left to right. One wheel takes all; more than two stand at equal distances
        across the track and share as equal springs (R).
    lateral_acceleration: a_y, m/s², to the left positive; (...).
    center_of_gravity_height: h, m. track: m between the outermost wheels.

    Returns
    -------
    (..., wheels), each row's sum 1. A negative share says that the wheel would lift.
    """
    lateral = np.asarray(lateral_acceleration)[..., np.newaxis]
    if wheels == 1:
        return np.ones(lateral.shape)
    left = np.linspace(track / 2, -track / 2, wheels)
    return 1 / wheels - lateral / gravity * center_of_gravity_height * left / np.sum(left**2)

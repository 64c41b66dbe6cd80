"""Longitudinal motion of wheels and vehicle (paper eq. 2 and 3, physics.md 1), any number of wheels.

Wheels are the last axis of ``wheel_speed``, ``torque``, ``adhesion`` and ``load``; all other axes broadcast.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wheel_acceleration(
    wheel_speed: ArrayLike,
    torque: ArrayLike,
    adhesion: ArrayLike,
    load: ArrayLike,
    *,
    radius: ArrayLike,
    inertia: ArrayLike,
    tire_resistance: ArrayLike,
    bearing_resistance: ArrayLike,
) -> NDArray[Any]:
    """dω_i/dt = (M_i - r μ_i F_zi - r ρ_t F_zi - r ρ_w ω_i)/J_i, rad/s² (paper eq. 2).

    Parameters
    ----------
    wheel_speed: ω, rad/s. torque: M, N m at the wheel. adhesion: μ. load: F_z, N. All (..., wheels).
    radius: torque arm r, m. inertia: J, kg m², of wheel and geared rotor. tire_resistance: ρ_t.
    bearing_resistance: ρ_w, N s/rad (torque r ρ_w ω). Scalars or (wheels,).
    """
    speed, arm, load = np.asarray(wheel_speed), np.asarray(radius), np.asarray(load)
    drag = np.asarray(tire_resistance) * load + np.asarray(bearing_resistance) * speed
    return (np.asarray(torque) - arm * (np.asarray(adhesion) * load + drag)) / np.asarray(inertia)


def ground_acceleration(
    adhesion: ArrayLike,
    load: ArrayLike,
    drawbar: ArrayLike,
    soil_resistance: ArrayLike,
    slope: ArrayLike,
    *,
    mass: ArrayLike,
    gravity: ArrayLike,
    hitch_load: ArrayLike = 0.0,
) -> NDArray[Any]:
    """dv/dt = Σ μ_i F_zi/m - F_dx/m - ρ_s (g cosθ + F_dz/m) - g sinθ, m/s² (paper eq. 3, where θ and F_dz are 0).

    adhesion and load (..., wheels), load in N; drawbar F_dx N, backward pull positive; soil_resistance ρ_s;
    slope θ rad, uphill positive; mass kg; gravity m/s²; hitch_load F_dz N, what hangs on the hitch, down positive. Returns (...).
    """
    return specific_force(
        adhesion, load, drawbar, soil_resistance, slope, mass=mass, gravity=gravity, hitch_load=hitch_load
    ) - np.asarray(gravity) * np.sin(slope)


def specific_force(
    adhesion: ArrayLike,
    load: ArrayLike,
    drawbar: ArrayLike,
    soil_resistance: ArrayLike,
    slope: ArrayLike,
    *,
    mass: ArrayLike,
    gravity: ArrayLike,
    hitch_load: ArrayLike = 0.0,
) -> NDArray[Any]:
    """What an accelerometer along the vehicle reads: a_x = (Σ μ_i F_zi - F_dx)/m - ρ_s (g cosθ + F_dz/m), m/s²
    (physics.md 1).

    It is dv/dt + g sinθ, so it does not see the slope but through cosθ. Arguments and shape as in
    :func:`ground_acceleration`; a bias of the sensor is not in it.
    """
    thrust = np.sum(np.asarray(adhesion) * np.asarray(load), axis=-1)
    resistance = np.asarray(soil_resistance) * (
        gravity * np.cos(slope) + np.asarray(hitch_load) / np.asarray(mass)
    )
    return (thrust - np.asarray(drawbar)) / np.asarray(mass) - resistance


def algebraic_adhesion(
    wheel_speed: ArrayLike,
    wheel_acceleration: ArrayLike,
    torque: ArrayLike,
    load: ArrayLike,
    *,
    radius: ArrayLike,
    inertia: ArrayLike,
    tire_resistance: ArrayLike,
    bearing_resistance: ArrayLike,
) -> NDArray[Any]:
    """μ_i = (M_i - J_i dω_i/dt - r ρ_w ω_i)/(r F_zi) - ρ_t: eq. 2 solved for the adhesion (physics.md 1).

    wheel_acceleration dω/dt in rad/s²; the others as in :func:`wheel_acceleration`. Returns (..., wheels).
    """
    arm = np.asarray(radius)
    friction = arm * np.asarray(bearing_resistance) * np.asarray(wheel_speed)
    drive = np.asarray(torque) - np.asarray(inertia) * np.asarray(wheel_acceleration) - friction
    return drive / (arm * np.asarray(load)) - np.asarray(tire_resistance)


def algebraic_soil_resistance(
    adhesion: ArrayLike,
    load: ArrayLike,
    drawbar: ArrayLike,
    acceleration: ArrayLike,
    slope: ArrayLike,
    *,
    mass: ArrayLike,
    gravity: ArrayLike,
    hitch_load: ArrayLike = 0.0,
) -> NDArray[Any]:
    """ρ_s = (Σ μ_i F_zi - F_dx - m dv/dt - m g sinθ)/(m g cosθ + F_dz): eq. 3 solved for the resistance (physics.md 1).

    acceleration dv/dt in m/s², not the specific force; the others as in :func:`ground_acceleration`.
    Returns (...).
    """
    without_resistance = ground_acceleration(adhesion, load, drawbar, 0.0, slope, mass=mass, gravity=gravity)
    normal = np.asarray(gravity) * np.cos(slope) + np.asarray(hitch_load) / np.asarray(mass)
    return (without_resistance - np.asarray(acceleration)) / normal

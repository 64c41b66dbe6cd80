"""The plain Kalman filter that every other estimate is held against: physics.md 1, exactly discretised, one fixed Q.

Written apart from the kernel, in NumPy, as a user would: nothing adapts, nothing is weighed, no row is an outlier. It runs five
process noises at once; which of them is taken is decided afterwards, machine by machine, which no user can do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.physics.loads import axle_loads
from terragrip.recording import Recording
from terragrip.units import STANDARD_GRAVITY as G
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]

INTENSITIES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""1/s, how fast the variance of each wheel's adhesion grows; that of soil resistance grows a tenth as fast."""
MISSING = 1e12  # variance of a channel that a row does not hold


@dataclass(frozen=True)
class PlainEstimates:
    """States (q, rows, 2 n + 2) for each of INTENSITIES and their covariance's diagonal: n wheel speeds, ground speed, n
    adhesions, soil resistance. ``cross``: (q, rows, n), covariance of each wheel speed with the ground speed; ``net``: (q, rows,
    n), of each adhesion with the soil resistance. ``load``: (q, rows, n) [N], the loads it went by.
    """

    state: Floats
    variance: Floats
    cross: Floats
    net: Floats
    load: Floats


def held(values: Floats) -> Floats:
    """The last value before each row (n,), the first one before that."""
    seen = np.isfinite(values)
    last = np.maximum.accumulate(np.where(seen, np.arange(len(values)), -1))
    return np.asarray(values[np.where(last < 0, np.argmax(seen), last)])


def plain_filter(recording: Recording, vehicle: Vehicle) -> PlainEstimates:
    """Filter a recording with the vehicle file's noise, gains and offsets, at each of INTENSITIES."""
    n, time, sd = len(vehicle.wheels), recording.time, vehicle.sensors
    m, states = n + 1, 2 * n + 2
    radius, inertia, mass, axle = (
        vehicle.wheel_radius,
        vehicle.wheel_inertia,
        vehicle.mass,
        vehicle.wheel_axle,
    )
    torque = np.stack([_torque(recording, vehicle, i) for i in range(n)], axis=1)
    pull = np.zeros(len(time))
    if "drawbar_force" in recording.channels:
        pull = held(recording["drawbar_force"]) - vehicle.calibration.drawbar_offset
    seen = np.stack(
        [recording[f"wheel_speed_{w}"] for w in vehicle.wheels] + [recording["ground_speed"]], axis=1
    )
    noise = np.where(np.isfinite(seen), np.array([sd.wheel_speed] * n + [sd.ground_speed]) ** 2, MISSING)
    seen = np.nan_to_num(seen)
    share = 1.0 / np.bincount(axle)[axle]
    still = axle_loads(vehicle.axle_mass, vehicle.axle_to_rear, center_of_gravity_height=0.0)
    by_pull = _by(vehicle, drawbar=1.0) - still
    by_acceleration = _by(vehicle, acceleration=1.0) - still

    q = len(INTENSITIES)
    decay = radius * vehicle.bearing_resistance / inertia
    x, P = np.zeros((q, states)), np.zeros((q, states, states))
    x[:, :m] = np.where(noise[0] < MISSING, seen[0], 0.0)
    x[:, m:] = 0.1
    P[:] = np.diag([1.0] * m + [0.25] * n + [0.1])
    walk = np.array(INTENSITIES)
    F = np.tile(np.eye(states), (q, 1, 1))
    rows, every, added = np.arange(n), np.arange(states), np.zeros((q, states))
    out = PlainEstimates(
        np.empty((q, len(time), states)), np.empty((q, len(time), states)), np.empty((q, len(time), n)),
        np.empty((q, len(time), n)), np.empty((q, len(time), n)),
    )  # fmt: skip
    acceleration = np.zeros(q)
    for k in range(len(time)):
        load = (still + pull[k] * by_pull + acceleration[:, None] * by_acceleration)[:, axle] * share
        load = np.maximum(load, 0.05 * mass * G / n)
        if k:
            dt = time[k] - time[k - 1]
            keep = np.exp(-decay * dt)
            gain = np.where(decay * dt > 1e-9, (1 - keep) / np.where(decay > 0, decay, 1.0), dt) / inertia
            drive = 0.5 * (torque[k] + torque[k - 1])
            F[:, rows, rows] = keep
            F[:, rows, m + rows] = -gain * radius * load
            F[:, n, m : m + n] = dt * load / mass
            F[:, n, -1] = -dt * G
            before = x[:, n].copy()
            x = (F @ x[..., None])[..., 0]
            x[:, :n] += gain * (
                drive - radius * vehicle.tire_rolling_resistance * load * np.sign(seen[k, :n])
            )
            x[:, n] -= dt * 0.5 * (pull[k] + pull[k - 1]) / mass
            acceleration = (x[:, n] - before) / dt
            P = F @ P @ F.transpose(0, 2, 1)
            added[:, :n] = (gain * (sd.drive_torque or 0.0)) ** 2
            added[:, n] = (dt / mass * (sd.drawbar_force or 0.0)) ** 2
            added[:, m:-1] = walk[:, None] * dt
            added[:, -1] = 0.1 * walk * dt
            P[:, every, every] += added
        S = P[:, :m, :m] + np.diag(noise[k])
        K = np.linalg.solve(S, P[:, :m, :]).transpose(0, 2, 1)
        x += (K @ (seen[k] - x[:, :m])[..., None])[..., 0]
        P -= K @ P[:, :m, :]
        P = 0.5 * (P + P.transpose(0, 2, 1))
        out.state[:, k], out.load[:, k] = x, load
        out.variance[:, k] = np.diagonal(P, axis1=1, axis2=2)
        out.cross[:, k], out.net[:, k] = P[:, :n, n], P[:, m : m + n, -1]
    return out


def _torque(recording: Recording, vehicle: Vehicle, wheel: int) -> Floats:
    name = f"drive_torque_{vehicle.wheels[wheel]}"
    if not vehicle.driven[wheel] or name not in recording.channels:
        return np.zeros(len(recording.time))
    return (held(recording[name]) - vehicle.drive_torque_offset[wheel]) / vehicle.drive_torque_gain[wheel]


def _by(vehicle: Vehicle, *, drawbar: float = 0.0, acceleration: float = 0.0) -> Floats:
    return axle_loads(
        vehicle.axle_mass,
        vehicle.axle_to_rear,
        center_of_gravity_height=vehicle.center_of_gravity_height,
        hitch_height=vehicle.hitch_height,
        hitch_overhang=vehicle.hitch_overhang,
        drawbar=drawbar,
        acceleration=acceleration,
    )

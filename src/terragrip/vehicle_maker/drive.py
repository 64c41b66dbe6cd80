"""A short drive of a machine by the equations of motion, quasi-steady: what its sensors would read while it pulls more and less.

It is no simulation of a machine (that is `terragrip.simulation`): no tyres, no motors, level even ground. It is for how wide
intervals get, which hangs on the machine and its sensors, and is ready in milliseconds.
"""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.physics.adhesion import CURVES
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from terragrip.vehicle_maker.fields import Signals

RATE = 10.0  # rows a second
LIGHT = 50.0  # s without load, first
_WORK = 60.0  # s
_SOIL = {"a": 1.42}  # the paper's hard ground,
_RESISTANCE = 0.08  # and a rolling resistance between its hard and its fine one
_PULL = 0.3  # of the driven wheels' load, at most
_SPEED_NOISE, _FORCE_NOISE = 0.02, 0.005  # m/s; of the weight (R)


def drive(
    vehicle: Vehicle, speed: float, signals: Signals, *, tows: bool, has_light_work: bool = True
) -> Recording:
    """The recording (n rows) of a drive at a speed [m/s]: standing, driving without load, pulling in steps.

    ``vehicle`` needs wheels. ``signals``: what is measured beside the ground speed. Without light work it pulls all the way.
    """
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 5.0 + LIGHT + _WORK, 1 / RATE)
    ground = speed * np.clip((time - 5.0) / 3.0, 0.0, 1.0)
    ground *= 1 + 0.1 * np.sin(2 * np.pi * time / 20.0)
    weight = vehicle.mass * GRAVITY
    share = (
        _pull(time, has_light_work)
        * _PULL
        * float(vehicle.axle_mass[_driven_axles(vehicle)].sum())
        / vehicle.mass
    )
    pull = share * weight if tows else np.zeros(len(time))
    soft = (
        np.full(len(time), _RESISTANCE) if tows else _RESISTANCE + share
    )  # what tows nothing works in soft ground
    turning, torque = _wheels(vehicle, time, ground, pull, soft)
    columns = {"ground_speed": ground + _SPEED_NOISE * rng.standard_normal(len(time))}
    if signals == "bus-speed":
        driven = np.flatnonzero(vehicle.driven)
        rim = np.mean(turning[:, driven] * vehicle.wheel_radius[driven], axis=1)
        columns["wheel_based_speed"] = rim + _SPEED_NOISE * rng.standard_normal(len(time))
        return Recording(time, columns)
    for i, wheel in enumerate(vehicle.wheels):
        noise = _SPEED_NOISE / vehicle.wheel_radius[i] * rng.standard_normal(len(time))
        columns[f"wheel_speed_{wheel}"] = turning[:, i] + noise
        if signals == "torque" and vehicle.driven[i]:
            noise = _FORCE_NOISE * weight * vehicle.wheel_radius[i] * rng.standard_normal(len(time))
            columns[f"drive_torque_{wheel}"] = torque[:, i] + noise
    if signals == "torque" and tows:
        columns["drawbar_force"] = pull + _FORCE_NOISE * weight * rng.standard_normal(len(time))
    return Recording(time, columns)


def _driven_axles(vehicle: Vehicle) -> Bools:
    return np.array([axle.driven for axle in vehicle.axles.values()])


def _pull(time: Floats, has_light_work: bool) -> Floats:
    """Share (n,) of the pull, from 0 to 1: none on the light stretch, then steps with ramps; without such a stretch always the same."""
    if not has_light_work:
        return np.full(len(time), 0.8)  # all alike, so that nothing shows light work from field work
    begin = 5.0 + LIGHT
    steps = np.array([0.0, 0.6, 1.0, 0.4, 0.8, 1.0, 0.5, 0.9])
    late = (time - begin) / 8.0
    return np.where(
        late > 0, np.interp(late % len(steps), [*range(len(steps)), len(steps)], [*steps[1:], 0.6, 0.6]), 0.0
    )


def _wheels(
    vehicle: Vehicle, time: Floats, ground: Floats, pull: Floats, soft: Floats
) -> tuple[Floats, Floats]:
    """Wheel speeds [rad/s] and torques [N m] (n, wheels): driven wheels share one adhesion, the others roll."""
    push = np.gradient(ground, time)
    loads = vehicle.axle_loads(drawbar=pull, acceleration=push)
    load = (loads / np.bincount(vehicle.wheel_axle))[:, vehicle.wheel_axle]
    radius, driven = vehicle.wheel_radius, vehicle.driven
    moves = (ground > 0).astype(float)
    drag = moves[:, None] * (
        vehicle.tire_rolling_resistance * load + vehicle.wheel_bearing * ground[:, None] / radius
    )
    spin = vehicle.wheel_inertia * push[:, None] / radius
    free = np.where(driven, 0.0, -(drag + spin / radius))  # force of a wheel that no torque turns
    needed = moves * soft * vehicle.mass * GRAVITY + pull + vehicle.mass * push
    thrust = needed - free.sum(axis=1)
    adhesion = np.where(driven, (thrust / load[:, driven].sum(axis=1))[:, None], free / load)
    grid = np.linspace(0.0, 0.6, 601)
    curve = np.asarray(CURVES["exponential"].value(grid, _SOIL))
    slip = np.sign(adhesion) * np.interp(np.abs(adhesion), curve, grid)
    turning = np.where(slip > 0, ground[:, None] / (1 - slip), ground[:, None] * (1 + slip)) / radius
    torque = np.where(driven, spin + radius * (adhesion * load + drag), 0.0)
    return turning, torque

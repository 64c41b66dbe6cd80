"""The kernel's settings (tg_settings) of a vehicle: machine, loads, calibration, spreads, noise."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip._kernel import ffi, lib
from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.methods import Method
from terragrip.estimation.noise import DELAY, is_positive
from terragrip.physics.loads import GRAVITY, load_levers
from terragrip.physics.radius import biderman_deflection, hadekel_deflection, loaded_radius, rolling_radius
from terragrip.recording.checks import require_hitch
from terragrip.vehicle import Vehicle
from terragrip.vehicle_parts import BidermanRadius, HadekelRadius, Wheel


@dataclass(frozen=True)
class Thresholds:
    """The user's settings. Speeds in m/s, times in s; None keeps the kernel's tuned default."""

    gap: float | None = None
    standstill_speed: float | None = None
    together: int = 1  # wheels that each wheel of the vehicle represents

    def __post_init__(self) -> None:
        for name, unit in (("gap", "seconds"), ("standstill_speed", "m/s")):
            value = getattr(self, name)
            if value is not None and not is_positive(value):
                raise InputError(
                    f"{name} is {value!r}", hint=f"give a positive number of {unit}, or leave it out"
                )

    def put(self, settings: Any) -> None:
        """Write the user's settings into a tg_settings."""
        for name in ("gap", "standstill_speed"):
            value = getattr(self, name)
            if value is not None:
                setattr(settings, name, value)
        if (
            self.together > 1
        ):  # bumps come and go under single wheels; what all do together is the pull, not a load unseen
            settings.tuned.uneven_memory = 1e9


WITHOUT_TORQUE = 2 / 3
"""Where slip alone is estimated, the warning has three of its five signs: its score warns above this share of the whole."""


def watch_limits(wheel_radius: float = 0.2) -> dict[str, float]:
    """The thresholds by which the estimator flags rows: tg_watch_settings, ``gap`` [s] and ``standstill_speed`` [m/s].

    ``wheel_radius`` [m]: the machine's mean one, which sets the speed of standstill; default: the robot of physics.md 8.
    """
    settings = lib.tg_default_settings()
    names = [name for name, _ in ffi.typeof("tg_watch_settings").fields]
    found = {name: float(getattr(settings.watch, name)) for name in names}
    standing = float(settings.tuned.standstill) * math.sqrt(GRAVITY * wheel_radius)
    return found | {"gap": float(settings.gap), "standstill_speed": standing}


def sample_slots(vehicle: Vehicle) -> dict[str, int]:
    """The place in tg_sample.value of each recording column that the estimator uses."""
    return {
        **{f"wheel_speed_{w}": lib.TG_WHEEL_SPEED + i for i, w in enumerate(vehicle.wheels)},
        "ground_speed": lib.TG_GROUND_SPEED,
        **{f"drive_torque_{w}": lib.TG_DRIVE_TORQUE + i for i, w in enumerate(vehicle.wheels)},
        "drawbar_force": lib.TG_DRAWBAR_FORCE,
        "acceleration_x": lib.TG_ACCELERATION_X,
        "acceleration_y": lib.TG_ACCELERATION_Y,
        "pitch": lib.TG_PITCH,
        "roll": lib.TG_ROLL,
        "angular_velocity_z": lib.TG_YAW_RATE,
        **{f"vertical_load_{a}": lib.TG_VERTICAL_LOAD + k for k, a in enumerate(vehicle.axle_names)},
        "mass": lib.TG_MASS,
        "hitch_load": lib.TG_HITCH_LOAD,
        "brake": lib.TG_BRAKE,
    }


def settings_of(
    vehicle: Vehicle,
    method: Method,
    *,
    noise: Mapping[str, float],
    held: Mapping[str, float],
    channels: Collection[str],
    thresholds: Thresholds,
) -> Any:
    """A tg_settings for the vehicle.

    ``noise``: SD of each channel that the estimator uses, SI. ``held``: update period [s] of held channels.
    ``channels``: the columns of the samples. They determine whether drawbar force, mass, hitch load and the torque of an
    undriven wheel are measured. Raises InputError where the vehicle lacks a value that one of them needs.
    """
    require_hitch(vehicle, "hitch_load", channels)
    settings = ffi.new("tg_settings *", lib.tg_default_settings())
    settings.method = method.kind
    settings.tuning.engine = method.engine
    settings.tuning.policy = method.policy
    settings.tuning.supervisor = method.supervisor
    put_axles(settings, vehicle)
    settings.towing = "drawbar_force" in channels
    settings.weighed, settings.carrying = "mass" in channels, "hitch_load" in channels
    _set_wheels(settings, vehicle, channels)
    lib.tg_tune_walks(settings)
    _set_loads(settings, vehicle)
    _set_calibration(settings, vehicle)
    _set_uncertainty(settings, vehicle, channels)
    for name, slot in sample_slots(vehicle).items():
        settings.noise[slot] = noise.get(name, 0.0)
        settings.held_period[slot] = held.get(name, 0.0)
    settings.ground_speed_delay = noise.get(DELAY, 0.0)
    thresholds.put(settings)
    return settings


def _set_wheels(settings: Any, vehicle: Vehicle, channels: Collection[str]) -> None:
    machine = settings.machine
    machine.wheels = len(vehicle.wheels)
    machine.mass = vehicle.mass
    machine.gravity = GRAVITY
    machine.tire_rolling_resistance = vehicle.tire_rolling_resistance
    arms, rolling = wheel_radii(vehicle)
    for i, wheel in enumerate(vehicle.wheels):
        machine.radius[i] = arms[i]
        settings.rolling_radius[i] = rolling[i]
        settings.drive_friction[i] = vehicle.wheel_friction[i]
        machine.inertia[i] = vehicle.wheel_inertia[i]
        machine.bearing_resistance[i] = vehicle.wheel_bearing[i]
        settings.wheel_axle[i] = vehicle.wheel_axle[i]
        settings.powered[i] = bool(vehicle.driven[i])
        settings.driven[i] = bool(vehicle.driven[i]) or f"drive_torque_{wheel}" in channels


def wheel_radii(vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Torque arm and rolling radius of each wheel (n,) [m] under its static load (physics.md 4)."""
    arms, rolling = np.array(vehicle.wheel_radius), np.array(vehicle.wheel_radius)
    counts = np.bincount(vehicle.wheel_axle)
    for i, wheel in enumerate(vehicle.wheel_data):
        axle = vehicle.wheel_axle[i]
        deflection = _deflection(
            wheel, float(arms[i]), GRAVITY * float(vehicle.axle_mass[axle]) / counts[axle]
        )
        if deflection > 0:
            loaded = loaded_radius(arms[i], deflection)
            arms[i], rolling[i] = loaded, rolling_radius(arms[i], loaded)
    return arms, rolling


def _deflection(wheel: Wheel, radius: float, load: float) -> float:
    model = wheel.radius_model
    if isinstance(model, HadekelRadius):
        found = hadekel_deflection(
            load, unloaded_radius=radius, width=wheel.width or 0.0, inflation_pressure=model.pressure
        )
    elif isinstance(model, BidermanRadius):
        found = biderman_deflection(
            load, inflation_pressure=model.pressure, carcass_pressure=model.p0, c1=model.C1, c2=model.C2
        )
    else:
        return 0.0
    if found >= 0.5 * radius:
        raise InputError(
            f"the radius model deflects a tire of {radius:g} m by {float(found):.3g} m",
            place="wheel.radius_model",
            hint="check its pressure and constants",
        )
    return float(found)


def put_axles(settings: Any, vehicle: Vehicle) -> None:
    """Write into a tg_settings the axles, their loads and levers, the machine's length, and where its ground speed is measured."""
    levers, mass = load_levers(vehicle.axle_to_rear), vehicle.axle_mass
    settings.axles, settings.articulated = len(vehicle.axle_names), vehicle.articulated
    settings.receiver_ahead, settings.receiver_side = vehicle.receiver
    for k in range(len(mass)):
        settings.pivots[k] = bool(vehicle.pivoting[k])
        settings.load_share[k] = mass[k] / mass.sum()
        settings.load_transfer[k] = levers[k]


def _set_loads(settings: Any, vehicle: Vehicle) -> None:
    """Heights and shares of the load formulas (physics.md 3), from physics.loads."""
    settings.center_of_gravity_height = vehicle.center_of_gravity_height
    settings.hitch_height = vehicle.hitch_height
    settings.payload_height = vehicle.payload_height
    for k in range(len(vehicle.axle_names)):
        settings.payload_share[k], settings.hitch_share[k] = vehicle.payload_share[k], vehicle.hitch_share[k]
    level, leaning = vehicle.wheel_shares
    for i, side in enumerate(vehicle.wheel_side):
        settings.wheel_share[i], settings.lateral_share[i] = level[i], leaning[i]
        settings.wheel_side[i], settings.wheel_ahead[i] = side, vehicle.wheel_ahead[i]


def _set_calibration(settings: Any, vehicle: Vehicle) -> None:
    for i in range(len(vehicle.wheels)):
        settings.gain[lib.TG_DRIVE_TORQUE + i] = vehicle.drive_torque_gain[i]
        settings.offset[lib.TG_DRIVE_TORQUE + i] = vehicle.drive_torque_offset[i]
    settings.offset[lib.TG_DRAWBAR_FORCE] = vehicle.calibration.drawbar_offset
    settings.offset[lib.TG_ACCELERATION_X] = vehicle.calibration.acceleration_bias_x
    settings.offset[lib.TG_PITCH] = vehicle.calibration.pitch_offset


def _set_uncertainty(settings: Any, vehicle: Vehicle, channels: Collection[str]) -> None:
    """The vehicle file's spreads. A measured pitch leaves only its mounting unknown, not the slope; without a cell the pull itself is
    unknown, not a cell's zero."""
    given = vehicle.uncertainty
    spread = settings.uncertainty
    for name, _ in ffi.typeof("tg_uncertainty").fields:
        setattr(spread, name, getattr(given, name) or 0.0)
    spread.drawbar_offset = given.of_pull(channels)
    spread.slope = given.of_slope(channels)

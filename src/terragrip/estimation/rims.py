"""Rims whose slip is known without torque: single wheels, or a drive train as one wheel, and their radii at zero slip."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from terragrip._kernel import ffi, lib
from terragrip.errors import InputError
from terragrip.estimation.engine import OF_FORCES, SIGNS, twin_slots
from terragrip.estimation.methods import SLIP_ONLY
from terragrip.estimation.noise import DELAY
from terragrip.estimation.settings import WITHOUT_TORQUE, Thresholds, put_axles, wheel_radii
from terragrip.estimation.zero_slip import UNDETERMINED, Zero
from terragrip.physics.loads import GRAVITY
from terragrip.recording.schema import has_torque
from terragrip.vehicle import Vehicle

DRIVE = "drive"
"""Name of the wheel that represents all driven ones, where only the drive train's speed is measured."""


@dataclass(frozen=True)
class Rim:
    """A wheel whose slip is known, and the ``channel`` that gives its speed.

    ``scale``: reading of the channel at 1 rad/s (1, or for the drive train the radius that it uses [m]); ``radius`` [m] at zero slip
    and its relative SD ``spread``; ``side``: m left of the vehicle's middle; ``ahead``: of a steered wheel, as `Vehicle.wheel_ahead`. Where
    no radius is known (``has_radius``) the drive train is a wheel of 1 m, which does not affect slip, and quantities that need a radius
    have no column.
    """

    wheel: str
    channel: str
    scale: float
    radius: float
    spread: float
    side: float
    has_radius: bool = True
    ahead: float = 0.0


def speeds_alone(channels: Collection[str], vehicle: Vehicle) -> bool:
    """Whether samples of these columns have speeds, and no torque though the vehicle drives wheels."""
    wheels = any(name == "wheel_based_speed" or name.startswith("wheel_speed_") for name in channels)
    return bool(vehicle.driven.any()) and wheels and "ground_speed" in channels and not has_torque(channels)


def rims_of(vehicle: Vehicle, channels: Collection[str], source: str | None = None) -> tuple[Rim, ...]:
    """The rims in samples of these columns, by the vehicle file's radii; raises InputError on a wheel it does not have."""
    spread = vehicle.uncertainty.assumed("wheel_radius")
    named = [name.removeprefix("wheel_speed_") for name in channels if name.startswith("wheel_speed_")]
    for wheel in named:
        if wheel not in vehicle.wheels:
            hint = f"its wheels are {', '.join(vehicle.wheels)}"
            place = f"column wheel_speed_{wheel}"
            raise InputError(f"the vehicle has no wheel {wheel}", file=source, place=place, hint=hint)
    if named:
        places = zip(
            vehicle.wheels, wheel_radii(vehicle)[1], vehicle.wheel_side, vehicle.wheel_ahead, strict=True
        )
        return tuple(
            Rim(wheel, f"wheel_speed_{wheel}", 1.0, float(radius), spread, float(side), ahead=float(ahead))
            for wheel, radius, side, ahead in places
            if wheel in named
        )
    supposed, calibrated = supposed_radius(vehicle), calibrated_scale(vehicle)
    if calibrated is None:
        calibrated = 1.0
        spread = UNDETERMINED if vehicle.uncertainty.wheel_radius is None else spread
    return (
        Rim(
            DRIVE,
            "wheel_based_speed",
            supposed,
            calibrated * supposed,
            spread,
            0.0,
            has_radius=vehicle.knows_wheels,
        ),
    )


def supposed_radius(vehicle: Vehicle) -> float:
    """Mean radius [m] of the driven wheels by the vehicle file uncalibrated; 1 m if it has none: any will do for a speed in m/s."""
    if not vehicle.knows_wheels:
        return 1.0
    radii = [data.radius for data, driven in zip(vehicle.wheel_data, vehicle.driven, strict=True) if driven]
    return float(np.mean(radii))


def calibrated_scale(vehicle: Vehicle) -> float | None:
    """The factor for the drive train's speed, if it or all driven wheels are calibrated."""
    if not vehicle.knows_wheels:
        gain = vehicle.calibration.wheel_based_speed_gain
        return None if gain is None else 1 / gain
    result = vehicle.calibration.wheel_radius
    stated = {wheel: data.radius for wheel, data in zip(vehicle.wheels, vehicle.wheel_data, strict=True)}
    if not all(wheel in result for wheel in vehicle.driven_wheels):
        return None
    return float(np.mean([result[wheel] / stated[wheel] for wheel in vehicle.driven_wheels]))


def at_zero(rim: Rim, zero: Zero) -> Rim:
    """The rim with the radius from a log."""
    return replace(rim, radius=zero.ratio * rim.radius, spread=zero.std)


def slots_in(rims: Collection[Rim]) -> dict[str, int]:
    """The place in tg_sample.value of each column that slip is computed from."""
    wheels = {rim.channel: lib.TG_WHEEL_SPEED + i for i, rim in enumerate(rims)}
    return {**wheels, "ground_speed": lib.TG_GROUND_SPEED, "angular_velocity_z": lib.TG_YAW_RATE}


def slots_out(rims: Collection[Rim]) -> dict[str, int]:
    """The place in tg_estimate.value of each column of estimates from speeds alone, in the table's order."""
    slots = {"distance": lib.TG_OUT_DISTANCE} | twin_slots("ground_speed", ["ground_speed"])
    # Without a radius there is one rim, the drive train.
    for quantity in ("wheel_speed", "slip", "zero_slip_radius"):
        if quantity == "slip" or all(rim.has_radius for rim in rims):
            slots |= twin_slots(quantity, [f"{quantity}_{rim.wheel}" for rim in rims])
    slots |= {"warning": lib.TG_OUT_WARNING, "warning_usual_slip": lib.TG_OUT_USUAL_SLIP}
    slots |= {f"warning_{sign}": lib.TG_OUT_SIGN + k for k, sign in enumerate(SIGNS) if sign not in OF_FORCES}
    return slots | {"nis": lib.TG_OUT_NIS, "channels": lib.TG_OUT_CHANNELS}


def speed_settings(
    vehicle: Vehicle,
    rims: Collection[Rim],
    *,
    noise: Mapping[str, float],
    held: Mapping[str, float],
    thresholds: Thresholds,
    dead_band: float,
) -> Any:
    """A tg_settings for slip from speeds alone; arguments as for `engine.settings_of`, ``dead_band`` [m/s] of the rims."""
    settings = ffi.new("tg_settings *", lib.tg_default_settings())
    settings.method = SLIP_ONLY.kind
    machine = settings.machine
    machine.wheels, machine.mass, machine.gravity = len(rims), vehicle.mass, GRAVITY
    put_axles(settings, vehicle)
    for i, rim in enumerate(rims):
        machine.radius[i] = settings.rolling_radius[i] = rim.radius
        machine.inertia[i] = 1.0  # no effect without torque
        settings.wheel_share[i] = 1 / len(rims)
        settings.wheel_side[i], settings.wheel_ahead[i] = rim.side, rim.ahead
        if rim.wheel in vehicle.wheels:
            place = vehicle.wheels.index(rim.wheel)
            settings.wheel_axle[i], settings.powered[i] = (
                vehicle.wheel_axle[place],
                bool(vehicle.driven[place]),
            )
        settings.gain[lib.TG_WHEEL_SPEED + i] = rim.scale
        settings.noise[lib.TG_WHEEL_SPEED + i] = noise[rim.channel] / rim.scale
    lib.tg_tune_walks(settings)
    settings.noise[lib.TG_GROUND_SPEED] = noise["ground_speed"]
    settings.noise[lib.TG_YAW_RATE] = noise["angular_velocity_z"]
    settings.noise[lib.TG_ACCELERATION_X] = 1.0  # no effect either, but the kernel requires one
    for name, slot in slots_in(rims).items():
        settings.held_period[slot] = held.get(name, 0.0)
    settings.uncertainty.wheel_radius = max((rim.spread for rim in rims), default=0.0)
    settings.ground_speed_delay = noise[DELAY]
    settings.dead_band = dead_band
    settings.watch.warn *= WITHOUT_TORQUE
    thresholds.put(settings)
    return settings

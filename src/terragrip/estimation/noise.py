"""The noise of each channel: from the vehicle file, else from the log, else a cautious guess."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING

from terragrip.errors import InputError, suggestion
from terragrip.physics.loads import GRAVITY
from terragrip.recording.schema import is_channel

if TYPE_CHECKING:
    from terragrip.recording import Recording
    from terragrip.vehicle import Vehicle

DELAY = "ground_speed_delay"
"""The name among the sensors' SDs of that of the ground speed's delay [s]; 0 where nothing shows it."""

_SENSOR_OF = {
    "acceleration_x": "acceleration",
    "acceleration_y": "acceleration",
    "roll": "pitch",
    "angular_velocity_z": "yaw_rate",
}


def channel_noise(
    vehicle: Vehicle, channels: tuple[str, ...], sensors: Mapping[str, float] | None = None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """SD of every channel in ``channels`` and of the ground speed's delay, SI, and the channels that had to be guessed.

    ``sensors`` (by channel, ``ground_speed``, or by sensor, ``wheel_speed`` for all wheels) overrides the
    vehicle file, which overrides a guess from the vehicle's size. Raises InputError on a name that is neither, or an
    SD that is not positive.
    """
    given = dict(sensors or {})
    _check(given, channels)
    guesses = _guesses(vehicle)
    result, guessed = {}, []
    for name in channels:
        if name == "brake":  # pressed or not
            continue
        sensor = sensor_of(name)
        value = given.get(name, given.get(sensor, getattr(vehicle.sensors, sensor, None)))
        if value is None:
            value = guesses[sensor]
            guessed.append(name)
        result[name] = float(value)
    late = given.get(DELAY, vehicle.sensors.ground_speed_delay)
    result[DELAY] = late or 0.0
    return result, tuple(guessed)


def settings_in(
    recording: Recording,
    vehicle: Vehicle,
    *,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
) -> tuple[dict[str, float], dict[str, float]]:
    """Properties of the sensors from a log: SDs [SI] by channel, and the update periods [s] of held channels.

    Without the SDs that ``sensors`` (by channel or sensor) gives; of those that the vehicle file gives, the channels that the log rounds,
    whose error is added to them. ``held``: None finds the periods.
    """
    from terragrip.recording import held_periods
    from terragrip.recording.ground_noise import understated_noise

    periods = dict(held_periods(recording) if held is None else held)
    logged = rounded_noise(recording, vehicle) | logged_noise(recording, vehicle, periods)
    # Slip's interval rests on this one: with a fourth of the true SD it holds slip in 75 % of the rows, where that of any other sensor, as
    # wrong, leaves 96 % (development machines).
    if (more := understated_noise(recording, vehicle)) is not None:
        logged["ground_speed"] = more
    given = sensors or {}
    return {n: sd for n, sd in logged.items() if n not in given and sensor_of(n) not in given}, periods


def rounded_noise(recording: Recording, vehicle: Vehicle) -> dict[str, float]:
    """By channel the SD that the vehicle file gives, with what the log's rounding adds to it (docs/decisions/0115), or that of a derived
    channel where it is more; without the rest."""
    from terragrip.recording import rounding_noise

    result = {}
    for name, values in recording.channels.items():
        stated = getattr(vehicle.sensors, sensor_of(name), None)
        if stated is None:
            continue
        if recording.noise.get(name, 0.0) > stated:
            result[name] = recording.noise[name]
        elif (more := rounding_noise(values, stated)) > 0:
            result[name] = math.hypot(stated, more)
    return result


def logged_noise(recording: Recording, vehicle: Vehicle, held: dict[str, float]) -> dict[str, float]:
    """SDs from the log for sensors that the vehicle file does not give, by channel."""
    from terragrip.recording import sensor_noise
    from terragrip.recording.rest import noise_at_rest

    silent = {
        name: values
        for name, values in recording.channels.items()
        if getattr(vehicle.sensors, sensor_of(name), None) is None and sensor_of(name) in _guesses(vehicle)
    }
    if not silent:
        return {}
    noise = sensor_noise(replace(recording, channels=silent), {k: v for k, v in held.items() if k in silent})
    if "ground_speed" in noise and "ground_speed" not in recording.noise:
        noise["ground_speed"] = max(noise["ground_speed"], noise_at_rest(recording))
    return noise


def sensor_of(channel: str) -> str:
    """The sensor of a channel, as in the vehicle file: ``wheel_speed`` for ``wheel_speed_fl``."""
    for prefix in ("wheel_speed", "drive_torque", "vertical_load"):
        if channel.startswith(f"{prefix}_"):
            return prefix
    return _SENSOR_OF.get(channel, channel)


def is_positive(value: object) -> bool:
    """Whether a value is a number above 0, and finite."""
    return isinstance(value, Real) and 0 < float(value) < math.inf


def _check(given: Mapping[str, float], channels: tuple[str, ...]) -> None:
    known = {*channels, *(sensor_of(name) for name in channels), DELAY}
    for name, value in given.items():
        if name not in known:
            hint = suggestion(name, known, "name a channel")
            raise InputError(f"there is no sensor {name!r}", hint=hint)
        if not (is_positive(value) or (name == DELAY and value == 0)):
            raise InputError(
                f"the noise of {name} is {value!r}", hint="give a positive standard deviation in SI"
            )


def check_held(held: Mapping[str, float]) -> None:
    """Raise InputError unless the keys are channels and the values periods."""
    for name, period in held.items():
        if not is_channel(name):
            hint = "name a channel, as ground_speed"
            raise InputError(f"held names {name!r}, which is no channel", hint=hint)
        if not is_positive(period):
            raise InputError(
                f"held of {name} is {period!r}", hint="give the period of its updates in seconds"
            )


def _guesses(vehicle: Vehicle) -> dict[str, float]:
    """Cautious SDs from the vehicle's size, by sensor."""
    # Without radii slip follows from the drive train's speed, whose noise is in m/s.
    radius = float(vehicle.wheel_radius.mean()) if vehicle.knows_wheels else 1.0
    weight = vehicle.mass * GRAVITY
    return {
        "wheel_speed": 0.02 / radius,
        "ground_speed": 0.05,
        "wheel_based_speed": 0.02,
        "drive_torque": 0.01 * weight * radius,
        "drawbar_force": 0.01 * weight,
        "acceleration": 0.3,
        "pitch": 0.01,
        "yaw_rate": 0.01,
        "vertical_load": 0.02 * weight,
        "hitch_load": 0.02 * weight,
        "mass": 0.01 * vehicle.mass,
    }

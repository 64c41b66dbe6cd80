"""Sensors: what each channel reads of the truth, with its rate, delay, noise, gain, offset, resolution and drop-outs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError
from terragrip.simulation.fields import stream
from terragrip.simulation.route import geographic
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.scenario_sensors import Sensor, Sensors
from terragrip.simulation.trace import Trace


@dataclass(frozen=True)
class Series:
    """Samples of one sensor: its instants (k,) and its channels (k,), NaN = lost."""

    sensor: str
    rate: float
    time: Floats
    values: dict[str, Floats]


@dataclass(frozen=True)
class Errors:
    """True gain and offset of each channel of a machine: reading = gain x true + offset."""

    gain: dict[str, float]
    offset: dict[str, float]


def signals(sensor: str, trace: Trace) -> dict[str, Floats]:
    """True values (n,) of a sensor's channels, in the recording's units and signs (architecture.md, contracts)."""
    wheels, axles = trace.vehicle.wheels, trace.vehicle.axle_names
    pitch, turn = trace["body_pitch"], trace["curvature"] * trace["speed"]
    if sensor in ("wheel_speed", "drive_torque"):
        column = trace["wheel_speed" if sensor == "wheel_speed" else "torque"]
        if sensor == "drive_torque":  # with what motor and gears lose
            column = column + trace.vehicle.wheel_friction * np.sign(trace["wheel_speed"])
        return {f"{sensor}_{wheel}": column[:, i] for i, wheel in enumerate(wheels)}
    if sensor == "ground_speed":
        return {sensor: trace["speed"]}
    if sensor == "drawbar_force":
        return {sensor: trace["drawbar"]}
    if sensor == "acceleration":
        along, normal = trace.specific_force
        return {
            "acceleration_x": along * np.cos(pitch) + normal * np.sin(pitch),
            "acceleration_y": trace["speed"] * turn,
            "acceleration_z": normal * np.cos(pitch) - along * np.sin(pitch),
        }
    if sensor == "angular_velocity":
        time, height = trace["time"], trace["height"]
        sides = trace.vehicle.wheel_side
        width = float(sides @ sides)
        roll = height @ sides / width if width > 0 else np.zeros(len(time))
        nodding = trace["body_pitch_rate"] + np.gradient(trace["slope"], time)
        return {
            "angular_velocity_x": np.gradient(roll, time),
            "angular_velocity_y": -nodding,  # about y to the left: positive is nose down
            "angular_velocity_z": turn,
        }
    if sensor == "pitch":
        return {sensor: trace["slope"] + pitch}
    if sensor == "vertical_load":
        return {f"{sensor}_{axle}": trace.of_axles("load")[:, k] for k, axle in enumerate(axles)}
    if sensor == "wheel_force":
        forces = (("x", trace.wheel_force_x), ("z", trace.wheel_force_z))
        return {
            f"{sensor}_{axis}_{wheel}": force[:, i]
            for axis, force in forces
            for i, wheel in enumerate(wheels)
        }
    return dict(zip(("east", "north", "altitude"), trace.location, strict=True))


Sources = Callable[[str], dict[str, Floats]]
"""True values of a sensor's channels, by the sensor's name."""


def draw_errors(sensors: Sensors, sources: Sources, wheels: tuple[str, ...], seed: int) -> Errors:
    """Gains and offsets of every channel on board, drawn from the machine's ``seed``."""
    gain: dict[str, float] = {}
    offset: dict[str, float] = {}
    for name, sensor in _fitted(sensors):
        for channel in _channels(name, sensor, sources(name), wheels):
            g, o = stream(seed, f"errors {channel}").standard_normal(2)
            gain[channel] = sensor.gain + sensor.gain_sd * float(g)
            offset[channel] = sensor.offset + sensor.offset_sd * float(o)
    return Errors(gain, offset)


def measure(
    sensors: Sensors, time: Floats, sources: Sources, wheels: tuple[str, ...], errors: Errors, seed: int
) -> list[Series]:
    """What every sensor reads of a run whose true values (n,) at even ``time`` (n,) ``sources`` gives.

    ``wheels``: those of the vehicle. Position comes in metres: see `located`. Raises InputError where a sensor names a wheel
    that there is not.
    """
    return [
        _read(name, sensor, time, sources(name), wheels, errors, seed) for name, sensor in _fitted(sensors)
    ]


def _fitted(sensors: Sensors) -> list[tuple[str, Sensor]]:
    pairs = [(name, getattr(sensors, name)) for name in type(sensors).model_fields]
    return [(name, sensor) for name, sensor in pairs if sensor is not None]


def _channels(name: str, sensor: Sensor, source: dict[str, Floats], wheels: tuple[str, ...]) -> list[str]:
    keep = sensor.wheels
    odd = next((wheel for wheel in keep or () if wheel not in wheels), None)
    if odd is not None:
        raise InputError(
            f"no wheel {odd!r}",
            place=f"sensors.{name}.wheels",
            hint=f"wheels are {', '.join(wheels)}",
        )
    return [c for c in source if keep is None or c.rsplit("_", 1)[1] in keep]


def _read(
    name: str,
    sensor: Sensor,
    seen: Floats,
    true: dict[str, Floats],
    wheels: tuple[str, ...],
    errors: Errors,
    seed: int,
) -> Series:
    end = float(seen[-1])
    stamp = np.round(np.arange(int(np.floor(end * sensor.rate + 1e-6)) + 1) / sensor.rate, 6)
    source = _smoothed(true, sensor, float(seen[1] - seen[0]))
    values = {}
    for channel in _channels(name, sensor, true, wheels):
        rng = stream(seed, f"sensor {channel}")
        reading = errors.gain[channel] * np.interp(stamp - sensor.delay, seen, source[channel])
        reading += errors.offset[channel] + sensor.noise * rng.standard_normal(len(stamp))
        if sensor.drift > 0:
            reading += _drift(rng, sensor, len(stamp))
        if sensor.resolution > 0:
            reading = np.round(reading / sensor.resolution) * sensor.resolution
        values[channel] = reading
    lost = _lost(stream(seed, f"dropout {name}"), sensor, len(stamp))
    stamp = np.round(stamp - sensor.declared_delay, 6)
    keep = ~lost & (stamp >= 0)
    return Series(name, sensor.rate, stamp[keep], {channel: v[keep] for channel, v in values.items()})


def _smoothed(source: dict[str, Floats], sensor: Sensor, step: float) -> dict[str, Floats]:
    if not sensor.bandwidth:
        return source
    from scipy.signal import lfilter

    keep = float(np.exp(-2 * np.pi * sensor.bandwidth * step))
    return {c: lfilter([1 - keep], [1.0, -keep], v, zi=[keep * v[0]])[0] for c, v in source.items()}


def _drift(rng: np.random.Generator, sensor: Sensor, count: int) -> Floats:
    """A first-order Gauss-Markov error (count,)."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / (sensor.rate * sensor.drift_time)))
    drive = sensor.drift * np.sqrt(1 - keep**2) * rng.standard_normal(count)
    start = sensor.drift * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, zi=[keep * start])[0])


def _lost(rng: np.random.Generator, sensor: Sensor, count: int) -> Bools:
    """Samples lost (count,): spells of geometric length, their share as the sensor says."""
    lost = np.zeros(count, dtype=bool)
    if sensor.dropout <= 0:
        return lost
    spell = max(1.0, sensor.rate * sensor.dropout_length)
    between = spell * (1 - sensor.dropout) / sensor.dropout
    k = 0
    while k < count:
        k += int(rng.geometric(1 / max(between, 1.0)))
        length = int(rng.geometric(1 / spell))
        lost[k : k + length] = True
        k += length
    return lost


def located(scenario: Scenario, series: Series) -> Series:
    """Local position as latitude and longitude; any other sensor's samples as they are."""
    if series.sensor != "position":
        return series
    local: dict[str, Any] = series.values
    latitude, longitude = geographic(scenario.route, local["east"], local["north"])
    return replace(
        series, values={"latitude": latitude, "longitude": longitude, "altitude": local["altitude"]}
    )

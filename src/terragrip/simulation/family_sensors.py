"""Sensors and faults drawn at random, scaled with the machine, and what its user writes down of them (R)."""

from __future__ import annotations

from typing import Any

import numpy as np

from terragrip.simulation.family_machines import Machine
from terragrip.units import STANDARD_GRAVITY

Tree = dict[str, Any]

SENSORS = ("even", "plain", "uncoupled", "multirate", "coarse")
"""Sets of sensors. even: every channel at one rate. plain: no inertial sensors, so it drives straight. uncoupled: no drawbar cell
and no tool. multirate: ground speed and drawbar slower than the wheels, inertial channels faster. coarse: a slow receiver, rounded
channels, more noise, no accelerometer."""


def uncertainty(sensors: Tree, machine: Machine, slope: float) -> Tree:
    """What a careful user states as unknown: the spreads that gains, offsets and radius were drawn with."""
    torque = sensors["drive_torque"]
    return {
        "drive_torque_gain": torque["gain_sd"],
        "drive_torque_offset": torque["offset_sd"],
        "drawbar_offset": machine.drawbar_offset,
        "slope": slope,
        "vertical_load": 0.02,
        "wheel_radius": machine.radius_error,
        "acceleration_bias": 0.03,
    }


def draw_sensors(
    rng: np.random.Generator, name: str, machine: Machine, rate: float | None = None
) -> tuple[Tree, Tree]:
    """A set of sensors for a scenario, and the standard deviations that its user writes into the vehicle file.

    ``name`` is one of ``SENSORS``; ``rate`` [1/s] of the wheel speeds, drawn where not given.
    """
    corner, scale, beat = machine.corner_mass, machine.scale, np.sqrt(machine.scale)
    drawn = float(rng.choice([20.0, 50.0, 100.0, 200.0]))
    base = drawn if rate is None else rate
    rough = 2.5 if name == "coarse" else 1.0
    sd = {
        "wheel_speed": rough * 0.03 / beat * _spread(rng, 0.3, 1.5),
        "ground_speed": rough * 0.02 * beat * _spread(rng, 0.5, 2.0),
        "drive_torque": rough * 0.029 * corner * scale * _spread(rng, 0.3, 3.0),
        "drawbar_force": rough * 0.029 * machine.mass * _spread(rng, 0.3, 2.0),
        "acceleration": 0.1 * _spread(rng, 0.3, 2.0),
        "pitch": 0.0017 * _spread(rng, 0.5, 3.0),
    }
    gain, offset = rng.uniform(0.005, 0.03), 0.009 * corner * scale * rng.uniform(0.2, 1.0)
    slow, fast = float(rng.choice([2.0, 4.0, 5.0])), 2.0
    several, coarse = name == "multirate", name == "coarse"
    rates = dict.fromkeys(sd, base)
    if several or coarse:
        rates["ground_speed"] = max(base / slow, 1.0)
    if several:
        rates["drawbar_force"] = base / 2
        rates["acceleration"] = rates["pitch"] = min(base * fast, 200.0)
    fitted: Tree = {channel: {"rate": rates[channel], "noise": noise} for channel, noise in sd.items()}
    fitted["drive_torque"] |= {"gain_sd": gain, "offset_sd": offset}
    fitted["drawbar_force"] |= {"offset_sd": machine.drawbar_offset}
    fitted["acceleration"] |= {"offset_sd": 0.03}
    fitted["pitch"] |= {"offset_sd": 0.0035}
    fitted["angular_velocity"] = {"rate": rates["acceleration"], "noise": 0.005, "offset_sd": 0.002}
    if coarse:
        fitted["wheel_speed"]["resolution"] = 2 * sd["wheel_speed"]
        fitted["drive_torque"]["resolution"] = 2 * sd["drive_torque"]
        fitted["ground_speed"] |= {"resolution": sd["ground_speed"], "drift": 0.5 * sd["ground_speed"]}
    dropped = {
        "plain": ("acceleration", "angular_velocity", "pitch"),
        "uncoupled": ("drawbar_force",),
        "coarse": ("acceleration",),
    }.get(name, ())
    return {k: v for k, v in fitted.items() if k not in dropped}, {
        k: v for k, v in sd.items() if k not in dropped
    }


def _spread(rng: np.random.Generator, low: float, high: float) -> float:
    """A factor, uniform in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_faults(duration: float, machine: Machine, sensors: str) -> list[Tree]:
    """All defects in one log: gaps, spikes on every channel, jitter, held values, and one outage of the ground speed."""
    minutes, beat, wheel = duration / 60, np.sqrt(machine.scale), machine.wheels[-1]
    weight = machine.corner_mass * STANDARD_GRAVITY
    result: list[Tree] = [
        {"kind": "gap", "duration": 0.6, "count": max(1, round(minutes))},
        {"kind": "loss", "channel": "ground_speed", "at": 0.6 * duration, "duration": 6.0},
        {"kind": "spike", "channel": "ground_speed", "size": 0.8 * beat, "count": max(1, round(6 * minutes))},
        {"kind": "spike", "channel": f"wheel_speed_{wheel}", "size": 3 / beat, "count": max(1, round(4 * minutes))},
        {"kind": "spike", "channel": "drive_torque", "size": weight * machine.radius, "count": max(1, round(3 * minutes))},
        {"kind": "held", "channel": "ground_speed", "duration": 0.5, "count": max(1, round(minutes))},
        {"kind": "jitter", "size": 0.002},
    ]  # fmt: skip
    if sensors != "uncoupled":
        size = 0.3 * machine.mass * STANDARD_GRAVITY
        result.append(
            {"kind": "spike", "channel": "drawbar_force", "size": size, "count": max(1, round(3 * minutes))}
        )
    return result

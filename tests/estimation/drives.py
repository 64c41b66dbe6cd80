"""A drive that obeys physics.md 1-3 exactly, worked out backwards in NumPy: speeds and slip are chosen, adhesion follows from
slip, torque and drawbar force from the equations of motion. Nothing here comes from the kernel or the simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import Estimates
from terragrip.physics.loads import GRAVITY, axle_loads
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]
WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, INERTIA, TIRE, BEARING = 139.0, 0.2, 0.15, 0.02, 2.0


def robot(**changes: Any) -> Vehicle:
    """The robot of physics.md 8, four driven wheels on two axles; ``changes`` replace top-level keys."""
    data = {
        "mass": MASS,
        "wheelbase": 0.638,
        "track": 0.554,
        "center_of_gravity_height": 0.30,
        "hitch_height": 0.25,
        "axles": {"front": {"mass": 54.0, "wheels": ["fl", "fr"]}, "rear": {"mass": 85.0, "wheels": ["rl", "rr"]}},
        "wheel": {"radius": RADIUS, "inertia": INERTIA},
        "tire_rolling_resistance": TIRE,
        "bearing_resistance": BEARING,
        "sensors": {
            "wheel_speed": 0.03, "ground_speed": 0.02, "drive_torque": 1.0, "drawbar_force": 4.0,
            "acceleration": 0.1, "pitch": 0.002,
        },
        "uncertainty": {"drive_torque_gain": 0.02, "drawbar_offset": 3.0},
    }  # fmt: skip
    return Vehicle.from_dict({**data, **changes})


@dataclass(frozen=True)
class Drive:
    """A recording and what is true in it, by the names of the estimates' columns."""

    recording: Recording
    truth: dict[str, Floats]


def drive(
    seconds: float = 30.0,
    *,
    rate: float = 100.0,
    noise: float = 1.0,
    seed: int = 0,
    speed: Any = lambda t: 0.6 + 0.05 * np.sin(t / 3),
    slip: Any = lambda t: 0.10 + 0.05 * np.sin(t / 5),
    resistance: Any = lambda t: 0.08 + 0.0 * t,
    direction: int = 1,
    imu: bool = False,
    slope: Any = lambda t: 0.0 * t,
    payload: Any = lambda t: 0.0 * t,
    payload_at: tuple[float, float] = (0.0, 0.0),
    hitch: Any = lambda t: 0.0 * t,
    hitch_overhang: float = 0.0,
) -> Drive:
    """``noise`` scales the sensors' white noise (0: exact). Backwards, ``direction`` -1, every signed signal is mirrored.

    ``payload`` [kg] at ``payload_at`` (m ahead of the rear axle, m high) and ``hitch``, what hangs on the hitch [N], make channels ``mass``
    and ``hitch_load`` where they are not 0.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 1 / rate)
    v, s, rho, theta = speed(t), slip(t), resistance(t), slope(t)
    acceleration = np.gradient(v, t)
    rim = v / (1 - s)
    spin = np.gradient(rim / RADIUS, t)
    mu = 0.5 * (1 - np.exp(-10 * s))
    more, hanging = payload(t), hitch(t)
    mass = MASS + more
    weight = mass * GRAVITY * np.cos(theta) + hanging  # what the wheels carry
    # loads sum to the weight whatever the transfer, and all wheels share one adhesion: the pull follows at once
    pull = mu * weight - rho * weight - mass * (acceleration + GRAVITY * np.sin(theta))
    axles = axle_loads(
        (54.0, 85.0), (0.638, 0.0), center_of_gravity_height=0.30, hitch_height=0.25,
        drawbar=direction * pull, acceleration=direction * acceleration, slope=direction * theta,
        spin_torque=direction * 4 * INERTIA * acceleration / RADIUS,
    )  # fmt: skip
    ahead, height = payload_at
    moment = more * GRAVITY * np.cos(theta) * ahead - hanging * hitch_overhang
    moment -= more * direction * (acceleration + GRAVITY * np.sin(theta)) * height
    front = moment / 0.638  # about the rear axle
    axles += np.stack([front, more * GRAVITY * np.cos(theta) + hanging - front], axis=1)
    loads = np.repeat(axles / 2, 2, axis=1)
    channels = {"ground_speed": direction * v + 0.02 * noise * rng.standard_normal(len(t))}
    truth = {"ground_speed": direction * v, "soil_resistance": rho}
    for i, wheel in enumerate(WHEELS):
        torque = INERTIA * spin + RADIUS * (mu + TIRE) * loads[:, i] + RADIUS * BEARING * rim / RADIUS
        channels[f"wheel_speed_{wheel}"] = direction * rim / RADIUS + 0.03 * noise * rng.standard_normal(
            len(t)
        )
        channels[f"drive_torque_{wheel}"] = direction * torque + noise * rng.standard_normal(len(t))
        truth |= {f"adhesion_{wheel}": mu, f"slip_{wheel}": s, f"net_traction_{wheel}": mu - rho}
        truth[f"efficiency_{wheel}"] = (mu - rho) / (mu + TIRE) * (1 - s)
    channels["drawbar_force"] = direction * pull + 4 * noise * rng.standard_normal(len(t))
    if imu:
        force = direction * (acceleration + GRAVITY * np.sin(theta))
        channels["acceleration_x"] = force + 0.1 * noise * rng.standard_normal(len(t))
        channels["pitch"] = direction * theta + 0.002 * noise * rng.standard_normal(len(t))
    if more.any():
        channels["mass"] = mass + 0.5 * noise * rng.standard_normal(len(t))
    if hanging.any():
        channels["hitch_load"] = hanging + 4 * noise * rng.standard_normal(len(t))
    truth |= {"vertical_load_front": axles[:, 0], "vertical_load_rear": axles[:, 1]}
    return Drive(Recording(t, channels), truth)


def with_values(recording: Recording, channel: str, rows: Any, value: Any) -> Recording:
    """The recording with ``value`` put into the rows of one channel."""
    changed = recording.channels[channel].copy()
    changed[rows] = value
    return recording.with_channels(**{channel: changed})


def steady_rims(
    slip: Any,
    seconds: float,
    rate: float = 100.0,
    *,
    rim: Any = lambda t: 0.6 + 0.0 * t,
    noise: float = 0.3,
    pull_known: bool = False,
    **more: Any,
) -> Recording:
    """A drive whose rims' speed [m/s] is chosen, not the vehicle's, without a drawbar cell unless ``pull_known``."""
    log = drive(seconds, rate=rate, noise=noise, slip=slip, speed=lambda t: rim(t) * (1 - slip(t)), **more)
    channels = dict(log.recording.channels)
    if not pull_known:
        del channels["drawbar_force"]
    return Recording(log.recording.time, channels)


def begins(estimates: Estimates, kind: str) -> Floats:
    """When the spells of an event begin [s]."""
    has = estimates["event"] == kind
    return estimates.time[has & ~np.r_[False, has[:-1]]]

"""Runs of a rover into deep snow, made up from the published description of 17 measured ones (R): no soil model, only kinematics.

What the measured runs look like, of a 90 kg rover at 10 Hz with torque and speed of four wheels and a ground speed, no drawbar cell:
.5 to 1.5 m/s; a start with slip above .3 for up to a second; slip of -.03 to .16; then the mean slip passes .2, .3, .4 and .5
at 3.9, 2.8, 2.1 and 1.4 s before the stop (means over the runs), at a steady command; soil resistance .2 to .9 before it and
.8 to 1.7 in it; often one diagonal spins (.9) while the other holds (.1).

`snow_run` makes one such run; `healthy_snow` the same rover on the same snow with starts, stops and bumps, and no stop of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

Array = NDArray[np.float64]

WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, RATE, RUNS = 90.0, 0.15, 10.0, 17
BEFORE = np.array([3.9, 2.8, 2.1, 1.4])
"""s before the stop at which the mean slip passes PASSED."""
PASSED = np.array([0.2, 0.3, 0.4, 0.5])


def rover() -> Vehicle:
    """A 90 kg rover of four driven wheels; length and wheels are guesses, the description names none."""
    return Vehicle.from_dict(
        {
            "name": "snow rover",
            "mass": MASS,
            "wheelbase": 0.7,
            "track": 0.6,
            "center_of_gravity_height": 0.25,
            "hitch_height": 0.2,
            "axles": {"front": {"mass": 45.0, "wheels": ["fl", "fr"]}, "rear": {"mass": 45.0, "wheels": ["rl", "rr"]}},
            "wheel": {"radius": RADIUS, "inertia": 0.1},
        }
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SnowRun:
    """A recording, and what is true of it: time [s] and travel [m] of its rows, when the digging begins (infinite: never), when the
    vehicle stops (NaN: never), the mean rim speed [m/s] at first."""

    recording: Recording
    time: Array
    distance: Array
    begun: float
    stop: float
    command: float


def snow_run(seed: int) -> SnowRun:
    """Run ``seed`` of as many as one likes; two of three end with one diagonal spinning. The times of a run are the described
    ones times its own pace, of SD 20 % about 1."""
    rng = np.random.default_rng([17, seed])
    diagonal = seed % 3 != 0
    command, usual = rng.uniform(0.5, 1.5), rng.uniform(-0.03, 0.16)
    pace = float(np.clip(rng.normal(1.0, 0.2), 0.6, 1.4))
    stop = rng.uniform(12.0, 22.0) + 5.0 * pace
    time = np.arange(0.0, stop + 4.0, 1 / RATE)
    wander = _wander(rng, time, 0.5, 0.03)
    knots = np.concatenate([[stop - 5.0 * pace], stop - pace * BEFORE, [stop]])
    digging = np.interp(time, knots, [usual, *PASSED, 0.5 if diagonal else 0.9]) - usual
    mean = usual + _start_slip(rng, time, 2.0) + wander * np.interp(digging, [0.0, 0.3], [1.0, 0.3]) + digging
    slip = np.repeat(np.clip(mean, -0.15, 0.92)[:, None], 4, axis=1)
    if diagonal:  # the mean of both diagonals is kept while the slower one can give
        split = np.interp(time, stop - pace * BEFORE[[0, -1]], [0.0, 1.0])
        holds = (1 - split) * mean + split * 0.1
        spinning, holding = ([0, 3], [1, 2]) if rng.uniform() < 0.5 else ([1, 2], [0, 3])
        slip[:, holding] = holds[:, None]
        slip[:, spinning] = np.clip(2 * mean - holds, -0.15, 0.92)[:, None]
    rim = command * np.clip(time - 2.0, 0.0, 1.0)
    # A mean command shared by the wheels, as the mean slip and the halved speed of the description have it.
    speed = rim / np.mean(1 / (1 - slip), axis=1)
    held = np.clip((stop - time) / (0.3 * pace), 0.0, 1.0)  # the last creeping ends
    wheels = speed[:, None] / (1 - slip)
    speed = speed * held
    if diagonal:
        wheels[:, holding] *= held[:, None]
    resistance = rng.uniform(0.2, 0.9) + digging / 0.5 * rng.uniform(0.5, 0.8)
    measured = _measured(rng, time, wheels, speed, np.clip(resistance, 0.2, 1.7))
    return SnowRun(measured, time, np.cumsum(speed) / RATE, stop - 5.0 * pace, stop, command)


def healthy_snow(seed: int, duration: float = 300.0) -> SnowRun:
    """The same rover on snow that bears it: speeds held for 6 to 20 s, stops and starts, bumps of slip of up to .2 over half a second."""
    rng = np.random.default_rng([18, seed])
    time = np.arange(0.0, duration, 1 / RATE)
    rim, slip = np.zeros(len(time)), rng.uniform(-0.03, 0.16) + _wander(rng, time, 0.5, 0.03)
    slip += np.abs(_wander(rng, time, 5.0, 0.03))
    at, last = 2.0, 0.0
    while at < duration:
        aim, ramp, hold = rng.uniform(0.5, 1.5), rng.uniform(0.5, 2.0), rng.uniform(6.0, 20.0)
        rim = np.where(time >= at, last + (aim - last) * np.clip((time - at) / ramp, 0, 1), rim)
        if last == 0:
            slip += _start_slip(rng, time, at)
        at, last = at + ramp + hold, aim
        if rng.uniform() < 0.4:
            rim = np.where(time >= at, last * np.clip(1 - (time - at) / 0.7, 0, 1), rim)
            at, last = at + rng.uniform(2.0, 5.0), 0.0
    for bump in np.cumsum(rng.exponential(12.0, int(duration / 6))):
        slip += rng.uniform(0.05, 0.2) * np.exp(-0.5 * ((time - bump) / 0.2) ** 2)
    split = 0.3 * _wander(rng, time, 1.0, 0.1)[:, None] * [1, -1, -1, 1]
    wheels = np.repeat(rim[:, None], 4, axis=1) * (1 + split)
    speed = rim * (1 - np.clip(slip, -0.15, 0.9))
    resistance = rng.uniform(0.2, 0.9) + _wander(rng, time, 1.0, 0.05)
    measured = _measured(rng, time, wheels, speed, np.clip(resistance, 0.1, 1.7))
    return SnowRun(measured, time, np.cumsum(speed) / RATE, np.inf, np.nan, float(rim.max()))


def _start_slip(rng: np.random.Generator, time: Array, start: float) -> Array:
    """What a start from rest adds: slip above .3 for .3 to 1 s, gone half a second later."""
    size, lasts = rng.uniform(0.35, 0.6), rng.uniform(0.3, 1.0)
    return size * np.where(time < start, 0.0, np.clip(1 - (time - start - lasts) / 0.5, 0.0, 1.0))


def _wander(rng: np.random.Generator, time: Array, memory: float, deviation: float) -> Array:
    """A first-order random signal of SD ``deviation``."""
    keep = np.exp(-1 / (RATE * memory))
    result, noise = np.empty(len(time)), rng.normal(0, deviation, len(time))
    result[0] = noise[0]
    for k in range(1, len(time)):
        result[k] = keep * result[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    return result


def _measured(
    rng: np.random.Generator, time: Array, wheels: Array, speed: Array, resistance: Array
) -> Recording:
    """What the rover's sensors say: rims [m/s] (n, 4), ground speed [m/s], torques that carry resistance over weight, and inertia."""
    force = np.where(
        wheels.mean(axis=1) > 0.02, MASS * (GRAVITY * resistance + np.gradient(speed, time)), 0.0
    )
    torque = RADIUS * force / 4 + 0.1 * np.gradient(wheels.mean(axis=1) / RADIUS, time)
    channels = {"ground_speed": speed + rng.normal(0, 0.02, len(time))}
    for i, wheel in enumerate(WHEELS):
        channels[f"wheel_speed_{wheel}"] = wheels[:, i] / RADIUS + rng.normal(0, 0.03, len(time))
        channels[f"drive_torque_{wheel}"] = torque * rng.uniform(0.9, 1.1) + rng.normal(0, 1.0, len(time))
    return Recording(time=time, channels=channels)

"""Made-up recordings of grounds that differ in what a real one differs in: effort, its evenness, and vibration."""

from __future__ import annotations

import numpy as np
import pandas as pd

# ground: effort [N m], relative SD of it, vibration [m/s^2 at 1 rad/s], its frequency [Hz]
GROUNDS = {"hard": (4.0, 0.05, 0.3, 30.0), "loose": (9.0, 0.25, 0.6, 9.0), "wet": (6.0, 0.10, 0.15, 16.0)}
STRANGE = {"rails": (25.0, 0.9, 6.0, 44.0)}
WHEEL_RATE, BODY_RATE = 6.5, 100.0
BODY = [f"{name}_{axis}" for name in ("angular_velocity", "acceleration") for axis in "xyz"]


def drive(
    ground: str | tuple[float, float, float, float],
    seed: int,
    seconds: float = 30.0,
    wheels: tuple[str, ...] = ("left", "right"),
) -> pd.DataFrame:
    """A drive at changing speed with gentle turns: wheels 6.5 times and the body 100 times a second, in one table.

    Every drive has its own load (SD 8 %), and the body sensor sits on gravity and noise.
    """
    random = np.random.default_rng([seed, sum(map(ord, str(ground)))])
    effort, evenness, vibration, frequency = (
        {**GROUNDS, **STRANGE}[ground] if isinstance(ground, str) else ground
    )
    load = np.exp(0.08 * random.standard_normal())
    pace, phase = random.uniform(1.0, 4.0), random.uniform(0, 6)

    def speed(t: np.ndarray) -> np.ndarray:
        return pace * (1 + 0.3 * np.sin(t / 5 + phase))

    slow = np.arange(0, seconds, 1 / WHEEL_RATE)
    turn = 0.2 * np.sin(slow / 3 + phase)
    wheel = {"time": slow}
    for k, name in enumerate(wheels):
        side = (-1) ** k
        wheel[f"wheel_speed_{name}"] = speed(slow) * (1 + side * turn) + 0.02 * random.standard_normal(
            len(slow)
        )
        uneven = 1 + evenness * random.standard_normal(len(slow))
        wheel[f"drive_torque_{name}"] = effort * load * uneven * (1 + 0.5 * side * turn)
    fast = np.arange(0, seconds, 1 / BODY_RATE)
    body = {"time": fast}
    for name in BODY:
        size = vibration * speed(fast) * (0.1 if name.startswith("angular") else 1.0)
        tone = np.sin(2 * np.pi * frequency * fast + 4 * np.cumsum(random.standard_normal(len(fast))) / 30)
        body[name] = size * (tone + 0.5 * random.standard_normal(len(fast))) + 0.02 * random.standard_normal(
            len(fast)
        )
    body["acceleration_z"] += 9.81
    both = pd.concat([pd.DataFrame(wheel).set_index("time"), pd.DataFrame(body).set_index("time")], axis=1)
    return both.sort_index().rename_axis("time").reset_index()


def drives(
    seeds: range, grounds: tuple[str, ...] = tuple(GROUNDS), **how: float
) -> tuple[list[pd.DataFrame], list[str]]:
    """A drive for each ground and seed, and its label."""
    pairs = [(drive(ground, seed, **how), ground) for ground in grounds for seed in seeds]
    return [table for table, _ in pairs], [ground for _, ground in pairs]

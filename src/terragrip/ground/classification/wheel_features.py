"""Features of the wheels: how evenly they turn, and how much effort they need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.classification.vibration import likeness, moments

Table = dict[str, Floats]

ONE_WHEEL = "at "
SIDES = "sides "
FLOOR = 0.02  # of a channel's usual size: what counts as none


def log_size(values: Floats, size: float) -> Floats:
    """Logarithm of sizes relative to the usual one, finite at none."""
    return np.log(np.maximum(values / size, 0.0) + FLOOR)


def over_wheels(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean, greatest and least over the wheels that are measured (axis 1)."""
    measured = np.isfinite(values)
    count = measured.sum(axis=1)
    mean = np.where(measured, values, 0.0).sum(axis=1) / np.where(count, count, np.nan)
    return mean, np.fmax.reduce(values, axis=1), np.fmin.reduce(values, axis=1)


def motion(speed: Floats, size: float) -> Table:
    """How the wheels are driven and how evenly they turn; speed (windows, wheels, samples)."""
    pace, fastest, slowest = over_wheels(np.abs(speed))
    net, most, least = over_wheels(speed)
    usual = pace.mean(axis=-1)
    base = usual + FLOOR * size
    parting = (most - least) / 2
    along = moments(pace)
    step = np.sqrt(over_wheels(np.diff(speed, axis=-1) ** 2)[0].mean(axis=-1))
    spread = over_wheels(speed.std(axis=-1))
    ends = max(pace.shape[-1] // 4, 1)
    straight = np.abs(net).mean(axis=-1) > 0.3 * usual
    return {
        "pace": log_size(usual, size),
        "direction": np.where(straight, np.sign(net.mean(axis=-1)), 0.0) + 0.0 * usual,
        "straightness": np.abs(net).mean(axis=-1) / base,
        "turn": parting.mean(axis=-1) / base,
        "turn size": parting.mean(axis=-1) / size,
        "turn spread": log_size(parting.std(axis=-1), size),
        "fastest": fastest.mean(axis=-1) / size,
        "slowest": slowest.mean(axis=-1) / size,
        "spread": log_size(along["spread"], size),
        "evenness": log_size(along["spread"], size) - log_size(usual, size),
        "lag": along["lag"],
        "roughness": log_size(step, size),
        "roughness per speed": np.log(step / base + FLOOR),
        "greatest spread": log_size(spread[1], size),
        "least spread": log_size(spread[2], size),
        "trend": (pace[:, -ends:].mean(axis=-1) - pace[:, :ends].mean(axis=-1)) / base,
    }


def each_wheel(values: Floats, wheels: Sequence[str], size: float) -> Table:
    """Each wheel by its name; values (windows, wheels, samples). Names begin with `ONE_WHEEL`."""
    own = values / size
    parts = {
        "mean": own.mean(axis=-1),
        "least": own.min(axis=-1),
        "greatest": own.max(axis=-1),
        "level": np.log(np.abs(own).mean(axis=-1) + FLOOR),
        "spread": np.log(own.std(axis=-1) + FLOOR),
        "step": np.log(np.abs(np.diff(own, axis=-1)).mean(axis=-1) + FLOOR),
    }
    return {
        f"{ONE_WHEEL}{wheel} {name}": part[:, k]
        for k, wheel in enumerate(wheels)
        for name, part in parts.items()
    }


def effort_of(torque: Floats, size: float) -> Table:
    """The resistance proxy: how much torque (or current), how evenly, and how it is shared among the wheels."""
    effort = np.abs(torque)
    mean = over_wheels(effort)[0]
    level = mean.mean(axis=-1)
    base = level + FLOOR * size
    along = moments(mean)
    step = np.sqrt(over_wheels(np.diff(torque, axis=-1) ** 2)[0].mean(axis=-1))
    hardest = over_wheels(effort.mean(axis=-1))
    spread = over_wheels(torque.std(axis=-1))
    result = {
        "level": log_size(level, size),
        "spread": log_size(along["spread"], size),
        "evenness": np.log(along["spread"] / base + FLOOR),
        "kurtosis": along["kurtosis"],
        "peak": along["peak"],
        "lag": along["lag"],
        "least": log_size(mean.min(axis=-1), size),
        "greatest": log_size(mean.max(axis=-1), size),
        "roughness": log_size(step, size),
        "roughness per level": np.log(step / base + FLOOR),
        "hardest wheel": log_size(hardest[1], size),
        "easiest wheel": log_size(hardest[2], size),
        "greatest spread": log_size(spread[1], size),
        "least spread": log_size(spread[2], size),
        "imbalance": log_size(hardest[1], size) - log_size(hardest[2], size),
    }
    flat = np.sort(effort.reshape(len(effort), -1), axis=-1)  # NaN sorts to the end
    count = np.isfinite(flat).sum(axis=-1)
    for share in (0.1, 0.25, 0.5, 0.75, 0.9):
        at = np.clip(np.rint(share * (count - 1)), 0, None).astype(int)
        result[f"quantile {share:g}"] = log_size(flat[np.arange(len(flat)), at], size)
    return result


def sides(effort: Floats, speed: Floats, size: float, usual_speed: float) -> Table:
    """How the fastest and the slowest wheel share the effort; effort and speed (windows, wheels, samples) of the same wheels.

    In a turn the outer wheels push the vehicle round against the ground, and the inner ones brake: their difference is the
    turning resistance, their sum the rolling resistance. Also how rough both are. Names begin with `SIDES`.
    """
    pace = np.abs(speed)
    rate = pace.mean(axis=-1)
    rows = np.arange(len(effort))
    outer, inner = np.nan_to_num(rate).argmax(axis=1), np.nan_to_num(rate, nan=np.inf).argmin(axis=1)
    fast, slow = effort[rows, outer], effort[rows, inner]
    all_of, usual = over_wheels(effort)[0], over_wheels(rate)[0]
    parting = np.abs(speed[rows, outer] - speed[rows, inner]).mean(axis=-1) / 2
    difference = (fast - slow).mean(axis=-1) / size
    travelled = over_wheels(effort * pace)[0].mean(axis=-1) / (usual + 0.1 * usual_speed)
    speed_jerk = over_wheels(jerk(speed))[0]
    result = {
        "fast level": log_size(fast.mean(axis=-1), size),
        "slow level": log_size(slow.mean(axis=-1), size),
        "difference": np.clip(difference, -3.0, 3.0),
        "difference size": log_size(np.abs(difference), 1.0),
        "difference per turn": difference * usual_speed / (parting + 0.2 * usual + 0.1 * usual_speed),
        "alike": likeness(fast, slow),
        "jerk": log_size(jerk(all_of), size),
        "jerk per level": np.log((jerk(all_of) / size + FLOOR) / (all_of.mean(axis=-1) / size + 2 * FLOOR)),
        "jerk of difference": log_size(jerk(fast - slow), size),
        "fast jerk": log_size(jerk(fast), size),
        "slow jerk": log_size(jerk(slow), size),
        "speed jerk": log_size(speed_jerk, usual_speed),
        "speed jerk per speed": np.log(
            (speed_jerk / usual_speed + FLOOR) / (usual / usual_speed + 2 * FLOOR)
        ),
        "per way": log_size(travelled, size),
    }
    return {f"{SIDES}{name}": values for name, values in result.items()}


def jerk(values: Floats) -> Floats:
    """Root mean square (...,) of the second differences of ``values`` (..., samples): what is left without slow changes."""
    return np.asarray(np.sqrt((np.diff(values, 2, axis=-1) ** 2).mean(axis=-1)))

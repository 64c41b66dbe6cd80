"""Features of windows: what each shows of the ground, and which sensors it needs.

A feature's name begins with its sensors. Wheels come in as mean and spread over the wheels, so that neither their
number nor their order matters. Sizes come in as logarithms relative to the vehicle's usual ones, so that a gain on
a channel, such as amperes for newton metres, is only a shift.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.classification.channels import (
    FAMILIES,
    SAME_RATE,
    Channel,
    Signals,
    shortest_period,
    wheel_of,
)
from terragrip.ground.classification.vibration import (
    band_edges,
    band_energies,
    likeness,
    moments,
    spectral_shape,
    unsteadiness,
)
from terragrip.ground.classification.wheel_features import (
    FLOOR,
    ONE_WHEEL,
    SIDES,
    Table,
    each_wheel,
    effort_of,
    log_size,
    motion,
    over_wheels,
    sides,
)
from terragrip.ground.classification.windows import samples_in

SPEED, TORQUE, GROUND, TURN, ACCELERATION = FAMILIES
_BLOCK = 2000  # windows at a time bound the memory of a long drive
_FEWEST = 5  # samples a window where training had more: with fewer, probabilities were worse than equal ones


@dataclass(frozen=True)
class Layout:
    """What a vehicle's recordings look like: window [s], sample period [s] and usual size of each family."""

    window: float
    period: dict[str, float]
    size: dict[str, float]


def features_of(signals: Signals, starts: Floats, layout: Layout) -> Table:
    """Features (windows,) by name, of the windows that begin at ``starts``; NaN where not measured.

    A family of sensors that the recording or the layout lacks gives none.
    """
    if len(starts) > _BLOCK:
        blocks = [features_of(signals, starts[k : k + _BLOCK], layout) for k in range(0, len(starts), _BLOCK)]
        return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    result: Table = {}
    usable = {f: c for f, c in signals.families.items() if f in layout.period and dense(f, c, layout)}
    with np.errstate(invalid="ignore", divide="ignore"):
        speeds = _wheels(usable.get(SPEED, {}), starts, layout, SPEED)
        if speeds is not None:
            result |= _named(SPEED, motion(speeds, layout.size[SPEED]))
            result |= _each(SPEED, usable[SPEED], speeds, layout)
        torques = _wheels(usable.get(TORQUE, {}), starts, layout, TORQUE)
        if torques is not None:
            result |= _named(TORQUE, effort_of(torques, layout.size[TORQUE]))
            result |= _each(TORQUE, usable[TORQUE], torques, layout)
            if speeds is not None:
                beside = _drive_beside_motion(usable, starts, layout, torques)
                result |= _named(f"{SPEED}+{TORQUE}", beside)
        if GROUND in usable:
            result |= _ground(usable, starts, layout, speeds)
        for family in (TURN, ACCELERATION):
            if family in usable:
                result |= _body(family, usable[family], starts, layout)
                if speeds is not None:
                    pace = result[f"{SPEED}: pace"]
                    result[f"{SPEED}+{family}: per speed"] = result[f"{family}: all spread"] - pace
        if speeds is not None and TURN in usable:
            result |= _named(f"{SPEED}+{TURN}", _yaw(usable, starts, layout, speeds))
    return result


@cache
def families_needed(feature: str) -> frozenset[str]:
    """The sensor families that a feature rests on, read from its name."""
    return frozenset(feature.partition(": ")[0].split("+"))


def of_one_wheel(feature: str) -> bool:
    """Whether a feature is of one wheel, so that it depends on the wheels' names."""
    return feature.partition(": ")[2].startswith(ONE_WHEEL)


def of_sides(feature: str) -> bool:
    """Whether a feature compares the fastest wheel with the slowest, which is informative only together with the motion."""
    return feature.partition(": ")[2].startswith(SIDES)


def _each(family: str, channels: dict[str, Channel], values: Floats, layout: Layout) -> Table:
    wheels = [wheel_of(name) for name in channels]
    return _named(family, each_wheel(values, wheels, layout.size[family]))


def _named(sensors: str, features: Table) -> Table:
    return {f"{sensors}: {name}": values for name, values in features.items()}


def _period(family: str, channels: dict[str, Channel], layout: Layout) -> float:
    """The trained period, at which faster samples are taken; of slower ones their own."""
    own, trained = shortest_period(channels), layout.period[family]
    return trained if own < SAME_RATE * trained else own


def dense(family: str, channels: dict[str, Channel], layout: Layout) -> bool:
    """Whether a family's channels have samples enough in a window, or as many as in training."""
    period = _period(family, channels, layout)
    return period == layout.period[family] or layout.window >= _FEWEST * period


def _stack(
    channels: dict[str, Channel],
    starts: Floats,
    layout: Layout,
    period: float,
    beside: dict[str, Channel] | None = None,
) -> Floats:
    """Samples (windows, channels, samples) on one grid: of the densest channel, the first of equals, of these or those ``beside``."""
    lead = max((beside or channels).values(), key=lambda channel: len(channel.time))
    return samples_in(list(channels.values()), starts, layout.window, period, lead)


def _wheels(channels: dict[str, Channel], starts: Floats, layout: Layout, family: str) -> Floats | None:
    """Samples (windows, wheels, samples), or None if no channel holds at least two a window."""
    if not channels:
        return None
    period = _period(family, channels, layout)
    if period > layout.window / 2:
        return None
    return _stack(channels, starts, layout, period)


def _drive_beside_motion(
    usable: dict[str, dict[str, Channel]], starts: Floats, layout: Layout, torque: Floats
) -> Table:
    """Torque and speed together: power, signed effort, and whether they rise and fall as one."""
    period = _period(TORQUE, usable[TORQUE], layout)
    speed = _stack(usable[SPEED], starts, layout, period, usable[TORQUE])
    effort, pace = over_wheels(np.abs(torque))[0], over_wheels(np.abs(speed))[0]
    net = over_wheels(speed)[0]
    size = layout.size[TORQUE] * layout.size[SPEED]
    result = {
        "power": log_size((effort * pace).mean(axis=-1), size),
        "rise together": likeness(effort, pace),
        "rise with acceleration": likeness(effort[:, 1:], np.diff(pace, axis=-1)),
    }
    # Wheels are paired by name where both are measured; mean net effort needs no pairing.
    forward = over_wheels(torque)[0] * np.sign(net)
    result["net effort"] = forward.mean(axis=-1) / layout.size[TORQUE]
    pairs = {wheel_of(name): k for k, name in enumerate(usable[SPEED])}
    own = [(k, pairs[wheel_of(n)]) for k, n in enumerate(usable[TORQUE]) if wheel_of(n) in pairs]
    if len(own) > 1:
        level = np.abs(torque[:, [t for t, _ in own]]).mean(axis=-1)
        rate = np.abs(speed[:, [s for _, s in own]]).mean(axis=-1)
        rows = np.arange(len(level))
        floor = FLOOR * layout.size[TORQUE]
        fast, slow = np.nan_to_num(rate).argmax(axis=1), np.nan_to_num(rate, nan=np.inf).argmin(axis=1)
        result["fast against slow wheel"] = np.log((level[rows, fast] + floor) / (level[rows, slow] + floor))
        if torque.shape[-1] > 2:
            pair = np.abs(torque[:, [t for t, _ in own]]), speed[:, [s for _, s in own]]
            result |= sides(*pair, layout.size[TORQUE], layout.size[SPEED])
    return result


def _ground(
    usable: dict[str, dict[str, Channel]],
    starts: Floats,
    layout: Layout,
    speeds: Floats | None,
) -> Table:
    """Ground speed: its own evenness, and how much faster the wheels turn than the vehicle moves (slip)."""
    channels = usable[GROUND]
    period = _period(GROUND, channels, layout)
    size = layout.size[GROUND]
    moving = _stack(channels, starts, layout, period)[:, 0]
    level = np.abs(moving).mean(axis=-1)
    result = _named(
        GROUND,
        {
            "level": log_size(level, size),
            "evenness": np.log(moving.std(axis=-1) / (level + FLOOR * size) + FLOOR),
        },
    )
    if speeds is not None:
        pace = over_wheels(np.abs(speeds))[0].mean(axis=-1)
        slip = log_size(pace, layout.size[SPEED]) - log_size(level, size)
        result[f"{SPEED}+{GROUND}: slip"] = slip
    return result


def _body(family: str, channels: dict[str, Channel], starts: Floats, layout: Layout) -> Table:
    """Vibration of the body, gravity and slow tilt removed: each axis, and all of them."""
    period = _period(family, channels, layout)
    edges = band_edges(layout.window, layout.period[family])
    size = layout.size[family]
    values = _stack(channels, starts, layout, period)
    axes = [name.rpartition("_")[2] for name in channels]
    result: Table = {}
    each = moments(values)
    spread = np.log(each.pop("spread") / size + 1e-3)
    total = 0.5 * np.log(np.nansum(np.exp(2 * spread), axis=1)) + 0.0 * spread.sum(axis=1)
    result["all spread"] = total
    result["unsteadiness"] = unsteadiness(values)
    energies = band_energies(values, period, edges) / size**2 if len(edges) else None
    if energies is not None:
        whole = energies.sum(axis=1)
        result |= {f"all {name}": shape for name, shape in spectral_shape(whole, edges).items()}
        spectrum = np.log(energies + 1e-7)
        resolved = np.isfinite(spectrum)
        mean = np.where(resolved, spectrum, 0.0).sum(axis=-1, keepdims=True)
        shape = spectrum - mean / resolved.sum(axis=-1, keepdims=True)
        octaves = _octaves(whole)
        result |= {f"all octave {k}": np.log(band + 1e-7) for k, band in enumerate(octaves)}
    for k, axis in enumerate(axes):
        result[f"{axis} spread"] = spread[:, k]
        result[f"{axis} share"] = spread[:, k] - total
        result |= {f"{axis} {name}": of_axes[:, k] for name, of_axes in each.items()}
        if energies is not None:
            result |= {f"{axis} band {b}": shape[:, k, b] for b in range(shape.shape[-1])}
        for j in range(k):
            result[f"{axes[j]}{axis} alike"] = np.abs(likeness(values[:, j], values[:, k]))
    return _named(family, result)


def _octaves(energies: Floats) -> list[Floats]:
    """Band energies (windows, bands) summed by octave, from the highest down."""
    result, high = [], energies.shape[-1]
    while high >= 1:
        low = high // 2
        result.append(energies[:, low:high].sum(axis=-1))
        high = low
    return result


def _yaw(usable: dict[str, dict[str, Channel]], starts: Floats, layout: Layout, speeds: Floats) -> Table:
    """How much the body turns relative to what the wheels command: low on ground that lets a skid-steered vehicle slide."""
    channels = usable[TURN]
    if "angular_velocity_z" not in channels:
        return {}
    about_z = {"angular_velocity_z": channels["angular_velocity_z"]}
    period = _period(TURN, channels, layout)
    turning = _stack(about_z, starts, layout, period)[:, 0]
    _, most, least = over_wheels(speeds)
    parting = (most - least).mean(axis=-1) / (2 * layout.size[SPEED])
    rate = np.abs(turning.mean(axis=-1)) / layout.size[TURN]
    return {
        "yaw rate": np.log(rate + FLOOR),
        "yaw gain": np.log((rate + 0.1) / (parting + 0.1)),
        "yaw energy": np.log(np.sqrt((turning**2).mean(axis=-1)) / layout.size[TURN] + FLOOR),
    }

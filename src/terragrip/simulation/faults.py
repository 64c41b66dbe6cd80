"""Faults on demand, put into the samples of the sensors before they become one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError, suggestion
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario_sensors import Fault
from terragrip.simulation.sensors import Series

Rows = Bools

MARGIN = 0.05  # share of the run at either end where no fault is placed by chance


def apply(faults: tuple[Fault, ...], series: list[Series], duration: float, seed: int) -> list[Series]:
    """The series with every fault in it, in order; raises InputError if a fault names no channel on board."""
    for k, fault in enumerate(faults):
        known = [name for one in series for name in (one.sensor, *one.values)]
        if fault.channel is not None and fault.channel not in known:
            raise InputError(
                f"no channel {fault.channel!r} on board",
                place=f"faults.{k}.channel",
                hint=suggestion(fault.channel, known, f"channels are {', '.join(known)}"),
            )
        rng = stream(seed, f"fault {k} {fault.kind}")
        windows = _windows(fault, duration, rng)
        series = [_struck(fault, one, windows, rng) for one in series]
    return series


def _windows(fault: Fault, duration: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Spells [start, end) of a fault. Spikes fall anywhere in their spell, so they have one."""
    length = np.inf if fault.duration is None else fault.duration
    if fault.at is not None:
        return [(fault.at, fault.at + length)]
    if fault.kind in ("spike", "jitter") or fault.duration is None:
        return [(0.0, np.inf)]
    low, high = MARGIN * duration, max((1 - MARGIN) * duration - length, MARGIN * duration)
    return [(start, start + length) for start in np.sort(rng.uniform(low, high, fault.count))]


def _struck(
    fault: Fault, series: Series, windows: list[tuple[float, float]], rng: np.random.Generator
) -> Series:
    named = [c for c in series.values if fault.channel in (None, series.sensor, c)]
    if not named:
        return series
    rows = np.zeros(len(series.time), dtype=bool)
    for start, end in windows:
        rows |= (series.time >= start) & (series.time < end)
    if fault.kind == "jitter":
        return _jittered(fault, series, rows, rng)
    if fault.kind == "gap":
        return replace(
            series, time=series.time[~rows], values={c: v[~rows] for c, v in series.values.items()}
        )
    change = _CHANGES[fault.kind]
    return replace(
        series,
        values={c: change(fault, v.copy(), rows, rng) if c in named else v for c, v in series.values.items()},
    )


def _jittered(fault: Fault, series: Series, rows: Rows, rng: np.random.Generator) -> Series:
    """Stamps scatter, but never out of order."""
    limit = 0.45 / series.rate
    scatter = np.clip(fault.size * rng.standard_normal(len(rows)), -limit, limit)
    return replace(series, time=np.round(series.time + np.where(rows, scatter, 0.0), 6))


def _loss(fault: Fault, values: Floats, rows: Rows, rng: np.random.Generator) -> Floats:
    values[rows] = np.nan
    return values


def _held(fault: Fault, values: Floats, rows: Rows, rng: np.random.Generator) -> Floats:
    if rows.any():
        first = int(np.argmax(rows))
        source = np.maximum.accumulate(np.where(rows, 0, np.arange(len(rows))))
        values[rows] = values[np.maximum(source[rows], max(first - 1, 0))]
    return values


def _spike(fault: Fault, values: Floats, rows: Rows, rng: np.random.Generator) -> Floats:
    places = np.flatnonzero(rows & np.isfinite(values))
    hit = rng.choice(places, min(fault.count, len(places)), replace=False)
    values[hit] += fault.size * rng.choice([-1.0, 1.0], len(hit))
    return values


def _sign(fault: Fault, values: Floats, rows: Rows, rng: np.random.Generator) -> Floats:
    values[rows] *= -1.0
    return values


def _dead(fault: Fault, values: Floats, rows: Rows, rng: np.random.Generator) -> Floats:
    values[rows] = fault.size
    return values


_CHANGES: dict[str, Callable[[Fault, Floats, Rows, np.random.Generator], Floats]] = {
    "loss": _loss,
    "held": _held,
    "spike": _spike,
    "sign": _sign,
    "dead": _dead,
}

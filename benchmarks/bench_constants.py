"""What each tuned number of the estimator does: halved and doubled, on the development families.

    python benchmarks/bench_constants.py [--machines 12] [--rates 100 20] [--only NAME ...] [--write]

The numbers are tg_tuned (kernel/include/terragrip.h), the bank's scales, all together, and `huber`. A line a number: R² of
adhesion less that with the number as it is, median and worst machine over all rates; NIS a channel of moving rows; the interval
scores of adhesion, slip and soil resistance over those with the number as it is, geometric means. Every log loses its ground speed
for 8 s and everything for 3 s, and half of them their pitch and accelerometer, so that each number has something to do. The numbers
of slip from speeds alone are tried on the same logs without torques. --write puts the table into docs/tuned-numbers.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench_families import Floats, driven_wheels, moving_rows, pooled_r2, result_without
from family_intervals import SCORED, intervals
from marked import put
from terragrip._kernel import ffi, lib
from terragrip.estimation import estimator as estimator_module
from terragrip.estimation import rims
from terragrip.estimation.batch import estimate
from terragrip.estimation.engine import EVENTS
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import draw, machines

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/tuned-numbers.md"
BEGIN = "<!-- made by benchmarks/bench_constants.py --write -->"
AT_REST = [EVENTS.index("standstill"), EVENTS.index("gap")]
ALONE = (
    "manoeuvre",
    "slipping",
    "lasting",
    "mode_dwell",
    "first_rate",
    "slowest",
    "apart",
)  # of speeds alone
SETTINGS = (
    (estimator_module, "settings_of"),
    (rims, "speed_settings"),
)  # where a log with torques takes them, and one without


@dataclass(frozen=True)
class Figures:
    """R² of adhesion, NIS a channel, and interval scores (k, SCORED), a number a machine and rate."""

    r2: Floats
    nis: Floats
    score: Floats


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=12)
    parser.add_argument("--rates", type=float, nargs="+", default=[100.0, 20.0])
    parser.add_argument("--only", nargs="+", help="these numbers")
    parser.add_argument("--write", action="store_true", help="put the table into docs/tuned-numbers.md")
    arguments = parser.parse_args()
    drawn = [
        draw(kind, seed, rate=rate)
        for kind, seed in machines("development", arguments.machines, 0)
        for rate in arguments.rates
    ]
    drawn = [damaged(result, bare=k % 2 == 1) for k, result in enumerate(drawn)]
    alone = [result_without(one, "drive_torque") for one in drawn]
    usual = figures(drawn, lambda settings: None)
    usual_alone = figures(alone, lambda settings: None)
    nis = f"{np.median(usual.nis):.2f}"
    columns = ["R² median", "worst", "NIS", "score µ", "slip", "ρs"]
    lines = [
        f"| number | value | halved: {' | '.join(columns)} | doubled: {' | '.join(columns)} |",
        f"|---|---:{'|---:' * 2 * len(columns)}|",
        f"| as they are | {f'| | | {nis} | 1 | 1 | 1 ' * 2}|",
    ]
    for name, value in numbers().items():
        if arguments.only and name not in arguments.only:
            continue
        cells = [name, value]
        logs, before = (alone, usual_alone) if name in ALONE else (drawn, usual)
        for factor in (0.5, 2.0):
            out = figures(logs, scaled(name, factor))
            change = out.r2 - before.r2
            known = np.isfinite(change).all()
            cells += [f"{np.median(change):+.4f}", f"{change.min():+.4f}"] if known else ["", ""]
            cells.append(f"{np.median(out.nis):.2f}")
            cells += [
                f"{np.exp(np.nanmean(np.log(ratio))):.3f}" if np.isfinite(ratio).any() else ""
                for ratio in (out.score / before.score).T
            ]
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    text = "\n".join(lines)
    print("\n" + text)
    if arguments.write:
        put(DOCUMENT, BEGIN, text)
        print(f"written to {DOCUMENT}")


def damaged(result: SimulationResult, bare: bool) -> SimulationResult:
    """The result whose log lacks the ground speed for 8 s, everything for 3 s and, if ``bare``, the inertial unit."""
    log = result.recording
    time, middle = log.time - log.time[0], float(log.time[-1] - log.time[0]) / 2
    silent, dead = (time > middle) & (time < middle + 8), (time > middle + 15) & (time < middle + 18)
    channels = {
        name: np.where(dead | (silent & (name == "ground_speed")), np.nan, values)
        for name, values in log.channels.items()
        if not (bare and name.startswith(("acceleration", "pitch", "angular")))
    }
    return replace(result, recording=replace(log, channels=channels))


def numbers() -> dict[str, str]:
    """Every tuned number by name, and its value."""
    settings = lib.tg_default_settings()
    out = {}
    for name, field in ffi.typeof("tg_tuned").fields:
        value = getattr(settings.tuned, name)
        out[name] = " ".join(f"{v:.3g}" for v in (value if field.type.kind == "array" else [value]))
    out["scales"] = " ".join(f"{scale:g}" for scale in settings.tuning.scales)
    for name in ("huber", "dwell"):
        out[name] = f"{getattr(settings.tuning, name):g}"
    return out


def scaled(name: str, factor: float) -> Callable[[Any], None]:
    """A change of settings: this number times `factor`."""

    def change(settings: Any) -> None:
        holder = settings.tuning if name in ("scales", "huber", "dwell") else settings.tuned
        value = getattr(holder, name)
        if isinstance(value, float):
            setattr(holder, name, value * factor)
        else:
            for k in range(len(value)):
                value[k] *= factor
        lib.tg_tune_walks(settings)

    return change


def changed(made: Callable[..., Any], change: Callable[[Any], None]) -> Callable[..., Any]:
    """What makes settings, and changes them."""

    def remade(*arguments: Any, **named: Any) -> Any:
        settings = made(*arguments, **named)
        change(settings)
        return settings

    return remade


@contextmanager
def changed_settings(change: Callable[[Any], None]) -> Iterator[None]:
    """Within it every estimate is made by settings changed so."""
    usual = [getattr(holder, name) for holder, name in SETTINGS]
    for (holder, name), made in zip(SETTINGS, usual, strict=True):
        setattr(holder, name, changed(made, change))
    try:
        yield
    finally:
        for (holder, name), made in zip(SETTINGS, usual, strict=True):
            setattr(holder, name, made)


def figures(drawn: list[SimulationResult], change: Callable[[Any], None]) -> Figures:
    """All recordings with the settings changed."""
    r2, nis, score = [], [], []
    for result in drawn:
        with changed_settings(change):
            estimates = estimate(result.recording, result.vehicle)
        wheels = driven_wheels(result)
        measured = np.isfinite(result.recording[f"wheel_speed_{wheels[0]}"])
        rows = moving_rows(result) & measured
        truth = np.stack([result.truth[f"true_adhesion_{w}"] for w in wheels], axis=1)
        estimated = np.full(truth.shape, np.nan)
        if f"adhesion_{wheels[0]}" in estimates:
            estimated = np.stack([estimates[f"adhesion_{w}"] for w in wheels], axis=1)
            rows &= np.isfinite(estimated).all(axis=1)  # none in rows of a gap
        r2.append(pooled_r2(truth, estimated, rows))
        held = intervals(result, estimates, wheels, rows)
        score.append([held.score[name] for name in SCORED])
        taken = (estimates["channels"] > 0) & ~np.isin(estimates.event_codes, AT_REST)
        nis.append(float(estimates["nis"][taken].sum() / estimates["channels"][taken].sum()))
    return Figures(np.array(r2), np.array(nis), np.array(score))


if __name__ == "__main__":
    main()

"""Changes and soils on development machines drawn at random: how many borders are found, what is false, how often a soil is named right.

    python benchmarks/ground_families.py [--machines 24] [--seed 8270000] [--rate 20] [--minutes 10] [--family development] [--write]

One drive a machine over two to four soils that come again and again, estimated by the default method. A border counts where true
resistance or true scale of the curve differ by three times their spread on one soil; others are neither found nor missed. A change counts
within its transition, give or take 2 s or half the vehicle's length; the second in one is false. Soils: the library is learned from the
first half of the drive, with its labels, and names the settled blocks of the second; left out: each soil in turn, which then is unknown.
log score: minus the mean log of the probability of the true soil, at least 1e-4 (lower is better). sure and wrong: share of blocks with a
wrong soil of more than 90 %. --write puts the table into docs/ground.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import ground_drives
from ground_drives import Matches, match
from marked import put
from soil_families import Floats, true_estimates
from terragrip.estimation import Estimates, estimate
from terragrip.ground.analysis import Settings, analyse, block_labels
from terragrip.ground.signals import signals_of
from terragrip.ground.unknown import UNKNOWN
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import draw, machines
from terragrip.soil.blocks import estimates_blocks
from terragrip.soil.estimates import GatheredRuns, whole_length
from terragrip.soil.library import SoilLibrary

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/ground.md"
BEGIN = "<!-- made by benchmarks/ground_families.py --write, {family}{rate:g} Hz -->"
DIFFERS = 3.0
LEAST_BLOCKS = 10
SURE = 0.9


@dataclass
class Named:
    """Settled blocks of the second half by machine: share right, mean stated probability, log score, share sure and wrong; blocks of
    soils left out, and those of them called unknown."""

    right: list[float] = field(default_factory=list)
    stated: list[float] = field(default_factory=list)
    logs: list[float] = field(default_factory=list)
    wrong: list[float] = field(default_factory=list)
    left: int = 0
    unknown: int = 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=8270000)
    parser.add_argument("--rate", type=float, default=20.0)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--family", choices=("development", "held-out"), default="development")
    parser.add_argument("--write", action="store_true", help="put the table into docs/ground.md")
    arguments = parser.parse_args()
    ways = {"afterwards": (Matches(), Named()), "while driving": (Matches(), Named())}
    for kind, seed in machines(arguments.family, arguments.machines, arguments.seed):
        result = draw(kind, seed, rate=arguments.rate, duration=60 * arguments.minutes)
        estimates = estimate(result.recording, result.vehicle)
        spans = list(borders(estimates, result))
        library, half = first_half(estimates)
        for way, (matches, named) in ways.items():
            settings = Settings(online=way == "while driving")
            matches.add(changes(estimates, settings, spans))
            if library.recognisable:
                add_soils(named, estimates, library, half, settings)
    lines = [
        f"{arguments.machines} {arguments.family} machines from seed {arguments.seed}, {arguments.rate:g} Hz; "
        f"soils of {len(ways['afterwards'][1].right)} of them.",
        "",
        "| way | borders | found (%) | changes right (%) | false an hour | soil right (%) | stated (%) | log score | sure and wrong (%) "
        "| left out: unknown (%) |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for way, (one, soils) in ways.items():
        right, stated, wrong = (100 * float(np.mean(x)) for x in (soils.right, soils.stated, soils.wrong))
        lines.append(
            f"| {way} | {one.borders} | {100 * one.recall:.0f} | {100 * one.precision:.0f} | {one.false_an_hour:.1f} | "
            f"{right:.0f} | {stated:.0f} | {np.mean(soils.logs):.2f} | {wrong:.0f} | {100 * soils.unknown / max(soils.left, 1):.0f} |"
        )
    print("\n".join(lines))
    if arguments.write:
        family = "" if arguments.family == "development" else f"{arguments.family}, "
        put(DOCUMENT, BEGIN.format(rate=arguments.rate, family=family), "\n".join(lines))


def borders(estimates: Estimates, result: SimulationResult) -> Iterator[tuple[float, float, float, bool]]:
    """Transitions as `ground_drives.borders`; the soils of one differ by `DIFFERS` of their spreads, in truth."""
    true = true_estimates(estimates, result)
    columns = {**true.columns, "soil_resistance": result.truth["true_soil_resistance"].to_numpy()}
    columns |= {name: np.zeros_like(x) for name, x in columns.items() if name.endswith("_std")}
    true = replace(true, columns=columns)
    blocks = estimates_blocks(true)
    signals, labels = signals_of(blocks, ("soil_resistance", "curve_scale")), block_labels(true, blocks)
    levels: dict[str, Floats] = {}
    spreads = []
    for soil in set(labels) - {""}:
        mine = signals[(labels == soil) & np.isfinite(signals).all(axis=1)]
        if len(mine) >= LEAST_BLOCKS:
            levels[soil] = np.median(mine, axis=0)
            spreads.append(np.median(np.abs(mine - levels[soil]), axis=0) / 0.6745)
    spread = np.median(spreads, axis=0) if spreads else np.ones(2)
    time, soil_at = result.truth["time"].to_numpy(), result.truth["soil"].to_numpy(dtype=object)
    for first, last, turn, _ in ground_drives.borders(result):
        before, after = (soil_at[np.searchsorted(time, t)] for t in (first, last))
        there = before in levels and after in levels
        differ = there and bool((np.abs(levels[before] - levels[after]) > DIFFERS * spread).any())
        yield first, last, turn, differ


def changes(
    estimates: Estimates, settings: Settings, spans: list[tuple[float, float, float, bool]]
) -> Matches:
    """The drive's changes beside its borders."""
    moving = estimates["ground_speed"] > 0.05
    speed = float(np.median(estimates["ground_speed"][moving])) if moving.any() else 1.0
    margin = max(2.0, 0.5 * whole_length(estimates.vehicle) / speed)
    seconds = float(estimates.time[-1] - estimates.time[0])
    return match(analyse(estimates, settings=settings)[0].changes, spans, seconds, margin)


def first_half(estimates: Estimates) -> tuple[SoilLibrary, float]:
    """The library of the first half's labels, and when that ends [s]."""
    half = 0.5 * float(estimates.time[0] + estimates.time[-1])
    labels = np.where(estimates.time <= half, estimates["soil"], "")
    gathered = GatheredRuns()
    gathered.add(replace(estimates, labels={**estimates.labels, "soil": labels}), "first half")
    return gathered.learn().library(), half


def add_soils(
    named: Named, estimates: Estimates, library: SoilLibrary, half: float, settings: Settings
) -> None:
    """Score the second half, with the library and without each of its soils."""
    timeline = analyse(estimates, library, settings=settings)[0].timeline
    late = timeline.known & (timeline.time > half)
    here = late & np.isin(timeline.label, list(library.recognisable))
    if here.any():
        right, probabilities = (timeline.soil == timeline.label)[here], timeline.probabilities[here]
        stated = probabilities.max(axis=1)
        true = [timeline.names.index(label) for label in timeline.label[here]]
        named.right.append(float(right.mean()))
        named.stated.append(float(stated.mean()))
        named.logs.append(-float(np.log(np.maximum(probabilities[np.arange(len(true)), true], 1e-4)).mean()))
        named.wrong.append(float(((stated > SURE) & ~right).mean()))
    every = library.recognisable
    for soil in every if len(every) > 1 else ():
        rest = SoilLibrary({name: one for name, one in every.items() if name != soil})
        soils = analyse(estimates, rest, settings=settings)[0].timeline.soil
        missing = late & (timeline.label == soil)
        named.left += int(missing.sum())
        named.unknown += int((soils[missing] == UNKNOWN).sum())


if __name__ == "__main__":
    main()

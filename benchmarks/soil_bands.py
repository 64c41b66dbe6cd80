"""Whether the bands of soils' curves hold the true curve within their data and beyond: simulated machines, curves of the literature.

    python benchmarks/soil_bands.py [--machines 12] [--seed 8162000] [--minutes 5] [--write]

One drive a machine at 20 Hz on development machines, the same on rises of other forms and on yielding ground (other_grounds.py); each soil
is learned as `terragrip soils` does, from all of the drive's slips and from those up to 6 %, and counts with the badge. *Literature*: the
paper's and Burckhardt's soils, but ice and snow (k of 94 and more), and one curve each of the other forms, 4000 points of 5 % about them up
to 10 % of slip, runs apart by 2 %. A band is judged at multiples of the largest slip of its bins, up to 60 %; *own*: between the curves at
the ends of the interval of `a`. --write puts the table into docs/soils.md.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import other_grounds
from bench_advice import machines
from marked import put
from terragrip.advice.optimum import GRID
from terragrip.estimation import estimate
from terragrip.simulation import families
from terragrip.simulation.scenario import Scenario
from terragrip.soil.bins import PULL, BinSettings
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.literature import literature_soils

Floats = NDArray[np.float64]
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/soils.md"
BEGIN = "<!-- made by benchmarks/soil_bands.py --write -->"
MULTIPLES = (0.5, 1.0, 1.5, 3.0, 5.0)
PARTS = ("development", "other-grounds", "yielding")
STEEP = ("ice", "snow")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=12)
    parser.add_argument("--seed", type=int, default=8162000)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--write", action="store_true", help="put the table into docs/soils.md")
    arguments = parser.parse_args()
    lines = [
        f"{arguments.machines} machines a part from seed {arguments.seed}, {arguments.minutes:g} minutes each; simulation.",
        "",
        "| curves | slip, times the data's largest | curves judged | own holds (%) | band holds (%) | width over the curve, own | band |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for part in (*PARTS, "literature"):
        rows = literature(arguments.seed) if part == "literature" else learned(part, arguments)
        scores: dict[float, list[tuple[float, ...]]] = defaultdict(list)
        for curve, truth in rows:
            for multiple, row in judged(curve, truth):
                scores[multiple].append(row)
        for multiple, some in sorted(scores.items()):
            (own, band), (narrow, wide) = 100 * np.mean(some, axis=0)[:2], np.median(some, axis=0)[2:]
            lines.append(
                f"| {part} | {multiple:g} | {len(some)} | {own:.0f} | {band:.0f} | {narrow:.2f} | {wide:.2f} |"
            )
        print(f"{part}: {len(scores[1.0])} curves", flush=True)
    print("\n".join(lines))
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))


def learned(part: str, arguments: argparse.Namespace) -> Iterator[tuple[AdhesionCurve, Floats]]:
    """Each soil's curve with the true one over GRID."""
    draw = families.draw if part == "development" else other_grounds.draw
    for kind, seed in machines(part, arguments.machines, arguments.seed):
        result = draw(kind, seed, rate=20.0, duration=60 * arguments.minutes)
        gathered = GatheredRuns()
        gathered.add(estimate(result.recording, result.vehicle), "drive", signatures=False)
        for upper in (PULL.upper, 0.06):
            for name, one in gathered.learn(AdhesionCurve(bins=replace(PULL, upper=upper))).soils.items():
                if one.curve.has_band and one.curve.identifiability_.identifiable:
                    yield one.curve, true_curve(result.scenario, name)


def true_curve(scenario: Scenario, soil: str) -> Floats:
    """mu over GRID, of a mean spot, wheels sunk in as each slip makes them."""
    form = dict(scenario.soils[soil].curve)
    spots = scenario.soft_spots
    loosening, fall = (spots[0].loosening, spots[0].adhesion_fall) if spots else (0.0, 0.0)
    value = other_grounds.EVERY[form.pop("name")].value(GRID / (1 + loosening), form)
    return np.asarray(value * (1 - fall * GRID))


def literature(seed: int) -> Iterator[tuple[AdhesionCurve, Floats]]:
    """Curves of the literature measured closely up to 10 % of slip."""
    rng = np.random.default_rng(seed)
    curves: list[Callable[[Floats], Floats]] = [
        one.value for name, one in literature_soils().items() if name not in STEEP
    ]
    for name, (_, faster) in other_grounds.RISES.items():
        form = {"A": 0.6, "k": 11.0 * faster, "f": 0.2}
        curves.append(lambda slip, name=name, form=form: other_grounds.EVERY[name].value(slip, form))  # type: ignore[misc]
    for value in curves:
        slip, run = rng.uniform(0.005, 0.1, 4000), np.repeat(np.arange(10), 400)
        mu = value(slip) * (1 + 0.02 * rng.standard_normal(10))[run] + 0.05 * rng.standard_normal(4000)
        yield AdhesionCurve(bins=BinSettings(0.005, 0.005, 0.1, 20)).fit(slip, mu, run), value(GRID)


def judged(curve: AdhesionCurve, truth: Floats) -> Iterator[tuple[float, tuple[float, ...]]]:
    """By multiple: whether the form's own interval and the band hold the truth, and their widths over the curve."""
    reach = float(curve.bins_.slip[curve.bins_.used].max())
    for multiple in MULTIPLES:
        if (slip := multiple * reach) <= GRID[-1]:
            true, value = float(np.interp(slip, GRID, truth)), float(curve.predict(slip))
            low, high = (value * end / curve.parameters_["a"] for end in curve.interval_["a"])
            under, over = (float(edge) for edge in curve.band(slip))
            held = (low <= true <= high, under <= true <= over)
            yield multiple, (*held, (high - low) / value, (over - under) / value)


if __name__ == "__main__":
    main()

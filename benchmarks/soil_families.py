"""Curves of soils on development machines drawn at random: how many are learned, how near the truth, and whether their bands hold it.

    python benchmarks/soil_families.py [--machines 24] [--seed 8130000] [--minutes 10] [--write]

One drive a machine at 20 Hz, estimated by the default method; each of its soils is learned as `terragrip soils` does, and with the bins
of the paper's slips (from 5 %, 1 % wide), by pull where they suffice and else by slip. The truth is the mean true slip and adhesion of
eight equal shares of the way, sorted by the true pull. error: root mean square over the shares whose slip is above .5 %, over their
mean adhesion. held: shares within the curve's 95 % band,
of curves that state one. --write puts the table into docs/soils.md.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from marked import put
from terragrip.estimation import Estimates, estimate
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import draw, machines
from terragrip.soil.bins import PAPER, PULL
from terragrip.soil.estimates import GatheredRuns, pairs_of
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import RunPairs

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/soils.md"
BEGIN = "<!-- made by benchmarks/soil_families.py --write -->"
BINS = {
    "from 0.5 %, 0.5 % wide": PULL,
    "from 5 %, 1 % wide": replace(PULL, lower=PAPER.lower, width=PAPER.width),
}
LEAST_WAY = 8.0  # m
LEAST_SLIP = 0.005
SHARES = 8
Floats = npt.NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=8130000)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--write", action="store_true", help="put the table into docs/soils.md")
    arguments = parser.parse_args()
    rows: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    soils = 0
    for kind, seed in machines("development", arguments.machines, arguments.seed):
        result = draw(kind, seed, rate=20.0, duration=60 * arguments.minutes)
        estimates = estimate(result.recording, result.vehicle)
        truth = {
            one.soil: shares
            for one in pairs_of(true_estimates(estimates, result), "drive")
            if len((shares := shares_of(one))[0]) > 2
        }
        soils += len(truth)
        for name, bins in BINS.items():
            gathered = GatheredRuns()
            gathered.add(estimates, "drive", signatures=False)
            learned = gathered.learn(AdhesionCurve(bins=bins)).soils
            for soil in sorted(truth.keys() & learned.keys()):
                curve = learned[soil].curve
                badge = "yes" if curve.identifiability_.identifiable else "no"
                rows[name, badge].append(against(curve, *truth[soil]))
    lines = [
        f"{arguments.machines} machines from seed {arguments.seed}, {soils} soils driven.",
        "",
        "| bins by pull | data fix it | soils learned | error, median | 90 % of them | worst | held (%) |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for (name, badge), scores in sorted(rows.items()):
        error, held = np.array(scores).T
        lines.append(
            f"| {name} | {badge} | {len(scores)} | {np.median(error):.3f} | {np.quantile(error, 0.9):.3f} | "
            f"{error.max():.3f} | {100 * np.nanmean(held):.0f} |"
        )
    print("\n".join(lines))
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))


def true_estimates(estimates: Estimates, result: SimulationResult) -> Estimates:
    """The estimates with the true slip and adhesion in place of theirs."""
    true = {
        f"{quantity}_{wheel}": result.truth[f"true_{quantity}_{wheel}"].to_numpy()
        for wheel in estimates.wheels
        for quantity in ("slip", "adhesion")
        if f"true_{quantity}_{wheel}" in result.truth
    }
    return replace(estimates, columns={**estimates.columns, **true})


def shares_of(pairs: RunPairs) -> tuple[Floats, Floats]:
    """Mean slip and adhesion (shares,) of equal shares of the way, by pull; those of almost no slip are left out."""
    pull, metres = (np.tile(x, pairs.wheels) for x in (pairs.pull, pairs.metres / pairs.wheels))
    good = np.isfinite(pairs.slip) & np.isfinite(pairs.adhesion) & (metres > 0)
    slip, adhesion, pull, metres = (x[good] for x in (pairs.slip, pairs.adhesion, pull, metres))
    if metres.sum() < LEAST_WAY:
        return np.empty(0), np.empty(0)
    order = np.argsort(pull, kind="stable")
    way = np.cumsum(metres[order])
    parts = [
        part
        for part in np.split(order, np.searchsorted(way, way[-1] * np.arange(1, SHARES) / SHARES))
        if part.size
    ]
    means = np.array(
        [[np.average(x[part], weights=metres[part]) for x in (slip, adhesion)] for part in parts]
    )
    return tuple(means[means[:, 0] > LEAST_SLIP].T)


def against(curve: AdhesionCurve, slip: Floats, adhesion: Floats) -> tuple[float, float]:
    """Relative error of a curve over the shares, and how many its band holds; NaN of a curve that states none."""
    low, high = curve.band(slip) if curve.has_band else (np.full_like(slip, np.nan),) * 2
    error = float(np.sqrt(np.mean((curve.predict(slip) - adhesion) ** 2)) / adhesion.mean())
    return error, float(np.mean((low <= adhesion) & (adhesion <= high))) if curve.has_band else np.nan


if __name__ == "__main__":
    main()

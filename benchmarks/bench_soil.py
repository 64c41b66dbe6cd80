"""Curves of soils: how near the truth on simulated campaigns that nothing was tuned on, and how fast a fit is beside SciPy.

    python benchmarks/bench_soil.py [--seeds 3000 3001 ...] [--write] [--speed-only]

Accuracy: the paper's 68 runs a seed, calibrated from their own logs, estimated by the default method; then `terragrip soils`' fits from
estimated slip and adhesion. Beside the truth (what each soil was made with: the mean over its ground) stands the same fit on the true
slip and adhesion of the same rows: what no estimator can mend. --write puts the tables into docs/soils.md.

Speed: one fit with 1 000 bootstrap repetitions over runs, against a loop of scipy.optimize.curve_fit over the same draws.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit

from marked import put
from terragrip.physics.adhesion import CURVES
from terragrip.report.campaign import estimate_campaign
from terragrip.report.campaign_soils import fits_of_truth, soils_of_scenario
from terragrip.soil.bins import Bins, BinSettings, bin_pairs
from terragrip.soil.fit import FREE, AdhesionCurve

SEEDS = tuple(range(3000, 3008))
TARGET_A, TARGET_R2 = 0.05, 0.93
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/soils.md"
BEGIN = "<!-- made by benchmarks/bench_soil.py --write -->"
REPETITIONS = 1000
DRAWS = 100
"""Repetitions that the peer is timed on."""


@dataclass(frozen=True)
class Score:
    """One soil of one seed. Errors of a, relative to the truth; `held`: the 95 % interval by metres holds it."""

    soil: str
    bins: float
    metres: float
    true_pairs: float
    r2: float
    r2_true: float
    held: bool


def campaign_scores(seed: int) -> list[Score]:
    """Every soil of the campaign of `seed`."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = estimate_campaign(Path(folder), seed, 2, None, None)
    pairs = [part for run in campaign.runs for part in run.true_pairs]
    truth, true_fits = soils_of_scenario("multi2", pairs), fits_of_truth(campaign.soils, pairs)
    scores = []
    for name, learned in campaign.soils.soils.items():
        a, ground = truth[name].parameters["a"], learned.ground_mean
        assert ground is not None
        assert ground.interval is not None
        low, high = ground.interval
        scores.append(
            Score(
                name,
                learned.soil.parameters["a"] / a - 1,
                ground.mean / a - 1,
                true_fits[name].parameters_["a"] / a - 1,
                float(learned.soil.r2 or 0.0),
                true_fits[name].r2_,
                low <= a <= high,
            )
        )
    return scores


def table(scores: Sequence[Score]) -> str:
    """A row a soil: mean and worst over the seeds."""
    lines = [
        "| soil | a by bins: error, mean (worst) | same fit on true pairs | a by metres: error, mean (worst) | 95 % holds | "
        "R² of the bins' fit, mean (worst) | on true pairs |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for soil in sorted({score.soil for score in scores}):
        mine = [score for score in scores if score.soil == soil]
        cells = [
            _errors([s.bins for s in mine]),
            _errors([s.true_pairs for s in mine]),
            _errors([s.metres for s in mine]),
        ]
        cells.append(f"{sum(s.held for s in mine)} of {len(mine)}")
        both = ([s.r2 for s in mine], [s.r2_true for s in mine])
        cells += [f"{np.mean(values):.3f} ({min(values):.3f})" for values in both]
        lines.append(f"| {soil} | {' | '.join(cells)} |")
    return "\n".join(lines)


def verdicts(scores: Sequence[Score]) -> list[str]:
    """The targets and how often they are met, soil by soil and seed by seed."""
    every = len(scores)
    return [
        f"a by bins within {TARGET_A:.0%} of the truth: {sum(abs(s.bins) <= TARGET_A for s in scores)} of {every}",
        f"a by bins within {TARGET_A:.0%} of the same fit on true pairs: "
        f"{sum(abs((1 + s.bins) / (1 + s.true_pairs) - 1) <= TARGET_A for s in scores)} of {every}",
        f"a by metres within {TARGET_A:.0%} of the truth: {sum(abs(s.metres) <= TARGET_A for s in scores)} of {every}",
        f"R² of the bins' fit at least {TARGET_R2}: {sum(s.r2 >= TARGET_R2 for s in scores)} of {every}; "
        f"on true pairs {sum(s.r2_true >= TARGET_R2 for s in scores)} of {every}",
    ]


def speed() -> list[str]:
    """Time of a fit with intervals, and the peer's over the same draws."""
    rng = np.random.default_rng(0)
    run = np.repeat(np.arange(15), 8000)
    slip = rng.uniform(0.0, 0.65, run.size)
    level = 0.85 * (1 + 0.05 * rng.standard_normal(15))[run]
    mu = CURVES["exponential"].value(slip, {"a": level}) + 0.05 * rng.standard_normal(run.size)
    bins = bin_pairs(slip, mu, run, BinSettings())
    lines = []
    for name, fixed, model, start in (
        ("the paper's fit (a)", None, lambda s, a: CURVES["exponential"].value(s, {"a": a}), [0.5]),
        ("free shape (a, p, α1, α2)", FREE, _four, [0.9, 0.5, 0.01, -11.0]),
    ):
        curve = AdhesionCurve(fixed=fixed, bootstrap=REPETITIONS)
        ours = _seconds(lambda curve=curve: curve.fit(slip, mu, run))  # type: ignore[misc]
        peer = _seconds(lambda model=model, start=start: _peer(bins, model, start)) * REPETITIONS / DRAWS  # type: ignore[misc]
        lines.append(
            f"{name}, {run.size} pairs, {REPETITIONS} repetitions: {ours:.2f} s, "
            f"SciPy's curve_fit in a loop {peer:.2f} s: {peer / ours:.0f} times"
        )
    return lines


def _four(s: np.ndarray, a: float, p: float, alpha_1: float, alpha_2: float) -> np.ndarray:
    return CURVES["exponential"].value(s, {"a": a, "p": p, "alpha_1": alpha_1, "alpha_2": alpha_2})


def _peer(bins: Bins, model: Callable[..., np.ndarray], start: list[float]) -> None:
    """curve_fit on the bin means of runs drawn with replacement."""
    rng = np.random.default_rng(1)
    clusters = len(bins.cluster_count)
    for times in rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=DRAWS):
        count = times @ bins.cluster_count
        used = count >= bins.settings.minimum
        slip, mean = (
            (times @ bins.cluster_slip)[used] / count[used],
            (times @ bins.cluster_sum)[used] / count[used],
        )
        curve_fit(model, slip, mean, p0=start, maxfev=20_000)


def _seconds(work: Callable[[], object]) -> float:
    """The quicker of two tries [s]."""
    took = []
    for _ in range(2):
        begin = time.perf_counter()
        work()
        took.append(time.perf_counter() - begin)
    return min(took)


def _errors(values: Sequence[float]) -> str:
    worst = max(values, key=abs)
    return f"{100 * np.mean(values):+.1f} % ({100 * worst:+.1f} %)".replace("-", "−")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--write", action="store_true", help="put the tables into docs/soils.md")
    parser.add_argument("--speed-only", action="store_true")
    options = parser.parse_args()
    fast = speed()
    print("\n".join(fast))
    if options.speed_only:
        return
    scores: list[Score] = []
    for seed in options.seeds:
        scores += campaign_scores(seed)
        print(f"seed {seed} done", flush=True)
    said = verdicts(scores)
    print(table(scores), *said, sep="\n")
    if options.write:
        seeds = f"Seeds {options.seeds[0]} to {options.seeds[-1]}, {len(options.seeds)} campaigns of 68 runs."
        put(
            DOCUMENT,
            BEGIN,
            "\n".join([seeds, "", table(scores), "", *(f"- {line}" for line in (*said, *fast))]),
        )


if __name__ == "__main__":
    main()

"""How good: every method on simulated drives that nothing was tuned on, beside an oracle, after `calibrate`.

    python benchmarks/bench_accuracy.py [--seeds 3000 3001 ...] [--write]

Two scenarios on the same ground and machine a seed: clean (all channels at 100 Hz) and faults (multi-rate, delays,
gaps, spikes, held values, 8 s without ground speed). Load transfer, roughness, 2 % torque gain errors, a 3 N drawbar
offset and whatever spells of being stuck the ground brings are in both; nothing is cut out by hand.

R² of the rear right wheel's adhesion counts every row but standstill. Slip, soil resistance and coverage count the rows
in which the vehicle moves. --write puts the tables into docs/methods.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration_drive import calibrate_machine
from marked import put
from oracle import oracle
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.consistency import agreement, coverage, mean_absolute_error, nis_consistency
from terragrip.estimation.methods import DEFAULT, METHODS
from terragrip.simulation import SimulationResult, simulate
from terragrip.vehicle import Vehicle

SEEDS = tuple(range(3000, 3008))
WHEEL = "rr"
MOVING = 0.05  # m/s
SCENARIOS = {"clean": ("accuracy-clean", "clean"), "faults": ("accuracy-faults", "multirate")}
TARGETS = {
    "clean": {"r2_below_oracle": 0.01, "slip_mae": 0.011, "rho_s_mae": 0.010},
    "faults": {"r2_below_oracle": 0.03, "slip_mae": 0.016, "rho_s_mae": 0.012},
}
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/methods.md"
BEGIN = "<!-- made by benchmarks/bench_accuracy.py --write -->"


@dataclass(frozen=True)
class Score:
    """One method on one drive. R² and NRMSE: adhesion of WHEEL. Coverage at 95 %: that wheel, while moving."""

    scenario: str
    seed: int
    method: str
    r2: float
    nrmse: float
    mu_mae: float
    slip_mae: float
    rho_s_mae: float
    mu_coverage: float
    slip_coverage: float
    rho_s_coverage: float
    nis: float


@dataclass(frozen=True)
class Drive:
    """All scores of one seed, and the oracle's R² on the clean and on the faulty recording."""

    scores: tuple[Score, ...]
    oracle_clean: float
    oracle_faults: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--write", action="store_true", help="put the tables into docs/methods.md")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    drives = []
    with ProcessPoolExecutor(arguments.workers) as pool:
        for seed, drive in zip(arguments.seeds, pool.map(score_seed, arguments.seeds), strict=True):
            drives.append(drive)
            best = next(s for s in drive.scores if s.scenario == "clean" and s.method == DEFAULT)
            print(f"seed {seed}: oracle {drive.oracle_clean:.3f}, {DEFAULT} {best.r2:.3f}", flush=True)
    text = tables(drives, arguments.seeds)
    print("\n" + text)
    if arguments.write:
        put(DOCUMENT, BEGIN, text)
        print(f"written to {DOCUMENT}")


def score_seed(seed: int) -> Drive:
    """Calibrate, estimate by every method, and score both scenarios of one seed."""
    scores, oracles = [], {}
    for name, (scenario, sensors) in SCENARIOS.items():
        result = simulate(scenario, seed)
        vehicle = calibrate_machine(seed, sensors).apply(result.vehicle)
        oracles[name] = oracle(result, WHEEL, ~result.truth["standstill"].to_numpy()).r2
        scores += [score(result, vehicle, name, seed, method) for method in METHODS]
    return Drive(tuple(scores), oracles["clean"], oracles["faults"])


def score(result: SimulationResult, vehicle: Vehicle, name: str, seed: int, method: str) -> Score:
    """One method on one recording."""
    estimates = estimate(result.recording, vehicle, method=method)
    truth = result.truth
    moving = np.abs(truth["true_ground_speed"].to_numpy()) > MOVING
    columns = (f"adhesion_{WHEEL}", f"slip_{WHEEL}", "soil_resistance")
    mu = truth[f"true_{columns[0]}"].to_numpy()
    fit = agreement(mu, estimates[columns[0]], ~truth["standstill"].to_numpy())
    errors = [mean_absolute_error(truth[f"true_{c}"], estimates[c], moving) for c in columns]
    held = [coverage(truth[f"true_{c}"], estimates[c], estimates[f"{c}_std"], mask=moving) for c in columns]
    return Score(name, seed, method, fit.r2, fit.nrmse, *errors, *held, _nis(estimates))


def _nis(estimates: Estimates) -> float:
    """NIS over its expectation; NaN for a method without innovations."""
    taken = estimates["channels"] > 0
    if not taken.any() or not (estimates["nis"][taken] > 0).any():
        return float("nan")
    return nis_consistency(estimates["nis"], estimates["channels"]).ratio


def tables(drives: Sequence[Drive], seeds: Sequence[int]) -> str:
    """Markdown: a summary of methods by scenario, targets, and R² by seed."""
    parts = []
    for name in SCENARIOS:
        parts += [f"### {name.capitalize()}\n", _summary(drives, name), _by_seed(drives, seeds, name)]
    parts.append(_targets(drives))
    return "\n".join(parts)


def _summary(drives: Sequence[Drive], name: str) -> str:
    lines = [
        "| method | R² µ | worst | NRMSE µ | MAE µ | MAE slip | MAE ρs | 95 % µ | 95 % slip | 95 % ρs | NIS / channels |",
        "|---|" + "---:|" * 10,
    ]
    for method in METHODS:
        s = [x for drive in drives for x in drive.scores if (x.scenario, x.method) == (name, method)]
        r2 = [x.r2 for x in s]
        cells = [f"{np.mean(r2):.3f}", f"{min(r2):.3f}", f"{np.mean([x.nrmse for x in s]):.3f}"]
        cells += [f"{np.mean([getattr(x, k) for x in s]):.4f}" for k in ("mu_mae", "slip_mae", "rho_s_mae")]
        held = ("mu_coverage", "slip_coverage", "rho_s_coverage")
        cells += [f"{100 * np.mean([getattr(x, k) for x in s]):.1f}" for k in held]
        nis = np.mean([x.nis for x in s])
        cells.append("" if np.isnan(nis) else f"{nis:.2f}")
        strong = f"**{method}**" if method == DEFAULT else method
        lines.append(f"| {strong} | " + " | ".join(cells) + " |")
    return f"Means over {len(drives)} seeds.\n\n" + "\n".join(lines) + "\n"


def _by_seed(drives: Sequence[Drive], seeds: Sequence[int], name: str) -> str:
    lines = [
        "| R² µ by seed | " + " | ".join(str(seed) for seed in seeds) + " | mean |",
        "|---|" + "---:|" * (len(seeds) + 1),
    ]
    lines.append(_row("oracle, clean data", [drive.oracle_clean for drive in drives]))
    if name == "faults":
        lines.append(_row("oracle, these data", [drive.oracle_faults for drive in drives]))
    for method in METHODS:
        values = [x.r2 for d in drives for x in d.scores if (x.scenario, x.method) == (name, method)]
        lines.append(_row(f"**{method}**" if method == DEFAULT else method, values))
    return "\n".join(lines) + "\n"


def _row(label: str, values: Iterable[float]) -> str:
    listed = list(values)
    return f"| {label} | " + " | ".join(f"{value:.3f}" for value in [*listed, float(np.mean(listed))]) + " |"


def _targets(drives: Sequence[Drive]) -> str:
    lines = [
        "### Targets\n",
        f"The default method, {DEFAULT}, against the plan's targets; means over {len(drives)} seeds.\n",
        "| figure | scenario | reached | target | |",
        "|---|---|---:|---:|---|",
    ]
    for name, wanted in TARGETS.items():
        s = [x for drive in drives for x in drive.scores if (x.scenario, x.method) == (name, DEFAULT)]
        reached = {
            "r2_below_oracle": np.mean([d.oracle_clean - x.r2 for d, x in zip(drives, s, strict=True)]),
            "slip_mae": np.mean([x.slip_mae for x in s]),
            "rho_s_mae": np.mean([x.rho_s_mae for x in s]),
        }
        for key, label in (
            ("r2_below_oracle", "R² of µ below the oracle on clean data"),
            ("slip_mae", "MAE of slip while moving"),
            ("rho_s_mae", "MAE of ρs while moving"),
        ):
            met = "reached" if reached[key] <= wanted[key] else "missed"
            lines.append(f"| {label} | {name} | {reached[key]:.4f} | {wanted[key]:.3f} | {met} |")
        for key, label in (("mu", "µ"), ("slip", "slip"), ("rho_s", "ρs")):
            share = 100 * np.mean([getattr(x, f"{key}_coverage") for x in s])
            met = "reached" if 90 <= share <= 99 else "missed"
            lines.append(
                f"| rows whose 95 % interval holds {label} | {name} | {share:.1f} % | 90–99 % | {met} |"
            )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()

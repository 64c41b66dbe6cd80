"""How good on machines that nothing was tuned on: random machines of every kind, beside the best plain Kalman filter.

    python benchmarks/bench_families.py [--families development held-out] [--machines 24] [--rates 100 50 20 10] [--quick]
                                        [--method bank] [--write]

Machines: terragrip.simulation.families, split by kind (docs/decisions/0095). Only --families held-out looks at what is held
out: nothing may be tuned on it. R² of adhesion counts all driven wheels together, in rows in which the machine moves. The plain
filter (plain_filter.py) has the same log and vehicle file and one fixed Q of five, the best of them taken afterwards for each
machine. --quick: 8 machines at 100 and 20 Hz. --write puts the tables into docs/families.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marked import put
from plain_filter import INTENSITIES, plain_filter
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.methods import DEFAULT, METHODS
from terragrip.simulation import SimulationResult
from terragrip.simulation.families import Kind, draw, machines

Floats = NDArray[np.float64]

RATES = (100.0, 50.0, 20.0, 10.0)
MOVING = 0.05  # m/s, or a tenth of the usual speed where that is less
LAGS = 40  # samples either way
COVERED = ("adhesion", "slip", "soil_resistance", "net_traction", "efficiency")
SHORT = {"adhesion": "µ", "slip": "slip", "soil_resistance": "ρs", "net_traction": "κ", "efficiency": "η"}
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/families.md"
BEGIN = "<!-- made by benchmarks/bench_families.py --write: {part} -->"


@dataclass(frozen=True)
class Row:
    """One machine at one rate: R² and lag [samples] of both, share of rows that each 95 % interval holds."""

    kind: Kind
    seed: int
    rate: float
    mass: float
    wheels: int
    r2: float
    plain_r2: float
    plain_intensity: float
    lag: float
    plain_lag: float
    covered: dict[str, float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--families", nargs="+", default=["development"], choices=["development", "held-out"])
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--rates", type=float, nargs="+", default=list(RATES))
    parser.add_argument("--method", default=DEFAULT, choices=list(METHODS))
    parser.add_argument("--quick", action="store_true", help="8 machines at 100 and 20 Hz")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the tables into docs/families.md")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.machines, arguments.rates = 8, [100.0, 20.0]
    for part in arguments.families:
        drawn = list(machines(part, arguments.machines, arguments.seed))
        jobs = [(kind, seed, tuple(arguments.rates), arguments.method) for kind, seed in drawn]
        found: list[Row] = []
        with ProcessPoolExecutor(arguments.workers) as pool:
            for rows in pool.map(score_machine, jobs):
                found += rows
                print(_line(rows), flush=True)
        text = f"{summary(found, arguments.rates)}\n\n{by_machine(found, arguments.rates)}"
        print(f"\n{part}, {arguments.method}\n\n{text}\n")
        if arguments.write:
            put(DOCUMENT, BEGIN.format(part=part), text)
            print(f"written to {DOCUMENT}")


def score_machine(job: tuple[Kind, int, tuple[float, ...], str]) -> list[Row]:
    """One machine at every rate."""
    kind, seed, rates, method = job
    return [score(draw(kind, seed, rate=rate), kind, seed, rate, method) for rate in rates]


def score(result: SimulationResult, kind: Kind, seed: int, rate: float, method: str) -> Row:
    """Our method and the plain filter on one recording."""
    vehicle, recording = result.vehicle, result.recording
    found = estimate(recording, vehicle, method=method)
    driven = [w for w, driven in zip(vehicle.wheels, vehicle.driven, strict=True) if driven]
    rows = np.isfinite(recording[f"wheel_speed_{driven[0]}"])
    truth = np.stack([result.truth[f"true_adhesion_{w}"] for w in driven], axis=1)[rows]
    moving = moving_rows(result)[rows]
    used = [
        c for c in recording.channels if c.startswith(("wheel_speed", "drive_torque", "ground", "drawbar"))
    ]
    heard = np.logical_or.reduce([np.isfinite(recording[c]) for c in used])
    plain = plain_filter(recording.select(heard), vehicle)
    n = len(vehicle.wheels)
    first = [n + 1 + vehicle.wheels.index(w) for w in driven]
    plains = [plain.state[q][rows[heard]][:, first] for q in range(len(INTENSITIES))]
    scores = [pooled_r2(truth, said, moving) for said in plains]
    best = int(np.argmax(scores))
    ours = np.stack([found[f"adhesion_{w}"] for w in driven], axis=1)[rows]
    return Row(
        kind, seed, rate, vehicle.mass, n, pooled_r2(truth, ours, moving), scores[best], INTENSITIES[best],
        lag(truth, ours, moving), lag(truth, plains[best], moving), coverages(result, found, driven),
    )  # fmt: skip


def moving_rows(result: SimulationResult) -> NDArray[np.bool_]:
    """Rows in which the machine moves (n,)."""
    speed = np.abs(result.truth["true_ground_speed"].to_numpy())
    return np.asarray(speed > min(MOVING, 0.1 * float(np.median(speed[speed > 0.01]))))


def pooled_r2(truth: Floats, said: Floats, rows: NDArray[np.bool_]) -> float:
    """1 - SSE/SST over all columns together, each (n, wheels)."""
    true, estimate = truth[rows], said[rows]
    return float(1 - np.sum((estimate - true) ** 2) / np.sum((true - true.mean()) ** 2))


def lag(truth: Floats, said: Floats, rows: NDArray[np.bool_]) -> float:
    """By how many samples the estimate follows the truth: where their correlation, wheel by wheel, is best."""

    def correlation(shift: int) -> float:
        n = len(truth)
        now = np.arange(max(0, shift), min(n, n + shift))
        both = rows[now] & rows[now - shift]
        pairs = zip(truth[now - shift][both].T, said[now][both].T, strict=True)
        return float(np.mean([np.corrcoef(true, estimate)[0, 1] for true, estimate in pairs]))

    values = [correlation(shift) for shift in range(-LAGS, LAGS + 1)]
    return float(np.argmax(values) - LAGS)


def coverages(result: SimulationResult, found: Estimates, driven: Sequence[str]) -> dict[str, float]:
    """Share of moving rows, driven wheels together, whose 95 % interval holds the truth."""
    moving, out = moving_rows(result), {}
    for quantity in COVERED:
        names = [quantity] if quantity == "soil_resistance" else [f"{quantity}_{w}" for w in driven]
        held = []
        for name in names:
            true = result.truth[f"true_{name}"].to_numpy()
            inside = np.abs(found[name] - true) <= 1.96 * found[f"{name}_std"]
            held.append(inside[moving & np.isfinite(true) & np.isfinite(found[name])])
        together = np.concatenate(held)
        out[quantity] = float(together.mean()) if len(together) else float("nan")
    return out


def _line(rows: Sequence[Row]) -> str:
    figures = ", ".join(f"{r.rate:g} Hz {r.r2:.3f} ({r.plain_r2:.3f})" for r in rows)
    return f"{rows[0].kind!s} {rows[0].seed}, {rows[0].mass:.0f} kg, {rows[0].wheels} wheels: {figures}"


def summary(rows: Sequence[Row], rates: Sequence[float]) -> str:
    """Markdown: a line a rate over all machines."""
    covered = [f"95 % {SHORT[c]}" for c in COVERED]
    head = [
        "rate (Hz)",
        "R² µ, median",
        "plain",
        "difference, median",
        "worst",
        "lag (samples)",
        "plain",
        *covered,
        "µ under 88 %",
    ]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for rate in rates:
        some = [r for r in rows if r.rate == rate]
        gain = [r.r2 - r.plain_r2 for r in some]
        cells = [
            f"{rate:g}",
            f"{np.median([r.r2 for r in some]):.3f}",
            f"{np.median([r.plain_r2 for r in some]):.3f}",
        ]
        cells += [f"{np.median(gain):+.3f}", f"{min(gain):+.3f}"]
        cells += [f"{np.mean([r.lag for r in some]):.1f}", f"{np.mean([r.plain_lag for r in some]):.1f}"]
        cells += [f"{100 * np.nanmean([r.covered[c] for r in some]):.0f}" for c in COVERED]
        cells.append(f"{sum(r.covered['adhesion'] < 0.88 for r in some)} of {len(some)}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def by_machine(rows: Sequence[Row], rates: Sequence[float]) -> str:
    """Markdown: a line a machine, R² with the plain filter's in brackets, and the coverage of µ at the first rate."""
    head = [
        "machine",
        "kg",
        "wheels",
        *(f"R² at {rate:g} Hz" for rate in rates),
        f"95 % µ at {rates[0]:g} Hz",
    ]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for kind, seed in dict.fromkeys((r.kind, r.seed) for r in rows):
        some = {r.rate: r for r in rows if (r.kind, r.seed) == (kind, seed)}
        first = some[rates[0]]
        cells = [f"{kind} {seed}", f"{first.mass:.0f}", str(first.wheels)]
        cells += [f"{some[rate].r2:.3f} ({some[rate].plain_r2:.3f})" for rate in rates]
        cells.append(f"{100 * first.covered['adhesion']:.0f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()

"""What the estimates of wheels tell of loads that nothing measures, on development machines (docs/families-history.md).

    python benchmarks/unseen_loads.py [--seeds 5 11 8 13] [--write]

Loads, adhesions and slips of the driven wheels at 100 Hz, each beyond the mean of them all (loads and adhesions relative
to it), every quarter of a wheel radius; then the share of the loads' variance that a linear fit by estimated adhesions
explains, alone and with slips.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench_families import driven_wheels, moving_rows
from marked import put
from terragrip.estimation import estimate
from terragrip.simulation import families

Floats = NDArray[np.float64]
RATE = 100.0
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/families-history.md"
BEGIN = "<!-- made by benchmarks/unseen_loads.py --write -->"
HEAD = (
    "machine", "driven wheels", "µ held (%)", "load, SD", "true µ, SD", "estimated µ, SD", "true µ with load",
    "true slip, SD", "estimated slip, SD", "of the load: by estimated µ", "and true slip", "and estimated slip",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[5, 11, 8, 13])
    parser.add_argument("--write", action="store_true", help="put the table into docs/families-history.md")
    arguments = parser.parse_args()
    lines = ["| " + " | ".join(HEAD) + " |", "|---|" + "---:|" * (len(HEAD) - 1)]
    kinds = {seed: kind for kind, seed in families.machines("development", max(arguments.seeds) + 1)}
    for seed in arguments.seeds:
        kind = kinds[seed]
        lines.append("| " + " | ".join([f"{kind} {seed}", *one_machine(kind, seed)]) + " |")
        print(lines[-1], flush=True)
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))


def one_machine(kind: families.Kind, seed: int) -> list[str]:
    """The cells of one machine."""
    drawn = families.draw(kind, seed, rate=RATE)
    truth, wheels, moving = drawn.truth, driven_wheels(drawn), moving_rows(drawn)
    estimates = estimate(drawn.recording, drawn.vehicle)
    travelled = np.cumsum(np.abs(truth["true_ground_speed"].to_numpy())) / RATE
    rows = np.searchsorted(travelled, np.arange(0, travelled[-1], 0.25 * drawn.vehicle.wheel_radius[0]))
    rows = rows[rows < len(travelled)]
    rows = rows[moving[rows]]

    def of(table: Any, before: str, after: str = "") -> Floats:
        return np.stack([np.asarray(table[f"{before}{w}{after}"])[rows] for w in wheels], axis=1)

    load, true, slip = (of(truth, f"true_{name}_") for name in ("vertical_load", "adhesion", "slip"))
    estimated, estimated_slip = of(estimates, "adhesion_"), of(estimates, "slip_")
    spread = of(estimates, "adhesion_", "_std")
    known = np.isfinite(load + true + slip + estimated + estimated_slip).all(axis=1)
    held = np.mean(np.abs(estimated - true)[known] <= 1.96 * spread[known])
    load, true, slip, estimated, estimated_slip = (
        x[known] for x in (load, true, slip, estimated, estimated_slip)
    )
    y = beyond_others(load / load.mean(axis=0))
    mu, mu_true = (beyond_others(x / x.mean(axis=1, keepdims=True)) for x in (estimated, true))
    s, s_true = beyond_others(estimated_slip), beyond_others(slip)
    return [
        f"{len(wheels)}",
        f"{100 * held:.0f}",
        f"{y.std():.3f}",
        f"{mu_true.std():.3f}",
        f"{mu.std():.3f}",
        f"{np.corrcoef(y, mu_true)[0, 1]:.2f}",
        f"{s_true.std():.4f}",
        f"{s.std():.4f}",
        f"{explained(y, mu):.2f}",
        f"{explained(y, mu, s_true):.2f}",
        f"{explained(y, mu, s):.2f}",
    ]


def beyond_others(values: Floats) -> Floats:
    """Of (rows, wheels): beyond the row's mean, less what a wheel always is; flat."""
    apart = values - values.mean(axis=1, keepdims=True)
    return (apart - apart.mean(axis=0)).ravel()


def explained(y: Floats, *by: Floats) -> float:
    """Share of the variance of y (n,) that a linear fit by the others (n,) explains."""
    X = np.column_stack(by)
    return float(1 - np.var(y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) / np.var(y))


if __name__ == "__main__":
    main()

"""How good the advised slip is on simulated machines with known truth: efficiency lost there, error of the best slip, its interval.

    python benchmarks/bench_advice.py [--part NAME] [--machines 24] [--seed 0] [--write]

Machines of terragrip.simulation.families, split by kind, or of the second plant (docs/families.md). Development has two parts beside its
own kinds: their masses and curves with coarse sensors, and grounds whose curve is no exponential (other_grounds.py). Each has a drive of
50 to 150 s at 50 Hz, estimated with the default method and the vehicle file as its user wrote it. The true optimum is that of the soil's
own curve and resistance, sinkage included; on the second plant by its stresses in steady motion, loads as at rest. The peer is one slip
for all grounds: the middle of the usual band, 11.5 %. --write puts the table into docs/advice.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import other_grounds
from marked import put
from second_plant import draw as second
from second_plant.plant import curves as second_curves
from second_plant.result import result_of
from terragrip.advice.analysis import advise
from terragrip.advice.optimum import GRID, OverSlip, best_of, over_slip
from terragrip.advice.samples import GatheredSamples
from terragrip.advice.slip_only import BAND
from terragrip.advice.soil_curves import driven_share
from terragrip.estimation import estimate
from terragrip.simulation import SimulationResult, families
from terragrip.simulation.families import Kind
from terragrip.simulation.scenario import Scenario
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]
RATE = 50.0
PARTS = ("development", "coarse", "other-grounds", "yielding", "held-out", "second-plant")
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/advice.md"
BEGIN = "<!-- made by benchmarks/bench_advice.py --write: {part} -->"


@dataclass(frozen=True)
class Row:
    """One soil of one machine: true best slip, the advised one with its interval (NaN: none given), efficiency lost there and at the
    band's middle; of most pull power whether its interval holds the truth (None: none given)."""

    kind: Kind
    seed: int
    soil: str
    true: float
    slip: float
    low: float
    high: float
    lost: float
    lost_at_band: float
    power_held: bool | None

    @property
    def given(self) -> bool:
        """Whether a best slip was advised."""
        return bool(np.isfinite(self.slip))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--part", default="development", choices=PARTS)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--write", action="store_true", help="put the table into docs/advice.md")
    arguments = parser.parse_args()
    rows: list[Row] = []
    for kind, seed in machines(arguments.part, arguments.machines, arguments.seed):
        rows += score(kind, seed, arguments.part)
        print(f"{kind} {seed}: {len(rows)} soils so far", flush=True)
    text = table(rows, arguments)
    print(f"\n{text}\n")
    if arguments.write:
        put(DOCUMENT, BEGIN.format(part=arguments.part), text)
        print(f"written to {DOCUMENT}")


def machines(part: str, count: int, first: int) -> Iterator[tuple[Kind, int]]:
    """Kinds and seeds of a part."""
    if part == "second-plant":
        yield from second.machines(count, first)
    elif part == "other-grounds":
        yield from other_grounds.machines(count, first)
    elif part == "yielding":
        yield from other_grounds.machines(count, first, ("yielding",))
    elif part == "coarse":
        for kind, seed in families.machines("development", count, first):
            yield Kind(kind.mass, kind.curve, "coarse"), seed
    else:
        yield from families.machines(part, count, first)  # type: ignore[arg-type]


def score(kind: Kind, seed: int, part: str) -> list[Row]:
    """Every soil of one machine's drive that holds usable rows."""
    result, truths = drawn(kind, seed, part)
    vehicle = result.vehicle
    estimates = estimate(result.recording, vehicle)
    advice, _ = advise([estimates], vehicle)
    gathered = GatheredSamples(vehicle)
    gathered.add(estimates)
    samples = gathered.by_soil()
    rows = []
    for soil, one in advice.items():
        if soil not in samples:
            continue
        truth = truths(soil, driven_share(vehicle, samples[soil]))
        best, power = best_of(truth, truth.efficiency), best_of(truth, truth.productivity)

        def lost(slip: float, truth: OverSlip = truth, top: float = best.efficiency) -> float:
            return float(top - np.interp(slip, truth.slip, truth.efficiency[0]))

        given, most = one.best_efficiency, one.best_productivity
        slip, interval = (given.slip, given.interval) if given else (np.nan, (np.nan, np.nan))
        held = None if most is None else most.interval[0] <= power.slip <= most.interval[1]
        rows.append(
            Row(kind, seed, soil, best.slip, slip, *interval, lost(slip), lost(float(np.mean(BAND))), held)
        )
    return rows


def drawn(
    kind: Kind, seed: int, part: str
) -> tuple[SimulationResult, Callable[[str, tuple[float, float]], OverSlip]]:
    """A machine's drive, and its true curves by the soil's name and the driven wheels' share of the weight, as `driven_share`."""
    if part != "second-plant":
        draw = other_grounds.draw if part in ("other-grounds", "yielding") else families.draw
        result = draw(kind, seed, rate=RATE)
        return result, lambda soil, driven: true_curves(result.scenario, soil, result.vehicle, driven)
    run, scenario, vehicle, seed = second.drive(kind, seed, rate=RATE)

    def truth(soil: str, driven: tuple[float, float]) -> OverSlip:
        ground = run.ground.soils[-1 if soil == "second" else 0]
        mu, rho, _ = second_curves(vehicle, ground, GRID)
        return over_slip(mu[None], rho[None], GRID, vehicle.tire_rolling_resistance, *driven)

    return result_of(run, scenario, vehicle, seed), truth


def true_curves(scenario: Scenario, soil: str, vehicle: Vehicle, driven: tuple[float, float]) -> OverSlip:
    """The plant's own curve and resistance over slip, wheels sunk in as each slip makes them (families.capacity at every slip)."""
    ground = scenario.soils[soil]
    model = other_grounds.EVERY[ground.curve["name"]]
    spots = scenario.soft_spots
    loosening, fall = (spots[0].loosening, spots[0].adhesion_fall) if spots else (0.0, 0.0)
    figures = {key: value for key, value in ground.curve.items() if key != "name"}
    mu = model.value(GRID / (1 + loosening), figures) * (1 - fall * GRID)
    rho = ground.resistance + ground.resistance_slip * GRID
    if spots:
        rho = rho + spots[0].front * (1 + spots[0].sinkage * GRID)
    return over_slip(mu[None], rho[None], GRID, vehicle.tire_rolling_resistance, *driven)


def table(rows: list[Row], arguments: argparse.Namespace) -> str:
    """Figures by family of curves and of all."""
    lines = [
        f"{arguments.machines} machines, {arguments.part}, seeds from {arguments.seed}; every soil of a machine counts.",
        "",
        "| curves | soils | advised | efficiency lost, median (90 %) | at 11.5 % | best slip off, median | within .02 | interval holds it "
        "| its width | interval of most pull power holds it |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in (*dict.fromkeys(row.kind.curve for row in rows), "all"):
        some = [row for row in rows if name in (row.kind.curve, "all")]
        given = [row for row in some if row.given]
        if not given:
            lines.append(f"| {name} | {len(some)} | 0 | | | | | | | |")
            continue
        off = np.abs([row.slip - row.true for row in given])
        lost = np.array([row.lost for row in given])
        held = np.mean([row.low <= row.true <= row.high for row in given])
        width = np.median([row.high - row.low for row in given])
        power = [row.power_held for row in given if row.power_held is not None]
        lines.append(
            f"| {name} | {len(some)} | {len(given)} | {np.median(lost):.4f} ({np.quantile(lost, 0.9):.4f}) | "
            f"{np.median([row.lost_at_band for row in given]):.4f} | {np.median(off):.3f} | {100 * np.mean(off <= 0.02):.0f} % | "
            f"{100 * held:.0f} % | {width:.3f} | {f'{100 * np.mean(power):.0f} %' if power else ''} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()

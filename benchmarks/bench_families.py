"""How good on machines that nothing was tuned on: random machines of every kind, beside the best plain Kalman filter.

    python benchmarks/bench_families.py [--families development held-out second-plant] [--machines 24] [--rates 100 50 20 10]
                                        [--quick] [--method bank] [--workers 2] [--write]

Machines: terragrip.simulation.families, split by kind (docs/families.md), and the second plant (benchmarks/second_plant), which
is held out as a whole. Nothing may be tuned on held-out, nor with its figures in sight. R² of adhesion counts all driven wheels
together, in rows in which the machine moves; *all faults* is its change, outside the outage, where the log has gaps, spikes, jitter,
held values and an outage. The plain filter (plain_filter.py) has the same log and vehicle file and one fixed Q of five, the best of them
taken afterwards for each machine. Intervals: family_intervals.py. Each machine is also seen at 50 Hz after `terragrip calibrate`, with its
true constants, without accelerometer, and with those faults, and tractors at 1 Hz. --quick: 8 machines at 100 and 20 Hz, nothing else.
--write puts the tables into docs/families.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from family_intervals import COVERED, SCORED, Intervals, intervals, knowing_nearly, oracle_scores
from marked import put
from plain_filter import INTENSITIES, plain_filter
from second_plant import draw as second
from terragrip.estimation import Estimates, calibrate, estimate
from terragrip.estimation.methods import DEFAULT, METHODS
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, families
from terragrip.simulation.families import Kind

Floats = NDArray[np.float64]

PARTS = ("development", "rigid", "rolling", "held-out", "second-plant")
RATES = (100.0, 50.0, 20.0, 10.0)
MOVING = 0.05  # m/s, or a tenth of the usual speed where that is less
LAGS = 40  # samples either way
VIEWS = (
    "as delivered",
    "after calibrate",
    "true constants",
    "no accelerometer",
    "faults together",
    "speeds alone",
)
VIEW_RATE = 50.0
CALIBRATING = 240.0  # s of another drive of the machine, which calibrate gets
OUTAGE = 6.0  # s, of the ground speed, at .6 of the drive; another second to recover
SHORT = {"adhesion": "µ", "slip": "slip", "soil_resistance": "ρs", "net_traction": "κ", "efficiency": "η"}
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/families.md"
BEGIN = "<!-- made by benchmarks/bench_families.py --write: {part} -->"


@dataclass(frozen=True)
class Row:
    """One machine at one rate: R² and lag [samples] of both, share of rows that each 95 % interval holds, change of R² by all faults."""

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
    by_faults: float


@dataclass(frozen=True)
class View:
    """One machine at VIEW_RATE, seen otherwise: R² outside the outage, intervals, and their score over the oracle's."""

    kind: Kind
    seed: int
    view: str
    r2: float
    held: Intervals
    over_oracle: dict[str, float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--families", nargs="+", default=["development"], choices=PARTS)
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
        drawn = list(machines_of(part, arguments.machines, arguments.seed))
        rates = tuple(arguments.rates)
        jobs = [(part, kind, seed, rates, arguments.method, not arguments.quick) for kind, seed in drawn]
        result: list[Row] = []
        views: list[View] = []
        slow: list[float] = []
        with ProcessPoolExecutor(arguments.workers) as pool:
            for rows, seen, at_1_hz in pool.map(score_machine, jobs):
                result += rows
                views += seen
                slow += at_1_hz
                print(_line(rows), flush=True)
        text = f"{summary(result, rates)}\n\n"
        if views:
            text += f"At {VIEW_RATE:g} Hz:\n\n{views_table(views)}\n\n"
        if slow:
            text += f"At 1 Hz, {len(slow)} tractors: ground speed within its 95 % interval in {100 * np.mean(slow):.0f} % of moving rows "
            text += f"(worst {100 * min(slow):.0f} %).\n\n"
        text += by_machine(result, rates)
        print(f"\n{part}, {arguments.method}\n\n{text}\n")
        if arguments.write:
            put(DOCUMENT, BEGIN.format(part=part), text)
            print(f"written to {DOCUMENT}")


def machines_of(part: str, count: int, seed: int) -> Iterator[tuple[Kind, int]]:
    """``count`` machines of one of PARTS, of which rigid and rolling are for development, too."""
    if part == "second-plant":
        return second.machines(count, seed)
    if part in ("rigid", "rolling"):
        return families.machines("development", count, seed, "rigid" if part == "rigid" else "rolling")
    return families.machines("held-out" if part == "held-out" else "development", count, seed)


Job = tuple[str, Kind, int, tuple[float, ...], str, bool]


def score_machine(job: Job) -> tuple[list[Row], list[View], list[float]]:
    """One machine at every rate, seen otherwise at VIEW_RATE, and a tractor at 1 Hz."""
    part, kind, seed, rates, method, whole = job
    draw: Callable[..., SimulationResult] = second.draw if part == "second-plant" else families.draw
    rows = [score(draw, kind, seed, rate, method) for rate in rates]
    if not whole:
        return rows, [], []
    slow = [speeds_hold(draw(kind, seed, rate=1.0), method)] if kind.mass == "tractor" else []
    return rows, view_machine(draw, kind, seed, method), slow


def view_machine(draw: Callable[..., SimulationResult], kind: Kind, seed: int, method: str) -> list[View]:
    """Every view of one machine."""
    result = draw(kind, seed, rate=VIEW_RATE)
    faulty = draw(kind, seed, rate=VIEW_RATE, faults=True)
    oracle = oracle_scores(result, driven_wheels(result), moving_rows(result))
    out = []
    for view in VIEWS:
        seen = faulty if view == "faults together" else result
        vehicle = seen.vehicle
        if view == "true constants":
            vehicle = knowing_nearly(seen)
        elif view == "after calibrate":
            if "drawbar_force" not in seen.recording.channels:  # what that drive tows is in no channel
                continue
            drive = another_drive(kind, seen)
            vehicle = calibrate(drive.recording, vehicle).apply(vehicle)
        elif view == "no accelerometer":
            if "acceleration_x" not in seen.recording.channels:
                continue
            seen = result_without(seen, "acceleration")
        elif view == "speeds alone":
            seen = result_without(seen, "drive_torque")
        recording = seen.recording
        estimates = estimate(recording, vehicle, method=method)
        held = intervals(seen, estimates, driven_wheels(seen), moving_rows(seen))
        r2 = np.nan if view == "speeds alone" else r2_outside(seen, estimates)
        over = {name: held.score[name] / oracle[name] for name in SCORED}
        out.append(View(kind, seed, view, r2, held, over))
    return out


def r2_outside(result: SimulationResult, estimates: Estimates) -> float:
    """R² of adhesion in moving rows outside the outage that `draw_faults` makes, once anything was measured."""
    driven, time, outage = driven_wheels(result), result.recording.time, 0.6 * result.scenario.duration
    outside = moving_rows(result) & ~((time > outage) & (time < outage + OUTAGE + 1.0))
    truth = np.stack([result.truth[f"true_adhesion_{w}"] for w in driven], axis=1)
    estimated = np.stack([estimates[f"adhesion_{w}"] for w in driven], axis=1)
    return pooled_r2(truth, estimated, outside & np.isfinite(estimated).all(axis=1))


def another_drive(kind: Kind, result: SimulationResult) -> SimulationResult:
    """A drive of CALIBRATING seconds of the result's machine, on other ground."""
    if kind in second.kinds():
        return second.another_drive(kind, result.seed, rate=VIEW_RATE, duration=CALIBRATING)
    return families.draw(kind, result.seed, rate=VIEW_RATE, task="healthy", duration=CALIBRATING)


def result_without(result: SimulationResult, start: str) -> SimulationResult:
    """The recording as `without` leaves it, and the truth at its rows."""
    recording = without(result.recording, start)
    rows = np.isin(result.recording.time, recording.time)
    return replace(result, recording=recording, truth=result.truth[rows].reset_index(drop=True))


def without(recording: Recording, start: str) -> Recording:
    """The recording without the channels whose names begin so, and without rows that hold nothing then."""
    channels = {name: values for name, values in recording.channels.items() if not name.startswith(start)}
    some = np.logical_or.reduce([np.isfinite(values) for values in channels.values()])
    return replace(recording, channels=channels).select(some)


def speeds_hold(result: SimulationResult, method: str) -> float:
    """Share of moving rows whose ground speed lies within its 95 % interval."""
    estimates = estimate(result.recording, result.vehicle, method=method)
    error = estimates["ground_speed"] - result.truth["true_ground_speed"].to_numpy()
    return float(np.mean((np.abs(error) <= 1.96 * estimates["ground_speed_std"])[moving_rows(result)]))


def driven_wheels(result: SimulationResult) -> list[str]:
    """Names of the driven wheels."""
    vehicle = result.vehicle
    return [w for w, driven in zip(vehicle.wheels, vehicle.driven, strict=True) if driven]


def score(draw: Callable[..., SimulationResult], kind: Kind, seed: int, rate: float, method: str) -> Row:
    """Our method and the plain filter on one machine's recording, and ours where it has all faults."""
    result, faulty = (draw(kind, seed, rate=rate, faults=faults) for faults in (False, True))
    vehicle, recording = result.vehicle, result.recording
    estimates = estimate(recording, vehicle, method=method)
    with_faults = estimate(faulty.recording, vehicle, method=method)
    driven = driven_wheels(result)
    rows = np.isfinite(recording[f"wheel_speed_{driven[0]}"])
    truth = np.stack([result.truth[f"true_adhesion_{w}"] for w in driven], axis=1)[rows]
    moving = moving_rows(result)[rows]
    used = [
        c for c in recording.channels if c.startswith(("wheel_speed", "drive_torque", "ground", "drawbar"))
    ]
    measured = np.logical_or.reduce([np.isfinite(recording[c]) for c in used])
    plain = plain_filter(recording.select(measured), vehicle)
    n = len(vehicle.wheels)
    first = [n + 1 + vehicle.wheels.index(w) for w in driven]
    plains = [plain.state[q][rows[measured]][:, first] for q in range(len(INTENSITIES))]
    scores = [pooled_r2(truth, estimated, moving) for estimated in plains]
    best = int(np.argmax(scores))
    ours = np.stack([estimates[f"adhesion_{w}"] for w in driven], axis=1)[rows]
    return Row(
        kind, seed, rate, vehicle.mass, n, pooled_r2(truth, ours, moving), scores[best], INTENSITIES[best],
        lag(truth, ours, moving), lag(truth, plains[best], moving), intervals(result, estimates, driven, moving_rows(result)).covered,
        r2_outside(faulty, with_faults) - r2_outside(result, estimates),
    )  # fmt: skip


def moving_rows(result: SimulationResult) -> NDArray[np.bool_]:
    """Rows in which the machine moves (n,)."""
    speed = np.abs(result.truth["true_ground_speed"].to_numpy())
    return np.asarray(speed > min(MOVING, 0.1 * float(np.median(speed[speed > 0.01]))))


def pooled_r2(truth: Floats, estimated: Floats, rows: NDArray[np.bool_]) -> float:
    """1 - SSE/SST over all columns together, each (n, wheels)."""
    true, estimate = truth[rows], estimated[rows]
    return float(1 - np.sum((estimate - true) ** 2) / np.sum((true - true.mean()) ** 2))


def lag(truth: Floats, estimated: Floats, rows: NDArray[np.bool_]) -> float:
    """By how many samples the estimate follows the truth: where their correlation, wheel by wheel, is best."""

    def correlation(shift: int) -> float:
        n = len(truth)
        now = np.arange(max(0, shift), min(n, n + shift))
        both = rows[now] & rows[now - shift]
        pairs = zip(truth[now - shift][both].T, estimated[now][both].T, strict=True)
        return float(np.mean([np.corrcoef(true, estimate)[0, 1] for true, estimate in pairs]))

    values = [correlation(shift) for shift in range(-LAGS, LAGS + 1)]
    return float(np.argmax(values) - LAGS)


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
        "all faults, R² µ",
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
        cells.append(f"{np.median([r.by_faults for r in some]):+.3f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def views_table(views: Sequence[View]) -> str:
    """Markdown: a line a view, means over the machines (of R²: the median change against as delivered)."""
    covered = [f"95 % {SHORT[c]}" for c in COVERED]
    scores = [f"score {SHORT[c]} / oracle" for c in SCORED]
    head = ["view", "machines", "R² µ, change", *covered, "µ under 88 %", *scores]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    base = {(v.kind, v.seed): v.r2 for v in views if v.view == VIEWS[0]}
    for view in VIEWS:
        some = [v for v in views if v.view == view]
        if not some:
            continue
        change = np.median([v.r2 - base[v.kind, v.seed] for v in some])
        known = {c for c in COVERED if np.isfinite([v.held.covered[c] for v in some]).any()}
        cells = [view, str(len(some)), f"{change:+.3f}" if "adhesion" in known else ""]
        cells += [
            f"{100 * np.nanmean([v.held.covered[c] for v in some]):.0f}" if c in known else ""
            for c in COVERED
        ]
        cells.append(str(sum(v.held.covered["adhesion"] < 0.88 for v in some)) if "adhesion" in known else "")
        cells += [f"{np.median([v.over_oracle[c] for v in some]):.2f}" if c in known else "" for c in SCORED]
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

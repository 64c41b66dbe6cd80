"""The demo: the paper's campaign simulated, every run estimated, scored, drawn, and put on one page."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip import __version__
from terragrip.errors import InputError
from terragrip.report import sections
from terragrip.report.intervals import Coverage, pooled, run_coverage
from terragrip.report.page import Headline, Page, number, percent, write_page, write_whole
from terragrip.report.runs import Run
from terragrip.report.scores import (
    PAPER_NRMSE,
    PAPER_R2_WHOLE,
    PAPER_R2_WITHOUT_STUCK,
    Comparison,
    TruthScore,
    compare,
    find,
    truth_score,
)

if TYPE_CHECKING:
    from terragrip.simulation import SimulationResult

SEED = 2021
"""The campaign's seed: with it the demo's numbers can be looked up and repeated."""
CAMPAIGN = "campaign"
BENCHMARKS = ("multi1", "multi2")
"""The runs over several soils that the paper scores; every method estimates them."""

Progress = Callable[[int, int, str], None]
"""Called with runs done, runs in all, and the name of the run just done."""


@dataclass(frozen=True)
class DemoResult:
    """Where the demo's files lie, what it scored, and how long it took [s]."""

    page: Path
    scores: Path
    estimates: tuple[Path, ...]
    comparisons: tuple[Comparison, ...]
    seconds: float


@dataclass(frozen=True)
class _Done:
    """What a worker hands back: small for most runs, the tables too for those that are drawn."""

    name: str
    path: Path
    rows: int
    duration: float
    coverage: list[Coverage]
    comparisons: list[Comparison]
    truth_scores: list[TruthScore]
    run: Run | None


def run_demo(
    output: Path,
    seed: int = SEED,
    workers: int = 2,
    progress: Progress | None = None,
    runs: Sequence[str] | None = None,
) -> DemoResult:
    """Simulate the campaign, estimate every run, score, draw; everything under `output`.

    Parameters
    ----------
    output: folder, made if it is not there. It gets index.html, figures/*.svg, scores.json and
        estimates/<run>.parquet; a file is written whole or not at all.
    seed: of the whole campaign. workers: processes.
    runs: names of the campaign's runs to take; all by default. The benchmarks multi1 and multi2 are always
        among them.

    Raises InputError when the folder cannot be written or matplotlib or Jinja2 is missing.
    KeyboardInterrupt passes through once the workers have stopped.
    """
    from terragrip.simulation import set_runs

    begin = time.monotonic()
    _require_drawing()
    listed = list(set_runs(CAMPAIGN))
    names = listed if runs is None else [name for name in listed if name in {*runs, *BENCHMARKS}]
    folder = output / "estimates"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"folder cannot be made ({error.strerror})"
        raise InputError(problem, file=folder, mend="choose another folder") from error
    order = sorted(names, key=lambda name: name not in BENCHMARKS)  # the long ones first
    done: dict[str, _Done] = {}
    for item in _in_processes([(name, seed, folder) for name in order], workers):
        done[item.name] = item
        if progress is not None:
            progress(len(done), len(names), item.name)
    results = [done[name] for name in names]
    comparisons = [c for item in results for c in item.comparisons]
    seconds = time.monotonic() - begin
    page = write_page(_page(results, comparisons, seed, seconds), output)
    scores = output / "scores.json"
    write_whole(scores, json.dumps(_scores(results, comparisons, seed), indent=2) + "\n")
    return DemoResult(
        page, scores, tuple(r.path for r in results), tuple(comparisons), time.monotonic() - begin
    )


def _in_processes(tasks: list[tuple[str, int, Path]], workers: int) -> Iterator[_Done]:
    """Results as they come. An interrupt or a failure cancels what has not begun, then passes on."""
    if workers <= 1:
        for task in tasks:
            yield _simulate_and_estimate(*task)
        return
    with ProcessPoolExecutor(workers, initializer=_ignore_interrupts) as pool:
        futures = [pool.submit(_simulate_and_estimate, *task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _ignore_interrupts() -> None:
    """Ctrl-C reaches the whole process group: the parent ends the work, a worker finishes its file."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _simulate_and_estimate(name: str, seed: int, folder: Path) -> _Done:
    """One run from scenario to saved estimates and scores."""
    from terragrip.estimation import estimate
    from terragrip.estimation.methods import DEFAULT, METHODS
    from terragrip.simulation import simulate

    result = simulate(name, seed)
    drawn = name in BENCHMARKS
    comparisons, truth_scores, shown = [], [], None
    for method in METHODS if drawn else (DEFAULT,):
        estimates = estimate(result.recording, result.vehicle, method=method)
        run = _run(name, estimates, result, method)
        if drawn:
            comparisons += compare(run)
            truth_scores += [score] if (score := truth_score(run)) else []
        if method == DEFAULT:
            shown, path = run, folder / f"{name}.parquet"
            estimates.write(path)
    if shown is None:
        raise AssertionError(f"the default method {DEFAULT} is not among {METHODS}")
    return _Done(
        name, path, len(shown.time), float(shown.time[-1] - shown.time[0]), run_coverage(shown), comparisons,
        truth_scores, shown if drawn else None,
    )  # fmt: skip


def _run(name: str, estimates: Any, result: SimulationResult, method: str) -> Run:
    """The report's view of one estimated run."""
    return Run(
        name, estimates.to_pandas(), method, result.truth, result.recording.to_pandas(), result.vehicle
    )


def _page(results: list[_Done], comparisons: list[Comparison], seed: int, seconds: float) -> Page:
    """The demo's page."""
    from terragrip.estimation.methods import DEFAULT

    drawn = {item.name: item.run for item in results if item.run is not None}
    main = drawn[BENCHMARKS[-1]]
    covered = [item for result in results for item in result.coverage]
    scored = [score for result in results for score in result.truth_scores]
    minutes = sum(item.duration for item in results) / 60
    return Page(
        "The field campaign, simulated and estimated",
        f"{len(results)} simulated runs of the robot of Kobelski, Osinenko and Streif (2021), "
        f"{minutes:.0f} minutes on five soils. Every number and figure here comes from simulation, save those "
        f"marked as the paper's, which come from its field. The method is {DEFAULT} where none is named.",
        (
            sections.tracking(main, _sensor_prose(main)),
            sections.slip_and_resistance(main),
            sections.methods(comparisons, scored, DEFAULT, _method_prose()),
            sections.soils(main, list(drawn.values())),
            sections.honesty(main, covered),
        ),
        _headlines(comparisons, covered, DEFAULT),
        simulated=True,
        facts=(
            ("Made by", f"Terragrip {__version__}, terragrip demo"),
            ("Seed", str(seed)),
            ("Runs", f"{len(results)}, {sum(item.rows for item in results)} rows"),
            ("Simulated and estimated in", f"{seconds:.0f} s"),
        ),
    )


def _headlines(comparisons: list[Comparison], covered: list[Coverage], default: str) -> tuple[Headline, ...]:
    """R² and NRMSE of multi2 in the paper's manner, R² against the truth, coverage."""
    main = BENCHMARKS[-1]
    sensor = find(comparisons, run=main, method=default, quantity="net_traction", against="sensor")
    truth = find(comparisons, run=main, method=default, quantity="adhesion", against="truth")
    found = []
    if sensor and sensor.whole and sensor.without_outlier:
        kappa = f"κ of {main} against the simulated force sensor"
        found += [
            Headline(number(sensor.whole.r2), f"R², {kappa}, whole", f"paper {PAPER_R2_WHOLE}"),
            Headline(
                number(sensor.without_outlier.r2),
                "R² without the stuck spell",
                f"paper {PAPER_R2_WITHOUT_STUCK}",
            ),
            Headline(
                number(sensor.without_outlier.nrmse), "NRMSE without the stuck spell", f"paper {PAPER_NRMSE}"
            ),
        ]
    if truth and truth.without_stuck:
        found.append(
            Headline(
                number(truth.without_stuck.r2), f"R², µ of {main} against the truth", "stuck spell left out"
            )
        )
    mu = next((item for item in pooled(covered) if item.quantity == "adhesion µ"), None)
    if mu:
        found.append(
            Headline(percent(mu.share()), "of rows with the true µ inside the 95 % interval", "all runs")
        )
    return tuple(found)


def _sensor_prose(run: Run) -> tuple[str, ...]:
    return (
        (
            "The force sensor sits on the axle of the rear right wheel. It reads the force that reaches the chassis, "
            "so soil resistance is already taken off, over a load that lacks the wheel's own weight. The paper "
            "compares it with µ; what it reads is closer to κ = µ − ρs. Both comparisons are below.",
            "While the vehicle is stuck its tool slides up and pushes: the force on the axle falls or turns negative, "
            "the torque and with it the estimate stay high. The paper cuts this spell out; here the simulation "
            "knows when it was, and scores stand with and without it.",
        )
        if run.stuck.any()
        else ()
    )


def _method_prose() -> tuple[str, ...]:
    return (
        "The model is affine in its state, so ekf, ukf and kalman are one filter computed three ways and agree to "
        "rounding; aukf and aukf-fs adapt the process noise (the latter is the paper's method); bank mixes four "
        "noise levels; algebraic solves the equations of motion on low-passed signals.",
    )


def _scores(results: list[_Done], comparisons: list[Comparison], seed: int) -> dict[str, Any]:
    """Everything that was scored, as JSON."""
    covered = [item for result in results for item in result.coverage]
    return {
        "simulated": True,
        "version": __version__,
        "seed": seed,
        "paper": {
            "r2": PAPER_R2_WHOLE,
            "r2_without_outlier": PAPER_R2_WITHOUT_STUCK,
            "nrmse_without_outlier": PAPER_NRMSE,
        },
        "comparisons": [c.to_dict() for c in comparisons],
        "truth": [score.to_dict() for result in results for score in result.truth_scores],
        "coverage_95": {item.quantity: item.share() for item in pooled(covered)},
    }


def _require_drawing() -> None:
    """Tell before the long work, not after it, that drawing is not possible."""
    from importlib.util import find_spec

    missing = [name for name in ("matplotlib", "jinja2") if find_spec(name) is None]
    if missing:
        raise InputError(f"{missing[0]} is not installed", mend="pip install 'terragrip[report]'")

"""The simulated campaign: calibrate its machine, then simulate, estimate and score every run, in processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from terragrip.report.advice_sections import GatheredAdvice
from terragrip.report.blocks import Blocks, blocks_of
from terragrip.report.ground_sections import WARNINGS
from terragrip.report.intervals import Coverage, run_coverage
from terragrip.report.runs import Run
from terragrip.report.scores import Comparison, TruthScore, compare, compare_truth, truth_score

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.estimation.calibration import Calibration
    from terragrip.ground.events import Event
    from terragrip.ground.result import Ground
    from terragrip.recording import Recording
    from terragrip.report.page import Section
    from terragrip.simulation import SimulationResult
    from terragrip.soil.estimates import GatheredRuns
    from terragrip.soil.learn import Campaign, RunPairs
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

CAMPAIGN = "campaign"
BENCHMARKS = ("multi1", "multi2")
"""The runs over several soils that the paper scores; every method estimates them."""
CALIBRATED_BY = ("-01", "-02", "-06", "-09")
"""Endings of the runs that the machine is calibrated from, on each soil: two without a tool, two with."""

Progress = Callable[[int, int, str], None]
"""Called with steps done, steps in all, and what was just done."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class EstimatedRun:
    """One run of the campaign. `run`, the whole tables, is kept of the benchmarks only; the rest is small.

    `path`: its estimates by the default method. `duration` [s]. `gathered`: what the soils'
    curves are learned from; `true_pairs`: true slip and adhesion of the same rows. `distance` [m]; `blocks`: half minutes for the tables by
    soil; `warnings`: kinds of the events that a driver acts on.
    """

    name: str
    path: Path
    rows: int
    duration: float
    coverage: tuple[Coverage, ...]
    comparisons: tuple[Comparison, ...]
    truth_scores: tuple[TruthScore, ...]
    gathered: GatheredRuns
    true_pairs: tuple[RunPairs, ...]
    run: Run | None
    distance: float
    blocks: Blocks
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class EstimatedCampaign:
    """The runs in the campaign's order, and the calibration that their estimates stand on."""

    runs: tuple[EstimatedRun, ...]
    calibration: Calibration
    vehicle: Vehicle

    @property
    def comparisons(self) -> list[Comparison]:
        """Of all runs and methods."""
        return [item for run in self.runs for item in run.comparisons]

    @property
    def truth_scores(self) -> list[TruthScore]:
        """Of all runs and methods."""
        return [item for run in self.runs for item in run.truth_scores]

    @property
    def coverage(self) -> list[Coverage]:
        """Of all runs, default method."""
        return [item for run in self.runs for item in run.coverage]

    @cached_property
    def soils(self) -> Campaign:
        """The soils' curves from the estimates of all runs."""
        return _learn(self.runs)

    @cached_property
    def known_soils(self) -> SoilLibrary:
        """The soils by the runs that stay on one: what the benchmarks, left out here, are recognised by."""
        return _learn([run for run in self.runs if run.run is None]).library()

    @cached_property
    def grounds(self) -> tuple[Ground, ...]:
        """The ground of the benchmarks by their estimates and the soils of the other runs."""
        from terragrip.estimation import Estimates
        from terragrip.ground.analysis import analyse

        library = self.known_soils if self.known_soils else None
        return tuple(
            analyse(Estimates.read(one.path), library, one.name)[0]
            for one in self.runs
            if one.run is not None
        )

    @cached_property
    def advice(self) -> Section:
        """The chapter of advice from the estimates of all runs."""
        from terragrip.estimation import Estimates

        gathered = GatheredAdvice()
        for one in self.runs:
            gathered.add(Estimates.read(one.path), one.name)
        return gathered.section()

    @property
    def benchmarks(self) -> list[Run]:
        """The benchmark runs with their tables."""
        return [item.run for item in self.runs if item.run is not None]


def _learn(runs: Sequence[EstimatedRun]) -> Campaign:
    """The soils of these runs; an empty campaign where none carries a label."""
    from terragrip.soil.estimates import GatheredRuns
    from terragrip.soil.learn import Campaign

    every = GatheredRuns()
    for run in runs:
        every.join(run.gathered)
    return every.learn() if every.pairs else Campaign({}, {}, ())


def estimate_campaign(
    folder: Path, seed: int, workers: int, progress: Progress | None, names: Sequence[str] | None
) -> EstimatedCampaign:
    """Calibrate, simulate, estimate and score; estimates go to `folder`/<run>.parquet, the benchmarks' recordings to
    recordings/<run>.parquet beside `folder`.

    `names`: which of the campaign's runs; None takes all; the benchmarks are always among them.
    """
    from terragrip.estimation.calibration import calibrate
    from terragrip.simulation import Scenario, set_runs

    listed = list(set_runs(CAMPAIGN))
    wanted = listed if names is None else [name for name in listed if name in {*names, *BENCHMARKS}]
    calibrating = [name for name in listed if name.endswith(CALIBRATED_BY)]
    total = len(calibrating) + len(wanted)

    logs: dict[str, Recording] = {}
    for name, log in in_processes(_record, [(name, seed) for name in calibrating], workers):
        logs[name] = log
        _report_progress(progress, len(logs), total, f"{name}, to calibrate")
    nominal = Scenario.load(BENCHMARKS[-1]).nominal_vehicle()
    calibration = calibrate([logs[name] for name in calibrating], nominal)
    vehicle = calibration.apply(nominal)

    order = sorted(wanted, key=lambda name: name not in BENCHMARKS)  # the long ones first
    done: dict[str, EstimatedRun] = {}
    for item in in_processes(_estimate, [(name, seed, vehicle, folder) for name in order], workers):
        done[item.name] = item
        _report_progress(progress, len(calibrating) + len(done), total, item.name)
    return EstimatedCampaign(tuple(done[name] for name in wanted), calibration, vehicle)


def in_processes(
    function: Callable[..., Result], tasks: Sequence[tuple[object, ...]], workers: int
) -> Iterator[Result]:
    """Results of function(*task) as they come. An interrupt or a failure cancels what has not begun and passes on.

    With one worker all happens in this process, in order.
    """
    if workers <= 1:
        for task in tasks:
            yield function(*task)
        return
    from terragrip.simulation.campaign import ignore_interrupts

    with ProcessPoolExecutor(workers, initializer=ignore_interrupts) as pool:
        futures = [pool.submit(function, *task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _report_progress(progress: Progress | None, done: int, total: int, what: str) -> None:
    if progress is not None:
        progress(done, total, what)


def _simulated(name: str, seed: int) -> SimulationResult:
    """The run as `simulate_campaign` makes it: one machine for a seed, another ground for each name."""
    from terragrip.simulation import simulate
    from terragrip.simulation.campaign import run_seed

    return simulate(name, run_seed(seed, name), machine_seed=seed)


def _record(name: str, seed: int) -> tuple[str, Recording]:
    """What the sensors read in one run."""
    return name, _simulated(name, seed).recording


def _kept(result: SimulationResult, folder: Path, name: str) -> Path:
    """The recording as a file, so that `terragrip studio` can draw what was measured beside what was estimated of it."""
    from terragrip.files import replacing

    folder.mkdir(exist_ok=True)
    with replacing(folder / f"{name}.parquet") as temporary:
        result.recording.to_pandas().to_parquet(temporary, index=False)
    return folder / f"{name}.parquet"


def _estimate(name: str, seed: int, vehicle: Vehicle, folder: Path) -> EstimatedRun:
    """One run from scenario to saved estimates and scores."""
    from terragrip.estimation import DEFAULT, METHODS, Estimates, estimate
    from terragrip.from_log import estimate_file
    from terragrip.ground.analysis import analyse
    from terragrip.ground.events import events as events_of
    from terragrip.report.campaign_soils import true_pairs
    from terragrip.soil.estimates import GatheredRuns

    result = _simulated(name, seed)
    path = folder / f"{name}.parquet"
    log = _kept(result, folder.parent / "recordings", name) if name in BENCHMARKS else result.recording
    estimate_file(log, vehicle, path)
    estimates = Estimates.read(path)
    gathered = GatheredRuns()
    gathered.add(estimates, name)
    events = analyse(estimates, None, name)[0].events if name in BENCHMARKS else ()
    shown = _run(name, estimates, result, vehicle, events)
    comparisons: list[Comparison] = []
    scores: list[TruthScore | None] = []
    if name in BENCHMARKS:
        comparisons += compare_truth(shown)
        for method in METHODS:
            run = shown
            if method != DEFAULT:
                others = estimate(result.recording, vehicle, method=method)
                run = _run(name, others, result, vehicle, events)
            comparisons += compare(run)
            scores.append(truth_score(run))
    return EstimatedRun(
        name,
        path,
        len(shown.time),
        float(shown.time[-1] - shown.time[0]),
        tuple(run_coverage(shown)),
        tuple(comparisons),
        tuple(score for score in scores if score is not None),
        gathered,
        tuple(true_pairs(estimates, result, name)),
        shown if name in BENCHMARKS else None,
        float(shown.estimated("distance")[-1]),
        blocks_of(shown),
        tuple(one.kind for one in events_of(estimates) if one.kind in WARNINGS),
    )


def _run(
    name: str,
    estimates: Estimates,
    result: SimulationResult,
    vehicle: Vehicle,
    events: Sequence[Event] = (),
) -> Run:
    """The report's view of one estimated run; `events` are the default method's, for every method."""
    table, recording = estimates.to_pandas(), result.recording.to_pandas()
    return Run(name, table, estimates.method, result.truth, recording, vehicle, tuple(events))

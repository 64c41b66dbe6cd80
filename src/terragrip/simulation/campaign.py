"""Many runs of one machine: the paper's campaign, or any set of scenarios."""

from __future__ import annotations

import signal
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing

from terragrip.errors import InputError
from terragrip.simulation.library import set_runs
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.simulate import SimulationResult, simulate

Progress = Callable[[int, int, str], None]


def simulate_campaign(
    names: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    workers: int = 2,
) -> Iterator[tuple[str, SimulationResult]]:
    """Simulate scenarios (default: the 68 runs of the set ``campaign``) with one machine; yields (name, result) in order.

    ``seed`` fixes the machine's errors and, with the name, each run's ground and noise: a run is the same alone, in any
    order and with any number of ``workers`` (1: in this process). ``progress(done, total, name)`` is called after each
    run. Raises InputError on an unknown name, before any run.
    """
    runs = list(set_runs("campaign") if names is None else names)
    if workers < 1:
        raise InputError(f"{workers} workers", hint="give at least 1")
    scenarios = [Scenario.load(name) for name in runs]
    return _results(runs, scenarios, seed, progress, workers)


def run_seed(seed: int, name: str) -> int:
    """The seed of one run of a campaign: another for every name, the same on every machine."""
    return (seed * 2_654_435_761 + zlib.crc32(name.encode())) % 2**32


def _results(
    names: list[str], scenarios: list[Scenario], seed: int, progress: Progress | None, workers: int
) -> Iterator[tuple[str, SimulationResult]]:
    jobs = [(scenario, run_seed(seed, name), seed) for name, scenario in zip(names, scenarios, strict=True)]
    with closing(_each(jobs, min(workers, len(jobs)))) as results:
        for done, (name, result) in enumerate(zip(names, results, strict=True), start=1):
            if progress is not None:
                progress(done, len(names), name)
            yield name, result


def _each(jobs: list[tuple[Scenario, int, int]], workers: int) -> Generator[SimulationResult, None, None]:
    if workers <= 1:
        yield from map(_one, jobs)
        return
    pool = ProcessPoolExecutor(workers, initializer=ignore_interrupts)
    try:
        # A few runs ahead of the reader, no more: results are large.
        ahead = [pool.submit(_one, job) for job in jobs[: 2 * workers]]
        for k in range(len(jobs)):
            yield ahead.pop(0).result()
            if k + 2 * workers < len(jobs):
                ahead.append(pool.submit(_one, jobs[k + 2 * workers]))
    finally:
        pool.shutdown(cancel_futures=True)


def ignore_interrupts() -> None:
    """Ctrl-C reaches the workers too: one that it stops while it holds a queue would hang the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _one(job: tuple[Scenario, int, int]) -> SimulationResult:
    scenario, seed, machine_seed = job
    return simulate(scenario, seed, machine_seed=machine_seed)

"""The drives of `bench_ground.py`, analysed and scored: changes beside the borders, soils beside the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from adwin import adwin_changes
from calibration_drive import calibrate_machine
from terragrip.estimation import Estimates, calibrate, estimate
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.changes import Change
from terragrip.ground.result import Timeline
from terragrip.ground.unknown import UNKNOWN
from terragrip.simulation import Scenario, SimulationResult, set_runs, simulate
from terragrip.simulation.campaign import run_seed
from terragrip.soil.blocks import estimates_blocks
from terragrip.soil.estimates import labelled_blocks, pairs_of
from terragrip.soil.learn import learn_soils
from terragrip.soil.library import SoilLibrary
from terragrip.soil.signature import maker, with_signatures
from terragrip.vehicle import Vehicle

LIBRARY_SEED = 2000
MULTI = ("multi1", "multi2")
OTHER = {"accuracy-clean": "clean", "accuracy-faults": "multirate"}
ONE = {"fine": "fine or wet", "wet": "fine or wet"}
MARGIN = 2.0


@dataclass
class Matches:
    """Changes of one way on drives: borders, how many were found, changes reported, hours driven, delays [s]; of each change its stated
    probability and whether it was right; of each right one its error in time and its stated SD [s]."""

    borders: int = 0
    found: int = 0
    reported: int = 0
    hours: float = 0.0
    delays: list[float] = field(default_factory=list)
    stated: list[float] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    errors: list[tuple[float, float]] = field(default_factory=list)

    def add(self, other: Matches) -> None:
        self.borders += other.borders
        self.found += other.found
        self.reported += other.reported
        self.hours += other.hours
        self.delays += other.delays
        self.stated += other.stated
        self.right += other.right
        self.errors += other.errors

    @property
    def recall(self) -> float:
        return self.found / self.borders if self.borders else float("nan")

    @property
    def precision(self) -> float:
        return self.found / self.reported if self.reported else float("nan")

    @property
    def false_an_hour(self) -> float:
        return (self.reported - self.found) / self.hours


@dataclass
class Drive:
    """Scores of one drive: changes by way; shares of rows, and of settled rows, with the right soil; seconds until a soil was named."""

    group: str
    changes: dict[str, Matches]
    right: dict[str, float] = field(default_factory=dict)
    settled: dict[str, float] = field(default_factory=dict)
    naming: dict[str, list[float]] = field(default_factory=dict)
    timelines: dict[str, Timeline] = field(default_factory=dict)
    unknown: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)


@cache
def library_of(seed: int) -> tuple[Vehicle, SoilLibrary]:
    """The calibrated machine of a seed, and the library of its single-soil runs (never `multi1`, `multi2`)."""
    names = [name for name in set_runs("campaign") if name not in MULTI]
    logs = {name: run(name, seed) for name in names}
    by = [logs[name].recording for name in names if name.endswith(("-01", "-02", "-06", "-09"))]
    vehicle = calibrate(by, Scenario.load(MULTI[0]).nominal_vehicle()).apply(logs[names[0]].vehicle)
    parts, blocks, made_by = [], {}, ""
    for name in names:
        estimates = estimate(logs[name].recording, vehicle)
        parts += pairs_of(estimates, name)
        made_by = maker(estimates)
        for soil, one in labelled_blocks(estimates, None, name):
            blocks.setdefault(soil, []).append(one)
    library = learn_soils(parts).library()
    return vehicle, SoilLibrary(with_signatures(library.soils, blocks, made_by))


def run(name: str, seed: int) -> SimulationResult:
    """A run of the campaign of a seed: one machine, another ground for each name."""
    return simulate(name, run_seed(seed, name), machine_seed=seed)


def score_seed(job: tuple[int, bool]) -> list[Drive]:
    """All drives of one seed."""
    seed, alone = job
    another = library_of(LIBRARY_SEED)[1]
    vehicle, own = library_of(seed)
    drives = [score(run(name, seed), vehicle, "multi", another, own) for name in MULTI]
    for name, sensors in OTHER.items():
        result = simulate(name, seed)
        calibrated = calibrate_machine(seed, sensors).apply(result.vehicle)
        drives.append(score(result, calibrated, name, another, None))
    if alone:
        singles = [name for name in set_runs("campaign") if name not in MULTI]
        drives += [Drive("single", changes_by_way(run(name, seed), vehicle)) for name in singles]
    return drives


def score(
    result: SimulationResult, vehicle: Vehicle, group: str, another: SoilLibrary, own: SoilLibrary | None
) -> Drive:
    """One drive over several soils."""
    estimates = estimate(result.recording, vehicle)
    drive = Drive(group, changes(estimates, result))
    truth = np.array([ONE.get(x, x) for x in result.truth["soil"]], dtype=object)
    mixed = result.truth["transition"].to_numpy(dtype=bool)
    for label, library in (("another", another), ("own", own)):
        if library is None:
            continue
        for way in ("offline", "online"):
            ground, table = analyse(estimates, library, group, Settings(online=way == "online"))
            named = np.array([ONE.get(x, x) for x in table["soil_estimate"]], dtype=object)
            key = f"{label}, {way}"
            drive.right[key] = float((named == truth).mean())
            drive.settled[key] = float((named == truth)[~mixed].mean())
            drive.timelines[key] = ground.timeline
            if way == "online":
                drive.naming[label] = list(naming(estimates.time, truth, named, result))
    for soils in (("grass",), ("coarse",), ("fine", "wet"), ("hard",)):
        rest = SoilLibrary({k: v for k, v in another.items() if k not in soils})
        timeline = analyse(estimates, rest, group)[0].timeline
        predicted_unknown = timeline.soil == UNKNOWN
        missing, there = (
            np.isin(timeline.label, soils),
            (timeline.label != "") & ~np.isin(timeline.label, soils),
        )
        counts = [
            missing.sum(),
            (missing & predicted_unknown).sum(),
            there.sum(),
            (there & predicted_unknown).sum(),
        ]
        drive.unknown[" and ".join(soils)] = (int(counts[0]), int(counts[1]), int(counts[2]), int(counts[3]))
    return drive


def naming(
    time: np.ndarray, truth: np.ndarray, named: np.ndarray, result: SimulationResult
) -> Iterator[float]:
    """Seconds from a soil's coming under the centre of gravity to its being named while driving, 15 where it is not by then.

    Borders with the vehicle standing, stuck or pushed from 10 s before to 5 s after are left out.
    """
    still = (result.truth["stuck"] | result.truth["push"] | result.truth["standstill"]).to_numpy(dtype=bool)
    for k in np.flatnonzero(truth[1:] != truth[:-1]) + 1:
        around = (time > time[k] - 10) & (time < time[k] + 5)
        if not still[around].any():
            rows = np.flatnonzero((time >= time[k]) & (time < time[k] + 15) & (named == truth[k]))
            yield float(time[rows[0]] - time[k]) if rows.size else 15.0


def changes_by_way(result: SimulationResult, vehicle: Vehicle) -> dict[str, Matches]:
    """Changes on one drive, by way."""
    return changes(estimate(result.recording, vehicle), result)


def changes(estimates: Estimates, result: SimulationResult) -> dict[str, Matches]:
    blocks = estimates_blocks(estimates)
    offline = analyse(estimates)[0].changes
    online = analyse(estimates, settings=Settings(online=True))[0].changes
    ways: dict[str, Sequence[Change]] = {"offline": offline, "online": online, "adwin": adwin_changes(blocks)}
    spans = list(borders(result))
    return {
        way: match(some, spans, float(estimates.time[-1] - estimates.time[0])) for way, some in ways.items()
    }


def borders(result: SimulationResult) -> Iterator[tuple[float, float, float, bool]]:
    """Transitions: start, end, when the soil changes under the centre of gravity, whether the soils differ."""
    time = result.truth["time"].to_numpy()
    soil = result.truth["soil"].to_numpy(dtype=object)
    mixed = np.concatenate(([0], result.truth["transition"].to_numpy(dtype=np.int8), [0]))
    for first, after in zip(
        np.flatnonzero(np.diff(mixed) == 1), np.flatnonzero(np.diff(mixed) == -1), strict=True
    ):
        inside = slice(max(first - 1, 0), after + 1)
        turn = np.flatnonzero(soil[inside][1:] != soil[inside][:-1])
        if turn.size:
            sides = {ONE.get(x, x) for x in (soil[inside][0], soil[inside][-1])}
            yield time[first], time[after - 1], time[inside][turn[0] + 1], len(sides) > 1


def match(
    some: Sequence[Change],
    spans: Sequence[tuple[float, float, float, bool]],
    seconds: float,
    margin: float = MARGIN,
) -> Matches:
    """One change a border, within `margin` [s] of its transition; a border between fine and wet may be determined or not."""
    out, matched = Matches(borders=sum(differ for *_, differ in spans), hours=seconds / 3600), set()
    for change in some:
        near = [k for k, (a, b, _, _) in enumerate(spans) if a - margin <= change.time <= b + margin]
        free = [k for k in near if k not in matched]
        if free and not spans[free[0]][3]:
            matched.add(free[0])
            continue
        out.reported += 1
        out.stated.append(change.probability)
        out.right.append(bool(free))
        if free:
            out.errors.append((change.time - spans[free[0]][2], change.std))
            matched.add(free[0])
            out.found += 1
            if change.reported is not None:
                out.delays.append(change.reported - spans[free[0]][2])
    return out

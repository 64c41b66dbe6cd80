"""Soils from files of estimates: one file, one run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.note_pages import doubts_of
from terragrip.soil.bins import BinSettings
from terragrip.soil.blocks import Blocks, driven_wheels, estimates_blocks
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import Campaign, RunPairs, learn_soils, usable_pairs
from terragrip.soil.library import Soil
from terragrip.soil.signature import USUAL_CURVE, maker, with_signatures
from terragrip.soil.transitions import settled

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle


def soils_of(
    files: Sequence[str | os.PathLike[str]],
    curve: AdhesionCurve | None = None,
    bins: Mapping[str, BinSettings] | None = None,
    soil: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Campaign:
    """Learn the soils of estimates files (Parquet, written by `terragrip estimate`).

    `soil`: the name of all rows, for logs without labels. Other arguments as `learn_soils`. Raises InputError on a file that is not a table
    of estimates, on a file given twice, and if no row is labelled.
    """
    paths = distinct(files)
    gathered = GatheredRuns()
    for number, path in enumerate(paths, 1):
        gathered.add(Estimates.read(path), path.stem, soil, os.fspath(path))
        if progress:
            progress(number, len(paths) + 1)
    campaign = gathered.learn(curve, bins)
    if progress:
        progress(len(paths) + 1, len(paths) + 1)
    return replace(campaign, words=(*repeated(paths), *campaign.words))


_SHARED = 0.5
"""Of the shorter drive's rows in another's time, from which on it is asked whether both are one."""
_ROWS = 20
_WITHIN = 0.8
"""Standard deviations that two estimates of one measured speed differ by (.4 by method, .65 smoothed and not), by the larger one; of two
drives with one command at least 1.3 (root 2, by theory; simulation, 435 pairs), one of them smoothed at least 1."""
_CHANGES = (
    0.5  # correlation of their changes from row to row: noise, at one speed, that two drives do not share
)


def distinct(files: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files as paths. Raises InputError on a file given twice."""
    paths = [Path(file) for file in files]
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise InputError("is given twice", file=path, hint="name each run once")
        seen.add(path.resolve())
    return paths


def repeated(paths: Sequence[Path]) -> list[str]:
    """A sentence on each file of a drive that one before it holds, too: by another name or method, smoothed, or a part of it."""
    drives: list[tuple[Path, Floats]] = []
    words = []
    for path in paths if len(paths) > 1 else ():
        drive = _speeds(path, "ground_speed")
        same = (one for one, before in drives if _is_same(before, drive) and _turned_alike(one, path))
        other = next(same, None)
        if other is not None:
            one, first = (path, other) if path.name == other.name else (path.name, other.name)
            words.append(f"{one} holds the same drive as {first}, so its rows count twice: leave one out.")
        drives.append((path, drive))
    return words


def _speeds(path: Path, name: str) -> Floats:
    """Clock time (from 0 without a clock), a speed and its standard deviation (3, n) where known; none of a table without them."""
    import pyarrow.parquet as pq

    zero = (Estimates.read_about(path).get("recording") or {}).get("time_zero")
    start = 0.0 if zero is None else datetime.fromisoformat(zero).timestamp()
    columns = ["time", name, f"{name}_std"]
    if not set(columns) <= set(pq.read_schema(path).names):
        return np.empty((3, 0))
    table = pq.read_table(path, columns=columns)
    rows = np.array([table.column(name).to_numpy() for name in columns], dtype=np.float64)
    rows[0] += start
    return rows[:, np.isfinite(rows).all(axis=0) & (np.abs(rows[1]) > 3 * rows[2])]


def _turned_alike(first: Path, second: Path) -> bool:
    """Whether the wheels turned alike, too: simulated runs without noise may have one ground speed on two soils.

    Twice as far apart as ground speeds may be: the algebraic method's low-passed speeds are 1.1 SDs from a filter's.
    """
    import pyarrow.parquet as pq

    both = set(pq.read_schema(first).names) & set(pq.read_schema(second).names)
    wheels = [name for name in both if name.startswith("wheel_speed_") and f"{name}_std" in both]
    return all(_is_same(_speeds(first, name), _speeds(second, name), 2 * _WITHIN) for name in wheels)


def _is_same(first: Floats, second: Floats, within: float = _WITHIN) -> bool:
    """Whether the ``second``'s speed (3, n) is an estimate of what was measured in the ``first`` (3, m), too, noise and all."""
    if min(first.shape[1], second.shape[1]) < _ROWS:
        return False
    inside = second[:, slice(*np.searchsorted(second[0], [first[0, 0], np.nextafter(first[0, -1], np.inf)]))]
    if inside.shape[1] < max(_ROWS, _SHARED * min(first.shape[1], second.shape[1])):
        return False
    for rows in (inside[:, :: max(1, inside.shape[1] // _ROWS)], inside):  # a few first: most pairs end there
        before, std = (np.interp(rows[0], first[0], of) for of in first[1:])
        off = np.sqrt(np.mean(((rows[1] - before) / np.maximum(rows[2], std)) ** 2))
        if off > 1.25 * within:
            return False
    changes = np.diff(inside[1]), np.diff(before)
    if min(np.std(changes[0]), np.std(changes[1])) == 0:
        return False
    return bool(off < within and np.corrcoef(*changes)[0, 1] > _CHANGES)


@dataclass
class GatheredRuns:
    """The data for learning soils, run after run: usable pairs, blocks for signatures, and the machine's data for the advice."""

    runs: list[str] = field(default_factory=list)
    pairs: list[RunPairs] = field(default_factory=list)
    blocks: dict[str, list[Blocks]] = field(default_factory=dict)
    makers: set[str] = field(default_factory=set)
    periods: list[float] = field(default_factory=list)
    masses: list[float] = field(default_factory=list)
    common_sd: float = 0.0
    slip_sd: float = 0.0
    wheels: int = 1
    notes: list[tuple[str, ...]] = field(default_factory=list)

    def add(
        self,
        estimates: Estimates,
        run: str,
        soil: str | None = None,
        file: str | None = None,
        *,
        signatures: bool = True,
    ) -> None:
        """Add one run; `soil` names all its rows, errors name `file`; `signatures`: False adds no blocks."""
        if not estimates.has_adhesion:
            problem, hint = (
                "has slip but no adhesion, so no soil can be learned",
                "estimate a log with torques",
            )
            raise InputError(problem, file=file or run, hint=hint)
        self.runs.append(run)
        self.notes.append(estimates.notes)
        self.pairs += pairs_of(estimates, run, soil)
        for name, blocks in labelled_blocks(estimates, soil, file or run) if signatures else ():
            self.blocks.setdefault(name, []).append(blocks)
        self.makers.add(maker(estimates))
        if len(estimates) > 1:
            self.periods.append(float(np.median(np.diff(estimates.time))))
        vehicle = estimates.vehicle
        self.masses.append(vehicle.mass)
        self.common_sd = max(self.common_sd, torque_scale_sd(vehicle))
        self.slip_sd = max(self.slip_sd, zero_slip_sd(vehicle))
        self.wheels = max(self.wheels, len(estimates.wheels))

    def join(self, other: GatheredRuns) -> None:
        """Add all runs of `other`."""
        self.runs += other.runs
        self.notes += other.notes
        self.pairs += other.pairs
        for name, blocks in other.blocks.items():
            self.blocks.setdefault(name, []).extend(blocks)
        self.makers |= other.makers
        self.periods += other.periods
        self.masses += other.masses
        self.common_sd = max(self.common_sd, other.common_sd)
        self.slip_sd = max(self.slip_sd, other.slip_sd)
        self.wheels = max(self.wheels, other.wheels)

    def only(self, soil: str) -> GatheredRuns:
        """The same runs with the rows of one soil."""
        blocks = {name: blocks for name, blocks in self.blocks.items() if name == soil}
        return replace(self, pairs=[part for part in self.pairs if part.soil == soil], blocks=blocks)

    def learn(
        self, curve: AdhesionCurve | None = None, bins: Mapping[str, BinSettings] | None = None
    ) -> Campaign:
        """Fit every soil of the runs. Raises as `learn_soils`."""
        names = ", ".join(self.runs[:3])
        names += f" and {len(self.runs) - 3} more" if len(self.runs) > 3 else ""
        campaign = learn_soils(
            self.pairs,
            curve,
            bins,
            float(np.median(self.masses)) if self.masses else None,
            float(np.median(self.periods)) if self.periods else 0.01,
            self.wheels,
            source=f"{len(self.runs)} runs: {names}",
            common_sd=self.common_sd,
            common_slip_sd=self.slip_sd,
        )
        plain = {name: learned.soil for name, learned in campaign.soils.items()}
        plain |= {name: Soil(name, "exponential", USUAL_CURVE) for name in campaign.not_fitted}
        signed = with_signatures(plain, self.blocks, " and ".join(sorted(self.makers)))
        learned = {name: replace(one, soil=signed[name]) for name, one in campaign.soils.items()}
        bare = {name: signed[name] for name in campaign.not_fitted if "signature" in signed[name].fit}
        words = [*doubts_of(zip(self.runs, self.notes, strict=True)), *campaign.words]
        if bare:
            words.append(f"{', '.join(bare)}: recognised without a curve, by resistance and roughness.")
        return replace(campaign, soils=learned, words=tuple(words), without_curve=bare)


def zero_slip_sd(vehicle: Vehicle) -> float:
    """SD of the slip at zero slip, by the rolling radius: all logs of the machine share it."""
    return vehicle.uncertainty.assumed("wheel_radius")


def torque_scale_sd(vehicle: Vehicle) -> float:
    """Relative SD of the mean torque scale of all wheels, by the vehicle's stated uncertainty: all logs of the machine share it."""
    known = vehicle.uncertainty
    own, common = known.drive_torque_gain or 0.0, known.drive_torque_gain_common or 0.0
    return float(np.hypot(own / np.sqrt(len(vehicle.wheels)), common))


def labelled_blocks(estimates: Estimates, soil: str | None, file: str) -> Iterator[tuple[str, Blocks]]:
    """Blocks of one table by soil: those of its rows where vehicle and tool are on that soil, for the library's signatures."""
    labels, length = _labels(estimates, soil), whole_length(estimates.vehicle)
    good = settled(estimates["distance"], labels, length)
    for name in sorted(set(labels[good])):
        yield str(name), estimates_blocks(estimates, good & (labels == name), file)


def pairs_of(estimates: Estimates, run: str, soil: str | None = None) -> list[RunPairs]:
    """Usable pairs of one table: vehicle and tool on one soil, no event; `soil` names all rows."""
    columns = {name: estimates[name] for name in estimates.names} | {"soil": _labels(estimates, soil)}
    driven = driven_wheels(estimates.vehicle)
    wheels = [w for w in estimates.wheels if w in driven] or list(estimates.wheels)
    return usable_pairs(columns, wheels, whole_length(estimates.vehicle), run, roll_of(estimates.vehicle))


def _labels(estimates: Estimates, soil: str | None) -> NDArray[np.object_]:
    if soil is not None:
        return np.full(len(estimates), soil, dtype=object)
    return estimates.soil


def roll_of(vehicle: Vehicle) -> float:
    """A driven wheel's diameter [m]: the way in which a tyre answers a change of slip is of its contact's length, or a few of them."""
    radii = vehicle.driven_radii.values()
    return 2 * sum(radii) / len(radii) if radii else 0.0


def whole_length(vehicle: Vehicle) -> float:
    """From the front axle to the end of the tool [m]: over this distance vehicle and tool move onto a new soil."""
    return (vehicle.wheelbase or 0.0) + (vehicle.hitch_overhang or 0.0) + (vehicle.tool_length or 0.0)

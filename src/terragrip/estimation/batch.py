"""Estimates of a whole recording: one loop over its blocks; a recording in memory is one block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terragrip.estimation.by_cycle import ByCycle
from terragrip.estimation.by_engine import ByEngine
from terragrip.estimation.driveline import by_engine
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.forward import carried_channels, flag_before_gaps, run
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.estimation.provenance import notes_of, with_push_note
from terragrip.estimation.rims import speeds_alone
from terragrip.estimation.slip_only import slip_reference_in
from terragrip.estimation.turning import turn_in
from terragrip.recording import LogBlocks, Recording, survey_of
from terragrip.recording.alignment import recording_of
from terragrip.recording.counted import refuse_counted
from terragrip.recording.interpolated import lines_in, without_lines
from terragrip.vehicle import Vehicle, require_vehicle

if TYPE_CHECKING:
    import os


Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class RunOptions:
    """How to estimate a log; fields are arguments of :func:`estimate`, but for ``checked``: whether its likely faults are noted."""

    method: str = DEFAULT
    smooth: bool = False
    sensors: Mapping[str, float] | None = None
    held: Mapping[str, float] | None = None
    gap: float | None = None
    standstill_speed: float | None = None
    checked: bool = True

    def __post_init__(self) -> None:
        method_named(self.method, smooth=self.smooth)


def estimate(
    recording: Recording | Any,
    vehicle: Vehicle,
    method: str = DEFAULT,
    *,
    smooth: bool = False,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
    gap: float | None = None,
    standstill_speed: float | None = None,
    progress: Progress | None = None,
) -> Estimates:
    """Estimate a whole recording; without any drive torque, slip alone (docs/methods.md).

    Parameters
    ----------
    recording: a Recording, or a table that :meth:`Recording.from_frame` accepts.
    vehicle, method, gap, standstill_speed: see :class:`TractionEstimator`.
    smooth: run the recording backwards too: every row then also uses the rows after it.
    sensors: SDs of the noise [SI] by channel or sensor. A value given neither here nor in the vehicle file is
        estimated from the log, else guessed with a note.
    held: update periods [s] of held channels; None: found in the log.
    progress: called with the rows done and the total.

    Raises
    ------
    InputError: the recording or the vehicle is unusable, there is no such method, or `algebraic` is used with ``smooth``.
    """
    log = recording_of(recording)
    options = RunOptions(method, smooth, sensors, held, gap, standstill_speed)
    (result,) = estimated(LogBlocks.of(log), vehicle, options, progress=progress)
    return result


def estimated(
    log: LogBlocks,
    vehicle: Vehicle,
    options: RunOptions | None = None,
    *,
    beside: str | os.PathLike[str] | None = None,
    planned: Callable[[int, tuple[str, ...]], None] | None = None,
    progress: Progress | None = None,
    together: int = 1,
) -> Iterator[Estimates]:
    """The estimates of a log in blocks, a table for each block, in the order of time; ``options``: None: the defaults of :func:`estimate`.

    A first pass over the log finds the noise and the held channels (`terragrip.recording.survey`), so the size of the blocks
    changes no digit. ``beside``: blocks that wait for the backward pass of ``smooth`` are written next to this folder, if the log
    has more than one block; None: the system's folder. ``planned`` is called with the rows and the columns to come, before any row is
    estimated. ``together``: see :class:`TractionEstimator`. Raises InputError as :func:`estimate` does, each when its block is
    reached.
    """
    options = options or RunOptions()
    require_vehicle(vehicle)
    driven = None
    if vehicle.driveline is not None and by_engine((whole := log.whole()).channels, vehicle):
        driven = ByEngine(whole, vehicle)
        log, vehicle, together = driven.log(log), driven.machine.vehicle, driven.machine.together
    cycles = ByCycle.of(log)
    if cycles is None:
        parts = _row_by_row(log, vehicle, options, beside, planned, progress, together)
    else:
        every = planned and (lambda _, names: planned(log.rows, names))
        parts = _row_by_row(cycles.log(log), vehicle, options, beside, every, progress, together)
        parts = cycles.spread(log, parts)
    yield from with_push_note(parts if driven is None else driven.completed(parts))


def _row_by_row(
    log: LogBlocks,
    vehicle: Vehicle,
    options: RunOptions,
    beside: str | os.PathLike[str] | None,
    planned: Callable[[int, tuple[str, ...]], None] | None,
    progress: Progress | None,
    together: int,
) -> Iterator[Estimates]:
    """`estimated` of a log whose rows are instants."""
    passes = _Passes(progress, log.rows, log.from_disk + 1 + options.smooth)
    known = survey_of(log, passes.of(0) if log.from_disk else None)
    passes.rows = known.rows
    refuse_counted(known.sample)
    alone = speeds_alone(known.sample.channels, vehicle)
    if not alone:
        known.sample.check_against(vehicle)
    # One stretch of light work may determine the zero of slip, and a sample of the rows can miss it.
    reference = slip_reference_in(log.whole(), vehicle) if alone else None
    turn, turn_notes = turn_in(log, known.sample, vehicle)
    lines = lines_in(known.sample)
    estimator = TractionEstimator.for_recording(
        without_lines(known.sample, lines),
        vehicle,
        options.method,
        sensors=options.sensors,
        held=options.held,
        gap=options.gap,
        standstill_speed=options.standstill_speed,
        slip_reference=reference,
        together=together,
    )
    estimator.turn = turn
    if planned is not None:
        beside_them = (*carried_channels(known.sample, estimator), *known.sample.labels)
        planned(known.rows, ("time", *estimator.columns, *beside_them, "event"))
    checks = ThreadPoolExecutor(1)  # beside the kernel, which holds no lock: a sixth of a short log's time
    found = checks.submit(notes_of, estimator, known.sample) if options.checked else None
    checks.shutdown(wait=False)

    def notes() -> tuple[str, ...]:
        return (*(found.result() if found else ()), *turn_notes)

    blocks = (without_lines(known.without_empty(block), lines) for block in log.blocks())
    forward = passes.of(log.from_disk)
    if options.smooth:
        from terragrip.estimation.smoothing import smoothed

        yield from smoothed(estimator, blocks, notes, beside, forward, passes.of(log.from_disk + 1))
    else:
        yield from _flagged(_filtered(estimator, blocks, notes, forward))


class _Passes:
    """Progress over several passes of all rows, each as a function of its finished rows."""

    def __init__(self, progress: Progress | None, rows: int, count: int) -> None:
        self._progress, self.rows, self.count = progress, rows, count

    def of(self, number: int) -> Callable[[int], None]:
        """Progress of one pass, counted from 0."""

        def report(done: int) -> None:
            if self._progress is not None:
                self._progress(number * self.rows + min(done, self.rows), self.count * self.rows)

        return report


def _filtered(
    estimator: TractionEstimator,
    blocks: Iterator[Recording],
    notes: Callable[[], Sequence[str]],
    progress: Callable[[int], None],
) -> Iterator[Estimates]:
    """Each block run through the estimator."""
    rows = 0
    for block in blocks:
        yield run(estimator, block, notes, lambda done, before=rows: progress(before + done))  # type: ignore[misc]
        rows += len(block)


def _flagged(parts: Iterator[Estimates]) -> Iterator[Estimates]:
    """Delay each part until the next shows whether a gap follows its last row."""
    last: Estimates | None = None
    for part in parts:
        flag_before_gaps(part.event_codes, None if last is None else last.event_codes)
        if last is not None:
            yield last
        last = part
    if last is not None:
        yield last

"""A whole recording: one loop over its blocks, of which a recording in memory is one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.estimation.driveline import ByEngine, by_engine
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.methods import DEFAULT, SLIP_ONLY, method_named
from terragrip.estimation.rims import speeds_alone
from terragrip.estimation.slip_only import slip_reference_in
from terragrip.recording import LogBlocks, Recording, survey_of, unit_warnings
from terragrip.recording.clock import clock_text

if TYPE_CHECKING:
    import os

    from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]
Codes = npt.NDArray[np.uint8]
Progress = Callable[[int, int], None]

_PASSED_ON = ("latitude", "longitude", "altitude")
GAP = EVENTS.index("gap")


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
    """Estimate a whole recording; of one without any drive torque, slip alone (docs/methods.md).

    Parameters
    ----------
    recording: a Recording, or a table that :meth:`Recording.from_frame` takes.
    vehicle, method, gap, standstill_speed: see :class:`TractionEstimator`.
    smooth: run the recording backwards too: every row then knows the rows after it.
    sensors: SDs of the noise [SI] by channel or sensor; what neither they nor the vehicle file give is
        estimated from the log, else guessed with a note.
    held: update periods [s] of held channels; None finds them.
    progress: called with rows done and rows in all.

    Raises
    ------
    InputError: the recording or the vehicle is unusable, there is no such method, or `algebraic` is to smooth.
    """
    log = recording if isinstance(recording, Recording) else Recording.from_frame(recording)
    (result,) = estimated(
        LogBlocks.of(log),
        vehicle,
        method,
        smooth=smooth,
        sensors=sensors,
        held=held,
        gap=gap,
        standstill_speed=standstill_speed,
        progress=progress,
    )
    return result


def estimated(
    log: LogBlocks,
    vehicle: Vehicle,
    method: str = DEFAULT,
    *,
    smooth: bool = False,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
    gap: float | None = None,
    standstill_speed: float | None = None,
    beside: str | os.PathLike[str] | None = None,
    planned: Callable[[int, tuple[str, ...]], None] | None = None,
    progress: Progress | None = None,
    together: int = 1,
) -> Iterator[Estimates]:
    """The estimates of a log in blocks, a table a block, in the order of time; arguments as for :func:`estimate`.

    A first pass over the log finds the noise and the held channels (`terragrip.recording.survey`), so that the blocks' size
    changes no digit. ``beside``: the folder in whose neighbourhood blocks wait for the backward pass of ``smooth``, where the log
    has more than one; None: the system's. ``planned`` is called with the rows and the columns that there will be, before any row is
    estimated. ``together``: see :class:`TractionEstimator`. Raises InputError as :func:`estimate` does, each when its block is reached.
    """
    if smooth and not method_named(method).can_smooth:
        raise InputError(f"the method {method} cannot smooth", hint="use another method, or leave out smooth")
    if vehicle.driveline is not None and by_engine(whole := log.whole(), vehicle):
        machine = ByEngine(whole, vehicle)
        yield from machine.completed(
            estimated(
                machine.log(log),
                machine.vehicle,
                method,
                smooth=smooth,
                sensors=sensors,
                held=held,
                gap=gap,
                standstill_speed=standstill_speed,
                beside=beside,
                planned=planned,
                progress=progress,
                together=machine.together,
            )
        )
        return
    passes = _Passes(progress, log.rows, log.from_disk + 1 + smooth)
    known = survey_of(log, passes.first if log.from_disk else None)
    passes.rows = known.rows
    alone = speeds_alone(known.sample.channels, vehicle)
    if not alone:
        known.sample.check_against(vehicle)
    # Where slip counts from may be determined by one stretch of light work, which a sample of the rows can miss.
    reference = slip_reference_in(log.whole(), vehicle) if alone else None
    estimator = TractionEstimator.for_recording(
        known.sample,
        vehicle,
        method,
        sensors=sensors,
        held=held,
        gap=gap,
        standstill_speed=standstill_speed,
        slip_reference=reference,
        together=together,
    )
    if planned is not None:
        beside_them = (*passed_on(known.sample, estimator), *known.sample.labels)
        planned(known.rows, ("time", *estimator.columns, *beside_them, "event"))
    notes = notes_of(estimator, known.sample)
    blocks = (known.without_empty(block) for block in log.blocks())
    forward = passes.of(log.from_disk)
    if smooth:
        from terragrip.estimation.smoothing import smoothed

        yield from smoothed(estimator, blocks, notes, beside, forward, passes.of(log.from_disk + 1))
    else:
        yield from _flagged(_filtered(estimator, blocks, notes, forward))


class _Passes:
    """Progress over several passes of all rows, each as a function of the rows that it has done."""

    def __init__(self, progress: Progress | None, rows: int, count: int) -> None:
        self._progress, self.rows, self.count = progress, rows, count

    def of(self, number: int) -> Callable[[int], None]:
        """Progress of one pass, counted from 0."""
        return lambda done: self._tell(number * self.rows + min(done, self.rows))

    @property
    def first(self) -> Callable[[int], None]:
        """Progress of the first pass."""
        return self.of(0)

    def done(self, count: int) -> None:
        """So many passes are done."""
        self._tell(count * self.rows)

    def _tell(self, done: int) -> None:
        if self._progress is not None:
            self._progress(done, self.count * self.rows)


def _filtered(
    estimator: TractionEstimator,
    blocks: Iterator[Recording],
    notes: Sequence[str],
    progress: Callable[[int], None],
) -> Iterator[Estimates]:
    """Each block through the estimator."""
    rows = 0
    for block in blocks:
        yield run(estimator, block, notes, lambda done, before=rows: progress(before + done))  # type: ignore[misc]
        rows += len(block)


def _flagged(parts: Iterator[Estimates]) -> Iterator[Estimates]:
    """Hold each part back until the next shows whether a gap follows its last row."""
    last: Estimates | None = None
    for part in parts:
        flag_before_gaps(part.event_codes, None if last is None else last.event_codes)
        if last is not None:
            yield last
        last = part
    if last is not None:
        yield last


def run(
    estimator: TractionEstimator,
    recording: Recording,
    notes: Sequence[str] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Estimates:
    """All rows of the recording through the estimator as it stands; ``notes``: None: those that it gives itself.

    A row before a gap is not flagged (`flag_before_gaps`), as none is where samples come one by one.
    """
    time, columns = prepared(estimator, recording)
    out = table_of(estimator.columns, len(time))
    event = np.empty(len(time), dtype=np.uint8)
    estimator.engine.run(time, columns, out, event, progress)
    notes = notes_of(estimator, recording) if notes is None else notes
    return finished(estimator, recording, out, event, notes, smooth=False)


def prepared(estimator: TractionEstimator, recording: Recording) -> tuple[Floats, dict[str, Floats]]:
    """Time and those channels that the estimator looks at, each contiguous."""
    wanted, channels = estimator.engine.slots_in, recording.channels
    if estimator.slip_reference is not None:
        channels = estimator.slip_reference.completed(recording.time, channels)
    columns = {name: np.ascontiguousarray(values) for name, values in channels.items() if name in wanted}
    return np.ascontiguousarray(recording.time), columns


def table_of(names: Sequence[str], rows: int) -> dict[str, Floats]:
    """Empty columns (rows,) in one block.

    An odd number of cache lines a column keeps columns that are written side by side out of the same cache set.
    """
    lines = (rows + 7) // 8 | 1
    block = np.empty((len(names), 8 * lines))
    return {name: block[k, :rows] for k, name in enumerate(names)}


def finished(
    estimator: TractionEstimator,
    recording: Recording,
    out: dict[str, Floats],
    event: Codes,
    notes: Sequence[str],
    *,
    smooth: bool,
) -> Estimates:
    """Estimates from the kernel's columns, with what is passed on and notes."""
    out |= {name: recording.channels[name] for name in passed_on(recording, estimator)}
    about = about_run(estimator, about_recording(recording), smooth=smooth)
    return Estimates(recording.time, out, event, dict(recording.labels), about, tuple(notes))


def passed_on(recording: Recording, estimator: TractionEstimator) -> tuple[str, ...]:
    """The channels that stand beside the estimates as they were measured."""
    own = ("drawbar_force",) if estimator.method == SLIP_ONLY.name else ()
    return tuple(n for n in (*own, *_PASSED_ON, *recording.references) if n in recording.channels)


def flag_before_gaps(event: Codes, before: Codes | None = None) -> None:
    """Flag the row before each gap too: it is the last one before the unknown. ``before``: the codes of the rows before these."""
    if before is not None and event[0] == GAP:
        before[-1] = GAP
    event[np.flatnonzero((event[1:] == GAP) & (event[:-1] != GAP))] = GAP


def about_recording(recording: Recording) -> dict[str, Any]:
    """The log of a table: source and SHA-256, the clock time of its first row (``start``) and of its time 0 (``time_zero``) where
    it says them, and the profile that it was read by (a list, of several)."""
    about: dict[str, Any] = {"source": recording.source, "sha256": recording.sha256}
    zero = recording.clock_zero
    if zero is not None:
        about |= {"start": clock_text(zero + float(recording.time[0])), "time_zero": clock_text(zero)}
    if recording.profiles:
        profiles = [dict(profile) for profile in recording.profiles]
        about["profile"] = profiles[0] if len(profiles) == 1 else profiles
    return about


def about_run(estimator: TractionEstimator, recording: dict[str, Any], *, smooth: bool) -> dict[str, Any]:
    """What the table was made from, ready for JSON."""
    from terragrip import __version__

    about = {
        "version": __version__,
        "method": estimator.method,
        "smooth": smooth,
        "vehicle": estimator.vehicle.to_dict(),
        "recording": recording,
        "settings": {
            "noise": estimator.noise,
            "held": estimator.held,
            "gap": estimator.thresholds.gap,
            "standstill_speed": estimator.engine.standstill_speed,
        },
    }
    if estimator.slip_reference is not None:
        about["zero_slip"] = {
            wheel: {"ratio": zero.ratio, "std": zero.std, "windows": zero.windows, "doubt": zero.doubt}
            for wheel, zero in estimator.slip_reference.zero.items()
        }
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain


def notes_of(estimator: TractionEstimator, recording: Recording) -> tuple[str, ...]:
    """Sentences of the reader, on units that are likely wrong, and on what the estimator had to assume."""
    notes = [*recording.notes, *unit_warnings(recording, estimator.vehicle)]
    guessed = [name for name in estimator.guessed if name in recording.channels]
    if guessed:
        shown = ", ".join(f"{name} ({estimator.noise[name]:.3g})" for name in guessed)
        notes.append(f"The noise of {shown} is a guess from the vehicle's size: give it under 'sensors'.")
    if estimator.slip_reference is not None:
        notes = [note for note in notes if not note.startswith("There is no drawbar_force")]
        notes += estimator.slip_reference.notes
    return tuple(dict.fromkeys(notes))

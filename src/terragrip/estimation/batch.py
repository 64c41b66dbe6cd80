"""A whole recording at once."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.methods import DEFAULT, SLIP_ONLY, method_named
from terragrip.estimation.rims import speeds_alone
from terragrip.estimation.slip_only import against_travel
from terragrip.recording import Recording, unit_warnings

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]
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
    check(log, vehicle)
    if smooth and not method_named(method).can_smooth:
        raise InputError(
            f"the method {method} cannot smooth", mend="take another method, or leave out smooth"
        )
    estimator = TractionEstimator.for_recording(
        log, vehicle, method, sensors=sensors, held=held, gap=gap, standstill_speed=standstill_speed
    )
    if smooth:
        from terragrip.estimation.smoothing import run_smoothed

        return run_smoothed(estimator, log, progress)
    return run(estimator, log, progress)


def check(log: Recording, vehicle: Vehicle) -> None:
    """Raise InputError unless the log fits the vehicle; one without torque is looked at rim by rim instead."""
    if not speeds_alone(log.channels, vehicle):
        log.check_against(vehicle)


def run(
    estimator: TractionEstimator, recording: Recording, progress: Progress | None = None, *, flag: bool = True
) -> Estimates:
    """All rows of the recording through the estimator as it stands; ``flag`` also flags rows before gaps."""
    time, columns = prepared(estimator, recording)
    out = table_of(estimator.columns, len(time))
    event = np.empty(len(time), dtype=np.uint8)
    estimator.engine.run(time, columns, out, event, progress)
    if flag:
        flag_before_gaps(event)
    return finished(estimator, recording, out, event, smooth=False)


def prepared(estimator: TractionEstimator, recording: Recording) -> tuple[Floats, dict[str, Floats]]:
    """Time and those channels that the estimator looks at, each contiguous."""
    wanted = estimator.engine.slots_in
    columns = {
        name: np.ascontiguousarray(values) for name, values in recording.channels.items() if name in wanted
    }
    return np.ascontiguousarray(recording.time), columns


def table_of(names: tuple[str, ...], rows: int) -> dict[str, Floats]:
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
    event: npt.NDArray[np.uint8],
    *,
    smooth: bool,
) -> Estimates:
    """Estimates from the kernel's columns, with what is passed on and notes."""
    own = () if estimator.method != SLIP_ONLY.name else ("drawbar_force",)
    for name in (*own, *_PASSED_ON, *recording.references):
        if name in recording.channels:
            out[name] = recording.channels[name]
    labels = dict(recording.labels)
    about = about_run(estimator, recording.source, recording.sha256, smooth=smooth)
    notes = [*recording.notes, *unit_warnings(recording, estimator.vehicle), *notes_of(estimator, recording)]
    if estimator.found is not None:
        notes = [note for note in notes if not note.startswith("There is no drawbar_force")]
        wheels = {rim.wheel: out[f"wheel_speed_{rim.wheel}"] for rim in estimator.rims}
        notes += [*estimator.found.notes, *against_travel(out["ground_speed"], wheels)]
    return Estimates(recording.time, out, event, labels, about, tuple(dict.fromkeys(notes)))


def flag_before_gaps(event: npt.NDArray[np.uint8]) -> None:
    """Flag the row before each gap too: it is the last one before the unknown."""
    before = np.flatnonzero((event[1:] == GAP) & (event[:-1] != GAP))
    event[before] = GAP


def about_run(
    estimator: TractionEstimator, source: str | None, sha256: str | None, *, smooth: bool
) -> dict[str, Any]:
    """What the table was made from, ready for JSON."""
    from terragrip import __version__

    about = {
        "version": __version__,
        "method": estimator.method,
        "smooth": smooth,
        "vehicle": estimator.vehicle.to_dict(),
        "recording": {"source": source, "sha256": sha256},
        "settings": {
            "noise": estimator.noise,
            "held": estimator.held,
            "gap": estimator.thresholds.gap,
            "standstill_speed": estimator.thresholds.standstill_speed,
        },
    }
    if estimator.found is not None:
        about["zero_slip"] = {
            wheel: {"ratio": zero.ratio, "std": zero.std, "windows": zero.windows, "doubt": zero.doubt}
            for wheel, zero in estimator.found.zero.items()
        }
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain


def notes_of(estimator: TractionEstimator, recording: Recording) -> list[str]:
    """Sentences on what the estimator had to assume."""
    guessed = [name for name in estimator.guessed if name in recording.channels]
    if not guessed:
        return []
    shown = ", ".join(f"{name} ({estimator.noise[name]:.3g})" for name in guessed)
    return [f"The noise of {shown} is a guess from the vehicle's size: give it under 'sensors'."]

"""A log with the engine's torque in place of wheel torques: estimated block by block as a machine of driven wheels, then completed."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from terragrip.estimation.driveline import DRIVEN, DrivenMachine
from terragrip.estimation.engine_torque import TAIL, DrivelineTorque
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.slip_only import WHAT_IS_MISSING, slip_reference_in
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.lag import delay_of, lag_within
from terragrip.recording.plain_units import size_warnings
from terragrip.recording.plausibility import warnings_by_check
from terragrip.recording.survey import first_speeds, joined
from terragrip.vehicle import Vehicle

_LEAPS = f"drive_torque_{DRIVEN} leaps"
_ITS_ZERO = "its zero moved, or the signal was lost."
_BY_WHEEL = ("sides", "exchanged wheels", "turn rate", "turn rate at rest")
"""Checks whose mistakes the mean of the driven wheels no longer shows."""
_STARTS = "In starts and stops the drive torques"
"""What these say of the mass is not so: where the ratio changes rows have no torque, and in the rest the engine's inertia counts more."""
_TAKEN = "a PTO, a pump or a brake took another part of the engine's, or the signal was lost."


class ByEngine:
    """A log and a vehicle whose driven wheels are one; its estimates are made by the estimator as of any machine, then `completed`."""

    def __init__(self, whole: Recording, original: Vehicle) -> None:
        reference = slip_reference_in(whole, original)
        if whole.delay is None:
            whole = replace(whole, delay=delay_of(lag_within(*first_speeds([whole]))))
        self._whole = whole
        self.machine = DrivenMachine.of_log(whole, original, reference)
        beside = tuple(note for note in reference.notes if note != WHAT_IS_MISSING)
        by_wheel = [n for notes in warnings_by_check(whole, original, _BY_WHEEL).values() for n in notes]
        self.notes = (*size_warnings(original), *by_wheel, *self.machine.notes, *beside)
        self._waiting: deque[DrivelineTorque] = deque()

    def log(self, log: LogBlocks) -> LogBlocks:
        """The log as that of the machine of driven wheels."""

        def blocks() -> Iterator[Recording]:
            self._waiting.clear()
            tail = None
            for block in log.blocks():
                whole = block if tail is None else joined([tail, block], block)
                converted, drive = self._converted(whole, len(whole) - len(block))
                self._waiting.append(drive)
                yield converted
                tail = _tail(whole)

        return LogBlocks(log.rows, blocks, lambda: self._converted(self._whole, 0)[0], log.from_disk)

    def completed(self, parts: Iterator[Estimates]) -> Iterator[Estimates]:
        """Estimates of that machine, widened by the uncertainty of the driveline's losses; NaN where no torque is known."""
        for part in parts:
            std = self._waiting.popleft().std
            columns = {**part.columns, **self.machine.completed(part.columns, std)}
            none = ~np.isfinite(std) & part.during("push")  # no torque shows that the wheels pull
            columns = {name: values for name, values in columns.items() if self.machine.shows(name)}
            about = {**part.about, "driveline": self.machine.to_dict()}
            notes = (
                note.replace(_ITS_ZERO, _TAKEN) if note.startswith(_LEAPS) else note
                for note in part.notes
                if not (note.startswith(_STARTS) or (self.machine.unknown_pto and note.startswith(_LEAPS)))
            )
            yield replace(
                part,
                columns=columns,
                event_codes=np.where(none, np.uint8(0), part.event_codes),
                about=about,
                notes=tuple(dict.fromkeys((*notes, *self.notes))),
            )

    def _converted(self, log: Recording, before: int) -> tuple[Recording, DrivelineTorque]:
        """The rows of a log from ``before`` on as those of the machine of driven wheels, and the driveline's torque in them."""
        channels, drive = self.machine.converted(log.time, log.channels, before)
        return replace(log.select(slice(before, None)), channels=channels, delay=self._whole.delay), drive


def _tail(block: Recording) -> Recording:
    """The last rows of a block, on which those behind it depend."""
    return block.select(np.arange(np.searchsorted(block.time, block.time[-1] - TAIL), len(block)))

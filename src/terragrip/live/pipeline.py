"""From samples to what goes out: order and estimator (`Core`), then the record, where there is one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from terragrip.live.core import Core
from terragrip.live.outputs import Event, Output, Values
from terragrip.live.record import ROWS, SECONDS, Recorder


class Pipeline:
    """`process`, `tick`, `note` and `flush` as `Core` has them, their inputs and outputs kept in a record.

    A record that cannot be written ends with an event, not the run; ``failure`` then tells why. Arguments and errors are those of
    `Recorder`; ``folder`` None: no record is kept.
    """

    def __init__(
        self,
        core: Core,
        folder: Path | None = None,
        *,
        rows: int = ROWS,
        seconds: float = SECONDS,
        thread: Executor | None = None,
    ) -> None:
        self.recorder = (
            None if folder is None else Recorder(folder, core, rows=rows, seconds=seconds, thread=thread)
        )
        self.core = core if self.recorder is None else self.recorder.core
        self.opening: list[Output] = [] if self.recorder is None else self.recorder.opening
        self.failure: str | None = None

    def process(self, arrival: float, source: int, stamp: float, values: Values) -> list[Output]:
        """See `Core.process`."""
        outputs = self.core.process(arrival, source, stamp, values)
        return self._kept(outputs, "S", (arrival, source, stamp, values))

    def tick(self, now: float) -> list[Output]:
        """See `Core.tick`; nothing, and nothing recorded, where it would do nothing."""
        until = self.waiting_until
        if until is None or now < until:
            return []
        return self._kept(self.core.tick(now), "T", now)

    @property
    def waiting_until(self) -> float | None:
        """When a row that waits goes on at the latest, as an arrival [s]; None where none waits."""
        pending = self.core.reorder.pending
        return pending[0].arrival + self.core.settings.window if pending else None

    def note(self, note: dict[str, Any]) -> list[Output]:
        """See `Core.note`."""
        return self._kept(self.core.note(note), "N", note)

    def flush(self) -> list[Output]:
        """See `Core.flush`."""
        return self._kept(self.core.flush(), "F", None)

    def _kept(self, outputs: list[Output], kind: str, content: Any) -> list[Output]:
        return self._recorded(outputs, lambda recorder: recorder.keep(outputs, kind, content))

    def write(self) -> list[Output]:
        """Hand what came in to the system, after which a kill cannot lose it."""
        return self._recorded([], Recorder.write)

    def sync(self) -> list[Output]:
        """Have it put on the disk."""
        return self._recorded([], Recorder.sync)

    def close(self) -> None:
        """Close the record whole."""
        if self.recorder is None:
            return
        try:
            self.recorder.close()
        except OSError as error:
            self.failure = f"the record's last segment could not be closed ({error.strerror or error})"

    def abandon(self) -> None:
        """Let go of the record, with what came in so far, after a failure that is not the record's."""
        if self.recorder is not None:
            with contextlib.suppress(OSError):
                self.recorder.write()
            self.recorder.abandon()
            self.recorder = None

    def _recorded(self, outputs: list[Output], keep: Callable[[Recorder], None]) -> list[Output]:
        """Record it; where that is not possible, say so and go on without."""
        if self.recorder is None:
            return outputs
        try:
            keep(self.recorder)
        except OSError as error:
            self.failure = f"the record stopped at {self.core.when} ({error.strerror or error})"
            self.recorder.abandon()
            self.recorder = None
            return [*outputs, Event(self.core.time, "record_failed", "record", self.failure)]
        return outputs

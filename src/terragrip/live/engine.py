"""What turns samples into rows: the core, and its record where there is one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from terragrip.live.core import Core, Output, Values
from terragrip.live.event import Event
from terragrip.live.record import Recorder


class LiveEngine:
    """`take`, `tick`, `note` and `flush` as `Core` has them; a record that cannot be written ends with an event, not the run.

    ``failure``: why it could not be written.
    """

    def __init__(self, core: Core, recorder: Recorder | None) -> None:
        self._core, self._recorder = core, recorder
        self._taker: Core | Recorder = core if recorder is None else recorder
        self.failure: str | None = None

    @property
    def core(self) -> Core:
        """What estimates."""
        return self._core

    def take(self, arrival: float, source: int, stamp: float, values: Values) -> list[Output]:
        """See `Core.take`."""
        return self._safely(self._taker.take, arrival, source, stamp, values)

    def tick(self, now: float) -> list[Output]:
        """See `Core.tick`; nothing where it would do nothing."""
        if not self._core.due(now):
            return []
        return self._safely(self._taker.tick, now)

    @property
    def waiting_until(self) -> float | None:
        """When a row that waits goes on at the latest, as an arrival [s]; None where none waits."""
        pending = self._core.reorder.pending
        return pending[0].arrival + self._core.settings.window if pending else None

    def note(self, note: dict[str, Any]) -> list[Output]:
        """See `Core.note`."""
        return self._safely(self._taker.note, note)

    def flush(self) -> list[Output]:
        """See `Core.flush`."""
        return self._safely(self._taker.flush)

    def write(self) -> list[Output]:
        """Hand what came in to the system (`Recorder.write`)."""
        return [] if self._recorder is None else self._safely(self._recorder.write)

    def sync(self) -> list[Output]:
        """Have it put on the disk (`Recorder.sync`)."""
        return [] if self._recorder is None else self._safely(self._recorder.sync)

    def close(self) -> None:
        """Close the record whole."""
        if self._recorder is None:
            return
        try:
            self._recorder.close()
        except OSError as error:
            self.failure = f"the record's last segment could not be closed ({error.strerror or error})"

    def _safely(self, act: Callable[..., list[Output] | None], *arguments: Any) -> list[Output]:
        """Do it; where the record cannot be written, say so and go on without."""
        try:
            return act(*arguments) or []
        except OSError as error:
            return self._without_record(error)

    def _without_record(self, error: OSError) -> list[Output]:
        assert self._recorder is not None
        self.failure = f"the record stopped at {self._core.time:.6g} s ({error.strerror or error})"
        self._recorder.abandon()
        self._recorder, self._taker = None, self._core
        return [Event(self._core.time, "record_failed", "record", self.failure)]

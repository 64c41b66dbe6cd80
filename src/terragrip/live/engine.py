"""What turns samples into rows: the core, its record where there is one, and the express way past both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from terragrip.live.block import Block
from terragrip.live.core import Core, Output, Row, Values
from terragrip.live.event import Event
from terragrip.live.express import Express
from terragrip.live.feed import Feed
from terragrip.live.record import Recorder


class LiveEngine:
    """`take`, `tick`, `note` and `flush` as `Core` has them; a record that cannot be written ends with an event, not the run.

    ``failure``: why it could not be written. `allow_express` gives rows a shorter way; then ``passed`` is told of them, with
    what else they brought, and ``core`` and all methods see them as taken.
    """

    def __init__(self, core: Core, recorder: Recorder | None) -> None:
        self._core, self._recorder = core, recorder
        self._taker: Core | Recorder = core if recorder is None else recorder
        self._express: Express | None = None
        self._passed: Callable[[Block, list[Output]], None] = lambda block, outputs: None
        self.failure: str | None = None

    @property
    def core(self) -> Core:
        """The core, with all rows taken."""
        self.settle()
        return self._core

    def allow_express(
        self, feed: Feed, publish: Callable[[Row], None], passed: Callable[[Block, list[Output]], None]
    ) -> None:
        """Let messages of the only source be estimated by `express`; ``publish`` is given their rows."""
        self._express, self._passed = Express(self._core, feed, publish), passed

    def express(self, message: bytes) -> bool:
        """Estimate and publish a message's sample; False, and none estimated, where it must go the ordinary way."""
        if self._express is None or not self._express.take(message):
            return False
        if self._express.is_full:
            self.settle()
        return True

    def settle(self) -> None:
        """Have core and record take the rows of `express`."""
        block = None if self._express is None else self._express.drained()
        if block is not None:
            self._passed(block, self._safely(self._taker.passed, block))

    def take(self, arrival: float, source: int, stamp: float, values: Values) -> list[Output]:
        """See `Core.take`."""
        self.settle()
        return self._safely(self._taker.take, arrival, source, stamp, values)

    def tick(self, now: float) -> list[Output]:
        """See `Core.tick`; nothing where it would do nothing."""
        if not self._core.due(now):
            return []
        self.settle()
        return self._safely(self._taker.tick, now)

    @property
    def waiting_until(self) -> float | None:
        """When a row that waits goes on at the latest, as an arrival [s]; None where none waits, as behind rows of `express`."""
        pending = self._core.reorder.pending
        return pending[0].arrival + self._core.settings.window if pending else None

    def note(self, note: dict[str, Any]) -> list[Output]:
        """See `Core.note`."""
        self.settle()
        return self._safely(self._taker.note, note)

    def flush(self) -> list[Output]:
        """See `Core.flush`."""
        self.settle()
        return self._safely(self._taker.flush)

    def write(self) -> list[Output]:
        """Hand what came in to the system (`Recorder.write`)."""
        self.settle()
        return [] if self._recorder is None else self._safely(self._recorder.write)

    def sync(self) -> list[Output]:
        """Have it put on the disk (`Recorder.sync`)."""
        return [] if self._recorder is None else self._safely(self._recorder.sync)

    def close(self) -> None:
        """Close the record whole."""
        try:
            self.settle()
        finally:
            self._close_record()

    def _close_record(self) -> None:
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

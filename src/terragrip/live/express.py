"""The express way: samples that are as expected go from message to estimate in one call of C; all else about them follows later.

At 100 Hz a sample costs what code it touches, since the processor's caches are cold by the time it comes
(docs/decisions/0088). So a message that has the members of those before it, in their order, all of them numbers, from a lone
source in good order, is parsed and estimated by `tg_express_take` and published. Clocks, counts and record take it a few
rows later, together with the others that went this way. Anything unexpected changes nothing here and goes the ordinary way.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable

from terragrip._kernel import ffi, lib
from terragrip.estimation.estimator import Estimate, TractionEstimator
from terragrip.live.block import Block
from terragrip.live.clock import JUMP
from terragrip.live.core import Core, Row
from terragrip.live.feed import Feed
from terragrip.recording.schema import TIME

_ROOM = 32  # rows
_PATIENCE = 32  # messages refused one after another, after which their members are expected


class Express:
    """For the one source ``feed`` of a ``core`` that does not follow the ground; ``publish`` is given each row at once."""

    def __init__(self, core: Core, feed: Feed, publish: Callable[[Row], None]) -> None:
        self._core, self._feed, self._publish = core, feed, publish
        self._way = ffi.new("tg_express *", {"jump": JUMP, "room": _ROOM})
        self._names: tuple[str, ...] = ()  # the members that are expected
        self._open = False  # the way's bounds are those of the core as it is
        self._estimates: list[Estimate] = []
        self._told: list[float] = []
        self._refused = 0

    def take(self, message: bytes) -> bool:
        """Estimate and publish a message's sample; False, and none estimated, where it must go the ordinary way."""
        if self._open or self._opened():
            clock = self._feed.inbox.clock
            arrival = clock()
            if lib.tg_express_take(self._way, self._kernel, message, len(message), arrival):
                estimate = self._estimator.latest()
                self._estimates.append(estimate)
                self._told.append(clock())
                self._refused = 0
                self._publish(Row(arrival, {}, estimate))
                return True
        self._refused += 1
        if not self._refused % _PATIENCE and not self._estimates:
            self._expect(message)
        return False

    @property
    def is_full(self) -> bool:
        """Whether the rows that passed should be taken now: there is no more room, or the last one's event is another."""
        rows = self._estimates
        return bool(rows) and (self._way.taken >= self._way.room or rows[-1].event != self._core.event)

    def drained(self) -> Block | None:
        """The rows that have passed since the last call, for the core to take. The way is closed until it has."""
        self._open = False
        if not self._estimates:
            return None
        numbers = array("d", ffi.buffer(self._rows, 8 * len(self._estimates) * (1 + len(self._names)))[:])
        block = Block(0, self._channels, numbers, self._estimates, self._told)
        self._estimates, self._told = [], []
        return block

    def _expect(self, message: bytes) -> None:
        """Expect the members of a message that went the ordinary way."""
        names, estimator = self._feed.members(message), self._core.estimator
        if not names or not isinstance(estimator, TractionEstimator):
            return
        slots = estimator.engine.slots_in
        # Channels' names stand in JSON as they are (Decoder.is_sound).
        self._keys = ffi.new("char[]", b"".join(f'"{name}"\0'.encode() for name in names))
        self._slots = ffi.new(
            "int32_t[]",
            [lib.TG_EXPRESS_TIME if n == TIME else slots.get(n, lib.TG_EXPRESS_OTHER) for n in names],
        )
        self._rows = ffi.new("double[]", _ROOM * (1 + len(names)))
        self._sample = ffi.new("tg_sample *")
        for slot in range(lib.TG_SLOTS):
            self._sample.value[slot] = float("nan")
        way, engine = self._way, estimator.engine
        self._estimator, self._kernel = estimator, engine.handle
        way.members, way.keys, way.slots, way.rows = len(names), self._keys, self._slots, self._rows
        way.sample, way.estimate = self._sample, engine.estimate
        self._names, self._open = names, False
        self._channels = tuple(name for name in names if name != TIME)
        self._layout = frozenset(names)

    def _opened(self) -> bool:
        """Take the bounds of what is expected from the core; False where something waits, or is not yet known."""
        if not self._names or not self._feed.is_settled_on(self._layout):
            return False
        clock = self._core.clocks[0]
        bounds = self._core.reorder.steady(0, self._channels)
        if bounds is None or clock.offset is None or clock.waiting:
            return False
        way = self._way
        way.taken = 0
        way.offset, way.lead = clock.offset, clock.lead
        way.released = self._core.time
        way.calm, way.reach = bounds
        self._open = True
        return True

"""How long a source has been silent, against its own period."""

from __future__ import annotations

from collections import deque

from terragrip.live.feed import Feed

FLOOR = 0.5  # s; the pages' floor too (web/src/live/feed.ts)
_GAPS = 5


class Pulse:
    """The beat of one source, as it is looked at now and then.

    ``arrival`` [s]: when `update` last saw a new message. ``period`` [s]: the median of the last gaps between messages, so that one
    long silence does not become the measure; 0 before the second message.
    """

    def __init__(self, feed: Feed, now: float) -> None:
        self.feed, self.arrival, self.is_silent = feed, now, False
        self.messages = 0
        self._gaps: deque[float] = deque(maxlen=_GAPS)

    def update(self, now: float) -> bool:
        """Whether messages came since the last call."""
        messages = self._messages
        new, before = messages - self.messages, self.messages
        if not new:
            return False
        if before:
            self._gaps.append((now - self.arrival) / new)
        self.messages, self.arrival = messages, now
        return True

    @property
    def _messages(self) -> int:
        return self.feed.messages + self.feed.unreadable

    def why_old(self, now: float) -> str | None:
        """What is said where nothing came for twice the period, and `FLOOR`; None where something did."""
        silence, excuse = self.silence(now), self.feed.excuse_at(now)
        why = f": {excuse}" if excuse else ""
        if not self.has_begun:
            return f"nothing has come from {self.feed.name} yet{why}"
        old = silence > max(FLOOR, 2.0 * self.period)
        return f"nothing came from {self.feed.name} for {silence:.1f} s{why}" if old else None

    @property
    def period(self) -> float:
        """Usual time between two messages [s], of the last ones."""
        return sorted(self._gaps)[len(self._gaps) // 2] if self._gaps else 0.0

    @property
    def has_begun(self) -> bool:
        """Whether anything came at all."""
        return self._messages > 0

    def silence(self, now: float) -> float:
        """s since the last message, or since the start where none came."""
        return now - self.arrival if self._messages == self.messages else 0.0

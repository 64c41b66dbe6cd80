"""What was received, and what was not as it should be, by channel."""

from __future__ import annotations

from collections.abc import Iterable

FATES = ("received", "late", "doubled", "missing", "dropped", "unreadable", "clock")
"""received: came in. late: older than a row already estimated. doubled: the same instant twice. missing: a hole in a
regular stream. dropped: given up because estimates could not keep up. unreadable: no number. clock: stamp refused."""


class Counts:
    """Counters by channel and fate; plain integers, kept through a restart."""

    def __init__(self) -> None:
        self.by_channel: dict[str, dict[str, int]] = {}

    def add(self, fate: str, channels: Iterable[str], number: int = 1) -> None:
        """Count ``number`` more of ``fate`` (one of `FATES`) for each channel."""
        for name in channels:
            mine = self.by_channel.get(name)
            if mine is None:
                mine = self.by_channel[name] = dict.fromkeys(FATES, 0)
            mine[fate] += number

    def total(self, fate: str) -> int:
        """The sum over all channels."""
        return sum(mine[fate] for mine in self.by_channel.values())

    def state(self) -> dict[str, dict[str, int]]:
        """As JSON holds it."""
        return {name: dict(mine) for name, mine in self.by_channel.items()}

    @classmethod
    def from_state(cls, state: dict[str, dict[str, int]]) -> Counts:
        """The inverse of `state`."""
        result = cls()
        result.by_channel = {name: {**dict.fromkeys(FATES, 0), **mine} for name, mine in state.items()}
        return result

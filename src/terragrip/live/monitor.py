"""What a monitoring system asks the running service: is it alive, does it get data."""

from __future__ import annotations

from terragrip.live.pulse import FLOOR, Pulse
from terragrip.live.statistics import Statistics

LIVE, READY = "/health/live", "/health/ready"


class Monitor:
    """Answers by path. It reads `Statistics` and what these count; it counts nothing."""

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics

    def answer(self, path: str) -> tuple[int, str] | None:
        """HTTP status and text for a path; None where it is none of ours."""
        if path == LIVE:
            return 200, "alive\n"
        if path == READY:
            why = self.unready()
            return (200, "getting data\n") if why is None else (503, f"{why}\n")
        return None

    def unready(self) -> str | None:
        """Why the service has no data to give, in one line; None where it has.

        As the pages judge it, what is older than twice its period, and than half a second, is old. A replay keeps its own pace: there it is
        enough that a row came.
        """
        statistics = self._statistics
        now = statistics.now()
        if statistics.is_real_time:
            for pulse in statistics.pulses:
                why = _silent(pulse, now)
                if why is not None:
                    return why
        if not statistics.rows:
            return "no row has been estimated yet"
        if not statistics.is_real_time:
            return None
        age = now - statistics.last_row
        periods = (statistics.period, *(pulse.period for pulse in statistics.pulses))
        if age > max(FLOOR, 2.0 * max(periods)) + statistics.window:
            return f"messages come, but no row was estimated for {age:.1f} s"
        return None


def _silent(pulse: Pulse, now: float) -> str | None:
    silence = pulse.silence(now)
    if not pulse.has_begun:
        return f"nothing has come from {pulse.feed.name} yet"
    if silence > max(FLOOR, 2.0 * pulse.period):
        return f"nothing came from {pulse.feed.name} for {silence:.1f} s"
    return None

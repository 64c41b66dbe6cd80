"""What a monitoring system asks the running service: is it alive, does it get data."""

from __future__ import annotations

from collections.abc import Sequence

from terragrip.live.counts import FATES
from terragrip.live.inbox import Inbox
from terragrip.live.outbox import Outbox
from terragrip.live.pipeline import Pipeline
from terragrip.live.pulse import FLOOR, Pulse
from terragrip.live.statistics import Statistics
from terragrip.prometheus_text import METRICS, Metrics

LIVE, READY = "/health/live", "/health/ready"


class Monitor:
    """Answers by path. It reads `Statistics` and what these count; it counts nothing."""

    def __init__(
        self, statistics: Statistics, inbox: Inbox, outboxes: Sequence[Outbox], pipeline: Pipeline
    ) -> None:
        self._statistics, self._inbox, self._outboxes = statistics, inbox, outboxes
        self._pipeline = pipeline

    def answer(self, path: str) -> tuple[int, str] | None:
        """HTTP status and text for a path; None where it is none of ours."""
        if path == LIVE:
            return 200, "alive\n"
        if path == READY:
            why = self.unready()
            return (200, "getting data\n") if why is None else (503, f"{why}\n")
        if path == METRICS:
            return 200, self.metrics()
        return None

    def metrics(self) -> str:
        """Everything counted, as Prometheus reads it (docs/live.md)."""
        s, page = self._statistics, Metrics()
        core, recorder = self._pipeline.core, self._pipeline.recorder
        counter = "terragrip_live_{}_total".format
        page.add(
            "gauge", "terragrip_live_ready", "1 where /health/ready says so.", int(self.unready() is None)
        )
        page.add("counter", counter("samples"), "Samples processed by this process.", s.samples_in)
        by_channel = core.counts.by_channel
        page.add(
            "counter", counter("values"), "Values by channel and what became of them, restarts of a record included.",
            [({"channel": c, "fate": f}, by_channel[c][f]) for c in by_channel for f in FATES],
        )  # fmt: skip
        page.add("counter", counter("rows"), "Rows estimated by this process.", s.rows)
        page.add("counter", counter("rows_predicted"), "Rows predicted in silence.", s.predicted_rows)
        page.add(
            "counter", counter("filter_restarts"), "Rows at which the filter began anew.", s.filter_restarts
        )
        page.add("counter", counter("nis"), "Sum of NIS over rows.", s.nis)
        page.add("counter", counter("nis_expected"), "Sum of what NIS should be on average.", s.nis_expected)
        if s.is_real_time:
            page.add(
                "counter", counter("delay_seconds"), "Sum over rows of first sample to estimate.", s.delays
            )
        page.add("gauge", "terragrip_live_queue_samples", "Samples waiting.", len(self._inbox.samples))
        boxes = [({"sink": f"{k} {box.uri.name}"}, box) for k, box in enumerate(self._outboxes)]
        page.add(
            "gauge", "terragrip_live_sink_queue_messages", "Messages waiting for a sink.",
            [(label, len(box)) for label, box in boxes],
        )  # fmt: skip
        page.add("counter", counter("sink_sent"), "Messages to a sink.", [(n, b.sent) for n, b in boxes])
        lost = [(label, box.dropped) for label, box in boxes]
        page.add("counter", counter("sink_dropped"), "Messages that a sink was too slow for.", lost)
        kinds = [({"event": kind}, number) for kind, number in s.event_counts.items()]
        page.add("counter", counter("events"), "Events by name.", kinds)
        if recorder is not None:
            page.add("counter", counter("recorded_rows"), "Rows given to the record.", recorder.rows_kept)
        now = s.now()
        silences = [
            ({"source": f"{k} {pulse.feed.name}"}, pulse.silence(now)) for k, pulse in enumerate(s.pulses)
        ]
        page.add("gauge", "terragrip_live_source_silence_seconds", "Since a source's last message.", silences)
        return str(page)

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

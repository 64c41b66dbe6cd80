"""Answers to a monitoring system: is the service alive, does it get data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence

from terragrip.live.counts import FATES
from terragrip.live.feed import FLOOR
from terragrip.live.inbox import Inbox
from terragrip.live.outbox import Outbox
from terragrip.live.pipeline import Pipeline
from terragrip.live.statistics import Statistics
from terragrip.prometheus_text import METRICS, Labels, Metrics

Family = tuple[str, str, str, list[tuple[Labels, float]]]
"""Kind, name, help and samples of a metric."""
LIVE, READY = "/health/live", "/health/ready"


class Answers(ABC):
    """Answers by path."""

    def answer(self, path: str) -> tuple[int, str] | None:
        """HTTP status and text for a path; None where it is none of ours."""
        if path == LIVE:
            return 200, "alive\n"
        if path == METRICS:
            return 200, self.metrics()
        return self.ready(path.removeprefix(READY)) if path.startswith(READY) else None

    @abstractmethod
    def ready(self, path: str) -> tuple[int, str] | None:
        """Whether data come; ``path``: what stands behind `READY`."""

    @abstractmethod
    def metrics(self) -> str:
        """Everything counted, as Prometheus reads it (docs/live.md)."""


class Monitor(Answers):
    """Of one vehicle. It reads what others count; it counts nothing."""

    def __init__(
        self, statistics: Statistics, inbox: Inbox, outboxes: Sequence[Outbox], pipeline: Pipeline
    ) -> None:
        self._statistics, self._inbox, self._outboxes = statistics, inbox, outboxes
        self._pipeline = pipeline

    def ready(self, path: str) -> tuple[int, str] | None:
        """See `Answers`."""
        if path:
            return None
        why = self.unready()
        return (200, "getting data\n") if why is None else (503, f"{why}\n")

    def metrics(self) -> str:
        """See `Answers`."""
        page = Metrics()
        page.add(
            "gauge", "terragrip_live_ready", "1 if /health/ready answers 200.", int(self.unready() is None)
        )
        for kind, name, text, samples in self.families():
            page.add(kind, name, text, samples)
        add_sinks(page, self._outboxes)
        return str(page)

    def families(self, *, by_channel: bool = True) -> Iterator[Family]:
        """The numbers of one vehicle; values of all channels together unless ``by_channel``."""
        s, core, recorder = self._statistics, self._pipeline.core, self._pipeline.recorder

        def counter(name: str, text: str, value: float) -> Family:
            return "counter", f"terragrip_live_{name}_total", text, [({}, value)]

        yield counter("samples", "Samples processed by this process.", s.samples_in)
        values: list[tuple[Labels, float]] = [({"fate": fate}, core.counts.total(fate)) for fate in FATES]
        if by_channel:
            mine = core.counts.by_channel
            values = [({"channel": c, "fate": f}, mine[c][f]) for c in mine for f in FATES]
        text = "Values by channel and outcome, restarts of a record included."
        yield "counter", "terragrip_live_values_total", text, values
        yield counter("rows", "Rows estimated by this process.", s.rows)
        yield counter("rows_predicted", "Rows predicted in silence.", s.predicted_rows)
        yield counter("filter_restarts", "Rows at which the filter restarted.", s.filter_restarts)
        yield counter("nis", "Sum of NIS over rows.", s.nis)
        yield counter("nis_expected", "Sum of the expected NIS.", s.nis_expected)
        if s.is_real_time:
            yield counter("delay_seconds", "Sum over rows of first sample to estimate.", s.delays)
        waiting = len(self._inbox.samples)
        yield "gauge", "terragrip_live_queue_samples", "Samples waiting.", [({}, waiting)]
        kinds: list[tuple[Labels, float]] = [({"event": kind}, n) for kind, n in s.event_counts.items()]
        yield "counter", "terragrip_live_events_total", "Events by name.", kinds
        if recorder is not None:
            yield counter("recorded_rows", "Rows given to the record.", recorder.rows_kept)
        now, text = s.now(), "Since a source's last message."
        silences: list[tuple[Labels, float]] = [
            ({"source": f"{k} {feed.name}"}, feed.silence(now)) for k, feed in enumerate(s.feeds)
        ]
        yield "gauge", "terragrip_live_source_silence_seconds", text, silences

    def unready(self) -> str | None:
        """Why the service has no data to give, in one line; None where it has.

        As the pages judge it, what is older than twice its period, and than half a second, is old. A replay keeps its own pace: there it is
        enough that a row came.
        """
        statistics = self._statistics
        now = statistics.now()
        if statistics.is_real_time:
            for feed in statistics.feeds:
                why = feed.why_old(now)
                if why is not None:
                    return why
        if not statistics.rows:
            return "no row has been estimated yet"
        if not statistics.is_real_time:
            return None
        age = now - statistics.last_row
        periods = (statistics.period, *(feed.period for feed in statistics.feeds))
        if age > max(FLOOR, 2.0 * max(periods)) + statistics.window:
            return f"messages come, but no row was estimated for {age:.1f} s"
        return None


def add_sinks(page: Metrics, outboxes: Sequence[Outbox]) -> None:
    """The numbers of the sinks."""
    boxes = [({"sink": f"{k} {box.uri.name}"}, box) for k, box in enumerate(outboxes)]
    name = "terragrip_live_sink_{}".format
    waiting = [(label, len(box)) for label, box in boxes]
    page.add("gauge", name("queue_messages"), "Messages waiting for a sink.", waiting)
    page.add("counter", name("sent_total"), "Messages to a sink.", [(n, box.sent) for n, box in boxes])
    lost = [(label, box.dropped) for label, box in boxes]
    page.add("counter", name("dropped_total"), "Messages dropped because a sink was too slow.", lost)

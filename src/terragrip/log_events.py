"""The events that a running Terragrip logs: each has one name, and these are all (docs/live.md)."""

from __future__ import annotations

import logging
from typing import Any

LIVE = (
    "source_lost", "source_back", "channel_lost", "channel_back", "clock_jump", "clock_corrected", "late", "unreadable",
    "schema", "behind", "refused", "resumed", "sink_lost", "sink_back", "record_failed", "ground_change", "learned", "units",
    "contradiction", "immobilization", "stuck", "push",
)  # fmt: skip
"""Of the live service; sinks get these too (terragrip.live.outputs)."""
EVENTS = (
    *LIVE, "live_started", "live_stopped", "studio_started", "studio_stopped", "studio_write", "job_started", "job_ended",
    "fleet_started", "fleet_log_failed", "fleet_ended", "vehicle_started", "vehicle_refused", "vehicle_failed",
)  # fmt: skip


def emit(logger: logging.Logger, event: str, **fields: Any) -> None:
    """Log an event of `EVENTS` with its fields, none of them a secret or an address's options. Raises ValueError on another name."""
    if event not in EVENTS:
        raise ValueError(f"{event!r} is no event: add it to EVENTS")
    logger.info(event, extra=fields)

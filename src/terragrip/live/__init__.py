"""Live estimation: sources of samples, the same estimator as for logs, a record that survives a kill, and sinks."""

from __future__ import annotations

from terragrip.live.core import Core
from terragrip.live.outputs import Event, Row
from terragrip.live.pipeline import Pipeline
from terragrip.live.record_folder import read_record

__all__ = ["Core", "Event", "Pipeline", "Row", "read_record"]

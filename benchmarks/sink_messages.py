"""What `terragrip live` sends to a UDP sink, for the benchmarks that listen to one."""

from __future__ import annotations

import json
from typing import Any


def measured_row(data: bytes) -> dict[str, Any] | None:
    """The estimate of a row that was measured, as sent; None for a predicted one and for every other message."""
    if b'"predicted":false' not in data[:200]:  # most of the rest is not worth parsing at 1 kHz
        return None
    row: dict[str, Any] = json.loads(data)
    return row if row["kind"] == "estimate" else None

"""JSON schemas of the messages, for Foxglove and MCAP: traction estimate, ground change, soil, set-point of slip, event, status."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from terragrip.live.message import ESTIMATE, EVENT, GROUND, SETPOINT, SOIL, STATUS
from terragrip.log_events import LIVE

_NUMBER = {"type": ["number", "null"]}
_TEXT = {"type": "string"}
_COUNT = {"type": "integer"}
_TIME = {"type": ["number", "null"], "description": "s, on the samples' time base"}

NAMES = {
    ESTIMATE: "terragrip.TractionEstimate",
    GROUND: "terragrip.GroundChange",
    SOIL: "terragrip.Soil",
    EVENT: "terragrip.Event",
    SETPOINT: "terragrip.SlipSetpoint",
    STATUS: "terragrip.Status",
}


def schema_of(kind: str, columns: Iterable[str] = ()) -> dict[str, Any]:
    """The schema of a kind of message; of an estimate, with the vehicle's ``columns``."""
    own = dict.fromkeys(columns, _NUMBER) if kind == ESTIMATE else {}
    return {"title": NAMES[kind], "type": "object", "properties": _PROPERTIES[kind] | own}


_PROPERTIES: dict[str, dict[str, Any]] = {
    ESTIMATE: {
        "time": _TIME,
        "arrival": {"type": "number", "description": "s since 1970, of the row's first sample"},
        "event": _TEXT,
        "predicted": {"type": "boolean", "description": "nothing was measured: the filter predicted"},
    },
    GROUND: {"time": _TIME, "std": _NUMBER, "probability": _NUMBER},
    SOIL: {
        "time": _TIME,
        "soil": _TEXT,
        "probability": _NUMBER,
        "probabilities": {"type": "object", "additionalProperties": {"type": "number"}},
    },
    SETPOINT: {
        "time": _TIME,
        "state": {"type": "string", "enum": ["follow", "slow", "stop"]},
        "why": _TEXT,
        "slip": _NUMBER,
        "speed": _NUMBER,
        "wheel_speed": {
            "type": "object",
            "description": "rad/s by driven wheel; advice, not a command",
            "additionalProperties": {"type": "number"},
        },
    },
    EVENT: {"time": _TIME, "kind": {"type": "string", "enum": list(LIVE)}, "source": _TEXT, "text": _TEXT},
    STATUS: {
        "time": _TIME,
        "rows": _COUNT,
        "row_rate": _NUMBER,
        "sample_rate": _NUMBER,
        "delay": {"type": "number", "description": "s, mean, from a row's first sample to its estimate"},
        "silent": {"type": "array", "items": _TEXT, "description": "sources of which nothing came lately"},
        "waiting": _COUNT,
        "counts": {
            "type": "object",
            "description": "by channel: received, late, doubled, missing, dropped, …",
        },
        "events": {"type": "object", "additionalProperties": _COUNT},
        "sinks": {"type": "object"},
    },
}

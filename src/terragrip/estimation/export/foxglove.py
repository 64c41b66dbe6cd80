"""MCAP that Foxglove opens: estimates and events with JSON schemas, positions as foxglove.LocationFix."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.columns import column_named
from terragrip.estimation.export.about import about_texts
from terragrip.estimation.export.places import placed
from terragrip.estimation.export.rows_as_json import json_rows

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates

_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer", "minimum": 0},
                   "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999}},
}  # fmt: skip
LOCATION_FIX = {
    "title": "foxglove.LocationFix",
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "frame_id": {"type": "string"},
        "latitude": {"type": "number"},
        "longitude": {"type": "number"},
        "altitude": {"type": "number"},
        "position_covariance": {"type": "array", "items": {"type": "number"}, "minItems": 9, "maxItems": 9},
        "position_covariance_type": {"type": "integer", "minimum": 0, "maximum": 3},
    },
}
"""https://docs.foxglove.dev/docs/visualization/message-schemas/location-fix"""
LOG = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "level": {"type": "integer", "minimum": 0, "maximum": 5},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer", "minimum": 0},
    },
}
"""https://docs.foxglove.dev/docs/visualization/message-schemas/log"""
_INFO, _WARNING = 2, 3
_WARNED = ("immobilization", "stuck")
_NO_COVARIANCE = json.dumps({"position_covariance": [0.0] * 9, "position_covariance_type": 0})[1:]
_LATEST = (1 << 63) / 1e9  # s: what fits into nanoseconds


def estimate_schema(names: tuple[str, ...]) -> dict[str, Any]:
    """The JSON schema of a row with those columns."""
    properties: dict[str, Any] = {}
    for name in names:
        column = column_named(name)
        kind = "string" if not column.unit and column.description else ["number", "null"]
        properties[name] = {"type": kind, "description": column.label}
    return {"title": "terragrip.TractionEstimate", "type": "object", "properties": properties}


class McapFile:
    """Topics ``/terragrip/estimate`` (terragrip.TractionEstimate, a message a row), ``/terragrip/position`` (foxglove.LocationFix) where
    there are positions, ``/terragrip/event`` (foxglove.Log) where an event begins or ends; metadata ``terragrip``: what it was made from.

    Messages are stamped with clock time where the log has it, else with the log's own time from 0.
    """

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        from mcap.writer import Writer

        self._target, self._names = target, first.names
        self._zero = first.start.timestamp() if first.start is not None else max(0.0, -float(first.time[0]))
        self._stream = path.open("wb")
        self._writer = Writer(self._stream)
        self._writer.start(profile="", library="terragrip")
        self._writer.add_metadata("terragrip", {**about_texts(first), "notes": "\n".join(first.notes)})
        self._estimate = self._channel("estimate", estimate_schema(first.names))
        has_place = "latitude" in first and "longitude" in first
        self._position = self._channel("position", LOCATION_FIX) if has_place else None
        self._event = self._channel("event", LOG)
        self._last_event = ""

    def _channel(self, topic: str, schema: dict[str, Any]) -> int:
        text = json.dumps(schema, ensure_ascii=False).encode()
        number = self._writer.register_schema(schema["title"], "jsonschema", text)
        return self._writer.register_channel(f"/terragrip/{topic}", "json", number)

    def write(self, part: Estimates) -> None:
        """Write the messages of a part."""
        stamps = self._stamps(part)
        for when, text in zip(stamps.tolist(), json_rows(part, self._names), strict=True):
            self._send(self._estimate, when, text)
        if self._position is not None:
            self._write_positions(self._position, part)
        self._write_events(part, stamps)

    def _send(self, channel: int, when: int, text: str) -> None:
        self._writer.add_message(channel, log_time=when, data=text.encode(), publish_time=when)

    def _stamps(self, part: Estimates) -> Any:
        """Nanoseconds (n,) of each row's message."""
        wrong = [float(when) for when in part.time[[0, -1]] if not 0 <= when + self._zero < _LATEST]
        if wrong:
            raise InputError(
                f"a time of {wrong[0]:g} s cannot be the stamp of a message",
                file=self._target, hint="check the unit of the log's time in a profile",
            )  # fmt: skip
        return round(1e9 * self._zero) + np.round(1e9 * part.time).astype(np.int64)

    def _write_positions(self, channel: int, part: Estimates) -> None:
        part = placed(part)
        if not len(part):
            return
        altitude = part["altitude"] if "altitude" in part else np.full(len(part), np.nan)
        rows = zip(
            self._stamps(part).tolist(), part["latitude"].tolist(), part["longitude"].tolist(),
            altitude.tolist(), strict=True,
        )  # fmt: skip
        for when, latitude, longitude, height in rows:
            high = f'"altitude":{height!r},' if height == height else ""  # what is not known is left out
            place = f'"frame_id":"vehicle","latitude":{latitude!r},"longitude":{longitude!r},{high}'
            self._send(channel, when, f'{{"timestamp":{_time(when)},{place}{_NO_COVARIANCE}')

    def _write_events(self, part: Estimates, stamps: Any) -> None:
        events = part["event"]
        changed = np.flatnonzero(events != np.concatenate([[self._last_event], events[:-1]]))
        for row in changed.tolist():
            ended, begun, when = self._last_event, str(events[row]), int(stamps[row])
            words = [f"{ended} ends" if ended else "", f"{begun} begins" if begun else ""]
            data = {
                "level": _WARNING if begun in _WARNED else _INFO,
                "message": ", ".join(word for word in words if word),
                "name": "terragrip", "file": "", "line": 0,
            }  # fmt: skip
            self._send(self._event, when, f'{{"timestamp":{_time(when)},{json.dumps(data)[1:]}')
            self._last_event = begun

    def close(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def drop(self) -> None:
        """Close the stream."""
        self._stream.close()


def _time(when: int) -> str:
    return f'{{"sec":{when // 1_000_000_000},"nsec":{when % 1_000_000_000}}}'

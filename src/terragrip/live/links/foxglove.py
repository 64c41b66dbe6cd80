"""A WebSocket server for Foxglove, and the same messages in MCAP files, each kind with its JSON schema."""

from __future__ import annotations

import contextlib
import logging
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import unwritable
from terragrip.live.feed import Lost
from terragrip.live.message import ESTIMATE, EVENT, GROUND, SETPOINT, SOIL, STATUS, Message
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri, is_loopback
from terragrip.log_events import LIVE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from terragrip.vehicle import Vehicle

_FLUSH = 1.0  # s
_CHUNK = 1 << 16  # bytes: what a kill can cost a file
_SEGMENT = 600.0  # s in one MCAP file
_AGAIN = 30.0  # s until another is tried

NAMES = {
    ESTIMATE: "terragrip.TractionEstimate",
    GROUND: "terragrip.GroundChange",
    SOIL: "terragrip.Soil",
    EVENT: "terragrip.Event",
    SETPOINT: "terragrip.SlipSetpoint",
    STATUS: "terragrip.Status",
}

_NUMBER = {"type": ["number", "null"]}
_TEXT = {"type": "string"}
_COUNT = {"type": "integer"}
_NUMBERS = {"type": "object", "additionalProperties": {"type": "number"}}
_TIME = {"type": ["number", "null"], "description": "s, on the samples' time base"}

_PROPERTIES: dict[str, dict[str, Any]] = {
    ESTIMATE: {
        "time": _TIME,
        "arrival": {"type": "number", "description": "s since 1970, of the row's first sample"},
        "event": _TEXT,
        "predicted": {"type": "boolean", "description": "nothing was measured: the filter predicted"},
    },
    GROUND: {"time": _TIME, "std": _NUMBER, "probability": _NUMBER, "cause": _TEXT},
    SOIL: {
        "time": _TIME,
        "soil": _TEXT,
        "probability": _NUMBER,
        "probabilities": _NUMBERS,
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
        "learned": {
            "type": "object",
            "description": "by channel, of those that are learned: noise (SD, SI) and held (period of its updates, s)",
            "properties": {"noise": _NUMBERS, "held": _NUMBERS},
        },
    },
}


class FoxgloveSink:
    """``foxglove://127.0.0.1:8765?mcap=FOLDER``: topics /terragrip/estimate, /ground, /soil, /setpoint, /event, /status."""

    def __init__(self, uri: Uri, vehicle: Vehicle, columns: Sequence[str]) -> None:
        import foxglove

        logging.getLogger("foxglove.log_sink_set").setLevel(logging.ERROR)  # of a full disk: a line a message
        self.uri, self._vehicle = uri, vehicle
        if not is_loopback(uri.host):
            raise InputError(
                "Foxglove's protocol has no password", place=uri.text,
                hint="serve on 127.0.0.1, and connect by an SSH tunnel",
            )  # fmt: skip
        self._folder = Path(uri.options["mcap"]) if "mcap" in uri.options else None
        self._context = foxglove.Context()
        self._channels = {kind: self._channel(kind, columns) for kind in NAMES}
        self._writer: Any = None
        self._began = self._flushed = 0.0
        self._arrival = time.time()  # of the newest row: other messages are as old as that

    def _channel(self, kind: str, columns: Sequence[str]) -> Any:
        import json

        import foxglove

        data = json.dumps(schema_of(kind, columns)).encode()
        schema = foxglove.Schema(name=NAMES[kind], encoding="jsonschema", data=data)
        return foxglove.Channel(
            f"/terragrip/{kind}", schema=schema, message_encoding="json", context=self._context
        )

    async def run(self, outbox: Outbox) -> None:
        """Serve and record messages; raises Lost where the port is taken, InputError where the folder cannot be written."""
        import foxglove

        try:
            server = foxglove.start_server(
                name=f"Terragrip {self._vehicle.name}".strip(), host=self.uri.host, port=self.uri.port or 8765,
                context=self._context,
            )  # fmt: skip
        except (RuntimeError, OSError) as error:
            raise Lost(f"the server: {error}") from error
        try:
            outbox.connected()
            while True:
                self._log(await outbox.get(), outbox)
        finally:
            server.stop()
            try:
                self._close()
            except RuntimeError as error:  # the file ends as after a kill
                outbox.lost(f"the end of the MCAP could not be written, is the disk full? ({error})")

    def _log(self, message: Message, outbox: Outbox) -> None:
        if self._folder is not None:
            self._rotate(self._folder, outbox)
        if message.row is not None:
            self._arrival = message.row.arrival
        at = max(0, round(1e9 * self._arrival))
        self._channels[message.kind].log(message.json(outbox.columns), log_time=at)

    def _rotate(self, folder: Path, outbox: Outbox) -> None:
        """Open, flush or change the MCAP file as time goes; where the disk is full go on without, and try again later."""
        now = time.monotonic()
        try:
            if self._writer is not None and now - self._began > _SEGMENT:
                self._close()
            if self._writer is None and now >= self._began:
                self._open(folder)
                self._began = self._flushed = now
                outbox.connected()
            elif self._writer is not None and now - self._flushed > _FLUSH:
                self._writer.flush()
                self._flushed = now
        except (OSError, RuntimeError, ValueError) as error:
            if not self._began:
                raise unwritable(folder, error, "free space or choose another folder") from error
            self._began = now + _AGAIN
            with contextlib.suppress(RuntimeError):
                self._close()
            outbox.lost(f"no MCAP is written, is the disk full? ({error}); all else goes on")

    def _open(self, folder: Path) -> None:
        import foxglove
        from foxglove.mcap import MCAPWriteOptions

        folder.mkdir(parents=True, exist_ok=True)
        number = 1 + max((int(p.stem[10:]) for p in folder.glob("terragrip-??????.mcap")), default=0)
        self._writer = foxglove.open_mcap(
            folder / f"terragrip-{number:06d}.mcap",
            context=self._context,
            writer_options=MCAPWriteOptions(chunk_size=_CHUNK),
        )

    def _close(self) -> None:
        """Let go of the file; raises RuntimeError where its end cannot be written."""
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()


def schema_of(kind: str, columns: Iterable[str] = ()) -> dict[str, Any]:
    """The schema of a kind of message; of an estimate, with the vehicle's ``columns``."""
    own = dict.fromkeys(columns, _NUMBER) if kind == ESTIMATE else {}
    properties = {"kind": {"type": "string", "const": kind}} | _PROPERTIES[kind] | own
    return {"title": NAMES[kind], "type": "object", "properties": properties}

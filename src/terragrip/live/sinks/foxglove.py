"""A WebSocket server for Foxglove, and the same messages in MCAP files."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import unwritable
from terragrip.live.feed import Lost
from terragrip.live.message import Message
from terragrip.live.outbox import Outbox
from terragrip.live.schemas import NAMES, schema_of
from terragrip.live.uri import Uri, is_loopback

if TYPE_CHECKING:
    from collections.abc import Sequence

    from terragrip.vehicle import Vehicle

_FLUSH = 1.0  # s
_CHUNK = 1 << 16  # bytes: what a kill can cost a file
_SEGMENT = 600.0  # s in one MCAP file


class FoxgloveSink:
    """``foxglove://127.0.0.1:8765?mcap=FOLDER``: topics /terragrip/estimate, /ground, /soil, /setpoint, /event, /status."""

    def __init__(self, uri: Uri, vehicle: Vehicle, columns: Sequence[str]) -> None:
        import foxglove

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
            if self._writer is not None:
                self._writer.close()
                self._writer = None

    def _log(self, message: Message, outbox: Outbox) -> None:
        self._rotate()
        if message.row is not None:
            self._arrival = message.row.arrival
        at = max(0, round(1e9 * self._arrival))
        self._channels[message.kind].log(message.json(outbox.columns), log_time=at)

    def _rotate(self) -> None:
        """Open, flush or change the MCAP file as time goes."""
        if self._folder is None:
            return
        import foxglove
        from foxglove.mcap import MCAPWriteOptions

        now = time.monotonic()
        try:
            if self._writer is None or now - self._began > _SEGMENT:
                if self._writer is not None:
                    self._writer.close()
                self._folder.mkdir(parents=True, exist_ok=True)
                number = 1 + max(
                    (int(p.stem[10:]) for p in self._folder.glob("terragrip-??????.mcap")), default=0
                )
                self._writer = foxglove.open_mcap(
                    self._folder / f"terragrip-{number:06d}.mcap",
                    context=self._context,
                    writer_options=MCAPWriteOptions(chunk_size=_CHUNK),
                )
                self._began = self._flushed = now
            elif now - self._flushed > _FLUSH:
                self._writer.flush()
                self._flushed = now
        except (OSError, RuntimeError, ValueError) as error:
            self._writer = None
            raise unwritable(self._folder, error, "free space or choose another folder") from error

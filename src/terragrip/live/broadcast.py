"""Messages to any number of WebSocket clients, each with a queue of its own; the studio mounts this.

First comes a JSON text: ``{"kind": "hello", "version", "vehicle", "columns", "events"}``. Then JSON texts
``{"kind": "estimate", …}``, ``status``, ``soil``, ``ground``, ``setpoint``; the ``kind`` of an event is its own. A client that asks for
binary gets estimates as little-endian doubles: time [s], 1 if predicted, the place of the event in ``events``, then ``columns`` in order.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import AsyncGenerator, Sequence

from terragrip import __version__
from terragrip.estimation.columns import wheels_with
from terragrip.estimation.engine import EVENTS
from terragrip.live.message import ESTIMATE, EVENT, Message
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri

OPTIONS = ("rate", "columns", "format", "token")


class Broadcast:
    """``vehicle``: its name; ``columns``: those of the estimates to come. ``put`` queues a message for all; ``subscribe`` gives one
    client's frames.
    """

    def __init__(self, vehicle: str, columns: Sequence[str]) -> None:
        self._vehicle = vehicle
        self.columns = tuple(columns)
        self.wheels = wheels_with("slip", columns)
        self._clients: list[Outbox] = []

    def __len__(self) -> int:
        return len(self._clients)

    def put(self, message: Message) -> None:
        """Queue a message for each client."""
        for client in self._clients:
            client.put(message)

    async def subscribe(self, request: str = "/") -> AsyncGenerator[str | bytes]:
        """The frames for a client that asked for ``/?format=binary&rate=20&columns=slip_*``; raises InputError on any other."""
        uri = Uri.parse(f"studio://127.0.0.1{request}", {"studio": OPTIONS}, "sink")
        binary = uri.choice("format", ("json", "binary")) == "binary"
        client = Outbox(uri)
        every = list(self.columns)
        columns = every if client.columns is None else [n for n in every if client.columns.wants(n)]
        hello = {
            "kind": "hello", "version": __version__, "vehicle": self._vehicle, "columns": columns,
            "wheels": list(self.wheels), "events": list(EVENTS),
        }  # fmt: skip
        packer = struct.Struct(f"<{3 + len(columns)}d")
        self._clients.append(client)
        try:
            yield json.dumps(hello)
            while True:
                message = await client.get()
                row = message.row
                if binary and row is not None:
                    values, places = row.estimate.values, row.estimate.places
                    event = EVENTS.index(row.estimate.event)
                    numbers = (values[places[n]] if n in places else math.nan for n in columns)
                    yield packer.pack(row.estimate.time, row.predicted, event, *numbers)
                elif message.kind == EVENT:
                    yield message.json().decode()
                else:
                    yield _named(
                        message.kind, message.json(client.columns if message.kind == ESTIMATE else None)
                    )
        finally:
            self._clients.remove(client)


def _named(kind: str, data: bytes) -> str:
    """A JSON object with its kind in front."""
    return f'{{"kind":"{kind}",{data[1:].decode()}'

"""Estimates, events and the status under a key of Zenoh, as JSON."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from terragrip.live.feed import Lost
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri
from terragrip.live.zenoh_session import config, key_of, open_session

if TYPE_CHECKING:
    from collections.abc import Sequence

    from terragrip.vehicle import Vehicle


class ZenohSink:
    """``zenoh:terragrip?listen=tcp/127.0.0.1:7447``: to ``terragrip/estimate`` and so on."""

    def __init__(self, uri: Uri) -> None:
        self.uri = uri
        self.key = key_of(uri, "terragrip")
        config(uri)

    async def run(self, outbox: Outbox) -> None:
        """Put messages; raises Lost where Zenoh refuses."""
        import zenoh

        session = await asyncio.to_thread(open_session, self.uri)
        try:
            outbox.connected()
            while True:
                message = await outbox.get()
                session.put(
                    f"{self.key}/{message.kind}",
                    message.json(outbox.columns),
                    encoding=zenoh.Encoding.APPLICATION_JSON,
                )
        except zenoh.ZError as error:
            raise Lost(f"Zenoh: {error}") from error
        finally:
            await asyncio.to_thread(session.close)


def open_sink(uri: Uri, vehicle: Vehicle, columns: Sequence[str]) -> ZenohSink:
    """See `terragrip.live.sinks.open_sink`."""
    return ZenohSink(uri)

"""Estimates, events and the status under a key of Zenoh, as JSON."""

from __future__ import annotations

from terragrip.live.outbox import Outbox
from terragrip.live.topics import of_vehicle
from terragrip.live.uri import Uri
from terragrip.live.zenoh_session import config, key_of, session


class ZenohSink:
    """``zenoh:terragrip?listen=tcp/127.0.0.1:7447``: to ``terragrip/estimate`` and so on; ``{vehicle}`` as of MQTT."""

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.key = key_of(uri, "terragrip")
        config(uri)

    async def run(self, outbox: Outbox) -> None:
        """Put messages; raises Lost where Zenoh refuses."""
        import zenoh

        async with session(self.uri) as peer:
            outbox.connected()
            while True:
                message = await outbox.get()
                peer.put(
                    f"{of_vehicle(self.key, message.vehicle)}/{message.kind}",
                    message.json(outbox.columns),
                    encoding=zenoh.Encoding.APPLICATION_JSON,
                )

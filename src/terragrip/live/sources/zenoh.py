"""Key expressions of Zenoh: payloads as those of MQTT."""

from __future__ import annotations

import asyncio
from typing import Any

from terragrip.live.feed import Receiver
from terragrip.live.thread_bridge import ThreadBridge
from terragrip.live.uri import Uri
from terragrip.live.zenoh_session import config, key_of, session


class ZenohSource:
    """``zenoh:machine/**?connect=tcp/127.0.0.1:7447``."""

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.key = key_of(uri, "machine/**")
        config(uri)

    async def run(self, feed: Receiver) -> None:
        """Feed samples; raises Lost where the other side is not there. Zenoh itself connects again later."""
        bridge = ThreadBridge(feed)

        def received(sample: Any) -> None:  # in a thread of Zenoh's
            data, topic = bytes(sample.payload), str(sample.key_expr)
            bridge.call(lambda: feed.message(data, topic=topic))

        async with session(self.uri) as peer:
            peer.declare_subscriber(self.key, received)
            feed.connected()
            await asyncio.Event().wait()

"""Key expressions of Zenoh: payloads in as those of MQTT; estimates, events and the status out as JSON."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from terragrip.errors import InputError
from terragrip.live.feed import Lost, Receiver
from terragrip.live.outbox import Outbox
from terragrip.live.thread_bridge import ThreadBridge
from terragrip.live.topics import of_vehicle
from terragrip.live.uri import Uri, is_loopback


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


@asynccontextmanager
async def session(uri: Uri) -> AsyncIterator[Any]:
    """A peer that connects to ``connect`` and listens on ``listen`` (``tcp/127.0.0.1:7447``); it looks for others with ``scout=1``.

    By itself it neither listens nor looks beyond this machine. Raises Lost where the other side is not there, or refuses.
    """
    import zenoh

    try:
        opened = await asyncio.to_thread(zenoh.open, config(uri))
        try:
            yield opened
        finally:
            await asyncio.to_thread(opened.close)
    except zenoh.ZError as error:
        raise Lost(f"Zenoh: {' '.join(str(error).split())[:160]}") from error


def config(uri: Uri) -> Any:
    """The session's configuration; raises InputError on an endpoint that is none."""
    import zenoh

    result = zenoh.Config()
    ends = {name: [e for e in uri.options.get(name, "").split(",") if e] for name in ("connect", "listen")}
    for end in ends["listen"]:
        host = end.partition("/")[2].rpartition(":")[0].strip("[]")
        if not is_loopback(host):
            raise InputError(
                f"anyone could connect to {end}",
                place=uri.text,
                hint="listen on tcp/127.0.0.1:7447, or connect to a router",
            )
    scout = uri.choice("scout", ("0", "1"))
    try:
        result.insert_json5("mode", '"peer"')
        result.insert_json5("scouting/multicast/enabled", "true" if scout == "1" else "false")
        result.insert_json5("connect/endpoints", json.dumps(ends["connect"]))
        result.insert_json5("listen/endpoints", json.dumps(ends["listen"]))
        if ends["connect"]:
            result.insert_json5("connect/timeout_ms", "2000")
            result.insert_json5("connect/exit_on_failure", "true")
    except zenoh.ZError as error:
        raise InputError(
            "has no endpoint", place=uri.text, hint="write connect=tcp/127.0.0.1:7447"
        ) from error
    return result


def key_of(uri: Uri, where: str) -> str:
    """The key expression of a URI; raises InputError if it is none."""
    import zenoh

    try:
        return str(zenoh.KeyExpr(uri.path.strip("/")))
    except zenoh.ZError as error:
        raise InputError(
            f"{uri.path!r} is not a key expression", place=uri.text, hint=f"write zenoh:{where}"
        ) from error

"""The session of a Zenoh source or sink."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from terragrip.errors import InputError
from terragrip.live.feed import Lost
from terragrip.live.uri import Uri, is_loopback


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

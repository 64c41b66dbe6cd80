"""The CAN bus of a source or sink, by python-can."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from importlib.util import find_spec
from typing import Any

from terragrip.errors import InputError, missing_package
from terragrip.live.feed import Lost
from terragrip.live.uri import Uri

INTERFACES = ("socketcan", "vector", "virtual", "pcan", "kvaser", "slcan", "ixxat", "udp_multicast")


def check(uri: Uri) -> str:
    """The interface's name; raises InputError on a missing channel or an unknown interface."""
    _python_can()
    if not uri.path:
        raise InputError("names no channel", place=uri.text, hint="write can:can0")
    interface = uri.choice("interface", INTERFACES)
    if interface == "udp_multicast" and find_spec("msgpack") is None:
        raise missing_package("msgpack", "live", "use udp_multicast", place=uri.text)
    return interface


@asynccontextmanager
async def bus_of(uri: Uri) -> AsyncIterator[Any]:
    """The bus of ``can:can0?interface=socketcan&bitrate=250000``; raises Lost where it is not there or goes away."""
    can = _python_can()
    options: dict[str, Any] = {"interface": check(uri), "channel": uri.path}
    if "bitrate" in uri.options:
        options["bitrate"] = round(uri.number("bitrate", 250_000))
    try:
        bus = await asyncio.to_thread(can.Bus, **options)
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
        raise Lost(f"the bus: {' '.join(str(error).split())[:160]}") from error
    try:
        yield bus
    except (can.CanError, OSError) as error:
        raise Lost(f"the bus: {error}") from error
    finally:
        bus.shutdown()


def _python_can() -> Any:
    with _without("asammdf"):
        import can
    return can


@contextmanager
def _without(package: str) -> Iterator[None]:
    """python-can imports asammdf where it is installed, for a log format: 85 MB and 0.6 s that a live bus does not need."""
    if "can" in sys.modules or package in sys.modules:
        yield
        return
    sys.modules[package] = None  # type: ignore[assignment]  # makes its import fail
    try:
        yield
    finally:
        del sys.modules[package]

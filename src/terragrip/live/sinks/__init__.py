"""Where estimates and events go. Each sink has a module, which loads when its URI is opened."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

from terragrip.live.outbox import Outbox
from terragrip.live.sources import packages_of
from terragrip.live.uri import Uri

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

_HOMES: dict[str, str] = {
    "udp": "udp.UdpSink", "mqtt": "mqtt.MqttSink", "mqtts": "mqtt.MqttSink", "zenoh": "zenoh.ZenohSink",
    "foxglove": "foxglove.FoxgloveSink", "studio": "studio.StudioSink", "can": "can.CanSink", "ros2": "ros2.Ros2Sink",
}  # fmt: skip
"""Module and class of each scheme; the class is called with the URI, the vehicle and the estimates' columns."""
_ALL = ("rate", "columns")
OPTIONS: dict[str, Collection[str]] = {
    "udp": (*_ALL, "format"),
    "mqtt": (*_ALL, "qos", "client"),
    "mqtts": (*_ALL, "qos", "client", "ca"),
    "zenoh": (*_ALL, "connect", "listen", "scout"),
    "foxglove": (*_ALL, "mcap"),
    "studio": _ALL,
    "can": (*_ALL, "interface", "bitrate"),
    "ros2": (*_ALL, "domain", "connect", "listen", "scout"),
}


class Sink(Protocol):
    """A taker of messages."""

    async def run(self, outbox: Outbox) -> None:
        """Take messages for ever; raises Lost where the other side went away."""


def open_sink(text: str, vehicle: Vehicle | None, columns: Sequence[str]) -> tuple[Uri, Sink]:
    """The sink of a URI for estimates of these columns; ``vehicle`` None: of many. Raises InputError if it names none, or the package
    it needs is missing.
    """
    uri = Uri.parse(text, OPTIONS, "sink")
    with packages_of(uri):
        module, name = _HOMES[uri.scheme].split(".")
        sink: Sink = getattr(import_module(f"{__name__}.{module}"), name)(uri, vehicle, columns)
    return uri, sink

"""Where samples come from and where estimates go, by URI: a module a transport, which loads when its URI is opened."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from terragrip.errors import missing_package
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Receiver
from terragrip.live.outbox import Outbox
from terragrip.live.uri import Uri

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

_Links = dict[str, tuple[str, Collection[str]]]
_ZENOH, _BUS = ("connect", "listen", "scout"), ("interface", "bitrate")
_SOURCES: _Links = {
    "udp": ("udp.UdpSource", ("allow",)),
    "replay": ("replay.ReplaySource", ("speed",)),
    "mqtt": ("mqtt.MqttSource", ("qos", "client")),
    "mqtts": ("mqtt.MqttSource", ("qos", "client", "ca")),
    "serial": ("serial.SerialSource", ("baud",)),
    "can": ("can.CanSource", (*_BUS, "dbc")),
    "ros2": ("ros2.Ros2Source", ("domain", *_ZENOH)),
    "zenoh": ("zenoh.ZenohSource", _ZENOH),
}
"""Of each scheme the module and class, which is called with the URI and the decoder of its profile, and the URI's options."""
_ALL = ("rate", "columns")
_SINKS: _Links = {
    "udp": ("udp.UdpSink", (*_ALL, "format")),
    "mqtt": ("mqtt.MqttSink", (*_ALL, "qos", "client")),
    "mqtts": ("mqtt.MqttSink", (*_ALL, "qos", "client", "ca")),
    "zenoh": ("zenoh.ZenohSink", (*_ALL, *_ZENOH)),
    "foxglove": ("foxglove.FoxgloveSink", (*_ALL, "mcap")),
    "studio": ("studio.StudioSink", _ALL),
    "can": ("can.CanSink", (*_ALL, *_BUS)),
    "ros2": ("ros2.Ros2Sink", (*_ALL, "domain", *_ZENOH)),
}
"""Likewise; called with the URI, the vehicle and the estimates' columns."""


class Source(Protocol):
    """A source of messages.

    ``real_time``: samples come when they come, and silence means something; a replay waits for the estimator.
    """

    real_time: bool

    async def run(self, feed: Feed) -> None:
        """Feed messages until there are no more; raises Lost where the other side went away, InputError for good."""


class TopicSource(Protocol):
    """A source whose messages have a topic: MQTT and Zenoh."""

    async def run(self, feed: Receiver) -> None:
        """As of `Source`."""


class Sink(Protocol):
    """A taker of messages."""

    async def run(self, outbox: Outbox) -> None:
        """Take messages for ever; raises Lost where the other side went away."""


def open_source(text: str, decoder: Decoder) -> tuple[Uri, Source]:
    """The source of a URI; raises InputError if it names none, or the package it needs is missing."""
    return _opened(text, _SOURCES, "source", decoder)


def open_sink(text: str, vehicle: Vehicle | None, columns: Sequence[str]) -> tuple[Uri, Sink]:
    """The sink of a URI for estimates of these columns; ``vehicle`` None: of many. Raises InputError as `open_source`."""
    return _opened(text, _SINKS, "sink", vehicle, columns)


def _opened(text: str, links: _Links, role: str, *arguments: Any) -> tuple[Uri, Any]:
    uri = Uri.parse(text, {scheme: options for scheme, (_, options) in links.items()}, role)
    module, name = links[uri.scheme][0].split(".")
    try:
        return uri, getattr(import_module(f"{__name__}.{module}"), name)(uri, *arguments)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] == "terragrip":
            raise
        raise missing_package(error.name or "", "live", place=uri.text) from error

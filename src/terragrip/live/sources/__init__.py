"""Where samples come from. Each source has a module, which loads when its URI is opened."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Protocol

from terragrip.errors import missing_package
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Receiver
from terragrip.live.uri import Uri

_HOMES: dict[str, str] = {
    "udp": "udp.UdpSource", "replay": "replay.ReplaySource", "mqtt": "mqtt.MqttSource", "mqtts": "mqtt.MqttSource",
    "serial": "serial.SerialSource", "zenoh": "zenoh.ZenohSource", "can": "can.CanSource", "ros2": "ros2.Ros2Source",
}  # fmt: skip
"""Module and class of each scheme; the class is called with the URI and the decoder of its profile."""
OPTIONS: dict[str, Collection[str]] = {
    "udp": ("allow",),
    "replay": ("speed",),
    "mqtt": ("qos", "client"),
    "mqtts": ("qos", "client", "ca"),
    "serial": ("baud",),
    "can": ("interface", "bitrate", "dbc"),
    "ros2": ("domain", "connect", "listen", "scout"),
    "zenoh": ("connect", "listen", "scout"),
}


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


def open_source(text: str, decoder: Decoder) -> tuple[Uri, Source]:
    """The source of a URI; raises InputError if it names none, or the package it needs is missing."""
    uri = Uri.parse(text, OPTIONS, "source")
    with packages_of(uri):
        module, name = _HOMES[uri.scheme].split(".")
        source: Source = getattr(import_module(f"{__name__}.{module}"), name)(uri, decoder)
    return uri, source


@contextmanager
def packages_of(uri: Uri) -> Iterator[None]:
    """Raise InputError naming the extra where a package that a source or sink needs is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] == "terragrip":
            raise
        raise missing_package(error.name or "", "live", place=uri.text) from error

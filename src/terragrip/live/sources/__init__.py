"""Where samples come from. Each source has a module, which loads when its URI is opened."""

from __future__ import annotations

from typing import Protocol

from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Receiver
from terragrip.live.uri import Links, Uri, opened

_LINKS: Links = {
    "udp": ("udp.UdpSource", ("allow",)),
    "replay": ("replay.ReplaySource", ("speed",)),
    "mqtt": ("mqtt.MqttSource", ("qos", "client")),
    "mqtts": ("mqtt.MqttSource", ("qos", "client", "ca")),
    "serial": ("serial.SerialSource", ("baud",)),
    "can": ("can.CanSource", ("interface", "bitrate", "dbc")),
    "ros2": ("ros2.Ros2Source", ("domain", "connect", "listen", "scout")),
    "zenoh": ("zenoh.ZenohSource", ("connect", "listen", "scout")),
}
"""Of each scheme the module and class, which is called with the URI and the decoder of its profile, and the URI's options."""


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
    return opened(text, _LINKS, "source", __name__, decoder)

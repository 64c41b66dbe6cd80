"""Where estimates and events go. Each sink has a module, which loads when its URI is opened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from terragrip.live.outbox import Outbox
from terragrip.live.uri import Links, Uri, opened

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

_ALL = ("rate", "columns")
_LINKS: Links = {
    "udp": ("udp.UdpSink", (*_ALL, "format")),
    "mqtt": ("mqtt.MqttSink", (*_ALL, "qos", "client")),
    "mqtts": ("mqtt.MqttSink", (*_ALL, "qos", "client", "ca")),
    "zenoh": ("zenoh.ZenohSink", (*_ALL, "connect", "listen", "scout")),
    "foxglove": ("foxglove.FoxgloveSink", (*_ALL, "mcap")),
    "studio": ("studio.StudioSink", _ALL),
    "can": ("can.CanSink", (*_ALL, "interface", "bitrate")),
    "ros2": ("ros2.Ros2Sink", (*_ALL, "domain", "connect", "listen", "scout")),
}
"""Of each scheme the module and class, which is called with the URI, the vehicle and the estimates' columns, and the URI's options."""


class Sink(Protocol):
    """A taker of messages."""

    async def run(self, outbox: Outbox) -> None:
        """Take messages for ever; raises Lost where the other side went away."""


def open_sink(text: str, vehicle: Vehicle | None, columns: Sequence[str]) -> tuple[Uri, Sink]:
    """The sink of a URI for estimates of these columns; ``vehicle`` None: of many. Raises InputError if it names none, or the package
    it needs is missing.
    """
    return opened(text, _LINKS, "sink", __name__, vehicle, columns)

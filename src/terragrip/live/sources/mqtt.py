"""Topics of an MQTT broker: JSON objects, packed numbers by the profile's payload, or one number a topic."""

from __future__ import annotations

from terragrip.live.feed import Receiver
from terragrip.live.mqtt_client import Connection, check, quality
from terragrip.live.uri import Uri


class MqttSource:
    """``mqtt://HOST/machine/+``. A field is ``name``, or ``topic/name`` where the profile says so; a bare number is ``topic``."""

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri, wild=True)

    async def run(self, feed: Receiver) -> None:
        """Feed messages; raises Lost where the broker refuses or goes away."""
        async with Connection(self.uri, lambda topic, data: feed.message(data, topic=topic)) as broker:
            await broker.subscribe(self.uri.path, self.qos)
            feed.connected()
            await broker.ended()

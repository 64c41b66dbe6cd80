"""Topics of an MQTT broker: JSON objects, packed numbers by the profile's payload, or one number a topic."""

from __future__ import annotations

from terragrip.live.feed import Lost, Receiver
from terragrip.live.mqtt_client import check, client, quality
from terragrip.live.uri import Uri


class MqttSource:
    """``mqtt://HOST/machine/+``. A field is ``name``, or ``topic/name`` where the profile says so; a bare number is ``topic``."""

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri)

    async def run(self, feed: Receiver) -> None:
        """Feed messages; raises Lost where the broker refuses or goes away."""
        import aiomqtt

        try:
            async with client(self.uri) as broker:
                await broker.subscribe(self.uri.path, qos=self.qos)
                feed.connected()
                async for message in broker.messages:
                    payload = message.payload
                    data = payload if isinstance(payload, bytes) else str(payload).encode()
                    feed.message(data, topic=message.topic.value)
        except aiomqtt.MqttError as error:
            raise Lost(f"the broker: {error}") from error
        except OSError as error:  # TLS failures come through as they are
            raise Lost(f"the broker: {error.strerror or error}") from error

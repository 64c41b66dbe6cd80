"""Estimates, events and the status to topics of an MQTT broker, as JSON."""

from __future__ import annotations

from terragrip.live.feed import Lost
from terragrip.live.mqtt_client import check, client, quality
from terragrip.live.outbox import Outbox
from terragrip.live.topics import of_vehicle
from terragrip.live.uri import Uri


class MqttSink:
    """``mqtt://HOST/terragrip``: to ``terragrip/estimate``, ``terragrip/event``, ``/status``, ``/soil``, ``/ground`` and ``/setpoint``.

    ``{vehicle}`` in the topic stands for the name of a message's vehicle.
    """

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri)

    async def run(self, outbox: Outbox) -> None:
        """Publish messages; raises Lost where the broker refuses or goes away."""
        import aiomqtt

        prefix = self.uri.path.rstrip("/")
        try:
            async with client(self.uri) as broker:
                outbox.connected()
                while True:
                    message = await outbox.get()
                    topic = f"{of_vehicle(prefix, message.vehicle)}/{message.kind}"
                    await broker.publish(topic, message.json(outbox.columns), qos=self.qos)
        except aiomqtt.MqttError as error:
            raise Lost(f"the broker: {error}") from error
        except OSError as error:
            raise Lost(f"the broker: {error.strerror or error}") from error

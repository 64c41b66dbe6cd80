"""Estimates, events and the status to topics of an MQTT broker, as JSON."""

from __future__ import annotations

from collections import deque

from terragrip.live.mqtt_client import Connection, check, quality
from terragrip.live.outbox import Outbox
from terragrip.live.topics import of_vehicle
from terragrip.live.uri import Uri

_AT_ONCE = 64  # messages before others have their turn


class MqttSink:
    """``mqtt://HOST/terragrip``: to ``terragrip/estimate``, ``terragrip/event``, ``/status``, ``/soil``, ``/ground`` and ``/setpoint``.

    ``{vehicle}`` in the topic stands for the name of a message's vehicle.
    """

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri)
        self._again: deque[tuple[str, bytes]] = deque()  # what no broker acknowledged

    async def run(self, outbox: Outbox) -> None:
        """Publish messages; raises Lost where the broker refuses or goes away."""
        prefix, sent = self.uri.path.rstrip("/"), 0
        async with Connection(self.uri) as broker:
            outbox.connected()
            try:
                while True:
                    if self._again:
                        topic, data = self._again.popleft()
                    else:
                        message = await outbox.get()
                        topic = f"{of_vehicle(prefix, message.vehicle)}/{message.kind}"
                        data = message.json(outbox.columns)
                    broker.publish(topic, data, self.qos)
                    sent += 1
                    if not broker.has_room or not sent % _AT_ONCE:
                        await broker.room()
            finally:
                self._again.extendleft(reversed(broker.unacknowledged.values()))

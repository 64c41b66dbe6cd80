"""Estimates, events and the status to topics of ROS 2, as std_msgs/String with JSON: by rclpy where sourced, else by Zenoh."""

from __future__ import annotations

import secrets
import struct
import time
from typing import Any

from terragrip.errors import InputError
from terragrip.live.feed import Lost
from terragrip.live.message import Message
from terragrip.live.outbox import Outbox
from terragrip.live.ros2_messages import STRING, STRING_HASH, dds_name, domain_of, has_rclpy
from terragrip.live.uri import Uri


class Ros2Sink:
    """``ros2:/terragrip``: to ``/terragrip/estimate``, ``/terragrip/event`` and so on."""

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.domain = domain_of(uri)
        self.name = uri.path.strip("/")
        if not self.name:
            raise InputError("names no topic", place=uri.text, hint="write ros2:/terragrip")
        self.by_rclpy = has_rclpy()
        if not self.by_rclpy:
            from terragrip.live.zenoh_session import config

            config(uri)

    async def run(self, outbox: Outbox) -> None:
        """Publish messages; raises Lost where the other side is not there."""
        await (self._by_rclpy if self.by_rclpy else self._by_zenoh)(outbox)

    async def _by_zenoh(self, outbox: Outbox) -> None:
        from terragrip.live.zenoh_session import session

        sender, number = secrets.token_bytes(16), 0
        async with session(self.uri) as peer:
            outbox.connected()
            while True:
                message = await outbox.get()
                number += 1
                # What rmw_zenoh reads beside a message: its number, when it was sent, and by whom.
                beside = struct.pack("<qq", number, time.time_ns()) + bytes([16]) + sender
                key = f"{self.domain}/{self.name}/{message.kind}/{dds_name(STRING)}/{STRING_HASH}"
                peer.put(key, cdr_string(message.json(outbox.columns)), attachment=beside)

    async def _by_rclpy(self, outbox: Outbox) -> None:
        import rclpy
        from rclpy.context import Context
        from std_msgs.msg import String

        context = Context()
        rclpy.init(context=context, domain_id=self.domain)
        node = rclpy.create_node("terragrip_live_out", context=context)
        publishers: dict[str, Any] = {}

        def publish(message: Message) -> None:
            if message.kind not in publishers:
                publishers[message.kind] = node.create_publisher(String, f"/{self.name}/{message.kind}", 10)
            publishers[message.kind].publish(String(data=message.json(outbox.columns).decode()))

        try:
            outbox.connected()
            while True:
                publish(await outbox.get())
        except RuntimeError as error:
            raise Lost(f"ROS 2: {error}") from error
        finally:
            node.destroy_node()
            rclpy.shutdown(context=context)


def cdr_string(text: bytes) -> bytes:
    """A std_msgs/String in CDR, little-endian: encapsulation, length with the NUL, text, NUL."""
    return struct.pack("<BBHI", 0, 1, 0, len(text) + 1) + text + b"\0"

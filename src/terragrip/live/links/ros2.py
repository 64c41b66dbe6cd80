"""Topics of ROS 2: by rclpy where a ROS 2 installation is sourced, else by Zenoh as rmw_zenoh or a bridge puts them there.

The keys are those of rmw_zenoh: ``DOMAIN/TOPIC/TYPE/HASH``, the type as DDS writes it (``sensor_msgs::msg::dds_::JointState_``).
Messages are read and written in CDR; estimates, events and the status go out as std_msgs/String with JSON.
"""

from __future__ import annotations

import asyncio
import importlib.util
import re
import secrets
import struct
import threading
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from terragrip.errors import InputError
from terragrip.formats.boundary import DAMAGE
from terragrip.formats.messages import Decode
from terragrip.formats.ros_types import Types
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Lost
from terragrip.live.links.zenoh import config, session
from terragrip.live.message import Message
from terragrip.live.outbox import Outbox
from terragrip.live.payload import Fields, Unreadable
from terragrip.live.thread_bridge import ThreadBridge
from terragrip.live.uri import Uri

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
_NAMES = 10_000  # of fields, of which it is kept whether they are wanted
_DDS = re.compile(r"^(\w+)::(\w+)::dds_::(\w+)_$")
_SEARCH = 1.0  # s between searches for topics that nobody publishes yet

Receive = Callable[[str, str, bytes], None]


class Ros2Source:
    """``ros2:/joint_states,/odom``; for a Zenoh bridge, whose keys hold no type, ``/odom:nav_msgs/msg/Odometry``."""

    real_time = True

    def __init__(self, uri: Uri, decoder: Decoder) -> None:
        self.uri, self._decoder = uri, decoder
        self.domain = domain_of(uri)
        parts = [part.partition(":") for part in uri.path.split(",") if part]
        self.topics = {name: kind for name, _, kind in parts}
        if not parts or not all(name.startswith("/") for name in self.topics):
            raise InputError("names no topic", place=uri.text, hint="write ros2:/joint_states,/odom")
        self.by_rclpy = has_rclpy()
        if not self.by_rclpy:
            config(uri)

    async def run(self, feed: Feed) -> None:
        """Feed messages; raises Lost where the other side is not there."""
        bridge, reader = ThreadBridge(feed), Reader(self._decoder)
        feed.one_layout = False

        def feed_message(topic: str, kind: str, data: bytes) -> None:
            try:
                fields = reader.fields(topic, kind, data)
            except Unreadable as error:
                feed.reject(f"{error} on {topic}")
                return
            if fields:
                feed.fields(fields)

        def received(topic: str, kind: str, data: bytes) -> None:  # in another thread
            bridge.call(feed_message, topic, kind, data)

        await (self._by_rclpy if self.by_rclpy else self._by_zenoh)(feed, received)

    async def _by_zenoh(self, feed: Feed, received: Receive) -> None:
        async with session(self.uri) as peer:
            for topic, kind in self.topics.items():
                peer.declare_subscriber(f"{self.domain}{topic}/*/*", self._typed(topic, received))
                if kind:
                    peer.declare_subscriber(
                        topic.strip("/"),
                        lambda sample, t=topic, k=kind: received(t, k, bytes(sample.payload)),
                    )
            feed.connected()
            await asyncio.Event().wait()

    def _typed(self, topic: str, received: Receive) -> Callable[[Any], None]:
        def listen(sample: Any) -> None:
            kind = ros_name(str(sample.key_expr).split("/")[-2])
            if kind is not None:
                received(topic, kind, bytes(sample.payload))

        return listen

    async def _by_rclpy(self, feed: Feed, received: Receive) -> None:
        """Raw subscriptions, so that messages are read the same way on both paths."""
        done = threading.Event()

        def spin() -> None:
            import rclpy
            from rclpy.context import Context
            from rclpy.executors import SingleThreadedExecutor
            from rclpy.qos import qos_profile_sensor_data
            from rosidl_runtime_py.utilities import get_message

            context = Context()
            rclpy.init(context=context, domain_id=self.domain)
            node = rclpy.create_node("terragrip_live", context=context)
            executor = SingleThreadedExecutor(context=context)
            executor.add_node(node)
            missing = dict(self.topics)
            try:
                while not done.is_set():
                    types = dict(node.get_topic_names_and_types())
                    for topic in [name for name in missing if name in types]:
                        kind = missing.pop(topic) or types[topic][0]
                        node.create_subscription(
                            get_message(kind), topic, lambda data, t=topic, k=kind: received(t, k, bytes(data)),
                            qos_profile_sensor_data, raw=True,
                        )  # fmt: skip
                    executor.spin_once(timeout_sec=_SEARCH if missing else 0.2)
            finally:
                node.destroy_node()
                rclpy.shutdown(context=context)

        feed.connected()
        try:
            await asyncio.to_thread(spin)
        except RuntimeError as error:
            raise Lost(f"ROS 2: {error}") from error
        finally:
            done.set()


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
            config(uri)

    async def run(self, outbox: Outbox) -> None:
        """Publish messages; raises Lost where the other side is not there."""
        await (self._by_rclpy if self.by_rclpy else self._by_zenoh)(outbox)

    async def _by_zenoh(self, outbox: Outbox) -> None:
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


def has_rclpy() -> bool:
    """Whether a ROS 2 installation is sourced."""
    return importlib.util.find_spec("rclpy") is not None


def domain_of(uri: Uri) -> int:
    """The ROS domain; raises InputError if it is none."""
    text = uri.options.get("domain", "0")
    if not text.isdigit() or int(text) > 232:
        raise InputError(f"domain is {text!r}", place=uri.text, hint="give a number from 0 to 232")
    return int(text)


def dds_name(kind: str) -> str:
    """``sensor_msgs::msg::dds_::JointState_`` for ``sensor_msgs/msg/JointState``."""
    package, part, name = kind.split("/")
    return f"{package}::{part}::dds_::{name}_"


def ros_name(kind: str) -> str | None:
    """The inverse of `dds_name`; None for anything else."""
    match = _DDS.match(kind)
    return None if match is None else "/".join(match.groups())


class Reader:
    """CDR messages into fields by topic and field, ``/odom.twist.twist.linear.x``, as `tg.read` names those of a bag."""

    def __init__(self, decoder: Decoder) -> None:
        self._types = Types("LATEST")
        self._wants = lru_cache(_NAMES)(decoder.wants) if decoder.profile is not None else lambda name: True
        self._decoders: dict[tuple[str, str], Decode] = {}

    def fields(self, topic: str, kind: str, data: bytes) -> Fields:
        """The fields, and ``time`` from the header's stamp; raises Unreadable."""
        if not self._types.knows(kind):
            raise Unreadable(f"of the type {kind}, which does not come with ROS 2")
        if (topic, kind) not in self._decoders:
            self._decoders[topic, kind] = self._types.decoder(kind, topic, one=False)
        try:
            stamp, every = self._decoders[topic, kind](data)
        except DAMAGE:
            raise Unreadable(f"not a {kind}") from None
        fields = {name: value for name, value in every.items() if self._wants(name)}
        return {**fields, "time": stamp} if stamp and fields else fields

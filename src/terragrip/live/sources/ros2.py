"""Topics of ROS 2: by rclpy where a ROS 2 installation is sourced, else by Zenoh as rmw_zenoh or a bridge puts them there."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

from terragrip.errors import InputError
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Lost
from terragrip.live.payload import Unreadable
from terragrip.live.ros2_messages import Reader, domain_of, has_rclpy, ros_name
from terragrip.live.thread_bridge import ThreadBridge
from terragrip.live.uri import Uri

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
            from terragrip.live.zenoh_session import config

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
        from terragrip.live.zenoh_session import session

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

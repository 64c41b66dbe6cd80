"""What source and sink share of ROS 2: names of topics and types in Zenoh's keys, and messages in CDR.

The keys are those of rmw_zenoh: ``DOMAIN/TOPIC/TYPE/HASH``, the type as DDS writes it
(``sensor_msgs::msg::dds_::JointState_``).
"""

from __future__ import annotations

import importlib.util
import re

from terragrip.errors import InputError
from terragrip.formats.messages import Topic
from terragrip.formats.ros_types import Types, bag_topic
from terragrip.live.decode import Decoder
from terragrip.live.payload import Fields, Unreadable
from terragrip.live.uri import Uri

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
_DDS = re.compile(r"^(\w+)::(\w+)::dds_::(\w+)_$")


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
        self._wanted = decoder.wants if decoder.profile is not None else None
        self._topics: dict[str, Topic] = {}

    def fields(self, topic: str, kind: str, data: bytes) -> Fields:
        """The fields, and ``time`` from the header's stamp; raises Unreadable."""
        try:
            self._types.fields(kind)
        except KeyError:
            raise Unreadable(f"of the type {kind}, which does not come with ROS 2") from None
        reader = bag_topic(topic, self._wanted, self._topics)
        result = reader.fields(data, self._types.form(kind, one=False))
        if result is None:
            raise Unreadable(f"not a {kind}")
        stamp, fields = result
        return {**fields, "time": stamp} if stamp == stamp and fields else fields

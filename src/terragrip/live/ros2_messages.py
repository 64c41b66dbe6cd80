"""What source and sink share of ROS 2: names of topics and types in Zenoh's keys, and messages in CDR.

The keys are those of rmw_zenoh: ``DOMAIN/TOPIC/TYPE/HASH``, the type as DDS writes it
(``sensor_msgs::msg::dds_::JointState_``).
"""

from __future__ import annotations

import importlib.util
import re
from functools import lru_cache

from terragrip.errors import InputError
from terragrip.formats.boundary import DAMAGE
from terragrip.formats.messages import Decode
from terragrip.formats.ros_types import Types
from terragrip.live.decode import Decoder
from terragrip.live.payload import Fields, Unreadable
from terragrip.live.uri import Uri

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
_NAMES = 10_000  # of fields, of which it is kept whether they are wanted
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

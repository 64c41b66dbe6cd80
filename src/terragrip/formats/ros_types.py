"""Messages of ROS by the types that a log defines, else by those that come with ROS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from terragrip.formats.boundary import DAMAGE, needed
from terragrip.formats.messages import Topic
from terragrip.formats.ros_layout import Serialised
from terragrip.formats.ros_topic import RosTopic
from terragrip.formats.table import Wanted

_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST_MESSAGE = 1 << 28  # bytes that one may unpack to


class Types:
    """Message types of one log, from the definitions that it holds, else from those that come with ROS.

    ``unknown`` types, and those whose definition cannot be read, are named in `notes`.
    """

    def __init__(self, base: str) -> None:
        self._typesys = needed("rosbags.typesys", "a ROS message")
        self._base = base
        self._own: dict[str, Any] = {}
        self._common: Any = None
        self.unknown: dict[str, None] = {}
        self._forms: dict[tuple[str, bool], Serialised] = {}

    def learn(self, name: str, definition: str, language: str) -> str:
        """Take a type's definition (``msg`` or ``idl``); returns the name that it goes by."""
        name = name if name.count("/") != 1 else name.replace("/", "/msg/")
        if name in self._own or not definition.strip():
            return name
        try:
            read = self._typesys.get_types_from_idl if language == "idl" else self._typesys.get_types_from_msg
            result = read(definition) if language == "idl" else read(definition, name)
            store = self._typesys.get_typestore(self._typesys.Stores.EMPTY)
            given = {k: v for k, v in result.items() if k not in store.fielddefs}
            base = self._known()
            lacking = {k: v for k, v in base.fielddefs.items() if k not in given and k not in store.fielddefs}
            store.register({**lacking, **given} if _refers_out(given) else given)
            self._own[name] = store
        except (*DAMAGE, self._typesys.TypesysError):
            self.unknown[name] = None
        return name

    def fields(self, name: str) -> Any:
        """rosbags' descriptions of a type's fields, and of the types in it; raises KeyError if there are none."""
        defined = self._own.get(name, self._known()).fielddefs
        if name not in defined:
            self.unknown[name] = None
            raise KeyError(name)
        return defined

    def form(self, name: str, *, one: bool) -> Serialised:
        """How messages of a type are read; ``one``: they are serialised by ROS 1."""
        return self._forms.setdefault((name, one), Serialised(name, one, lambda: self.fields(name)))

    def notes(self) -> list[str]:
        """A sentence on the types that are unknown."""
        if not self.unknown:
            return []
        return [
            f"The log does not describe these message types, which were left out: {', '.join(self.unknown)}."
        ]

    def _known(self) -> Any:
        if self._common is None:
            self._common = self._typesys.get_typestore(self._typesys.Stores[self._base])
        return self._common


def _refers_out(definitions: dict[str, Any]) -> bool:
    """Whether types name others that are not among them (rosbags writes a name as ``(Nodetype.NAME, name)``)."""
    known = {*definitions, "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}

    def named(node: Any) -> Iterator[str]:
        kind, content = node
        if int(kind) == 2:
            yield content
        elif int(kind) in (3, 4):
            yield from named(content[0])

    return any(
        name not in known for _, fields in definitions.values() for _, node in fields for name in named(node)
    )


def bag_topic(name: str, wanted: Wanted | None, topics: dict[str, Topic]) -> RosTopic:
    """The topic of a bag of this name, of several connections the same one."""
    result = topics.setdefault(f"ros {name}", RosTopic(name, wanted=wanted))
    assert isinstance(result, RosTopic)
    return result


def unpacked(raw: bytes) -> bytes:
    """A message of ROS 2 that may be packed by zstd on its own (rosbag2's compression mode MESSAGE); unpackable ones as they are.

    CDR never begins as zstd does, so that no metadata are needed to tell.
    """
    if not raw.startswith(_ZSTD):
        return raw
    zstandard = needed("zstandard", "a ROS 2 bag with packed messages")
    try:
        return bytes(zstandard.ZstdDecompressor().decompress(raw, max_output_size=_LARGEST_MESSAGE))
    except zstandard.ZstdError:
        return raw  # which no message is: its topic counts it

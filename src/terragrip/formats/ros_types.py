"""Messages of ROS, by rosbags: by the types that a log defines, else by those that come with ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from operator import attrgetter
from typing import Any

from terragrip.formats.boundary import DAMAGE, needed
from terragrip.formats.messages import Decode, flat, kept

_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST_MESSAGE = 1 << 28  # bytes that one may unpack to
_CDR = (b"\0\0", b"\0\1")  # how a message of ROS 2 begins: big and little endian
_NAME = 2  # kind of a field's description in rosbags: a message
_INSTANT = ({"sec", "nanosec"}, {"sec", "nsec"})  # fields of a time or a duration


class Types:
    """Message types of one log, from the definitions that it holds, else from those that come with ROS.

    ``unknown`` types, and those whose definition cannot be read, are named in `notes`.
    """

    def __init__(self, base: str) -> None:
        self._typesys, self._serde = (
            needed(f"rosbags.{part}", "a ROS message") for part in ("typesys", "serde")
        )
        self._base = base
        self._own: dict[str, Any] = {}
        self._common: Any = None
        self.unknown: dict[str, None] = {}

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

    def knows(self, name: str) -> bool:
        """Whether a type is defined; if not, `notes` name it."""
        if name in self._own.get(name, self._known()).fielddefs:
            return True
        self.unknown[name] = None
        return False

    def decoder(self, name: str, topic: str, *, one: bool) -> Decode:
        """What reads a topic's messages of a type; ``one``: they are serialised by ROS 1."""
        store = self._own.get(name, self._known())
        read = store.deserialize_ros1 if one else store.deserialize_cdr
        plans: dict[str, tuple[list[str], Callable[[Any], Any]]] = {}

        def parts(message: Any) -> Iterable[tuple[str, Any]]:
            kind = message.__msgtype__
            if kind not in plans:
                places = dict(_places(store, kind))
                # Of fewer than two attributes it gives no tuple.
                plans[kind] = list(places), attrgetter(*places.values(), "__msgtype__", "__msgtype__")
            names, get = plans[kind]
            return zip(names, get(message), strict=False)

        def decode(content: bytes) -> tuple[float | None, dict[str, Any]]:
            content = _unpacked(content)
            if not self.knows(name) or not (one or content.startswith(_CDR)):
                raise ValueError("not a message of a known type")
            try:
                message = read(content, name)
            except self._serde.SerdeError as error:
                raise ValueError(str(error)) from error
            stamp: Any = getattr(getattr(message, "header", None), "stamp", None)
            sent = stamp.sec + 1e-9 * stamp.nanosec if hasattr(stamp, "nanosec") else None
            return sent, flat(message, parts, topic)

        return decode

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


def _places(store: Any, kind: str) -> Iterator[tuple[str, str]]:
    """The fields of a type by name, those of the messages in it behind a point, and the attributes that hold them."""
    names = [name for name, _ in store.fielddefs[kind][1]]
    fields = zip(names, store.get_msgdef(kind).fields, strict=True)
    for name, (attribute, (node, content)) in kept(fields) if set(names) not in _INSTANT else ():
        if int(node) == _NAME:
            yield from ((f"{name}.{own}", f"{attribute}.{place}") for own, place in _places(store, content))
        else:
            yield name, attribute


def _refers_out(definitions: dict[str, Any]) -> bool:
    """Whether types name others that are not among them (rosbags writes a name as ``(Nodetype.NAME, name)``)."""
    known = {*definitions, "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}

    def named(node: Any) -> Iterator[str]:
        kind, content = node
        if int(kind) == _NAME:
            yield content
        elif int(kind) in (3, 4):
            yield from named(content[0])

    return any(
        name not in known for _, fields in definitions.values() for _, node in fields for name in named(node)
    )


def _unpacked(raw: bytes) -> bytes:
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

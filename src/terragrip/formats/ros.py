"""ROS bags: ROS 1, and ROS 2 in SQLite or MCAP; messages of any type whose definition the bag holds."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import DAMAGE, as_far_as_it_goes, needed
from terragrip.formats.messages import Topic
from terragrip.formats.registry import Databases, Format
from terragrip.formats.ros_topic import RosTopic, Serialised
from terragrip.formats.rosbag1 import Connection, records
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted

_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST_MESSAGE = 1 << 28  # bytes that one may unpack to


def read_ros1(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read a ROS 1 bag by topic and field, with or without an index; raises InputError if it is damaged from the start.

    A bag that was cut off is read as far as it goes.
    """
    types = Types("ROS1_NOETIC")
    topics: dict[str, Topic] = {}
    connections: dict[int, tuple[RosTopic, Serialised]] = {}
    notes: list[str] = []
    lost = 0
    with as_far_as_it_goes(path, "ROS 1 bag", notes) as seen, open(path, "rb") as stream:
        for record in records(stream, notes):
            if isinstance(record, Connection):
                name = types.learn(record.kind, record.definition, "msg")
                topic = bag_topic(record.topic, wanted, topics)
                connections.setdefault(record.number, (topic, types.form(name, one=True)))
                continue
            number, receipt, content = record
            seen.messages += 1
            if number not in connections:
                lost += 1  # its sender was named in a part that is damaged
                continue
            topic, form = connections[number]
            if topic.is_wanted:
                topic.push(receipt, content, form)
    if lost:
        notes.append(f"{lost} messages are of connections that are not described, and were left out.")
    return log_of(topics.values(), path, [*types.notes(), *notes])


def read_ros2(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read a ROS 2 bag, a folder or one of its files, by topic and field.

    Message types that the bag does not describe must be those that come with ROS 2.
    """
    types = Types("LATEST")
    topics: dict[str, Topic] = {}
    files, notes = _files_of(path), list[str]()
    for file in files:
        if files[0].suffix == ".mcap":
            from terragrip.formats.mcap import collect

            notes += collect(file, wanted, topics, types)
        else:
            _collect(file, wanted, topics, types, notes)
    return log_of(topics.values(), path, [*types.notes(), *notes], files)


class Types:
    """Message types of one log, from the definitions that it holds, else from those that come with ROS.

    ``unknown`` types, and those whose definition cannot be read, are named in `notes`.
    """

    def __init__(self, base: str) -> None:
        self._typesys = needed("rosbags.typesys", "a ROS message")
        self._serde = needed("rosbags.serde", "a ROS message")
        self._base = base
        self._own: dict[str, Any] = {}
        self._common: Any = None
        self.unknown: dict[str, None] = {}
        self.errors: tuple[type[Exception], ...] = (self._typesys.TypesysError, self._serde.SerdeError)
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
        except (*DAMAGE, *self.errors):
            self.unknown[name] = None
        return name

    def store(self, name: str) -> Any:
        """The rosbags store that reads a type; raises KeyError if there is none."""
        if name in self._own:
            return self._own[name]
        if name not in self._known().fielddefs:
            self.unknown[name] = None
            raise KeyError(name)
        return self._known()

    def form(self, name: str, *, one: bool) -> Serialised:
        """How messages of a type are read; ``one``: they are serialised by ROS 1."""

        def read(raw: bytes) -> Any:
            store = self.store(name)
            return store.deserialize_ros1(raw, name) if one else store.deserialize_cdr(raw, name)

        return self._forms.setdefault(
            (name, one), Serialised(name, one, read, lambda: self.store(name).fielddefs, self.errors)
        )

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


def ros_topic(name: str, wanted: Wanted | None) -> Topic:
    """A `Topic` of ROS messages as rosbags gives them."""
    return Topic(name, _parts, _stamp, wanted)


def bag_topic(name: str, wanted: Wanted | None, topics: dict[str, Topic]) -> RosTopic:
    """The topic of a bag of this name, of several connections the same one."""
    result = topics.setdefault(f"ros {name}", RosTopic(name, _parts, _stamp, wanted))
    assert isinstance(result, RosTopic)
    return result


def _parts(message: Any) -> Iterable[tuple[str, Any]]:
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is None:
        return ()
    names = set(fields) - {"__msgtype__"}
    if names == {"sec", "nanosec"} or names == {"sec", "nsec"}:
        return ()  # a time or duration
    return [(key, getattr(message, key)) for key in fields if key != "__msgtype__"]


def _stamp(message: Any) -> float | None:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return None if stamp is None else float(stamp.sec + 1e-9 * getattr(stamp, "nanosec", 0))


def _files_of(path: str) -> list[Path]:
    """The files of a bag that is a folder or one file, in the order of their names."""
    if Path(path).is_file():
        return [Path(path)]
    for suffix in (".db3", ".mcap"):
        result = sorted(p for p in Path(path).iterdir() if p.suffix == suffix)
        if result:
            return result
    packed = [p.name for p in Path(path).iterdir() if p.suffix in (".zstd", ".zst")]
    hint = (
        f"unpack {packed[0]} first (zstd -d)" if packed else "name the bag's folder, with .db3 or .mcap files"
    )
    raise InputError("holds no bag file", file=path, hint=hint)


def _collect(
    file: Path, wanted: Wanted | None, topics: dict[str, Topic], types: Types, notes: list[str]
) -> None:
    """Read the messages of one SQLite file into their topics."""
    with (
        as_far_as_it_goes(file, "ROS 2 bag", notes, sqlite3.Error) as seen,
        closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base,
    ):
        known = _topics_of(base, wanted, topics, types)
        last = -1
        while True:
            # A topic of which nothing is wanted is asked for no more: its images are not even read.
            asked = ", ".join(str(number) for number, (topic, _) in known.items() if topic.is_wanted)
            rows = base.execute(
                "SELECT rowid, topic_id, timestamp, data FROM messages "
                f"WHERE rowid > ? AND topic_id IN ({asked}) ORDER BY rowid",
                (last,),
            )
            for place, number, receipt, raw in rows:
                seen.messages += 1
                topic, form = known[number]
                topic.push(receipt * 1e-9, unpacked(raw), form)
                if not topic.is_wanted:
                    last = place
                    break
            else:
                break


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


def _topics_of(
    base: sqlite3.Connection, wanted: Wanted | None, topics: dict[str, Topic], types: Types
) -> dict[int, tuple[RosTopic, Serialised]]:
    """The topics of a SQLite file by number, with how their messages are read."""
    tables = {row[0] for row in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise ValueError("it has no tables topics and messages")
    if "message_definitions" in tables:
        for name, language, text in base.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        ):
            types.learn(str(name), str(text), str(language).removeprefix("ros2"))
    known: dict[int, tuple[RosTopic, Serialised]] = {}
    for number, name, kind, form in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        if form == "cdr":
            known[int(number)] = bag_topic(str(name), wanted, topics), types.form(str(kind), one=False)
        else:
            types.unknown[f"{kind} ({form})"] = None
    return known


def log_of(topics: Iterable[Topic], path: str, notes: list[str], files: Iterable[Path] = ()) -> SignalLog:
    """The signals of all topics; raises InputError if no message could be read."""
    result: dict[str, Signal] = {}
    names: dict[str, None] = {}
    topics, remarks = list(topics), list(notes)
    for topic in topics:
        signals, own = topic.signals()
        result |= signals
        remarks += own
        names |= dict.fromkeys(topic.names)
    if not any(topic.count for topic in topics):
        bad = sum(topic.bad for topic in topics)
        problem = f"holds no message that can be read ({bad} cannot)" if bad else "holds no message"
        raise InputError(
            f"{problem}{'; ' + remarks[0] if remarks else ''}", file=path, hint="check how it was recorded"
        )
    digest = "+".join(sha256(file) for file in files) or sha256(path)
    return SignalLog(tuple(names), result, path, digest, tuple(remarks))


FORMATS = (
    Format("ros1", "ROS 1 bag", read_ros1, (".bag",), (b"#ROSBAG V",)),
    Format("ros2", "ROS 2 bag", read_ros2, (".db3",), (b"SQLite format 3\0",)),
)

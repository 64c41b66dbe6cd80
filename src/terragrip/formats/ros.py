"""ROS bags: ROS 1, and ROS 2 in SQLite or MCAP; messages of any type whose definition the bag holds."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from terragrip.errors import InputError
from terragrip.formats.boundary import as_far_as_it_goes
from terragrip.formats.mcap import collect
from terragrip.formats.messages import Decode, Topic, log_of
from terragrip.formats.registry import Databases, Format
from terragrip.formats.ros_types import Types
from terragrip.formats.rosbag1 import Connection, records
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import Wanted


def read_ros1(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Read a ROS 1 bag by topic and field, with or without an index; raises InputError if it is damaged from the start.

    A bag that was cut off is read as far as it goes.
    """
    types = Types("ROS1_NOETIC")
    topics: dict[str, Topic] = {}
    connections: dict[int, tuple[Topic, Decode]] = {}
    notes: list[str] = []
    lost = 0
    with as_far_as_it_goes(path, "ROS 1 bag", notes) as seen, open(path, "rb") as stream:
        for record in records(stream, notes):
            if isinstance(record, Connection):
                name = types.learn(record.kind, record.definition, "msg")
                topic = topics.setdefault(record.topic, Topic(record.topic, wanted))
                connections.setdefault(record.number, (topic, types.decoder(name, topic.name, one=True)))
                continue
            number, receipt, content = record
            seen.messages += 1
            if number not in connections:
                lost += 1  # its sender was named in a part that is damaged
                continue
            topic, decode = connections[number]
            if topic.is_wanted:
                topic.push(receipt, content, decode)
    if lost:
        notes.append(f"{lost} messages of undescribed connections were left out.")
    return log_of(topics.values(), path, [*types.notes(), *notes])


def read_ros2(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Read a ROS 2 bag, a folder or one of its files, by topic and field.

    Message types that the bag does not describe must be those that come with ROS 2.
    """
    types = Types("LATEST")
    topics: dict[str, Topic] = {}
    files, notes = _files_of(path), list[str]()
    for file in files:
        if files[0].suffix == ".mcap":
            notes += collect(file, wanted, topics, types)
        else:
            _collect(file, wanted, topics, types, notes)
    return log_of(topics.values(), path, [*types.notes(), *notes], files)


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
    raise InputError("has no bag file", file=path, hint=hint)


def _collect(file: Path, wanted: Wanted, topics: dict[str, Topic], types: Types, notes: list[str]) -> None:
    """Read the messages of one SQLite file into their topics."""
    with (
        as_far_as_it_goes(file, "ROS 2 bag", notes, sqlite3.Error) as seen,
        closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base,
    ):
        known = _topics_of(base, wanted, topics, types)
        # Asked of each row before its message is looked at: images of which nothing is wanted are not even read.
        base.create_function("is_wanted", 1, lambda number: number in known and known[number][0].is_wanted)
        rows = "SELECT topic_id, timestamp, data FROM messages WHERE is_wanted(topic_id) ORDER BY rowid"
        for number, receipt, content in base.execute(rows):
            seen.messages += 1
            topic, decode = known[number]
            topic.push(receipt * 1e-9, content, decode)


def _topics_of(
    base: sqlite3.Connection, wanted: Wanted, topics: dict[str, Topic], types: Types
) -> dict[int, tuple[Topic, Decode]]:
    """The topics of a SQLite file by number, with how their messages are read."""
    tables = {row[0] for row in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise ValueError("it has no tables topics and messages")
    if "message_definitions" in tables:
        for name, language, text in base.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        ):
            types.learn(str(name), str(text), str(language).removeprefix("ros2"))
    known: dict[int, tuple[Topic, Decode]] = {}
    for number, name, kind, form in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        if form == "cdr":
            topic = topics.setdefault(str(name), Topic(str(name), wanted))
            known[int(number)] = topic, types.decoder(str(kind), topic.name, one=False)
        else:
            types.unknown[f"{kind} ({form})"] = None
    return known


FORMATS = (
    Format("ros1", "ROS 1 bag", read_ros1, (".bag",), (b"#ROSBAG V",)),
    Format("ros2", "ROS 2 bag", read_ros2, (".db3",), (b"SQLite format 3\0",)),
)

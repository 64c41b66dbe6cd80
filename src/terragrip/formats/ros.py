"""ROS bags: ROS 1, and ROS 2 in SQLite or MCAP; messages of any type whose definition the bag holds."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from pathlib import Path

import yaml

from terragrip.errors import InputError
from terragrip.formats.boundary import DAMAGE, as_far_as_it_goes
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
    files, notes = _files_of(path)
    for file in files:
        try:
            if file.suffix == ".mcap":
                notes += collect(file, wanted, topics, types)
            else:
                _collect(file, wanted, topics, types, notes)
        except InputError as error:
            if len(files) == 1 or error.file is None:
                raise
            notes.append(f"{file.name} {error.problem}, and was left out.")
    return log_of(topics.values(), path, [*types.notes(), *notes], files)


def _files_of(path: str) -> tuple[list[Path], list[str]]:
    """The files of a bag that is a folder or one file, in the order of their numbers, and sentences on those that are not there."""
    folder = Path(path)
    if folder.is_file():
        return [folder], []
    inside = sorted(folder.iterdir(), key=lambda p: [(len(n), n) for n in re.split(r"(\d+)", p.name)])
    files = [p for p in inside if p.suffix == ".db3"] or [p for p in inside if p.suffix == ".mcap"]
    packed = [p.name for p in inside if p.suffix in (".zstd", ".zst")]
    if not files:
        hint = (
            f"unpack {packed[0]} first (zstd -d)" if packed else "name its folder, with .db3 or .mcap files"
        )
        raise InputError("has no bag file", file=path, hint=hint)
    read = {file.name for file in files}
    parts = {re.sub(r"\.zstd?$", "", name): name for name in (*_stated(folder), *packed)}
    return files, [
        f"{name} is {'packed' if name in packed else 'missing'}: what that part of the bag holds is not read."
        for unpacked, name in parts.items()
        if unpacked not in read
    ]


def _stated(folder: Path) -> list[str]:
    """The files that a bag's ``metadata.yaml`` names, as far as it can be read."""
    try:
        whole = yaml.safe_load((folder / "metadata.yaml").read_bytes())
        return [Path(name).name for name in whole["rosbag2_bagfile_information"]["relative_file_paths"]]
    except (*DAMAGE, yaml.YAMLError):
        return []


def _collect(file: Path, wanted: Wanted, topics: dict[str, Topic], types: Types, notes: list[str]) -> None:
    """Read the messages of one SQLite file into their topics."""
    # A recorder that was killed leaves its last messages in a file beside it, which a base that cannot change would not have.
    journal, index = (file.with_name(file.name + end) for end in ("-wal", "-shm"))
    mode = "ro&immutable=1"
    if journal.is_file() and journal.stat().st_size:
        mode = "ro" if index.is_file() else "ro&vfs=unix-none"  # without locks: nobody has the base open
    with (
        as_far_as_it_goes(file, "ROS 2 bag", notes, sqlite3.Error) as seen,
        closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode={mode}", uri=True)) as base,
    ):
        if mode.endswith("none"):  # the index in memory: the folder may be one that cannot be written
            base.execute("PRAGMA locking_mode = EXCLUSIVE")
        base.execute("PRAGMA writable_schema = ON")  # else one that was cut off is refused as a whole
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

"""MCAP files: ROS 1 and ROS 2 messages, JSON, and protobuf by the schema in the file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from terragrip.errors import InputError
from terragrip.formats.boundary import DAMAGE, needed, reading
from terragrip.formats.kind import Databases
from terragrip.formats.messages import Topic
from terragrip.formats.ros import Types, log_of, ros_topic
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import Wanted

_LARGEST = 1 << 30  # bytes of a record
_EPOCH = ("timestamp", "stamp", "time")

Decode = Callable[[bytes], Any]


def read_mcap(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read an MCAP file by topic and field; raises InputError if it is damaged from the start, or nothing can be read.

    A file that was cut off is read as far as it goes, and so is one of which some chunks are damaged.
    """
    topics: dict[str, Topic] = {}
    types = Types("LATEST")
    notes = collect(Path(path), wanted, topics, types)
    return log_of(topics.values(), path, [*types.notes(), *notes])


def collect(file: Path, wanted: Wanted | None, topics: dict[str, Topic], types: Types) -> list[str]:
    """Read the messages of one file into their topics; returns sentences on what could not be read."""
    exceptions = needed("mcap.exceptions", "an MCAP file")
    notes: list[str] = []
    schemas: dict[int, Any] = {}
    decoders: dict[int, tuple[Topic, Decode | None]] = {}
    unreadable: dict[str, None] = {}
    seen = 0
    try:
        with reading(file, "MCAP file", exceptions.McapError), file.open("rb") as stream:
            for record in _records(stream, notes, exceptions.McapError):
                kind = type(record).__name__
                if kind == "Schema":
                    schemas[record.id] = record
                elif kind == "Channel" and record.id not in decoders:
                    decoders[record.id] = _decoder(
                        record, schemas.get(record.schema_id), wanted, topics, types
                    )
                    if decoders[record.id][1] is None:
                        unreadable[f"{record.topic} ({record.message_encoding})"] = None
                elif kind == "Message":
                    seen += 1
                    topic, decode = decoders[record.channel_id]
                    if decode is None or not topic.is_wanted:
                        continue
                    try:
                        message = decode(record.data)
                    except (*DAMAGE, *types.errors):
                        topic.bad += 1
                        continue
                    except Exception as error:
                        if (
                            type(error).__name__ != "DecodeError"
                        ):  # protobuf's, whose module needs not be there
                            raise
                        topic.bad += 1
                        continue
                    topic.take(record.log_time * 1e-9, message)
    except InputError as error:
        if not seen:
            raise
        notes.append(
            f"The file ends early, or is damaged ({error.problem}); {seen} messages before were read."
        )
    if unreadable:
        notes.append(f"Topics in an encoding that is not known were left out: {', '.join(unreadable)}.")
    return notes


def _records(stream: Any, notes: list[str], error: type[Exception]) -> Iterator[Any]:
    """Records of a file in its order, those of a chunk as if they stood alone; damaged chunks are left out."""
    reader = needed("mcap.stream_reader", "an MCAP file")
    damaged = 0
    for record in reader.StreamReader(stream, emit_chunks=True, record_size_limit=_LARGEST).records:
        if type(record).__name__ != "Chunk":
            yield record
            continue
        try:
            if record.uncompressed_size > _LARGEST:
                raise ValueError("a chunk of over 1 GiB")
            inside = reader.breakup_chunk(record, validate_crc=True)
        except (*DAMAGE, error, *_packers()):
            damaged += 1
            continue
        yield from inside
    if damaged:
        notes.append(f"{damaged} chunks are damaged and were left out.")


def _packers() -> tuple[type[Exception], ...]:
    """What the decompressors of MCAP raise on damaged data."""
    found: list[type[Exception]] = []
    for module, name in (("zstandard", "ZstdError"), ("backports.zstd", "ZstdError"), ("zstd", "Error")):
        try:
            found.append(getattr(__import__(module, fromlist=[name]), name))
        except (ImportError, AttributeError):
            continue
    return tuple(found)


def _decoder(
    channel: Any, schema: Any, wanted: Wanted | None, topics: dict[str, Topic], types: Types
) -> tuple[Topic, Decode | None]:
    """The topic of a channel, and what reads its messages; None if its encoding is not known."""
    encoding = channel.message_encoding
    if encoding in ("cdr", "ros1") and schema is not None:
        topic = topics.setdefault(channel.topic, ros_topic(channel.topic, wanted))
        language = "idl" if schema.encoding.endswith("idl") else "msg"
        name = types.learn(schema.name, schema.data.decode("utf-8", "replace"), language)
        if encoding == "ros1":
            return topic, lambda data: types.store(name).deserialize_ros1(data, name)
        return topic, lambda data: types.store(name).deserialize_cdr(data, name)
    if encoding == "json":
        return topics.setdefault(
            channel.topic, Topic(channel.topic, _parts_of_json, _stamp_of_json, wanted)
        ), json.loads
    if encoding == "protobuf" and schema is not None:
        topic = topics.setdefault(
            channel.topic, Topic(channel.topic, _parts_of_protobuf, _stamp_of_protobuf, wanted)
        )
        factory = needed("mcap_protobuf.decoder", "protobuf messages").DecoderFactory()
        try:
            return topic, factory.decoder_for(encoding, schema)
        except Exception as error:
            if not isinstance(error, (*DAMAGE,)) and type(error).__name__ != "DecodeError":
                raise
            return topic, None
    return topics.setdefault(
        channel.topic, Topic(channel.topic, _parts_of_json, _stamp_of_json, wanted)
    ), None


def _parts_of_json(message: Any) -> Iterable[tuple[str, Any]]:
    if not isinstance(message, dict) or set(message) in ({"sec", "nsec"}, {"sec", "nanosec"}):
        return ()
    return message.items()


def _stamp_of_json(message: Any) -> float | None:
    """Foxglove's ``timestamp: {sec, nsec}``, or ROS's header."""
    if not isinstance(message, dict):
        return None
    header = message.get("header")
    stamp = message.get("timestamp") or (header.get("stamp") if isinstance(header, dict) else None)
    if not isinstance(stamp, dict):
        return None
    seconds, rest = stamp.get("sec"), stamp.get("nsec", stamp.get("nanosec", 0))
    whole = isinstance(seconds, int | float) and isinstance(rest, int | float)
    return float(seconds + 1e-9 * rest) if whole else None  # type: ignore[operator]


def _parts_of_protobuf(message: Any) -> Iterable[tuple[str, Any]]:
    descriptor = getattr(message, "DESCRIPTOR", None)
    if descriptor is None or descriptor.full_name in (
        "google.protobuf.Timestamp",
        "google.protobuf.Duration",
    ):
        return ()
    found = []
    for part in descriptor.fields:
        value = getattr(message, part.name)
        if not isinstance(value, bool | int | float | str | bytes) and not hasattr(value, "DESCRIPTOR"):
            value = list(value) if not hasattr(value, "keys") else []
        found.append((part.name, value))
    return found


def _stamp_of_protobuf(message: Any) -> float | None:
    for name in _EPOCH:
        stamp = getattr(message, name, None)
        if getattr(getattr(stamp, "DESCRIPTOR", None), "full_name", "") == "google.protobuf.Timestamp":
            return float(stamp.seconds + 1e-9 * stamp.nanos)  # type: ignore[union-attr]
    return None

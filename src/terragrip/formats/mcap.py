"""MCAP files: ROS 1 and ROS 2 messages, JSON, and protobuf by the schema in the file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from terragrip.formats.boundary import DAMAGE, LARGEST, as_far_as_it_goes, needed
from terragrip.formats.messages import Topic, log_of
from terragrip.formats.registry import Databases, Format
from terragrip.formats.ros_types import Types, bag_topic, unpacked
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import Wanted

_EPOCH = ("timestamp", "stamp", "time")

Add = Callable[[float, bytes], None]
"""Takes a message that came at a time [s]; raises what its decoder raises on damage."""


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
    exceptions, kinds = needed("mcap.exceptions", "an MCAP file"), needed("mcap.records", "an MCAP file")
    notes: list[str] = []
    schemas: dict[int, Any] = {}
    channels: dict[int, tuple[Topic, Add | None]] = {}
    unreadable: dict[str, None] = {}
    with (
        as_far_as_it_goes(file, "MCAP file", notes, exceptions.McapError) as seen,
        file.open("rb") as stream,
    ):
        for record in records(stream, notes):
            if isinstance(record, kinds.Message):
                seen.messages += 1
                topic, add = channels[record.channel_id]
                if add is not None and topic.is_wanted:
                    _add(topic, add, record.log_time * 1e-9, record.data)
            elif isinstance(record, kinds.Schema):
                schemas[record.id] = record
            elif isinstance(record, kinds.Channel) and record.id not in channels:
                channels[record.id] = _channel(record, schemas.get(record.schema_id), wanted, topics, types)
                if channels[record.id][1] is None:
                    unreadable[f"{record.topic} ({record.message_encoding})"] = None
    if unreadable:
        notes.append(f"Topics in an unknown encoding were left out: {', '.join(unreadable)}.")
    return notes


def records(stream: BinaryIO, notes: list[str]) -> Iterator[Any]:
    """mcap's records, with those in chunks in their place; damaged chunks are left out, which ``notes`` tell.

    Raises what mcap raises where the file is damaged or ends early.
    """
    reader, kinds = needed("mcap.stream_reader", "an MCAP file"), needed("mcap.records", "an MCAP file")
    packed = (needed("zstandard", "an MCAP file").ZstdError, RuntimeError)  # RuntimeError is lz4's
    damaged = 0
    for record in reader.StreamReader(stream, emit_chunks=True, record_size_limit=LARGEST).records:
        if isinstance(record, kinds.DataEnd):
            break
        if not isinstance(record, kinds.Chunk):
            yield record
            continue
        try:
            if record.uncompressed_size > LARGEST:
                raise ValueError("a chunk of over 1 GiB")
            inner = reader.breakup_chunk(record, validate_crc=True)
        except (*DAMAGE, needed("mcap.exceptions", "an MCAP file").McapError, *packed):
            damaged += 1
            continue
        yield from inner
    if damaged:
        notes.append(f"{damaged} chunks are damaged and were left out.")


def _add(topic: Topic, add: Add, receipt: float, content: bytes) -> None:
    """Hand a message to its topic; one that cannot be read is counted."""
    try:
        add(receipt, content)
    except DAMAGE:
        topic.bad += 1
    except Exception as error:
        if type(error).__name__ != "DecodeError":  # protobuf's, whose module needs not be there
            raise
        topic.bad += 1


def _channel(
    channel: Any, schema: Any, wanted: Wanted | None, topics: dict[str, Topic], types: Types
) -> tuple[Topic, Add | None]:
    """The topic of a channel (of several of one name the same), and what takes its messages; None if its encoding is not known."""
    encoding = channel.message_encoding
    if encoding in ("cdr", "ros1") and schema is not None:
        ros = bag_topic(channel.topic, wanted, topics)
        language = "idl" if schema.encoding.endswith("idl") else "msg"
        name = types.learn(schema.name, schema.data.decode("utf-8", "replace"), language)
        form = types.form(name, one=encoding == "ros1")
        return ros, lambda receipt, content: ros.push(receipt, unpacked(content), form)
    if encoding == "protobuf" and schema is not None:
        topic = topics.setdefault(
            channel.topic, Topic(channel.topic, _parts_of_protobuf, _stamp_of_protobuf, wanted, getattr)
        )
        factory = needed("mcap_protobuf.decoder", "protobuf messages").DecoderFactory()
        try:
            decode = factory.decoder_for(encoding, schema)
        except Exception as error:
            if not isinstance(error, (*DAMAGE,)) and type(error).__name__ != "DecodeError":
                raise
            return topic, None
        return topic, lambda receipt, content: topic.add(receipt, decode(content))
    topic = topics.setdefault(
        channel.topic, Topic(channel.topic, _parts_of_json, _stamp_of_json, wanted, dict.__getitem__)
    )
    if encoding == "json":
        return topic, lambda receipt, content: topic.add(receipt, json.loads(content))
    return topic, None


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
    result = []
    for part in descriptor.fields:
        value = getattr(message, part.name)
        if not isinstance(value, bool | int | float | str | bytes) and not hasattr(value, "DESCRIPTOR"):
            value = list(value) if not hasattr(value, "keys") else []
        result.append((part.name, value))
    return result


def _stamp_of_protobuf(message: Any) -> float | None:
    for name in _EPOCH:
        stamp = getattr(message, name, None)
        if getattr(getattr(stamp, "DESCRIPTOR", None), "full_name", "") == "google.protobuf.Timestamp":
            return float(stamp.seconds + 1e-9 * stamp.nanos)  # type: ignore[union-attr]
    return None


FORMATS = (Format("mcap", "MCAP file", read_mcap, (".mcap",), (b"\x89MCAP0\r\n",)),)

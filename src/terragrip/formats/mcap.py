"""MCAP files: ROS 1 and ROS 2 messages, JSON, and protobuf by the schema in the file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from terragrip.formats.boundary import DAMAGE, LARGEST, as_far_as_it_goes, needed
from terragrip.formats.messages import Decode, Topic, flat, kept, log_of
from terragrip.formats.registry import Databases, Format
from terragrip.formats.ros_types import Types
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import Wanted

_EPOCH = ("timestamp", "stamp", "time")


def read_mcap(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Read an MCAP file by topic and field; raises InputError if it is damaged from the start, or nothing can be read.

    A file that was cut off is read as far as it goes, and so is one of which some chunks are damaged.
    """
    topics: dict[str, Topic] = {}
    types = Types("LATEST")
    notes = collect(Path(path), wanted, topics, types)
    return log_of(topics.values(), path, [*types.notes(), *notes])


def collect(file: Path, wanted: Wanted, topics: dict[str, Topic], types: Types) -> list[str]:
    """Read the messages of one file into their topics; returns sentences on what could not be read."""
    exceptions, kinds = needed("mcap.exceptions", "an MCAP file"), needed("mcap.records", "an MCAP file")
    notes: list[str] = []
    schemas: dict[int, Any] = {}
    channels: dict[int, tuple[Topic, Decode | None]] = {}
    unreadable: dict[str, None] = {}
    with (
        as_far_as_it_goes(file, "MCAP file", notes, exceptions.McapError) as seen,
        file.open("rb") as stream,
    ):
        for record in records(stream, notes):
            if isinstance(record, kinds.Message):
                seen.messages += 1
                topic, decode = channels[record.channel_id]
                if decode is not None and topic.is_wanted:
                    topic.push(record.log_time * 1e-9, record.data, decode)
            elif isinstance(record, kinds.Schema):
                schemas[record.id] = record
            elif isinstance(record, kinds.Channel) and record.id not in channels:
                topic = topics.setdefault(record.topic, Topic(record.topic, wanted))
                decode = _decoder(record, schemas.get(record.schema_id), types)
                channels[record.id] = topic, decode
                if decode is None:
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


def _decoder(channel: Any, schema: Any, types: Types) -> Decode | None:
    """What reads the messages of a channel; None where their encoding is not known."""
    encoding, topic = channel.message_encoding, channel.topic
    if encoding in ("cdr", "ros1") and schema is not None:
        language = "idl" if schema.encoding.endswith("idl") else "msg"
        name = types.learn(schema.name, schema.data.decode("utf-8", "replace"), language)
        return types.decoder(name, topic, one=encoding == "ros1")
    if encoding == "protobuf" and schema is not None:
        factory = needed("mcap_protobuf.decoder", "protobuf messages").DecoderFactory()
        damage = needed("google.protobuf.message", "protobuf messages").DecodeError
        try:
            read = factory.decoder_for(encoding, schema)
        except (*DAMAGE, damage):
            return None

        def decode(content: bytes) -> tuple[float | None, dict[str, Any]]:
            try:
                message = read(content)
            except damage as error:
                raise ValueError(str(error)) from error
            return _stamp_of_protobuf(message), flat(message, _parts_of_protobuf, topic)

        return decode
    if encoding == "json":
        return lambda content: _of_json(json.loads(content), topic)
    return None


def _of_json(message: Any, topic: str) -> tuple[float | None, dict[str, Any]]:
    return _stamp_of_json(message), flat(message, _parts_of_json, topic)


def _parts_of_json(message: Any) -> Iterable[tuple[str, Any]]:
    if not isinstance(message, dict) or set(message) in ({"sec", "nsec"}, {"sec", "nanosec"}):
        return ()
    return kept(message.items())


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
    return kept(result)


def _stamp_of_protobuf(message: Any) -> float | None:
    for name in _EPOCH:
        stamp = getattr(message, name, None)
        if getattr(getattr(stamp, "DESCRIPTOR", None), "full_name", "") == "google.protobuf.Timestamp":
            return float(stamp.seconds + 1e-9 * stamp.nanos)  # type: ignore[union-attr]
    return None


FORMATS = (Format("mcap", "MCAP file", read_mcap, (".mcap",), (b"\x89MCAP0\r\n",)),)

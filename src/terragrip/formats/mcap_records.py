"""The records of an MCAP file that tell of messages, in the order of the file; indices and attachments are passed over.

mcap's own reader makes an object of every message and of every entry of the indices, which takes longer than all the rest.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

from terragrip.formats.boundary import DAMAGE, needed
from terragrip.formats.record_bytes import LARGEST, exactly

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 2, 3, 4, 5, 6, 15
_HEAD = struct.Struct("<BQ")  # kind and length of a record
_OF_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, time of log and of publication [ns]

Message = tuple[int, int, bytes]
"""A message: its channel, when it was logged [ns], its content."""


def records(stream: BinaryIO, notes: list[str]) -> Iterator[Any]:
    """mcap's Schema and Channel, and each `Message`, of a file; damaged chunks are left out, which ``notes`` tell.

    Raises ValueError or struct.error, or what mcap raises, where the file is damaged or ends early.
    """
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise ValueError("it does not begin as MCAP files do")
    damaged = 0
    while True:
        kind, length = _HEAD.unpack(exactly(stream, _HEAD.size))
        if kind in (_FOOTER, _DATA_END):
            break
        if kind not in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
            _pass(stream, length)
            continue
        if length > LARGEST:
            raise ValueError("a record of over 1 GiB")
        content = exactly(stream, length)
        if kind != _CHUNK:
            yield _record(kind, content)
            continue
        try:
            yield from _inner(_unpacked(content))
        except (*DAMAGE, needed("mcap.exceptions", "an MCAP file").McapError, *_packers()):
            damaged += 1
    if damaged:
        notes.append(f"{damaged} chunks are damaged and were left out.")


def _pass(stream: BinaryIO, size: int) -> None:
    """Go on behind a record, which must be there."""
    if size:
        stream.seek(size - 1, io.SEEK_CUR)
        exactly(stream, 1)


def _record(kind: int, content: bytes) -> Any:
    if kind == _MESSAGE:
        channel, _, time, _ = _OF_MESSAGE.unpack_from(content)
        return channel, time, content[_OF_MESSAGE.size :]
    module = needed("mcap.records", "an MCAP file")
    stream = needed("mcap.data_stream", "an MCAP file").ReadDataStream(io.BytesIO(content))
    return (module.Schema if kind == _SCHEMA else module.Channel).read(stream)


def _unpacked(content: bytes) -> bytes:
    """The records of a chunk, unpacked and proved by its check sum."""
    reader = needed("mcap.stream_reader", "an MCAP file")
    stream = needed("mcap.data_stream", "an MCAP file").ReadDataStream(io.BytesIO(content))
    chunk = needed("mcap.records", "an MCAP file").Chunk.read(stream)
    if chunk.uncompressed_size > LARGEST:
        raise ValueError("a chunk of over 1 GiB")
    unpacked, size = reader.get_chunk_data_stream(chunk, validate_crc=True)
    return bytes(unpacked.read(size))


def _inner(content: bytes) -> Iterator[Any]:
    """The records in a chunk; raises as `records` does."""
    place, end = 0, len(content)
    while place < end:
        kind, length = _HEAD.unpack_from(content, place)
        place += _HEAD.size
        after = place + length
        if after > end:
            raise ValueError("a record reaches beyond its chunk")
        if kind == _MESSAGE:
            channel, _, time, _ = _OF_MESSAGE.unpack_from(content, place)
            yield channel, time, content[place + _OF_MESSAGE.size : after]
        elif kind in (_SCHEMA, _CHANNEL):
            yield _record(kind, content[place:after])
        place = after


def _packers() -> tuple[type[Exception], ...]:
    """What the decompressors of MCAP raise on damaged data."""
    found: list[type[Exception]] = []
    for module, name in (("zstandard", "ZstdError"), ("backports.zstd", "ZstdError"), ("zstd", "Error")):
        try:
            found.append(getattr(__import__(module, fromlist=[name]), name))
        except (ImportError, AttributeError):
            continue
    return tuple(found)

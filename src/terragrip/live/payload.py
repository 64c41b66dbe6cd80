"""Bytes of a message into named fields."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from terragrip.formats.payload import Payload

Fields = dict[str, Any]
_TINY, _HUGE = 1e-20, 1e20  # no machine measures beyond; states of a filter that decay may be smaller


class Unreadable(Exception):
    """A message that is not what it should be; the text says what it is, shortly."""


Unpack = Callable[[bytes], list[Fields]]


def unpacker(payload: Payload | None) -> Unpack:
    """A function from a message's bytes to its fields, one mapping a sample; it raises Unreadable."""
    if payload is None or payload.format == "json":
        return from_json
    packer, names = payload.packer, payload.fields

    def unpack(data: bytes) -> list[Fields]:
        if len(data) % packer.size or not data:
            raise Unreadable(f"{len(data)} bytes, not a multiple of {packer.size}")
        samples = [dict(zip(names, values, strict=True)) for values in packer.iter_unpack(data)]
        largest = _of_other_order(samples[0])
        if largest:
            raise Unreadable(
                f"numbers up to {largest:.2g}: is byte_order in the profile's payload the sender's?"
            )
        return samples

    return unpack


def _of_other_order(fields: Fields) -> float:
    """The largest of numbers that look like those of the other byte order: most are far too large or too small, one too large. Else 0."""
    sizes = [
        abs(value) for value in fields.values() if isinstance(value, float) and value and math.isfinite(value)
    ]
    strange = [size for size in sizes if not _TINY < size < _HUGE]
    largest = max(strange, default=0.0)
    return largest if largest > _HUGE and 2 * len(strange) > len(sizes) else 0.0


def from_json(data: bytes) -> list[Fields]:
    """JSON objects: one, several in a list, or one a line. Nested ones are flattened: ``wheel.fl``."""
    try:
        result = json.loads(data)
    except UnicodeDecodeError:
        raise Unreadable(f"not JSON: {len(data)} bytes that are not text") from None
    except (ValueError, RecursionError):
        lines = data.splitlines()
        if len(lines) > 1:
            return [fields for line in lines if line.strip() for fields in from_json(line)]
        raise Unreadable(f"not JSON: {_short(data)}") from None
    objects = result if isinstance(result, list) else [result]
    if not all(isinstance(one, dict) for one in objects):
        raise Unreadable(f"JSON, but not an object: {_short(data)}")
    if data.count(b"{") == len(objects) and data.count(b"[") == (result is objects):
        return objects  # nothing is nested; braces within texts only cost a second look
    return [_flat(one) for one in objects]


def _flat(nested: Fields, prefix: str = "", depth: int = 0) -> Fields:
    flat: Fields = {}
    for name, value in nested.items():
        if isinstance(value, dict) and depth < 8:
            flat |= _flat(value, f"{prefix}{name}.", depth + 1)
        elif isinstance(value, list) and depth < 8:
            flat |= _flat({str(k): item for k, item in enumerate(value[:64])}, f"{prefix}{name}.", depth + 1)
        else:
            flat[prefix + name] = value
    return flat


def _short(data: bytes) -> str:
    text = data[:40].decode("utf-8", "replace")
    return repr(text + ("…" if len(data) > 40 else ""))

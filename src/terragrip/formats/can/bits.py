"""Signals in the payloads of many frames at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats

Bytes = npt.NDArray[np.uint8]

_SHORTEST = 50  # payloads that show a byte order
_NOISY = 0.3  # mean step over mean deviation in a wrong byte order, at least,
_SMOOTHER = 3.0  # and over that in the right one
_ACROSS, _NEAR = 0.7, 0.1  # largest step over the range: in a wrong order at least, in the right one at most


@dataclass(frozen=True)
class Field:
    """Where a signal stands in a payload: ``start`` and byte order as a DBC has them, bits counted from 0.

    Value = scale * raw + offset in ``unit``. ``codes``: the raw range ends in the codes of J1939 for "error" and "not
    available", which are missing values. ``selector`` and ``chosen``: present only where that field holds one of those.
    ``reverse``: the field that holds 0 where the value runs backward.
    """

    name: str
    start: int
    length: int
    little_endian: bool = True
    signed: bool = False
    floating: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str | None = None
    codes: bool = False
    selector: str | None = None
    chosen: tuple[int, ...] = ()
    reverse: str | None = None

    @property
    def last_byte(self) -> int:
        """Index of the last byte it reaches into."""
        if self.little_endian:
            return (self.start + self.length - 1) // 8
        return (8 * (self.start // 8) + 7 - self.start % 8 + self.length - 1) // 8

    @property
    def missing(self) -> range:
        """Raw values that say "error", "not available" or are reserved (SAE J1939-71, ISO 11783-7).

        Whole bytes: the highest byte is 0xFB or more. Fewer bits: the two highest codes, "error" and "not available"; a
        single bit has none. Signed fields are NMEA 2000's: the two highest codes.
        """
        if not self.codes or self.length < 2 or self.floating:
            return range(0)
        end = 1 << (self.length - self.signed)
        return range(0xFB << (self.length - 8) if self.length % 8 == 0 and not self.signed else end - 2, end)


def raw_of(field: Field, data: Bytes) -> npt.NDArray[np.uint64]:
    """Raw values (n,) of a field in payloads (n, bytes); the payloads must reach to the field's last byte."""
    little = field.little_endian
    low = field.start % 8 if little else 7 - field.start % 8  # where its bits begin in its first byte
    held = data[:, field.start // 8 : field.last_byte + 1]
    bits = np.unpackbits(held, axis=1, bitorder="little" if little else "big")[:, low : low + field.length]
    packed = np.packbits(bits if little else bits[:, ::-1], axis=1, bitorder="little")
    words = np.zeros((len(data), 8), dtype=np.uint8)
    words[:, : packed.shape[1]] = packed
    return words.view("<u8")[:, 0].astype(np.uint64, copy=False)


def leaps(field: Field, data: Bytes) -> bool:
    """Whether a field of whole bytes leaps from payload to payload (n, bytes), and would not in the other byte order.

    White noise steps by 1.1 times its mean deviation, in either order. A smooth signal whose bytes are exchanged does so, too, or from
    one end of its range to the other where its low byte begins anew. The two least and the two greatest values do not count: codes as
    for "not available" leap, too.
    """
    turned = 7 - field.start % 8 if field.little_endian else field.start % 8
    if field.length not in (16, 24, 32) or field.floating or turned != 7 or len(data) < _SHORTEST:
        return False
    start = 8 * (field.start // 8) + (7 if field.little_endian else 0)
    other = replace(field, start=start, little_endian=not field.little_endian)
    values, exchanged = (physical(f, raw_of(f, data)) for f in (field, other))
    ends = np.unique(values)[[1, -2]] if np.ptp(values) else values[:2]
    inner = (values > ends[0]) & (values < ends[1])
    (mean, most), (mean_of_other, most_of_other) = _steps(values[inner]), _steps(exchanged[inner])
    return mean > max(_NOISY, _SMOOTHER * mean_of_other) or (most > _ACROSS and most_of_other < _NEAR)


def _steps(values: Floats) -> tuple[float, float]:
    """From one value (n,) to the next, the mean step over the mean deviation, and the largest over the range."""
    if len(values) < _SHORTEST or not (reach := float(np.ptp(values))):
        return 0.0, 0.0
    steps = np.abs(np.diff(values))
    return float(steps.mean() / np.abs(values - values.mean()).mean()), float(steps.max() / reach)


def physical(field: Field, raw: npt.NDArray[np.uint64]) -> Floats:
    """Physical values (n,) of raw ones."""
    if field.floating:
        kind = {16: np.float16, 32: np.float32, 64: np.float64}[field.length]
        word = {16: np.uint16, 32: np.uint32, 64: np.uint64}[field.length]
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
            numbers = raw.astype(word).view(kind).astype(np.float64)
    elif field.signed:
        up = np.uint64(64 - field.length)
        numbers = ((raw << up).view(np.int64) >> np.int64(64 - field.length)).astype(np.float64)
    else:
        numbers = raw.astype(np.float64)
    if (field.scale, field.offset) == (1.0, 0.0):
        return numbers
    return field.scale * numbers + field.offset


def decode(
    fields: tuple[Field, ...], wanted: set[str], data: Bytes, lengths: npt.NDArray[np.uint16]
) -> dict[str, Floats]:
    """The wanted fields (n,) of payloads (n, bytes) of which each holds ``lengths`` (n,) bytes; NaN where absent."""
    by_name = {field.name: field for field in fields}
    raws: dict[str, npt.NDArray[np.uint64]] = {}

    def raw(field: Field) -> npt.NDArray[np.uint64]:
        if field.name not in raws:
            short = field.last_byte + 1 - data.shape[1]
            wide = np.pad(data, ((0, 0), (0, short))) if short > 0 else data
            raws[field.name] = raw_of(field, wide)
        return raws[field.name]

    def present(field: Field) -> Bools:
        there = lengths > field.last_byte
        if field.selector is not None:
            parent = by_name[field.selector]
            there = there & present(parent) & np.isin(raw(parent), np.array(field.chosen, dtype=np.uint64))
        return there

    result = {}
    for field in (f for f in fields if f.name in wanted):
        known = present(field)
        if field.missing:
            known = known & ((raw(field) < field.missing[0]) | (raw(field) > field.missing[-1]))
        values = np.where(known, physical(field, raw(field)), np.nan)
        if field.reverse is not None:
            backward = by_name[field.reverse]
            values = np.where(present(backward) & (raw(backward) == 0), -values, values)
        result[field.name] = values
    raws.clear()  # the functions above know each other, and would keep it until Python looks for such circles
    return result

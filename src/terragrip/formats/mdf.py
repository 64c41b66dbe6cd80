"""ASAM MDF 3 and 4 (MF4): measured signals, and raw CAN frames with a DBC or the table of J1939, by asammdf."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.files import sha256
from terragrip.formats.boundary import needed, reading
from terragrip.formats.can.catalog import EXTENDED, catalog
from terragrip.formats.can.frames import Frames
from terragrip.formats.can.log import finished
from terragrip.formats.kind import Databases
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted

_BLOCK = 200_000  # records at once, so that memory stays small
_BUS_EVENT = 2  # flag of a channel group that holds frames (ASAM MDF 4)
_FRAME = "CAN_DataFrame"


def read_mdf(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read an MDF file; raises InputError if it is damaged, or holds neither signals nor known frames."""
    asammdf = needed("asammdf", "an MDF file")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what it has to say, the error says
    error = asammdf.blocks.utils.MdfException
    with reading(path, "MDF file", error), asammdf.MDF(path) as file:
        start = file.start_time.timestamp()
        buses = [k for k, group in enumerate(file.groups) if _holds_frames(group)]
        names, signals = _signals(file, wanted, set(buses), start)
        frames = Frames(catalog(databases), wanted)
        for group in buses:
            for time, identifiers, lengths, data in _frames(file, group):
                frames.take_many(start + time, identifiers, lengths, data)
    if not frames.count:
        return SignalLog(names, signals, path, sha256(path))
    log = finished(frames, path, (), databases, refuse_unknown=not signals)
    return SignalLog((*names, *log.names), signals | log.signals, path, log.sha256, log.notes)


def _holds_frames(group: Any) -> bool:
    flags = getattr(group.channel_group, "flags", 0)
    return bool(flags & _BUS_EVENT) and any(channel.name.startswith(_FRAME) for channel in group.channels)


def _signals(
    file: Any, wanted: Wanted | None, buses: set[int], start: float
) -> tuple[tuple[str, ...], dict[str, Signal]]:
    """All names of measured signals, and the wanted ones; of several of one name, the later are ``name@group``."""
    names: dict[str, tuple[int, int]] = {}
    for k, group in enumerate(file.groups):
        if k in buses or getattr(group.channel_group, "flags", 0) & _BUS_EVENT:
            continue
        for index, channel in enumerate(group.channels):
            if file.masters_db.get(k) != index:
                names[channel.name if channel.name not in names else f"{channel.name}@{k}"] = k, index
    found: dict[str, Signal] = {}
    clocks: dict[int, npt.NDArray[np.float64]] = {}
    for name, (group, index) in names.items():
        if wanted is not None and not wanted(name):
            continue
        signal = file.get(group=group, index=index)
        values = _values(signal.samples)
        if values is None or not len(values):
            continue
        time = clocks.setdefault(group, start + signal.timestamps)
        if len(time) != len(values):  # invalid samples are left out of some signals of a group
            time = start + signal.timestamps
        found[name] = Signal(time, values, signal.unit or None)
    return tuple(names), found


def _values(samples: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Samples (n,) as numbers or texts; None of arrays and structures."""
    if samples.ndim != 1 or samples.dtype.names:
        return None
    if samples.dtype.kind in "fiub":
        return samples.astype(np.float64)
    if samples.dtype.kind == "S":
        return np.array([s.decode("utf-8", "replace") for s in samples.tolist()], dtype=object)
    return samples.astype(object) if samples.dtype.kind == "U" else None


def _frames(file: Any, group: int) -> Iterator[tuple[Any, Any, Any, Any]]:
    """Blocks of frames: time, identifiers with `EXTENDED`, lengths (n,) and payloads (n, bytes)."""
    count = file.groups[group].channel_group.cycles_nr
    for first in range(0, count, _BLOCK):
        block = file.get(
            _FRAME, group=group, raw=True, record_offset=first, record_count=min(_BLOCK, count - first)
        )
        fields = block.samples
        identifiers = fields[f"{_FRAME}.ID"].astype(np.int64) & 0x1FFFFFFF
        extended = (
            fields[f"{_FRAME}.IDE"] > 0 if f"{_FRAME}.IDE" in fields.dtype.names else identifiers > 0x7FF
        )
        identifiers |= np.where(extended, EXTENDED, 0)
        data = _payloads(fields[f"{_FRAME}.DataBytes"])
        lengths = np.minimum(fields[f"{_FRAME}.DataLength"].astype(np.int64), data.shape[1])
        yield block.timestamps, identifiers, lengths, data


def _payloads(column: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Payloads as rows (n, bytes), from rows or from byte strings of any length."""
    if column.ndim == 2:
        return column
    parts: Sequence[bytes] = [bytes(cell) for cell in column.tolist()]
    width = max(map(len, parts), default=8)
    joined = b"".join(part.ljust(width, b"\0") for part in parts)
    return np.frombuffer(joined, np.uint8).reshape(len(parts), width)

"""ASAM MDF 3 and 4 (MF4): measured signals, and raw CAN frames with a DBC or the table of J1939, by asammdf.

A damaged file can end asammdf's process (a segmentation fault in its C extension) or fill memory, so it runs in one that may end.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.can.catalog import EXTENDED, catalog, with_buses
from terragrip.formats.can.frames import Frames
from terragrip.formats.can.log import finished
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import Clock, Samples, SignalLog, signals_of
from terragrip.formats.table import Wanted
from terragrip.formats.worker import Reading, Worker

_BLOCK = 200_000  # records at once, so that memory stays small
_BUS_EVENT = 2  # flag of a channel group that holds frames (ASAM MDF 4)
_FRAME = "CAN_DataFrame"


def read_mdf(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Read an MDF file; raises InputError if it is damaged, or holds neither signals nor known frames."""
    frames = Frames(catalog(databases), wanted)

    def without_frames(items: Worker) -> Iterator[Clock | Samples]:
        for item in items:
            if isinstance(item, tuple):
                frames.add_many(*item)
            else:
                yield item

    with Worker("terragrip.formats.mdf:items_of", "asammdf", path, "MDF file") as worker:
        names = worker.receive()
        worker.send([name for name in names if wanted(name)])
        signals = signals_of(without_frames(worker), wanted)
    if not frames.count:
        return SignalLog(names, signals)
    log = finished(frames, path, (), databases, refuse_unknown=not signals)
    return replace(log, names=(*names, *log.names), signals=signals | log.signals)


def items_of(path: str) -> Reading:
    """The names of a file's signals; then, of those that are wanted, clocks and samples; then its frames, block by block."""
    import asammdf

    options: dict[str, Any] = {"process_bus_logging": False}  # else it reads all frames when it opens a file
    with asammdf.MDF(path, **options) as file:
        start = file.start_time.timestamp()
        flags = [getattr(group.channel_group, "flags", 0) for group in file.groups]
        buses = [k for k, flag in enumerate(flags) if flag & _BUS_EVENT]
        names = _names(file, set(buses))
        chosen = yield tuple(names)
        yield from _samples(file, start, {name: names[name] for name in chosen})
        for group in (k for k in buses if any(c.name.startswith(_FRAME) for c in file.groups[k].channels)):
            for time, *frames in _frames(file, group):
                yield start + time, *frames
                _let_go(file)


def _samples(file: Any, start: float, places: dict[str, tuple[int, int]]) -> Iterator[Clock | Samples]:
    lengths: dict[int, int] = {}  # of the groups' clocks
    for name, (group, index) in places.items():
        signal = file.get(group=group, index=index)
        values, stamps = _values(signal.samples), _values(np.asarray(signal.timestamps))
        if values is None or not len(values) or stamps is None or stamps.dtype.kind == "O":
            continue
        # Invalid samples are left out of some signals of a group: those have a clock of their own.
        is_first = group not in lengths
        is_own = lengths.setdefault(group, len(values)) != len(values)
        if is_first or is_own:
            yield Clock(name if is_own else group, start + stamps)
        yield Samples(name, name if is_own else group, values, signal.unit or None)
        _let_go(file)


def _let_go(file: Any) -> None:
    """Give back the memory of what was read of a mapped file, which the system would keep for as long as it can."""
    mapped = getattr(getattr(file, "_mdf", None), "_file", None)
    if isinstance(mapped, mmap.mmap):
        mapped.madvise(mmap.MADV_DONTNEED)


def _names(file: Any, buses: set[int]) -> dict[str, tuple[int, int]]:
    """Group and index of each measured signal; several of one name are ``name@source`` where their groups or sources are named apart,
    else the later are ``name@group``."""
    places: dict[str, list[tuple[int, int]]] = {}
    for k, group in enumerate(file.groups):
        for index, channel in enumerate(group.channels if k not in buses else ()):
            if file.masters_db.get(k) != index:
                places.setdefault(channel.name, []).append((k, index))
    names: dict[str, tuple[int, int]] = {}
    for name, these in places.items():
        apart = _named_apart([file.groups[k] for k, _ in these], [index for _, index in these])
        marks = apart or ["", *(str(k) for k, _ in these[1:])]
        for mark, place in zip(marks if len(these) > 1 else [""], these, strict=True):
            names[f"{name}@{mark}" if mark else name] = place
    return names


def _named_apart(groups: Sequence[Any], indices: Sequence[int]) -> list[str] | None:
    """What tells signals of one name apart: their groups' names of acquisition, else their own sources'; None where neither does."""
    acquired = [getattr(group.channel_group, "acq_name", None) or "" for group in groups]
    sources = [getattr(g.channels[k], "source", None) for g, k in zip(groups, indices, strict=True)]
    by_source = ([getattr(source, key, None) or "" for source in sources] for key in ("name", "path"))
    return next((m for m in (acquired, *by_source) if all(m) and len(set(m)) == len(m)), None)


def _values(samples: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Samples or stamps (n,) as numbers or texts; None of arrays and structures."""
    if samples.ndim != 1 or samples.dtype.names:
        return None
    if samples.dtype.kind in "fiub":
        return samples.astype(np.float64)
    if samples.dtype.kind == "S":
        return np.array([s.decode("utf-8", "replace") for s in samples.tolist()], dtype=object)
    return samples.astype(object) if samples.dtype.kind == "U" else None


def _frames(file: Any, group: int) -> Iterator[tuple[npt.NDArray[Any], ...]]:
    """Blocks of frames: time, identifiers with `EXTENDED`, lengths (n,) and payloads (n, bytes)."""
    count = file.groups[group].channel_group.cycles_nr
    for first in range(0, count, _BLOCK):
        block = file.get(
            _FRAME, group=group, raw=True, record_offset=first, record_count=min(_BLOCK, count - first)
        )
        fields = block.samples
        identifiers = fields[f"{_FRAME}.ID"].astype(np.int64) & 0x1FFFFFFF
        wide = fields[f"{_FRAME}.IDE"] > 0 if f"{_FRAME}.IDE" in fields.dtype.names else identifiers > 0x7FF
        identifiers |= np.where(wide, EXTENDED, 0)
        if f"{_FRAME}.BusChannel" in fields.dtype.names:
            identifiers = with_buses(identifiers, fields[f"{_FRAME}.BusChannel"])
        data = _payloads(fields[f"{_FRAME}.DataBytes"])
        lengths = np.minimum(fields[f"{_FRAME}.DataLength"].astype(np.int64), data.shape[1])
        yield np.asarray(block.timestamps, dtype=np.float64), identifiers, lengths, data


def _payloads(column: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Payloads as rows (n, bytes), from rows or from byte strings of any length."""
    if column.ndim == 2:
        return column
    parts: Sequence[bytes] = [bytes(cell) for cell in column.tolist()]
    width = max(map(len, parts), default=8)
    joined = b"".join(part.ljust(width, b"\0") for part in parts)
    return np.frombuffer(joined, np.uint8).reshape(len(parts), width)


FORMATS = (
    Format("mdf", "MDF file", read_mdf, (".mf4", ".mdf"), (b"MDF     ", b"UnFinMF "), takes_databases=True),
)

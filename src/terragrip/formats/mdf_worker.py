"""The part of reading MDF files that runs in a process of its own: ``python -m terragrip.formats.mdf_worker``.

A damaged file can end asammdf's process (a segmentation fault in its C extension) or fill memory, so it gets one that may
end. Standard output carries JSON lines and NumPy arrays, as `terragrip.formats.mdf` reads them: what the file holds; then,
once the wanted names came in on standard input, their samples; then the frames, block by block; then the end.
"""

from __future__ import annotations

import mmap
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.can.catalog import EXTENDED
from terragrip.formats.worker import Outlet, serve

BLOCK = 200_000
"""Records at once, so that memory stays small."""
_BUS_EVENT = 2  # flag of a channel group that holds frames (ASAM MDF 4)
_FRAME = "CAN_DataFrame"


def work(path: str, out: Outlet) -> None:
    """Serve one file."""
    import asammdf

    options: dict[str, Any] = {"process_bus_logging": False}  # else it reads all frames when it opens a file
    with asammdf.MDF(path, **options) as file:
        _serve(file, out)


def _serve(file: Any, out: Outlet) -> None:
    flags = [getattr(group.channel_group, "flags", 0) for group in file.groups]
    buses = [k for k, flag in enumerate(flags) if flag & _BUS_EVENT]
    names = _names(file, set(buses))
    units = {name: str(file.groups[g].channels[i].unit or "") for name, (g, i) in names.items()}
    out.send({"start": file.start_time.timestamp(), "units": units})
    clocks: dict[int, int] = {}
    for name in out.receive():
        group, index = names[name]
        signal = file.get(group=group, index=index)
        values = _values(signal.samples)
        if values is None or not len(values):
            continue
        # Invalid samples are left out of some signals of a group: those have a clock of their own.
        shared = clocks.get(group) == len(values)
        clocks.setdefault(group, len(values))
        out.send({"name": name, "unit": signal.unit or "", "group": group, "shared": shared})
        if not shared:
            out.send_array(np.asarray(signal.timestamps, dtype=np.float64))
        out.send_array(values)
        _let_go(file)
    for group in (k for k in buses if any(c.name.startswith(_FRAME) for c in file.groups[k].channels)):
        for block in _frames(file, group):
            out.send({"frames": True})
            for array in block:
                out.send_array(array)
            _let_go(file)


def _let_go(file: Any) -> None:
    """Give back the memory of what was read of a mapped file, which the system would keep for as long as it can."""
    mapped = getattr(getattr(file, "_mdf", None), "_file", None)
    if isinstance(mapped, mmap.mmap):
        mapped.madvise(mmap.MADV_DONTNEED)


def _names(file: Any, buses: set[int]) -> dict[str, tuple[int, int]]:
    """Group and index of each measured signal; of several of one name, the later are ``name@group``."""
    names: dict[str, tuple[int, int]] = {}
    for k, group in enumerate(file.groups):
        for index, channel in enumerate(group.channels if k not in buses else ()):
            if file.masters_db.get(k) != index:
                names[channel.name if channel.name not in names else f"{channel.name}@{k}"] = k, index
    return names


def _values(samples: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Samples (n,) as numbers or texts; None of arrays and structures."""
    if samples.ndim != 1 or samples.dtype.names:
        return None
    if samples.dtype.kind in "fiub":
        return samples.astype(np.float64)
    if samples.dtype.kind == "S":
        return np.array([s.decode("utf-8", "replace") for s in samples.tolist()], dtype=np.str_)
    return samples if samples.dtype.kind == "U" else None


def _frames(file: Any, group: int) -> Iterator[tuple[npt.NDArray[Any], ...]]:
    """Blocks of frames: time, identifiers with `EXTENDED`, lengths (n,) and payloads (n, bytes)."""
    count = file.groups[group].channel_group.cycles_nr
    for first in range(0, count, BLOCK):
        block = file.get(
            _FRAME, group=group, raw=True, record_offset=first, record_count=min(BLOCK, count - first)
        )
        fields = block.samples
        identifiers = fields[f"{_FRAME}.ID"].astype(np.int64) & 0x1FFFFFFF
        wide = fields[f"{_FRAME}.IDE"] > 0 if f"{_FRAME}.IDE" in fields.dtype.names else identifiers > 0x7FF
        identifiers |= np.where(wide, EXTENDED, 0)
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


if __name__ == "__main__":
    sys.exit(serve("asammdf", work))

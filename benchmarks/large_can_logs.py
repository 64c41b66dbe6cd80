"""Large CAN logs for `bench_formats.py`: a bus of 2000 frames a second and 20 messages, two of them wanted."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

SPEEDS = {0: 0x0CFE48F0, 1: 0x0CFE4980}  # of the frames in a turn, those that are wanted


def frames(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Identifiers (n,) and payloads (n, 8) of a bus of 2000 frames a second and 20 messages, two of them wanted."""
    draws, count = np.random.default_rng(0), np.arange(rows)
    other, time = count % 20, count * 5e-4
    speed = 2000 + 300 * np.sin(time / 20)
    raw = np.where(other == 0, speed / (0.94 - 0.05 * np.sin(time / 7)), speed)
    raw = (raw + 20 * draws.standard_normal(rows)).astype(np.uint16)
    data = np.zeros((rows, 8), np.uint8)
    data[:, 0], data[:, 1], data[:, 6], data[:, 7] = raw & 255, raw >> 8, 255, 0xFD
    known = np.where(other == 0, SPEEDS[0], SPEEDS[1])
    return np.where(other < 2, known, 0x18FF0017 + 256 * other).astype(np.uint32), data


FRAME = np.dtype(
    [("CAN_DataFrame.BusChannel", "u1"), ("CAN_DataFrame.ID", "<u4"), ("CAN_DataFrame.IDE", "u1"),
     ("CAN_DataFrame.DLC", "u1"), ("CAN_DataFrame.DataLength", "u1"), ("CAN_DataFrame.DataBytes", "(8,)u1")]
)  # fmt: skip


def mf4_bus(path: Path, size: int) -> None:
    """`frames` as bus loggers write them, block by block."""
    import asammdf

    source = asammdf.Source("CAN", "CAN", "", asammdf.Source.SOURCE_BUS, asammdf.Source.BUS_TYPE_CAN)
    rows = 2_000_000
    identifiers, data = frames(rows)
    records = np.zeros(rows, FRAME)
    records["CAN_DataFrame.ID"], records["CAN_DataFrame.DataBytes"] = identifiers, data
    records["CAN_DataFrame.IDE"], records["CAN_DataFrame.DLC"], records["CAN_DataFrame.DataLength"] = 1, 8, 8
    file = asammdf.MDF(temporary_folder=path.parent)
    for first in range(0, size // (FRAME.itemsize + 8), rows):
        time = (first + np.arange(rows)) * 5e-4
        if first:
            file.extend(0, [(time, None), (records, None)])
        else:
            file.append(asammdf.Signal(records, time, name="CAN_DataFrame", source=source), acq_source=source)
    file.save(path, overwrite=True)
    file.close()


def _texts(head: str, line: Callable[[int, str], str]) -> Callable[[Path, int], None]:
    """A writer of lines: ``line`` makes of identifier and payload what follows the stamp, which has a field ``{}``."""

    def write(path: Path, size: int) -> None:
        identifiers, data = frames(100_000)
        lines = [line(int(i), d.tobytes().hex().upper()) for i, d in zip(identifiers, data, strict=True)]
        with path.open("w") as stream:
            stream.write(head)
            first = written = 0
            while written < size:
                text = "".join(part.format((first + k) * 5e-4) for k, part in enumerate(lines))
                stream.write(text)
                written, first = written + len(text), first + len(lines)

    return write


def _spaced(content: str) -> str:
    return " ".join(content[k : k + 2] for k in range(0, len(content), 2))


candump = _texts("", lambda i, d: f"({{:.6f}}) can0 {i:08X}#{d}\n")
asc = _texts(
    "date Mon Jun 16 10:00:00.000 am 2025\nbase hex  timestamps absolute\ninternal events logged\n",
    lambda i, d: f"{{:12.6f}} 1  {i:X}x       Rx   d 8 {_spaced(d)}\n",
)


OBJECT = np.dtype(
    [("mark", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4"), ("flags", "<u4"),
     ("client", "<u2"), ("object_version", "<u2"), ("stamp", "<u8"), ("channel", "<u2"), ("frame_flags", "u1"), ("dlc", "u1"),
     ("id", "<u4"), ("data", "(8,)u1")]
)  # fmt: skip


def blf(path: Path, size: int) -> None:
    """BLF of classic CAN messages in containers of 128 kB, not packed, so that these hold as much as the file."""
    import can

    with can.BLFWriter(path) as writer:
        writer.on_message_received(can.Message(timestamp=1.75e9))  # for the head of the file
    rows = (128 << 10) // OBJECT.itemsize // 20 * 20
    identifiers, data = frames(rows)
    objects = np.zeros(rows, OBJECT)
    objects["mark"], objects["header"], objects["version"], objects["size"] = b"LOBJ", 32, 1, OBJECT.itemsize
    objects["type"], objects["flags"], objects["channel"], objects["dlc"] = 86, 2, 1, 8
    objects["id"], objects["data"] = identifiers | 0x80000000, data
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + objects.nbytes, 10) + struct.pack(
        "<H6xL4x", 0, objects.nbytes
    )
    with path.open("r+b") as stream:
        stream.seek(144)
        stream.truncate()
        for first in range(0, size // OBJECT.itemsize, rows):
            objects["stamp"] = (first + np.arange(rows)) * 500_000  # ns
            stream.write(head + objects.tobytes())

"""CAN logs: BLF, ASC, TRC, candump and tables of frames."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from terragrip.errors import InputError
from terragrip.formats.boundary import as_far_as_it_goes, needed
from terragrip.formats.can.catalog import catalog
from terragrip.formats.can.decoding import identifier_text, names_of, signals_of
from terragrip.formats.can.frames import Frame, Frames
from terragrip.formats.can.text_logs import (
    Count,
    asc,
    candump,
    frames_of,
    is_asc,
    is_candump,
    is_frame_table,
    is_trc,
    table,
    trc,
)
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import Sparse, Wanted

_TOO_SHORT = re.compile(
    rb"LOBJ.{4}[\x00-\x0f]\x00{3}", re.DOTALL
)  # signature, header's size and version, the object's size
_LONGEST = 4096  # characters of a line
_MOST_BAD = 0.5  # share of lines without a frame from which a file is none of its kind
_ORDERS = "correct it there: @1 is little-endian, @0 big-endian"
_BUSY = 20.0  # frames a second: a bus that speaks less is one whose stamps are taken for seconds by mistake

Parse = Callable[[Iterator[str], Count, Frames], Iterator[Frame]]


def read_blf(path: str, wanted: Wanted, databases: Databases) -> SignalLog:
    """Vector BLF, by python-can; one that is damaged behind some frames is read as far as it goes."""
    can = needed("can", "a BLF log")
    frames, notes = Frames(catalog(databases), wanted), list[str]()
    with (
        open(path, "rb") as stream,
        as_far_as_it_goes(path, "BLF log", notes, needed("can.io.blf", "a BLF log").BLFParseError) as seen,
    ):
        log = blf_reader(can.BLFReader)(stream)
        for frame in frames_of(log):
            frames.add(*frame)
            seen.messages += 1
        size = os.path.getsize(path)
        if size < log.file_size:
            notes.append(
                f"The file ends early: it has {size} bytes of the {log.file_size} that its head states."
            )
    return finished(frames, path, notes, databases)


def blf_reader(of: Any) -> Any:
    """python-can's reader ``of`` BLF, which would read an object that is shorter than its own header for ever."""

    class Reader(of):  # type: ignore[misc]
        def _parse_data(self, data: bytes) -> Iterator[Any]:
            short = _TOO_SHORT.search(data)
            yield from super()._parse_data(data[: short.start()] if short else data)
            if short:
                raise needed("can.io.blf", "a BLF log").BLFParseError("an object has no size")

    return Reader


def finished(
    frames: Frames,
    path: str,
    notes: Sequence[str],
    databases: Databases,
    *,
    refuse_unknown: bool = True,
) -> SignalLog:
    """The signals of all frames taken; raises InputError where none is known, and says which there are.

    ``refuse_unknown`` False lets a log pass that has other signals.
    """
    frames.flush()
    if not frames.count:
        raise InputError("has no CAN frame", file=path, hint="check that the bus was recorded")
    if not frames.seen and refuse_unknown:
        count = len(frames.unknown)
        shown = ", ".join(map(identifier_text, sorted(frames.unknown)[:6])) + (", ..." if count > 6 else "")
        what = "the DBC" if databases else "the built-in table of J1939"
        which = (
            f"its only identifier, {shown}, is not"
            if count == 1
            else f"none of its {count} identifiers ({shown}) is"
        )
        raise InputError(
            f"{which} in {what}",
            file=path,
            hint="give the bus's DBC: --dbc FILE, or 'dbc:' in the profile",
        )
    signals, remarks = signals_of(frames)
    if leaping := frames.leaping:
        what = ", ".join(leaping[:4]) + (f" and {len(leaping) - 4} more" if len(leaping) > 4 else "")
        problem = f"by the DBC {what} leap from frame to frame, and would not in the other byte order"
        if not signals or not isinstance(frames.wanted, Sparse):
            raise InputError(problem, file=path, hint=_ORDERS)
        remarks += [f"{problem[0].upper()}{problem[1:]}: left out; {_ORDERS}."]
    return SignalLog(names_of(frames), signals, notes=(*notes, *remarks))


def _from_lines(
    kind: str,
    parse: Parse,
    path: str,
    wanted: Wanted,
    databases: Databases,
) -> SignalLog:
    """A text log of a ``kind``, of whose lines ``parse`` makes frames."""
    frames, count = Frames(catalog(databases), wanted), Count()
    last = 0.0
    with Path(path).open("rb") as stream:
        lines = io.TextIOWrapper(stream, encoding="utf-8", errors="replace", newline="\n")
        for time, identifier, payload in parse(_bounded(lines), count, frames):
            frames.add(time, identifier, payload)
            last = time
    frames.flush()
    notes = _on_lines(count, frames.count, kind, path)
    span = last - (frames.first or 0.0)
    if parse is table and span > 0 and 100 < frames.count < _BUSY * span and last < 1e8:
        frames.tick = 1e-3
        notes.append(
            "The frames' stamps were read as milliseconds: in seconds the bus would be nearly silent."
        )
    return finished(frames, path, notes, databases)


def _on_lines(count: Count, good: int, kind: str, path: str) -> list[str]:
    """Sentences on the lines of a log with so many ``good`` ones; raises InputError where most hold no frame."""
    place = f"line {count.first} ({count.shown!r})"
    if count.bad > _MOST_BAD * (count.bad + good):
        problem = f"is a damaged {kind}, or none: {count.bad} lines have no frame"
        hint = "copy or record it again"
        if count.unstamped:
            problem, hint = "its frames have no stamps", "record it by candump -l, or with -t a"
        raise InputError(problem, file=path, place=place, hint=hint)
    notes = []
    if count.bad:
        what = "1 line has no frame:" if count.bad == 1 else f"{count.bad} lines have no frame, the first is"
        notes.append(f"{what} {place}; left out.")
    if any(not name.endswith(str(number)) for name, number in count.buses.items()) and len(count.buses) > 1:
        notes.append(f"Buses: {', '.join(f'{name} is bus {k}' for name, k in count.buses.items())}.")
    if count.begun:
        notes.append(
            "The log has no 'End TriggerBlock': it was cut, or its logger was, and the drive may have gone on."
        )
    return notes


def _bounded(lines: io.TextIOBase) -> Iterator[str]:
    """Lines of no more than `_LONGEST` characters, since a damaged file may have no line ends at all."""
    while line := lines.readline(_LONGEST):
        yield line


def _text(name: str, title: str, suffix: str, recognises: Callable[[bytes], bool], parse: Parse) -> Format:
    reader = partial(_from_lines, title, parse)
    return Format(
        name, title, reader, (suffix,) if suffix else (), recognises=recognises, takes_databases=True
    )


FORMATS = (
    Format("blf", "BLF log", read_blf, (".blf",), (b"LOGG",), takes_databases=True),
    _text("asc", "ASC log", ".asc", is_asc, asc),
    _text("trc", "TRC log", ".trc", is_trc, trc),
    _text("candump", "candump log", ".log", is_candump, candump),
    _text("frames", "table of CAN frames", "", is_frame_table, table),
)

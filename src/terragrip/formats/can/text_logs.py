"""CAN frames in text: candump's forms, ASC and TRC by python-can, and tables with an identifier and a data column."""

from __future__ import annotations

import base64
import binascii
import io
import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from terragrip.formats.boundary import DAMAGE, needed
from terragrip.formats.can.catalog import EXTENDED, bus_of, number_buses, on_bus
from terragrip.formats.can.frames import Frame, Frames

Numbered = tuple[int, str]
"""A line's number, and the line."""

_TIME = r"\s*\((\d+\.\d+|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+)\)\s+(\S+)\s+"  # and the interface
# (1600000000.000000) can0 18FE4800#0000030405060708 R
_COMPACT = re.compile(
    _TIME + r"([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#[0-9A-Fa-f])?([0-9A-Fa-f]*)(?:\s+[RT])?\s*$"
)
# (1600000000.000000)  can0  RX - -  18FE4800   [8]  00 00 03
_SPACED = re.compile(
    _TIME
    + r"(?:[RT]X\s+\S+\s+\S+\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[\s*\d+\]\s*((?:[0-9A-Fa-f]{2}\s?)*)"
)
_UNSTAMPED = re.compile(r"\s*\w+\s+(?:[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})(?:#|\s+\[)")
_ASC_REMARK = re.compile(
    r"\s*(?:$|//|\d+\.\d+\s|date\b|base\b|(?:no\s+)?internal\b|(?:begin|end)\s+trigger)", re.IGNORECASE
)
_TRC_REMARK = re.compile(
    r"\s*(?:$|;|\d+\)?\s+[\d.]+\s+(?:\d+\s+)?(?:Warng|Error|Event|ER|ST|EC|EV|RR|FFFFFFFF)\b)", re.IGNORECASE
)
_STAMP = re.compile(r"\d+\.\d+")
_NO_DATA = re.compile(r"#R\d?\b|remote request|ERRORFRAME|\b2[0-9A-Fa-f]{7}[# ]")
_HEAD = 200  # lines that tell what stamps count from:
_BACK, _LONGEST_STEP = 0.2, 1e6  # steps run back often, and are short
_EIGHT = 8  # hexadecimal digits of a 29-bit identifier
_BITS = 29  # of an identifier at most

_TIMES = dict.fromkeys(("timestamp", "time", "timestampepoch", "time_s", "t", "abs time(sec)"), 1.0)
_TIMES |= dict.fromkeys(("time_ms", "timems"), 1e-3) | {"time stamp": 1e-6}  # SavvyCAN's
_IDENTIFIERS = ("arbitration_id", "id", "can_id", "canid", "identifier", "arb id")
_DATA = ("data", "databytes", "payload", "data_hex")
_BYTES = [
    [f"{letter}{k}" for k in range(first, first + 8)] for letter, first in (("d", 1), ("b", 1), ("data", 0))
]
_SOURCES, _EXTENDED = ("source", "src", "sa"), ("extended", "ide", "xtd", "type")
_BUSES = ("bus", "channel", "network")
_YES, _NO = ("1", "true", "t"), ("", "0", "false", "f")
_DATE = re.compile(r"(\d{8})T(\d{6})(?:\.(\d+))?$")  # CL2000's
_PREAMBLE = 100  # lines before the header

# What the first lines of each form look like.
_TRC = re.compile(r"\s*\d+\)\s+\d+(?:\.\d+)?\s+(?:\d+\s+)?(?:[RT]x\s+)?[0-9A-Fa-f]{4,8}\s", re.IGNORECASE)
_ASC = re.compile(rb"\A(?:\s*//[^\n]*\n)*\s*(?:date\s|base\s+(?:hex|dec))", re.IGNORECASE)
_LIKE = 1 / 3  # share of the first lines that must have a form


def is_asc(head: bytes) -> bool:
    """Whether a file that begins so is an ASC log."""
    return _ASC.match(head) is not None


def is_trc(head: bytes) -> bool:
    """Whether a file that begins so is a TRC log; version 1.0 has no head."""
    return b";$FILEVERSION=" in head or (not is_candump(head) and lines_are_like(head, _TRC))


def is_candump(head: bytes) -> bool:
    """Whether a file that begins so is a log of candump, or its printed lines."""
    return lines_are_like(head, _COMPACT, _SPACED, _UNSTAMPED)


def is_frame_table(head: bytes) -> bool:
    """Whether a file that begins so is a table with columns of stamps, identifiers and payloads."""
    lines = (line.decode("utf-8", "replace") for line in head.splitlines()[:_PREAMBLE])
    return any(_is_frame_header(_cells(line)[1]) for line in lines)


def lines_are_like(head: bytes, *forms: re.Pattern[str]) -> bool:
    """Whether more than a third of the first lines have one of the forms."""
    lines = [line.decode("latin-1") for line in head.splitlines()[:40] if line.strip()]
    return sum(any(form.match(line) for form in forms) for line in lines) > _LIKE * len(lines)


@dataclass
class Count:
    """How many lines of a text log held no frame and were no known remark, and the first of them; ``begun``: a measurement has begun
    and not ended; ``buses``: the number of each bus by its name."""

    bad: int = 0
    first: int = 0
    shown: str = ""
    unstamped: bool = False
    begun: bool = False
    buses: dict[str, int] = field(default_factory=dict)

    def add(self, number: int, line: str) -> None:
        """Count a line."""
        if not self.bad:
            self.first, self.shown = number, line.strip()[:40]
        self.bad += 1


def candump(lines: Iterable[str], count: Count, frames: Frames) -> Iterator[Frame]:
    """Frames of candump's log file or of its printed lines; a line that is neither is counted.

    Stamps are seconds, dates (``-t A``, taken for UTC) or the time since the frame before (``-t d``). Lines of frames that ``frames``
    has no use for are counted there and not looked at any further.
    """
    lines = iter(lines)
    head = list(itertools.islice(lines, _HEAD))
    first = Count()
    stamps = [stamp for stamp, _, _ in _candump(enumerate(head), first, None)]
    number_buses(first.buses, count.buses)
    back = sum(after < before for before, after in itertools.pairwise(stamps))
    numbered = enumerate(itertools.chain(head, lines), 1)
    if len(stamps) < 3 or back < _BACK * len(stamps) or max(stamps) > _LONGEST_STEP:
        yield from _candump(numbered, count, frames)
        return
    now = 0.0
    for step, identifier, payload in _candump(numbered, count, None):  # every one, since steps add up
        now += step
        yield now, identifier, payload


def _candump(lines: Iterable[Numbered], count: Count, frames: Frames | None) -> Iterator[Frame]:
    """Frames with their stamps as they are; lines that ``frames`` has no use for are passed by."""
    unwanted: dict[str, int] = {}  # identifiers by what stands between stamp and payload
    for number, line in lines:
        mark = line.find("#")
        head = line[line.find(")") + 1 : mark]  # the interface, too
        if frames is not None and head in unwanted:
            frames.pass_by(unwanted[head])
            continue
        if frames is not None and frames.leaves_out_next():
            continue
        match = _COMPACT.match(line) or _SPACED.match(line)
        data = "" if match is None else "".join(match[4].split())
        if match is None or len(data) % 2:
            if line.strip() and not _NO_DATA.search(line):
                count.add(number, line)
                count.unstamped = count.unstamped or bool(_UNSTAMPED.match(line))
            continue
        identifier = int(match[3], 16) | (EXTENDED if len(match[3]) == _EIGHT else 0)
        identifier = on_bus(identifier, bus_of(match[2], count.buses))
        # Only log files, whose lines have no blanks in the payload, are of the size that makes this worth while.
        if frames is not None and mark > 0 and frames.are_unwanted(identifier):
            unwanted[head] = identifier
        yield _seconds(match[1]), identifier, bytes.fromhex(data)


def _seconds(stamp: str) -> float:
    """A stamp of candump [s]; a date since 1970."""
    if "-" not in stamp:
        return float(stamp)
    whole, _, part = stamp.partition(".")
    date = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
    return date.timestamp() + float(f"0.{part}")


def frames_of(messages: Iterable[Any]) -> Iterator[Frame]:
    """The data frames among python-can's messages."""
    for message in messages:
        if not (message.is_error_frame or message.is_remote_frame):
            wide = EXTENDED if message.is_extended_id else 0
            identifier = on_bus(message.arbitration_id | wide, message.channel)
            yield message.timestamp, identifier, bytes(message.data)


def asc(lines: Iterable[str], count: Count, frames: Frames) -> Iterator[Frame]:
    """Frames of a Vector ASC log, by python-can; time counts from the start of the measurement."""
    return _by_python_can("ASCReader", _asc_lines(enumerate(lines, 1), frames, count), count, _ASC_REMARK)


def trc(lines: Iterable[str], count: Count, frames: Frames) -> Iterator[Frame]:
    """Frames of a PEAK TRC log, by python-can."""
    return _by_python_can("TRCReader", enumerate(lines, 1), count, _TRC_REMARK)


def _by_python_can(
    name: str, lines: Iterable[Numbered], count: Count, remark: re.Pattern[str]
) -> Iterator[Frame]:
    """Frames by a reader of python-can, which goes on behind lines that it cannot read; those are counted, but for a ``remark``."""
    can = needed("can", "an ASC or TRC log")
    reader = getattr(can, name)(io.StringIO())
    number, shown, in_doubt = 0, "", False

    def fed() -> Iterator[str]:
        nonlocal number, shown, in_doubt
        for place, line in lines:
            if in_doubt:  # the reader made no frame of the one before, and said nothing
                count.add(number, shown)
            number, shown, in_doubt = place, line, not remark.match(line)
            yield line

    reader.file = source = fed()
    failed_at = -1
    while True:
        try:
            for message in reader:
                in_doubt = False
                if message.arbitration_id >> _BITS:
                    count.add(number, shown)
                else:
                    yield from frames_of((message,))
            break
        except (*DAMAGE, can.CanError):
            if number == failed_at:  # it did not get any further
                break
            failed_at = number
            count.add(number, shown)
            in_doubt = False
            # A reader that begins anew looks for its header, and for ASC drops the line that ends it.
            reader.file = (line for part in (["\n"] if name == "ASCReader" else [], source) for line in part)
    if in_doubt:
        count.add(number, shown)


def _asc_lines(lines: Iterable[Numbered], frames: Frames, count: Count) -> Iterator[Numbered]:
    """The lines of an ASC log, for python-can to read, but those of frames that ``frames`` has no use for and counts.

    Stamps that count from the event before ("timestamps relative") are made to count from the start. ``count`` learns whether the log has
    an end.
    """
    unwanted: dict[str, int | None] = {}
    base, relative, now = 16, False, 0.0
    for number, line in lines:
        cells = line.split(None, 3)
        if cells and cells[0].lower() == "base":
            base, relative = 10 if "dec" in line.lower() else 16, "relative" in line.lower()
        if cells and cells[0].lower() in ("begin", "end") and "trigger" in line.lower():
            count.begun = cells[0].lower() == "begin"
        if relative and cells and _STAMP.fullmatch(cells[0]):
            now += float(cells[0])
            line = f"{now:.6f} {line.lstrip().partition(' ')[2]}"
        if len(cells) == 4 and cells[1].isdigit() and cells[3].startswith(("Rx", "Tx")):
            name = f"{cells[1]} {cells[2]}"
            if frames.leaves_out_next():
                continue
            if name not in unwanted:
                identifier = _asc_identifier(cells[2], int(cells[1]) - 1, base)
                is_unwanted = identifier is not None and frames.are_unwanted(identifier)
                unwanted[name] = identifier if is_unwanted else None
            elif (known := unwanted[name]) is not None:
                frames.pass_by(known)
                continue
        yield number, line


def _asc_identifier(text: str, bus: int, base: int) -> int | None:
    try:
        wide = text[-1] in "xX"
        return on_bus(_checked(int(text[:-1] if wide else text, base)) | EXTENDED * wide, bus)
    except ValueError:
        return None


def table(lines: Iterable[str], count: Count, frames: Frames) -> Iterator[Frame]:
    """Frames of a table with time, identifier (or pgn and source) and data columns; a line that holds none is counted.

    The payload is in one column, or in one for each byte; numbers are hexadecimal, unless a byte has three digits.
    """
    numbered = ((number, line) for number, line in enumerate(lines, 1) if line.strip())
    before = itertools.islice(numbered, _PREAMBLE)
    separator, names = next((c for _, line in before if _is_frame_header((c := _cells(line))[1])), (",", []))
    if not names:
        return
    head = list(itertools.islice(numbered, _HEAD))
    some = [dict(zip(names, line.rstrip("\r\n").split(separator), strict=False)) for _, line in head]
    bus_name = next((name for name in _BUSES if name in names), None)
    number_buses({row[bus_name].strip() for row in some if bus_name in row}, count.buses)
    parts = next((own for own in _BYTES if set(own) <= set(names)), [])
    base = 10 if any(len(row.get(name, "").strip()) > 2 for row in some for name in parts) else 16
    for number, line in itertools.chain(head, numbered):
        if frames.leaves_out_next():
            continue
        cells = line.rstrip("\r\n").split(separator)
        row = dict(zip(names, cells, strict=False))
        try:
            if len(cells) < len(names) or any(cell.strip() for cell in cells[len(names) :]):
                raise ValueError("a row of another width")
            if any(row.get(mark, "").strip().lower() not in _NO for mark in ("remote", "error")):
                continue
            time = next(_scaled(row[name], _TIMES[name]) for name in names if name in _TIMES)
            if parts:
                payload = bytes(int(row[name], base) for name in parts if row[name].strip())
            else:
                payload = _payload(next(row[name] for name in names if name in _DATA))
            bus = row[bus_name].strip() if bus_name else ""
            identifier = on_bus(_identifier(row, base), bus_of(bus, count.buses))
            yield time, identifier, payload
        except (ValueError, binascii.Error):
            count.add(number, line)


def _scaled(text: str, scale: float) -> float:
    """A stamp [s]: a number times ``scale``, or a date as 20240914T100000.003."""
    date = _DATE.match(text.strip())
    if date is None:
        return scale * float(text.replace(",", "."))
    at = datetime.strptime(f"{date[1]}{date[2]}", "%Y%m%d%H%M%S").replace(tzinfo=UTC)
    return at.timestamp() + float(f"0.{date[3] or 0}")


def _cells(header: str) -> tuple[str, list[str]]:
    """The separator of a table, and the names in its header."""
    separator = max(";\t,", key=header.count)
    return separator, [c.strip().strip('"').lower() for c in header.strip().lstrip("\ufeff").split(separator)]


def _is_frame_header(names: list[str]) -> bool:
    has_data = any(name in _DATA for name in names) or any(set(own) <= set(names) for own in _BYTES)
    return has_data and all(
        any(name in known for name in names) for known in (_TIMES, (*_IDENTIFIERS, "pgn"))
    )


def _identifier(row: dict[str, str], base: int) -> int:
    """The identifier of a row: as it stands there, or made of group and source; raises ValueError where it is none."""
    written, source, extended = (
        next((row[name].strip().strip('"').lower() for name in names if name in row), None)
        for names in (_IDENTIFIERS, _SOURCES, _EXTENDED)
    )
    if written is None:
        return EXTENDED | _checked(int(row["pgn"]) << 8) | (0xFE if source is None else int(source) & 0xFF)
    text = written.removeprefix("0x").rstrip("hx")
    number = _checked(int(text, 16 if written.startswith("0x") else base))
    wide = number > 0x7FF or (len(text) == _EIGHT if extended is None else extended in _YES)
    return number | EXTENDED if wide else number


def _checked(identifier: int) -> int:
    if identifier >> _BITS:  # below 0, too
        raise ValueError("no identifier")
    return identifier


def _payload(text: str) -> bytes:
    """Hexadecimal with or without blanks and 0x, or python-can's base64."""
    plain = text.strip().strip('"')
    try:
        return bytes.fromhex(plain.replace("0x", "").replace(" ", ""))
    except ValueError:
        return base64.b64decode(plain, validate=True)

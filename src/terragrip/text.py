"""Text of any encoding as UTF-8, what a file that is no text looks like, and tables as text."""

from __future__ import annotations

import re
from collections.abc import Sequence

from terragrip.errors import InputError

_UTF8 = "utf-8"
_BEYOND_ASCII = re.compile(rb"[\x80-\xff]+")
_GB2312 = re.compile(rb"(?:[\xa1-\xa9\xb0-\xf7][\xa1-\xfe])+")
HEAD = 1 << 16  # bytes that are looked at
_BINARY = bytes(range(9)) + bytes(range(14, 32)) + b"\x7f"
_MAGIC = (
    (
        b"PK\x03\x04",
        "is a zip, an Excel workbook or NumPy's npz",
        "save the sheet as CSV; an npz is read as tg.read(dict(numpy.load(FILE)))",
    ),
    (b"\xd0\xcf\x11\xe0", "is an old Excel workbook", "save the sheet as CSV"),
    (b"MDF ", "is an MDF measurement", "export it as CSV or Parquet"),
    (b"UnFinMF ", "is an unfinished MDF measurement", "export it as CSV or Parquet"),
    (b"#ROSBAG", "is a ROS bag", "export its topics as CSV or Parquet"),
    (b"\x89MCAP0", "is an MCAP log", "export its topics as CSV or Parquet"),
    (b"\x89HDF", "is an HDF5 or MATLAB 7.3 file", "export it as CSV or Parquet"),
    *(
        (magic, "is a netCDF 3 file", "give tg.read the table: xarray.open_dataset(FILE)")
        for magic in (b"CDF\x01", b"CDF\x02", b"CDF\x05")
    ),
    (b"MATLAB 5.0", "is a MATLAB file", "export it as CSV or Parquet"),
    (b"SQLite format 3", "is an SQLite database", "export it as CSV or Parquet"),
    (b"ARROW1", "is an Arrow or Feather file", "save it as Parquet"),
    (
        b"TDSm",
        "is a LabVIEW TDMS file",
        "export it as CSV, or by nptdms: TdmsFile.read(...).as_dataframe().to_csv(...)",
    ),
    (
        b"LabVIEW Measurement",
        "is a LabVIEW measurement file, whose header is no table's",
        "delete the lines above 'X_Value', write time for it, and delete 'Comment' at that line's end",
    ),
    (b"ULog", "is a PX4 ULog", "make CSV tables of it by pyulog: ulog2csv LOG"),
    *(
        (
            magic,
            "is an ArduPilot log",
            "make a CSV table by pymavlink: mavlogdump.py --format csv --types GPS,IMU,RPM LOG",
        )
        for magic in (b"FMT, 128, 89", b"\xa3\x95\x80\x80\x59FMT")
    ),
    *(
        (magic, f"is packed by {name}", f"unpack it first: {name} -d FILE")
        for magic, name in ((b"\x28\xb5\x2f\xfd", "zstd"), (b"\xfd7zXZ", "xz"), (b"BZh", "bzip2"))
    ),
    *(
        (magic, "is XML", "export it as CSV, ISOXML's TASKDATA by the terminal's own software")
        for magic in (b"<?xml", b"\xef\xbb\xbf<?xml")
    ),
    (b"\x93NUMPY", "is a NumPy array without column names", "save it as CSV or Parquet with a header"),
)


def to_text(data: bytes, source: str) -> bytes:
    """The content as UTF-8 without a byte order mark; raises InputError if it is no text."""
    for magic, problem, hint in _MAGIC:
        if data.startswith(magic):
            raise InputError(problem, file=source, hint=hint)
    if data.startswith(b"\xef\xbb\xbf"):
        return data[3:]
    head = data[:HEAD]
    encoding = None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif len(head) >= 4 and head.count(0) > 0.2 * len(head):
        encoding = "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
    if encoding is not None:
        try:
            data = data.decode(encoding).encode()
            head = data[:HEAD]
        except (UnicodeDecodeError, UnicodeEncodeError) as error:
            raise _binary(source) from error
    if head.translate(None, _BINARY) != head:
        raise _binary(source)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return in_utf8(data)


def in_utf8(data: bytes, head: bytes = b"") -> bytes:
    """Text as UTF-8; what is not UTF-8 is taken for GB 18030 where that makes it Chinese, else for Latin-1.

    ``head``: the first lines of the file that it is a part of. Where these are not UTF-8, all parts are as they are.
    """
    if data.isascii():
        return data
    encoding = _encoding_of(head)
    if encoding == _UTF8:
        encoding = _encoding_of(data)
    return data if encoding == _UTF8 else data.decode(encoding, "replace").encode()


def _encoding_of(data: bytes) -> str:
    """UTF-8; or GB 18030 if all that is not ASCII is of its common characters (GB 2312), in runs of two or more; or Latin-1."""
    try:
        data.decode(_UTF8)
    except UnicodeDecodeError:
        runs = _BEYOND_ASCII.findall(data)
        is_chinese = all(len(run) % 2 == 0 and _GB2312.fullmatch(run) for run in runs)
        return "gb18030" if is_chinese and max(map(len, runs)) > 2 else "latin-1"
    return _UTF8


def _binary(source: str) -> InputError:
    return InputError("is not a table of text", file=source, hint="give a CSV or Parquet file")


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines, each column as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]

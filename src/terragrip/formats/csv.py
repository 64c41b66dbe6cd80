"""Text tables: CSV and its cousins, plain or gzipped, in blocks that are cut at the ends of lines; a short one is one block."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import numpy as np

from terragrip.errors import InputError
from terragrip.files import refuse_missing
from terragrip.formats.csv_cells import body_of, parse
from terragrip.formats.dialect import detect
from terragrip.formats.registry import Format
from terragrip.formats.table_on_disk import Columns, TableOnDisk
from terragrip.formats.text_file import is_packed, length_of, opened, read
from terragrip.recording.survey import ROWS
from terragrip.text import HEAD, in_utf8, to_text

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".csv.gz", ".txt.gz", ".tsv.gz")
_LONG = 256 << 20  # bytes
_BLOCK = 16 << 20  # bytes
_LOOK = 2 << 20  # bytes, where only some blocks are looked at


def csv_on_disk(path: str) -> TableOnDisk:
    """A text table, gzipped or not; separator, decimal sign, encoding and a units row are detected.

    Columns that are asked for are numbers where every cell is one; a column of the recording's schema must hold numbers. Raises
    InputError with row and content, some of it where a block is reached: no such file, empty, not a text table, no header, a row of
    another width, text in a number column, a name that occurs twice.
    """
    refuse_missing(path, suffixes=SUFFIXES)
    with closing(opened(path)) as stream:
        head = read(stream, HEAD, path)
    whole, lines = None, head[: head.rfind(b"\n") + 1] or head
    if b"\n" not in head or head.startswith((b"\xff\xfe", b"\xfe\xff")) or head.count(0) > 0.2 * len(head):
        whole = _text_of(path)  # its lines cannot be determined in its bytes: one block
        dialect = detect(whole, path)
    else:
        dialect = detect(to_text(lines, path), path)
    length = length_of(path)
    rows = max(1, round(length / max(len(head), 1) * head.count(b"\n")))
    size = int(np.clip(ROWS * length / rows, 1 << 20, 4 * _BLOCK))
    notes: list[str] = []
    if dialect.unnamed:
        notes.append(f"Columns that have values but no name in the header were left out: {dialect.unnamed}.")

    def blocks(names: list[str], every: int) -> Iterator[Columns]:
        chosen = [dialect.names.index(name) for name in names]
        row = 0
        parts = _lines(path, size if every == 1 else _LOOK) if whole is None else iter([(whole, True)])
        for number, (data, is_first) in enumerate(parts):
            if number % every:
                continue
            text = in_utf8(data.removeprefix(b"\xef\xbb\xbf"), lines)
            # A byte order mark, comments and the header stand in the first block only.
            start = dialect.start if is_first else 0
            body, written, remarks = body_of(text, dialect, start, more=not is_first)
            notes.extend(remarks)
            columns = parse(body, written, chosen, path, row)
            row += max((len(column) for column in columns.values()), default=0)
            yield columns

    named = [name for name in dialect.names if name]
    names = tuple(dict.fromkeys(named))
    twice = tuple(name for name in names if named.count(name) > 1)
    is_long = whole is None and length > _LONG
    return TableOnDisk(names, dialect.units, path, rows, blocks, notes, is_long=is_long, twice=twice)


def _text_of(path: str) -> bytes:
    """The content as UTF-8; of a packed file no more than is read at once, since there is no telling how much more there is."""
    with closing(opened(path)) as stream:
        raw = read(stream, _LONG + 1 if is_packed(path) else -1, path)
    if len(raw) > _LONG and is_packed(path):
        raise InputError("is not a table of text", file=path, hint="give a CSV or Parquet file")
    if not raw.strip():
        raise InputError("is empty", file=path, hint="give a table with a header and rows")
    return to_text(raw, path)


def _lines(source: str, size: int) -> Iterator[tuple[bytes, bool]]:
    """Blocks of whole lines, and whether each is the first."""
    rest, is_first = b"", True
    with closing(opened(source)) as stream:
        while data := read(stream, size, source):
            data = rest + data
            end = data.rfind(b"\n") + 1
            rest = data[end:]
            if len(rest) > 4 * size:
                raise InputError(
                    "has no line ends", file=source, hint="give a table of text, one row per line"
                )
            if end:
                yield data[:end], is_first
                is_first = False
    if rest.strip():
        yield rest, is_first


FORMATS = (Format("csv", "text table", None, SUFFIXES, in_blocks=csv_on_disk),)

"""Parquet logs, in blocks of rows."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import refuse_missing
from terragrip.formats.registry import Format
from terragrip.formats.table import from_arrow
from terragrip.formats.table_on_disk import Columns, TableOnDisk
from terragrip.recording.frames import names_and_units, of_levels, units_of_fields
from terragrip.recording.schema import TIME
from terragrip.recording.survey import ROWS

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

_LONG = 100_000_000  # bytes; ten times as much in memory
_BUFFER = 1 << 20  # bytes of a column that are read at once
_BLOCK = 20_000  # rows that are read or left out together, where a log is looked at in parts


def parquet_on_disk(path: str) -> TableOnDisk:
    """A Parquet file; raises InputError if it is damaged or none, and for columns that hold neither numbers, texts nor dates."""
    import pyarrow as pa

    with _opened(path) as file:
        # Not `Schema.empty_table`: it wakes pandas.
        fields = tuple(_flat(pa.Table.from_batches([], file.schema_arrow)).schema)
        whole = [str(field.name) for field in fields]
        stated = units_of_fields(file.schema_arrow)
        count = int(file.metadata.num_rows)
        named, behind = names_and_units([_joined(name) for name in whole])
        spelt = dict(zip(named, whole, strict=True))
        units = {name: unit for name in named if (unit := behind.get(name) or stated.get(spelt[name]))}
        unreadable = tuple(name for name, field in zip(named, fields, strict=True) if not _is_readable(field))
        index = [name for name in _index_columns(file.schema_arrow) if name in whole]
        if len(index) == 1 and TIME not in named and pa.types.is_temporal(fields[whole.index(index[0])].type):
            named = (TIME, *(name for name in named if not name.startswith("__index_level_")))
            spelt[TIME] = index[0]

    def blocks(chosen: list[str], every: int) -> Iterator[Columns]:
        with _opened(path) as file:
            batches = file.iter_batches(
                batch_size=ROWS if every <= 1 else _BLOCK, columns=[spelt[n] for n in chosen]
            )
            number = 0
            while (batch := _guarded(path, lambda: next(batches, None))) is not None:
                if number % every == 0:
                    table = _flat(pa.Table.from_batches([batch]))
                    yield {name: from_arrow(name, table.column(spelt[name]), path) for name in chosen}
                number += 1

    names = tuple(dict.fromkeys(named))
    twice = tuple(name for name in names if named.count(name) > 1)
    is_long = os.path.getsize(path) >= _LONG
    return TableOnDisk(names, units, path, count, blocks, is_long=is_long, unreadable=unreadable, twice=twice)


def _joined(name: str) -> str:
    """The name of a column of several levels, which pandas writes as a tuple, in one: ``wheel_speed_fl``."""
    if not re.fullmatch(r"\((['\"]).*\1\)", name):
        return name
    try:
        levels = ast.literal_eval(name)
    except (ValueError, SyntaxError):
        return name
    return of_levels(levels)


def _index_columns(schema: pa.Schema) -> list[str]:
    """The columns of a DataFrame's index, as pandas notes them in a file's metadata; none where these are damaged or another writer's."""
    try:
        noted = schema.pandas_metadata
    except (ValueError, RecursionError):
        return []
    columns = noted.get("index_columns") if isinstance(noted, dict) else None
    return [name for name in columns if isinstance(name, str)] if isinstance(columns, list) else []


def _flat(table: pa.Table) -> pa.Table:
    """A table whose structs, which JSON becomes in Parquet, are columns such as ``imu.pitch``."""
    import pyarrow as pa

    while any(pa.types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    return table


def _is_readable(field: pa.Field) -> bool:
    import pyarrow as pa

    try:
        from_arrow(field.name, pa.chunked_array([], field.type), None)
    except InputError:
        return False
    return True


def _opened(source: str) -> pq.ParquetFile:
    import pyarrow.parquet as pq

    refuse_missing(source, suffixes=(".parquet", ".pq"))
    # Read ahead, the whole file would stay in memory until it is closed; without a buffer, all of a row group.
    return _guarded(source, lambda: pq.ParquetFile(source, pre_buffer=False, buffer_size=_BUFFER))


def _guarded(source: str, work: Callable[[], Any]) -> Any:
    """Do ``work`` on a Parquet file; what is wrong with the file becomes an InputError."""
    import pyarrow as pa

    try:
        return work()
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        problem = f"is a damaged Parquet file, or none ({str(error)[:100]})"
        raise InputError(problem, file=source, hint="write it again, or give a CSV file") from error


FORMATS = (
    Format("parquet", "Parquet file", None, (".parquet", ".pq"), (b"PAR1",), in_blocks=parquet_on_disk),
)

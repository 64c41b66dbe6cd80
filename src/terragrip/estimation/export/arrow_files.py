"""Parquet and CSV, by Arrow."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pyarrow as pa

    from terragrip.estimation.estimates import Estimates


class _ArrowFile:
    """A file that Arrow writes table by table."""

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        self._schema = first.select(slice(0, 0)).to_arrow().schema
        self._writer = self._opened(path, self._schema)

    def _opened(self, path: Path, schema: pa.Schema) -> Any:
        raise NotImplementedError

    def write(self, part: Estimates) -> None:
        """Write the rows of a part."""
        table = part.to_arrow()  # of the same types, but where its texts are too many for short offsets
        self._writer.write_table(table if table.schema.equals(self._schema) else table.cast(self._schema))

    def close(self) -> None:
        """Complete the file."""
        self._writer.close()

    def drop(self) -> None:
        """Discard the file, which stays incomplete; Arrow's complaint of that would hide why."""
        with suppress(OSError, ValueError):
            self._writer.close()


class ParquetFile(_ArrowFile):
    """Parquet; the metadata of the file and of its columns hold all metadata of the table."""

    def _opened(self, path: Path, schema: pa.Schema) -> Any:
        import pyarrow.parquet as pq

        return pq.ParquetWriter(path, schema, **parquet_options(schema))


class CsvFile(_ArrowFile):
    """CSV: the columns alone, not what they were made from."""

    def _opened(self, path: Path, schema: pa.Schema) -> Any:
        from pyarrow import csv

        return csv.CSVWriter(path, schema, write_options=csv.WriteOptions(quoting_style="needed"))


def parquet_options(schema: pa.Schema) -> dict[str, Any]:
    """How estimates are stored: noisy floats do not repeat, so no dictionary; split by bytes they compress."""
    import pyarrow as pa

    floats = [f.name for f in schema if pa.types.is_floating(f.type)]
    texts = [f.name for f in schema if not pa.types.is_floating(f.type)]
    return {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": texts or False,
        "use_byte_stream_split": floats,
    }

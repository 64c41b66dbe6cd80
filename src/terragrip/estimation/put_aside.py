"""Tables that wait on disk while others are worked on: last in, first out."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Self

from terragrip.files import unwritable

if TYPE_CHECKING:
    import pyarrow as pa


class TablesAside:
    """A pile of tables in a temporary folder, which is made with the first of them and removed at the end.

    ``beside``: the folder in which that one is made, so that it is on the disk that the results go to; None: the system's.
    """

    def __init__(self, beside: str | os.PathLike[str] | None = None) -> None:
        self._beside = beside
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    def __enter__(self) -> Self:
        return self

    def __len__(self) -> int:
        return self._count

    def put(self, table: pa.Table) -> None:
        """Put a table on the pile; raises InputError if it cannot be written."""
        from pyarrow import feather

        try:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix=".terragrip-", dir=self._beside)
            feather.write_feather(table, self._path(self._count), compression="uncompressed")
        except OSError as error:
            where = self._folder.name if self._folder else self._beside or tempfile.gettempdir()
            raise unwritable(where, error, "free space or choose another folder") from error
        self._count += 1

    def finish(self) -> pa.Table:
        """Take the table that was put last off the pile; raises IndexError where there is none."""
        from pyarrow import feather

        if not self._count:
            raise IndexError("no table is put aside")
        self._count -= 1
        path = self._path(self._count)
        table = feather.read_table(path, memory_map=False)
        Path(path).unlink()
        return table

    def _path(self, number: int) -> str:
        assert self._folder is not None
        return str(Path(self._folder.name) / f"{number}.arrow")

    def __exit__(self, *failure: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()

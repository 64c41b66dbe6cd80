"""Blocks that wait on disk while others are worked on: last in, first out."""

from __future__ import annotations

import os
import pickle
import tempfile
from typing import IO, Any, Self

from terragrip.files import unwritable


class StackOnDisk:
    """A stack in a temporary file without a name, which only this process can open and which ends with it.

    ``beside``: the folder on whose disk it is, where the results go too; None: the system's.
    """

    def __init__(self, beside: str | os.PathLike[str] | None = None) -> None:
        self._beside = beside
        self._file: IO[bytes] | None = None
        self._places: list[int] = []

    def __enter__(self) -> Self:
        return self

    def __len__(self) -> int:
        return len(self._places)

    def push(self, block: Any) -> None:
        """Put a block on top; raises InputError if it cannot be written."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._beside)  # noqa: SIM115 - `__exit__` closes it
            self._places.append(self._file.seek(0, os.SEEK_END))
            pickle.dump(block, self._file, protocol=5)
            self._file.flush()
        except OSError as error:
            where = self._beside or tempfile.gettempdir()
            raise unwritable(where, error, "free space or choose another folder") from error

    def pop(self) -> Any:
        """Remove the block on top and return it; raises IndexError where there is none."""
        place = self._places.pop()
        assert self._file is not None
        self._file.seek(place)
        block = pickle.load(self._file)
        self._file.truncate(place)
        return block

    def __exit__(self, *failure: object) -> None:
        if self._file is not None:
            self._file.close()

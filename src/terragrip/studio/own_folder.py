"""The studio's own hidden folder within the folder that it serves; made when first needed, shown to no page."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from terragrip.files import lock, unwritable

NAME = ".terragrip"


class OwnFolder:
    """`.terragrip` in ``root``: what outlives a studio and is no file of the user's."""

    def __init__(self, root: Path) -> None:
        self.path = root / NAME
        self._saving = threading.Lock()

    def make(self) -> Path:
        """The folder, made where there is none. Raises InputError where it cannot be."""
        try:
            self.path.mkdir(exist_ok=True)
        except OSError as error:
            raise unwritable(self.path, error, "make the folder writable") from error
        return self.path

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Read a file, change it and write it, one studio and one request after the other. Raises InputError as `make`."""
        path = self.make() / "saving.lock"
        with self._saving:
            try:
                held = lock(path, wait=True)
            except OSError as error:
                raise unwritable(path, error, "make the folder writable") from error
            try:
                yield
            finally:
                if held is not None:
                    os.close(held)

"""Where a fleet's files are: a folder, or any store that fsspec knows, by its address."""

from __future__ import annotations

import os
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar
from urllib.parse import quote

from terragrip.errors import InputError
from terragrip.files import lock, sync, sync_folder

Result = TypeVar("Result")

WAITS = (0.2, 0.5, 1.0, 2.0, 4.0)
"""Seconds between the tries of a store that refuses."""
TEMPORARY, LOCK = ".tmp", ".lock"
_WHOLE = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "az", "adl", "memory"})
"""Stores that show an object only when all of it is there; elsewhere a file is written beside and renamed."""
_FINAL = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError, MemoryError)


def is_remote(path: str) -> bool:
    """Whether a path is an address (`s3://bucket/x`), not a place on this machine."""
    return "://" in path


def safe_name(text: str) -> str:
    """A text as the name of one file or folder, on any store and to readers of Hive partitions."""
    return quote(text, safe=" ()+,@") or "_"


@dataclass(frozen=True)
class Store:
    """A folder by its address; names within it are relative, with `/`. Travels to workers."""

    url: str

    @classmethod
    def at(cls, url: str) -> Store:
        """The store of a path or an address. Raises InputError where fsspec does not know its kind, or lacks its package."""
        store = cls(url if is_remote(url) else os.path.abspath(url))
        try:
            _ = store._place
        except (ImportError, ValueError) as error:
            raise InputError(
                f"is no store that can be reached ({error})",
                file=url,
                hint="name a folder, or install what fsspec needs for it",
            ) from None
        return store

    @cached_property
    def _place(self) -> tuple[Any, str]:
        from fsspec.core import url_to_fs

        system, root = url_to_fs(self.url)
        return system, str(root).rstrip("/")

    def __getstate__(self) -> dict[str, str]:
        return {"url": self.url}

    def __setstate__(self, state: dict[str, str]) -> None:
        self.__dict__.update(state)

    @property
    def is_local(self) -> bool:
        """Whether it is a folder of this machine."""
        return not is_remote(self.url)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other calls on this machine from a folder; the lock goes with the process. A store elsewhere has no lock.

        Raises InputError where the store cannot be written, or another call works on the folder; OSError where the lock cannot be made.
        """
        self.check()
        if not self.is_local:
            yield
            return
        held = lock(Path(self.url) / LOCK)
        if held is None:
            raise InputError(
                "another terragrip fleet works on it",
                file=self.url,
                place="--output",
                hint="wait for its end, or name another folder",
            )
        try:
            yield
        finally:
            os.close(held)

    def _path(self, name: str) -> str:
        return f"{self._place[1]}/{name}"

    @contextmanager
    def bench(self, scratch: str | None = None) -> Iterator[Path]:
        """A folder for files that are made to be `put`: within a local store, so that a rename puts them, else in ``scratch`` (None: the
        system's). It goes with what is left in it. Raises OSError where it cannot be made.
        """
        if self.is_local:
            scratch = os.path.join(self.url, TEMPORARY)
            os.makedirs(scratch, exist_ok=True)
        with TemporaryDirectory(prefix="terragrip-fleet-", dir=scratch, ignore_cleanup_errors=True) as folder:
            yield Path(folder)

    def put(self, local: Path, name: str) -> None:
        """Move a file of a `bench` to ``name``: whole or not at all. Raises OSError where the store keeps refusing."""
        system, protocol = self._place[0], self._place[0].protocol
        whole = bool({protocol} & _WHOLE if isinstance(protocol, str) else _WHOLE.intersection(protocol))
        target = self._path(name)

        def copy() -> None:
            system.makedirs(os.path.dirname(target), exist_ok=True)
            if whole:
                system.put_file(os.fspath(local), target)
                return
            beside = self._path(f"{TEMPORARY}/{secrets.token_hex(8)}")
            system.makedirs(os.path.dirname(beside), exist_ok=True)
            system.put_file(os.fspath(local), beside)
            system.mv(beside, target)

        if not self.is_local:
            patiently(copy)
            local.unlink()
            return
        folder = Path(target).parent
        patiently(lambda: folder.mkdir(parents=True, exist_ok=True))
        patiently(lambda: sync(local))
        patiently(lambda: os.replace(local, target))
        patiently(lambda: sync_folder(folder))

    def read(self, name: str) -> bytes | None:
        """The content of a file; None where there is none."""

        def content() -> bytes | None:
            try:
                return bytes(self._place[0].cat_file(self._path(name)))
            except FileNotFoundError:
                return None

        return patiently(content)

    def remove(self, name: str) -> None:
        """Remove a file or a folder with all in it; nothing where there is none."""
        system = self._place[0]

        def gone() -> None:
            if system.exists(self._path(name)):
                system.rm(self._path(name), recursive=True)

        patiently(gone)

    def read_all(self, folder: str) -> list[bytes]:
        """The content of all files right in a folder, in the order of their names."""
        system = self._place[0]
        system.invalidate_cache()
        if not system.exists(self._path(folder)):
            return []
        paths = sorted(patiently(lambda: system.ls(self._path(folder), detail=False)))
        content = patiently(lambda: system.cat(paths)) if paths else {}
        # of one path some stores give its content alone
        return [content] if isinstance(content, bytes) else [content[path] for path in content]

    def check(self) -> None:
        """Try to write and to remove. Raises InputError where it cannot be, in one try."""
        system, name = self._place[0], self._path(f"{TEMPORARY}/{secrets.token_hex(8)}")
        try:
            if self.is_local and os.path.exists(self.url) and not os.path.isdir(self.url):
                raise InputError(
                    "is a file, and a folder is needed", file=self.url, place="--output", hint="name a folder"
                )
            system.makedirs(os.path.dirname(name), exist_ok=True)
            system.pipe_file(name, b"")
            system.rm(name)
        except InputError:
            raise
        except Exception as error:
            # each store has its own errors (botocore's are no OSError): whatever it says is the reason
            raise InputError(
                f"cannot be written ({_said(error)})",
                file=self.url,
                place="--output",
                hint="choose another place, or give access to it",
            ) from error


@contextmanager
def fetched(url: str, folder: Path) -> Iterator[Path]:
    """A log on this machine: itself, or for as long as it is needed a copy in ``folder`` of one of a store.

    Raises OSError, also where there is none.
    """
    if not is_remote(url):
        yield Path(url)
        return
    from fsspec.core import url_to_fs

    system, path = url_to_fs(url)
    with TemporaryDirectory(dir=folder) as own:
        local = Path(own) / os.path.basename(path)
        patiently(lambda: system.get_file(path, os.fspath(local)))
        yield local


def patiently(function: Callable[[], Result]) -> Result:
    """What a store answers, asked again after each of `WAITS` while it refuses. Raises the OSError that it ends with."""
    for wait in (*WAITS, None):
        try:
            return function()
        except _FINAL:
            raise
        except Exception as error:  # each store has its own errors (botocore's are no OSError)
            if wait is None:
                raise error if isinstance(error, OSError) else OSError(_said(error)) from error
            time.sleep(wait)
    raise AssertionError("not reached")


def _said(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__

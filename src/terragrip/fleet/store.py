"""Where a fleet's files are kept: a folder, or any store that fsspec can address."""

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

RETRY_DELAYS = (0.2, 0.5, 1.0, 2.0, 4.0)
"""Delays before repeating an operation that the store refused [s]."""
TEMPORARY, LOCK = ".tmp", ".lock"
_ATOMIC = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "az", "adl", "memory"})
"""Stores in which an object appears only when complete; in others a file is written under a temporary name and renamed."""
_NOT_RETRIED = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError, MemoryError)


def is_remote(path: str) -> bool:
    """Whether a path is the address of a store (`s3://bucket/x`) rather than a path on this machine."""
    return "://" in path


def safe_name(text: str) -> str:
    """A text encoded as a single file or folder name, valid in any store and in Hive partitions."""
    return quote(text, safe=" ()+,@") or "_"


@dataclass(frozen=True)
class Store:
    """A folder or store by its address; names within it are relative, with `/`. It can be pickled to workers."""

    url: str

    @classmethod
    def at(cls, url: str) -> Store:
        """The store at a path or address. Raises InputError if fsspec does not know its protocol or lacks its package."""
        store = cls(url if is_remote(url) else os.path.abspath(url))
        try:
            _ = store._place
        except (ImportError, ValueError) as error:
            raise InputError(
                f"is not a store that fsspec can open ({error})",
                file=url,
                hint="name a folder, or install the package that fsspec needs",
            ) from None
        return store

    @cached_property
    def _place(self) -> tuple[Any, str]:
        from fsspec.core import url_to_fs

        system, root = url_to_fs(self.url)
        return system, str(root).rstrip("/")

    @property
    def is_local(self) -> bool:
        """Whether it is a folder on this machine."""
        return not is_remote(self.url)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder against other calls on this machine; the lock ends with the process. A remote store has no lock.

        Raises InputError if the store cannot be written or another call is using the folder, OSError if the lock cannot be created.
        """
        self.check()
        if not self.is_local:
            yield
            return
        held = lock(Path(self.url) / LOCK)
        if held is None:
            raise InputError(
                "another terragrip fleet is using it",
                file=self.url,
                place="--output",
                hint="wait until it ends, or name another folder",
            )
        try:
            yield
        finally:
            os.close(held)

    def _path(self, name: str) -> str:
        return f"{self._place[1]}/{name}"

    @contextmanager
    def staging(self, scratch: str | None = None) -> Iterator[Path]:
        """A temporary folder for files to `put`: within a local store, so that storing is a rename; otherwise in ``scratch`` (None: the
        system's temporary folder). Raises OSError if it cannot be created.
        """
        if self.is_local:
            scratch = os.path.join(self.url, TEMPORARY)
            os.makedirs(scratch, exist_ok=True)
        with TemporaryDirectory(prefix="terragrip-fleet-", dir=scratch, ignore_cleanup_errors=True) as folder:
            yield Path(folder)

    def put(self, local: Path, name: str) -> None:
        """Move a file of a `staging` folder to ``name``, whole or not at all. Raises OSError if the store keeps refusing."""
        system, protocol = self._place[0], self._place[0].protocol
        atomic = bool({protocol} & _ATOMIC if isinstance(protocol, str) else _ATOMIC.intersection(protocol))
        target = self._path(name)

        def copy() -> None:
            system.makedirs(os.path.dirname(target), exist_ok=True)
            if atomic:
                system.put_file(os.fspath(local), target)
                return
            beside = self._path(f"{TEMPORARY}/{secrets.token_hex(8)}")
            system.makedirs(os.path.dirname(beside), exist_ok=True)
            system.put_file(os.fspath(local), beside)
            system.mv(beside, target)

        if not self.is_local:
            retried(copy)
            local.unlink()
            return
        folder = Path(target).parent
        retried(lambda: folder.mkdir(parents=True, exist_ok=True))
        retried(lambda: sync(local))
        retried(lambda: os.replace(local, target))
        retried(lambda: sync_folder(folder))

    def read(self, name: str) -> bytes | None:
        """The content of a file; None if there is none."""

        def content() -> bytes | None:
            try:
                return bytes(self._place[0].cat_file(self._path(name)))
            except FileNotFoundError:
                return None

        return retried(content)

    def remove(self, name: str) -> None:
        """Remove a file, or a folder and its content; does nothing if there is none."""
        system = self._place[0]

        def delete() -> None:
            if system.exists(self._path(name)):
                system.rm(self._path(name), recursive=True)

        retried(delete)

    def read_all(self, folder: str) -> dict[str, bytes]:
        """The content of every file directly in a folder by its name within the store, in order of name."""
        system = self._place[0]
        system.invalidate_cache()
        if not system.exists(self._path(folder)):
            return {}
        paths = sorted(retried(lambda: system.ls(self._path(folder), detail=False)))
        content = retried(lambda: system.cat(paths)) if paths else {}
        # for a single path some stores return its content alone
        content = {paths[0]: content} if isinstance(content, bytes) else content
        return {f"{folder}/{os.path.basename(path)}": content[path] for path in content}

    def size(self, name: str) -> int | None:
        """The size of a file [bytes]; None if there is none."""

        def size() -> int | None:
            try:
                return int(self._place[0].info(self._path(name))["size"])
            except FileNotFoundError:
                return None

        return retried(size)

    def check(self) -> None:
        """Write and remove a file, without retrying. Raises InputError if that fails."""
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
            # each store has its own exceptions (botocore's are no OSError)
            raise InputError(
                f"cannot be written ({_message(error)})",
                file=self.url,
                place="--output",
                hint="choose another place, or allow access to it",
            ) from error


@contextmanager
def fetched(url: str, folder: Path) -> Iterator[Path]:
    """A log as a local file: itself, or a temporary copy in ``folder`` of one in a store.

    Raises OSError, also if there is no such log.
    """
    if not is_remote(url):
        yield Path(url)
        return
    from fsspec.core import url_to_fs

    system, path = url_to_fs(url)
    with TemporaryDirectory(dir=folder) as own:
        local = Path(own) / os.path.basename(path)
        retried(lambda: system.get_file(path, os.fspath(local)))
        yield local


def retried(function: Callable[[], Result]) -> Result:
    """The result of an operation on a store, retried after each of `RETRY_DELAYS`. Raises the last failure as an OSError."""
    for delay in (*RETRY_DELAYS, None):
        try:
            return function()
        except _NOT_RETRIED:
            raise
        except Exception as error:  # each store has its own exceptions (botocore's are no OSError)
            if delay is None:
                raise error if isinstance(error, OSError) else OSError(_message(error)) from error
            time.sleep(delay)
    raise AssertionError("not reached")


def _message(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__

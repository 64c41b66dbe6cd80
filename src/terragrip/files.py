"""Files on disk: a helpful refusal, a fingerprint, locks, and writing that never leaves half a file."""

from __future__ import annotations

import os
import secrets
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from terragrip.errors import InputError, suggestion

UNFINISHED = ".unfinished-"
"""How the name of a file begins that is still being written, or was left by a process that was killed meanwhile."""
_DAY = 86_400.0
_swept: set[tuple[int, str]] = set()


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside ``path``, renamed to it at the end, so that no file is ever half-written.

    What it holds is on the disk before it gets its name: a crash of the machine leaves the old file or the new one. Temporaries that
    killed processes left in the folder are removed. Raises InputError if the folder cannot be written or the disk is full.
    """
    target = Path(path)
    try:
        with suppress(FileNotFoundError):
            os.lstat(target)  # a name too long is refused before the work, not after it
        suffix = "".join(target.suffixes[-2:]) if target.suffix == ".gz" else target.suffix
        temporary = target.with_name(f"{UNFINISHED}{this_process()}-{secrets.token_hex(4)}{suffix}")
        _remove_left_over(target.parent)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except (OSError, ValueError) as error:
        raise unwritable(path, error, "choose another folder, or make it writable") from error
    try:
        yield temporary
        sync(temporary)
        temporary.replace(target)
        with suppress(OSError):  # the file is whole; some network file systems sync no folder
            sync_folder(target.parent)
    except OSError as error:
        raise unwritable(path, error, "free space or choose another folder") from error
    finally:
        temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Have what was written to a file survive a crash of the machine; raises OSError."""
    file = os.open(path, os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def sync_folder(folder: Path) -> None:
    """Have renames in a folder survive a crash of the machine; raises OSError. Windows cannot, and needs not, do so."""
    if os.name != "posix":
        return
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def this_process() -> str:
    """Which process this is, among those of all machines and containers that may write to one folder."""
    return f"{_machine()}-{os.getpid()}"


def has_ended(process: str) -> bool:
    """Whether a process, named by its `this_process`, runs no more; False where that cannot be known from here."""
    machine, _, number = process.partition("-")
    if os.name != "posix" or machine != _machine() or not number.isdigit():
        return False
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # another user's
        return False
    return False


@cache
def _machine() -> str:
    """This boot of this machine, and on Linux the container: process numbers mean the same within."""
    import platform

    parts = [platform.node()]
    with suppress(OSError):
        parts += [Path("/proc/sys/kernel/random/boot_id").read_text(), os.readlink("/proc/self/ns/pid")]
    return f"{zlib.crc32(' '.join(parts).encode()):08x}"


def _remove_left_over(folder: Path) -> None:
    """Remove the temporaries of ended processes, and of processes elsewhere those that nobody has written to for a day; looks once."""
    once = (os.getpid(), os.path.abspath(folder))
    if once in _swept:
        return
    _swept.add(once)
    with os.scandir(folder) as entries:
        left = [entry for entry in entries if entry.name.startswith(UNFINISHED)]
    for entry in left:
        process = "-".join(entry.name.removeprefix(UNFINISHED).split("-")[:2])
        with suppress(OSError):
            if has_ended(process) or time.time() - entry.stat().st_mtime > _DAY:
                os.unlink(entry.path)


def lock(path: Path, *, wait: bool = False) -> int | None:
    """Lock a file, which is made: a descriptor whose closing, or the end of the process however it comes, lets go of the lock.

    None where another holds it, unless ``wait``. Raises OSError where the file cannot be made. Locks nothing on Windows.
    """
    file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except ImportError:
        pass
    except BlockingIOError:
        os.close(file)
        return None
    except BaseException:
        os.close(file)
        raise
    return file


def unwritable(path: str | os.PathLike[str], error: Exception, hint: str) -> InputError:
    """The InputError for a file that cannot be written."""
    return InputError(
        f"cannot be written ({getattr(error, 'strerror', None) or error})", file=path, hint=hint
    )


def made_folder(path: str | os.PathLike[str]) -> Path:
    """A folder, made with those above it where it is missing; raises InputError where it cannot be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"folder cannot be made ({error.strerror})"
        raise InputError(problem, file=folder, hint="choose another folder") from error
    return folder


def path_of(path: object, otherwise: str = "give the path of a file") -> str:
    """A path as text; raises InputError, with ``otherwise`` as its hint, if it is none."""
    if isinstance(path, str | os.PathLike):
        return os.fspath(path)
    raise InputError(f"{type(path).__name__} is no path", hint=otherwise)


def refuse_missing(path: str | os.PathLike[str], *, suffixes: tuple[str, ...] = ()) -> None:
    """Raise InputError if ``path`` is no file; names the nearest one, or one of ``suffixes`` in a folder."""
    target = Path(path)
    try:
        if target.is_file():
            return
        if target.is_dir():
            inside = sorted(p.name for p in target.iterdir() if p.name.lower().endswith(suffixes or ""))
            hint = f"name a file in it, such as {inside[0]}" if inside else "name a file"
            raise InputError("is a folder", file=path, hint=hint)
        if target.exists():
            raise InputError("is not a regular file", file=path, hint="name a file on disk")
        if not target.parent.is_dir():
            raise InputError("no such file", file=path, hint=f"there is no folder {target.parent}")
        beside = [p.name for p in target.parent.iterdir() if p.is_file()]
    except InputError:
        raise
    except (OSError, ValueError) as error:  # no permission; a name too long or with a NUL
        raise InputError(
            f"cannot be opened ({error})", file=path, hint="check the path and its permissions"
        ) from error
    raise InputError("no such file", file=path, hint=suggestion(target.name, beside, "check the path"))


def sha256(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's content in hexadecimal, read in pieces; raises InputError if it cannot be read."""
    import hashlib

    refuse_missing(path)
    try:
        with Path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def unreadable(path: str | os.PathLike[str], error: OSError) -> InputError:
    """The InputError for a file that exists but cannot be read."""
    return InputError(
        f"cannot be read ({error.strerror or error})", file=path, hint="check its permissions and the disk"
    )

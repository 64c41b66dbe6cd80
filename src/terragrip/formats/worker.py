"""A process of its own for a library whose C code a damaged file can crash, or send out of bounds.

What reads a file there is a generator: it yields what the file offers, is sent what is wanted of it, and yields that. `Worker` runs it; the
two sides exchange pickles. Memory and processor time are bounded for each file. A process that has ended a file waits for the next one,
since importing the library takes longer than a small file.
"""

from __future__ import annotations

import atexit
import os
import pickle
import resource
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Self

from terragrip.errors import InputError
from terragrip.formats.boundary import needed

_MEMORY = 3 << 30  # bytes of address space beyond what the imports and the file take
_SECONDS, _BYTES_A_SECOND = 10, 1 << 20  # of the processor: so many, and one more for so many bytes

Reading = Generator[Any, Any, None]

_idle: dict[tuple[str, int], list[subprocess.Popen[bytes]]] = {}
"""Processes that wait for a file, by reader and by the process that started them: a forked child must not share its parent's."""


class UnreadableError(InputError):
    """The library failed on a file, or ended the process."""


@dataclass(frozen=True)
class _End:
    """Follows the last item of a file; ``failure``: what went wrong."""

    failure: InputError | str | None


class Worker:
    """The process that reads a file, and its items. Raises UnreadableError where the reader fails or ends, and the InputErrors of its own.

    ``reader``: module and function, of the path and the ``arguments``, with the library ``package``; ``kind`` is the file's, for messages.
    """

    def __init__(self, reader: str, package: str, path: str, kind: str, *arguments: Any) -> None:
        self._reader, self._package = reader, package
        self._path, self._kind, self._arguments = path, kind, arguments
        self._has_ended = False
        if find_spec(package) is None:
            needed(package, f"a {kind}")  # says what to install

    def __enter__(self) -> Self:
        waiting = [p for p in _idle.pop((self._reader, os.getpid()), []) if p.poll() is None]
        self._process = waiting.pop() if waiting else _started(self._reader, self._package)
        _idle[self._reader, os.getpid()] = waiting
        self.send((self._path, *self._arguments))
        return self

    def __exit__(self, *failure: object) -> None:
        if self._has_ended:
            _idle.setdefault((self._reader, os.getpid()), []).append(self._process)
        else:
            self._process.kill()
            self._process.communicate()

    def send(self, message: Any) -> None:
        """Send the reader something."""
        assert self._process.stdin is not None
        try:
            pickle.dump(message, self._process.stdin)
            self._process.stdin.flush()
        except OSError as error:
            raise self._unreadable("it ends the reader") from error

    def receive(self) -> Any:
        """The next item; None behind the last."""
        assert self._process.stdout is not None
        try:
            item = pickle.load(self._process.stdout)
        except (EOFError, pickle.UnpicklingError) as error:
            raise self._unreadable("it ends the reader") from error
        if not isinstance(item, _End):
            return item
        self._has_ended = True
        if isinstance(item.failure, InputError):
            raise item.failure
        if item.failure is not None:
            raise self._unreadable(item.failure)
        return None

    def __iter__(self) -> Iterator[Any]:
        while (item := self.receive()) is not None:
            yield item

    def _unreadable(self, why: str) -> InputError:
        sentence = " ".join(why.split())[:100]
        hint = "copy or record it again"
        return UnreadableError(f"is a damaged {self._kind}, or none ({sentence})", file=self._path, hint=hint)


def _started(reader: str, package: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [
            sys.executable,
            "-W",
            "ignore",
            "-c",
            f"from {__name__} import serve; serve({reader!r}, {package!r})",
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )


@atexit.register
def _end_all() -> None:
    for (_, owner), waiting in _idle.items():
        for process in waiting if owner == os.getpid() else ():
            process.kill()
            process.communicate()


def serve(reader: str, package: str) -> None:
    """Read the files that standard input names, until it is closed; what goes wrong with one is its last item."""
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what libraries print is none of it
    module, _, function = reader.partition(":")
    read: Callable[..., Reading] = getattr(import_module(module), function)

    def send(item: Any) -> None:
        pickle.dump(item, out, protocol=5)
        out.flush()

    while True:
        try:
            path, *arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        failure: InputError | str | None = None
        try:
            import_module(package)  # before its memory counts
            _limit(path)
            items = read(path, *arguments)
            send(next(items))
            item = items.send(pickle.load(sys.stdin.buffer))
            while True:
                send(item)
                item = next(items)
        except StopIteration:
            pass
        except InputError as error:
            failure = error
        except Exception as error:  # noqa: BLE001 - whatever a damaged file brings is reported to the caller
            failure = f"{type(error).__name__}: {error}"[:200]
        send(_End(failure))


def _limit(path: str) -> None:
    """Bound what a damaged file may cost, beyond what the process has taken so far."""
    with open("/proc/self/statm") as stream:
        in_use = int(stream.read().split()[0]) * resource.getpagesize()
    size = os.path.getsize(path)  # which may be mapped
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + _SECONDS + size // _BYTES_A_SECOND
    for what, most in ((resource.RLIMIT_AS, in_use + size + _MEMORY), (resource.RLIMIT_CPU, seconds)):
        hard = resource.getrlimit(what)[1]  # stays, so that the next file may have more
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

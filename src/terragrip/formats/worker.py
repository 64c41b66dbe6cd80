"""A process of its own for a library whose C code a damaged file can crash, or send out of bounds.

The worker is a module that calls `serve`; who wants a file's content runs it by `Worker`. Standard output carries JSON lines and NumPy
arrays, standard input JSON lines: a path, then what the two sides agree on. Memory and processor time are bounded for each file.
A process that has ended a file waits for the next one, since importing the library takes longer than a small file.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, BinaryIO, Self

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.formats.boundary import needed

_MEMORY = 3 << 30  # bytes of address space beyond what the imports and the file take
_SECONDS, _BYTES_A_SECOND = 10, 1 << 20  # of the processor: so many, and one more for so many bytes
_ENDED = "it ends the reader"


_idle: dict[tuple[str, int], list[subprocess.Popen[bytes]]] = {}
"""Processes that wait for a file, by module and by the process that started them: a forked child must not share its parent's."""


class Worker:
    """The process that reads a file, and what it says. Raises InputError where the reader fails or ends.

    ``module`` serves, with the library ``package``; ``kind`` is the file's, for messages.
    """

    def __init__(self, module: str, package: str, path: str, kind: str) -> None:
        self._module, self._path, self._kind = module, path, kind
        self._has_ended = self._is_lost = False
        if find_spec(package) is None:
            needed(package, f"a {kind}")  # says what to install

    def __enter__(self) -> Self:
        waiting = [p for p in _idle.pop((self._module, os.getpid()), []) if p.poll() is None]
        self._process = waiting.pop() if waiting else _started(self._module)
        _idle[self._module, os.getpid()] = waiting
        self.send(self._path)
        return self

    def __exit__(self, kind: type[BaseException] | None, *failure: object) -> None:
        if self._is_lost or (kind is not None and not issubclass(kind, Exception)):
            self._kill()
            return
        try:
            if not self._has_ended:
                self.send(None)  # nothing more is asked for
            while not self._has_ended:
                self.receive()
        except (InputError, ValueError):  # it was still sending, or is gone
            self._kill()
            return
        _idle.setdefault((self._module, os.getpid()), []).append(self._process)

    def _kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def send(self, message: Any) -> None:
        """Send the worker something."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        except OSError as error:
            raise self._damaged(_ENDED) from error

    def receive(self) -> dict[str, Any]:
        """The next message."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            raise self._damaged(_ENDED)
        message: dict[str, Any] = json.loads(line)
        self._has_ended = "end" in message or "error" in message
        if "error" in message:
            raise self._damaged(str(message["error"]))
        return message

    def array(self) -> npt.NDArray[Any]:
        """The next array."""
        try:
            return np.lib.format.read_array(self, allow_pickle=False)  # type: ignore[arg-type]  # it reads as a file does
        except ValueError as error:
            raise self._damaged(_ENDED) from error

    def read(self, size: int) -> bytes:
        """Bytes of an array, for NumPy."""
        assert self._process.stdout is not None
        return self._process.stdout.read(size)

    def _damaged(self, why: str) -> InputError:
        self._is_lost = self._is_lost or why == _ENDED
        sentence = " ".join(why.split())[:100]
        hint = "copy or record it again"
        return InputError(f"is a damaged {self._kind}, or none ({sentence})", file=self._path, hint=hint)


def _started(module: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", module],
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


class Outlet:
    """The messages of a worker to the process that runs it."""

    def __init__(self, out: BinaryIO) -> None:
        self._out = out
        self.write = out.write  # for NumPy, which takes this for no file and so keeps the order of bytes

    def send(self, message: dict[str, Any]) -> None:
        """Send a message."""
        self._out.write(json.dumps(message).encode() + b"\n")
        self._out.flush()

    def send_array(self, array: npt.NDArray[Any]) -> None:
        """Send an array."""
        np.lib.format.write_array(self, np.ascontiguousarray(array), allow_pickle=False)
        self._out.flush()

    def receive(self) -> Any:
        """The next message of the other side."""
        return json.loads(sys.stdin.readline())


def serve(package: str, work: Callable[[str, Outlet], None]) -> int:
    """Do ``work`` on the files that standard input names; anything that goes wrong becomes a message with the reason."""
    out = Outlet(os.fdopen(os.dup(sys.stdout.fileno()), "wb"))
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what libraries print is none of it
    while line := sys.stdin.readline():
        try:
            __import__(package)
            path = json.loads(line)
            _limit(path)
            work(path, out)
            out.send({"end": True})
        except Exception as error:  # noqa: BLE001 - whatever a damaged file brings is reported to the caller
            with contextlib.suppress(OSError):
                out.send({"error": f"{type(error).__name__}: {error}"[:200]})
    return 0


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

"""A process of its own for a library whose C code a damaged file can crash, or send out of bounds.

The worker is a module that calls `serve`; who wants the file's content runs it by `Worker`. Standard output carries JSON
lines and NumPy arrays, standard input JSON lines. Memory and processor time of the worker are bounded.
"""

from __future__ import annotations

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
_SECONDS, _BYTES_A_SECOND = 60, 1 << 20  # of the processor: so many, and one more for so many bytes
_ENDED = "it ends the reader"


class Worker:
    """The process that reads a file, and what it says. Raises InputError where the reader fails or ends.

    ``module`` serves, with the library ``package``; ``kind`` is the file's, for messages.
    """

    def __init__(self, module: str, package: str, path: str, kind: str) -> None:
        self._module, self._path, self._kind = module, path, kind
        if find_spec(package) is None:
            needed(package, f"a {kind}")  # says what to install

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", self._module, self._path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        return self

    def __exit__(self, *failure: object) -> None:
        self._process.kill()
        self._process.communicate()

    def say(self, message: Any) -> None:
        """Tell the worker something."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        except OSError as error:
            raise self._damaged(_ENDED) from error

    def hear(self) -> dict[str, Any]:
        """The next message."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            raise self._damaged(_ENDED)
        message: dict[str, Any] = json.loads(line)
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
        said = " ".join(why.split())[:100]
        mend = "copy or record it again"
        return InputError(f"is a damaged {self._kind}, or none ({said})", file=self._path, mend=mend)


class Outlet:
    """What a worker says, to whoever runs it."""

    def __init__(self, out: BinaryIO) -> None:
        self._out = out
        self.write = out.write  # for NumPy, which takes this for no file and so keeps the order of bytes

    def say(self, message: dict[str, Any]) -> None:
        """Send a message."""
        self._out.write(json.dumps(message).encode() + b"\n")
        self._out.flush()

    def send(self, array: npt.NDArray[Any]) -> None:
        """Send an array."""
        np.lib.format.write_array(self, np.ascontiguousarray(array), allow_pickle=False)
        self._out.flush()

    def hear(self) -> Any:
        """What the other side says."""
        return json.loads(sys.stdin.readline())


def serve(package: str, work: Callable[[str, Outlet], None]) -> int:
    """Do ``work`` on the file that the command line names; anything that goes wrong becomes a message with the reason."""
    out = Outlet(os.fdopen(os.dup(sys.stdout.fileno()), "wb"))
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what libraries print is none of it
    try:
        __import__(package)
        _limit(sys.argv[1])
        work(sys.argv[1], out)
        out.say({"end": True})
    except Exception as error:  # noqa: BLE001 - whatever a damaged file brings is told to the one who asked
        with contextlib.suppress(OSError):
            out.say({"error": f"{type(error).__name__}: {error}"[:200]})
        return 1
    return 0


def _limit(path: str) -> None:
    """Bound what a damaged file may cost."""
    with open("/proc/self/statm") as stream:
        taken = int(stream.read().split()[0]) * resource.getpagesize()
    size = os.path.getsize(path)  # which may be mapped
    for what, most in (
        (resource.RLIMIT_AS, taken + size + _MEMORY),
        (resource.RLIMIT_CPU, _SECONDS + size // _BYTES_A_SECOND),
    ):
        hard = resource.getrlimit(what)[1]
        limit = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (limit, hard))

"""ASAM MDF 3 and 4 (MF4): measured signals, and raw CAN frames with a DBC or the table of J1939, by asammdf.

asammdf runs in a process of its own (`terragrip.formats.mdf_worker` says why).
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import needed
from terragrip.formats.can.catalog import catalog
from terragrip.formats.can.frames import Frames
from terragrip.formats.can.log import finished
from terragrip.formats.kind import Databases
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted

_WORKER = "terragrip.formats.mdf_worker"


def read_mdf(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read an MDF file; raises InputError if it is damaged, or holds neither signals nor known frames."""
    frames = Frames(catalog(databases), wanted)
    with _Worker(path) as worker:
        head = worker.hear()
        start, units = float(head["start"]), dict(head["units"])
        worker.say([name for name in units if wanted is None or wanted(name)])
        signals: dict[str, Signal] = {}
        clocks: dict[int, npt.NDArray[np.float64]] = {}
        while "end" not in (message := worker.hear()):
            if "frames" in message:
                time, identifiers, lengths, data = (worker.array() for _ in range(4))
                frames.take_many(start + time, identifiers, lengths, data)
                continue
            group = int(message["group"])
            time = clocks[group] if message["shared"] else start + worker.array()
            clocks.setdefault(group, time)
            values = worker.array()
            signals[str(message["name"])] = Signal(
                time, values.astype(object) if values.dtype.kind == "U" else values, message["unit"] or None
            )
    if not frames.count:
        return SignalLog(tuple(units), signals, path, sha256(path))
    log = finished(frames, path, (), databases, refuse_unknown=not signals)
    return SignalLog((*units, *log.names), signals | log.signals, path, log.sha256, log.notes)


class _Worker:
    """The process that reads a file, and what it says."""

    def __init__(self, path: str) -> None:
        self._path = path
        if find_spec("asammdf") is None:
            needed("asammdf", "an MDF file")  # says what to install

    def __enter__(self) -> _Worker:
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", _WORKER, self._path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        return self

    def __exit__(self, *failure: object) -> None:
        self._process.kill()
        self._process.communicate()

    def say(self, names: list[str]) -> None:
        """Tell which signals are wanted."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(names).encode() + b"\n")
            self._process.stdin.flush()
        except OSError as error:
            raise self._damaged("it ends the reader") from error

    def hear(self) -> dict[str, Any]:
        """The next message; raises InputError where the reader failed or ended."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            raise self._damaged("it ends the reader")
        message: dict[str, Any] = json.loads(line)
        if "error" in message:
            raise self._damaged(str(message["error"]))
        return message

    def array(self) -> npt.NDArray[Any]:
        """The next array."""
        try:
            return np.lib.format.read_array(self, allow_pickle=False)  # type: ignore[arg-type]  # it reads as a file does
        except ValueError as error:
            raise self._damaged("it ends the reader") from error

    def read(self, size: int) -> bytes:
        """Bytes of an array, for NumPy."""
        assert self._process.stdout is not None
        return self._process.stdout.read(size)

    def _damaged(self, why: str) -> InputError:
        said = " ".join(why.split())[:100]
        return InputError(
            f"is a damaged MDF file, or none ({said})", file=self._path, mend="copy or record it again"
        )

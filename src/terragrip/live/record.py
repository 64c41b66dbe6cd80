"""The record: nothing that came in is lost, and a run goes on after a kill as if it had never stopped.

A folder holds closed segments (``recording-NNNNNN.parquet``: rows as measured; ``estimates-NNNNNN.parquet``; where there
are any, ``refused-`` and ``events-NNNNNN.jsonl``), the state at the end of the last closed one (``snapshot-NNNNNN.json``),
and the write-ahead file of the open one (``wal-NNNNNN.log``). A segment is closed in a thread: files, then the snapshot,
then its write-ahead file goes. What a kill leaves between these steps is made anew from the write-ahead file.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from importlib import import_module
from pathlib import Path
from typing import Any

from terragrip.errors import InputError
from terragrip.files import unwritable
from terragrip.live.core import Core
from terragrip.live.outputs import Output
from terragrip.live.record_folder import (
    SOILS,
    clear,
    last_snapshot,
    load_snapshot,
    locked,
    refuse_other,
    replay,
    wal_path,
    write_snapshot,
)
from terragrip.live.segment import Segment
from terragrip.live.wal import WriteAhead

ROWS = 10_000  # a segment is closed after so many rows
SECONDS = 60.0  # or so long after its first arrival


class Recorder:
    """Keeps the inputs of a `Core`, each with the outputs that followed from it.

    Parameters
    ----------
    folder: made if absent. If it holds a record, the run goes on from its end.
    core: one that has processed nothing yet. The record's takes its place; vehicle, settings and library must be the same.
    rows, seconds: when a segment is closed.
    thread: one thread, shared with other records, that does what waits for the disk; None: one of its own.

    Raises InputError if the folder cannot be used, is in use, or holds the record of another vehicle or other settings.
    """

    def __init__(
        self,
        folder: Path,
        core: Core,
        *,
        rows: int = ROWS,
        seconds: float = SECONDS,
        thread: Executor | None = None,
    ) -> None:
        self.folder = folder
        self._rows, self._seconds = rows, seconds
        self._lock = locked(folder)
        self._thread = thread or record_thread()
        self._is_shared = thread is not None
        self._closing: list[Future[None]] = []
        # Now, or it would hold up the estimates when the first segment closes.
        self._thread.submit(import_module, "pyarrow.parquet")
        self._syncing: Future[None] | None = None
        self.opening: list[Output] = []  # what opening brought: that a run goes on
        self.rows_kept = 0  # by this process
        self._opened: float | None = None  # arrival of the segment's first row, nearly
        try:
            self._resume(core)
        except OSError as error:
            self.abandon()
            raise unwritable(folder, error, "free space or choose another folder") from error
        except InputError:
            self.abandon()
            raise

    def _resume(self, core: Core) -> None:
        for part in self.folder.glob(".*.part"):
            part.unlink()
        number = last_snapshot(self.folder)
        if number is None:
            if core.library is not None:
                core.library.write(self.folder / SOILS)
            self.core = core
            write_snapshot(self.folder, 0, self.core.state())
            number = 0
        else:
            self.core = load_snapshot(self.folder, number)
            clear(self.folder, number)
            refuse_other(self.folder, self.core, core)
        self.segment, ahead, torn = Segment(number + 1), None, 0
        for segment, reading, more in replay(self.folder, number, self.core):
            if more:
                self._close_segment(segment, self.core.state(), None)
                self.segment = Segment(segment.number + 1)
            else:
                self.segment, torn = segment, reading.size - reading.good
                if reading.good:
                    path = wal_path(self.folder, segment.number)
                    ahead = WriteAhead(path, append_at=reading.good)
        self._ahead = self._open_wal() if ahead is None else ahead
        if self.core.rows:
            text = f"resumed after {self.core.rows} rows, the last at {self.core.when}"
            if torn:
                text += f"; the last {torn} bytes were incomplete and are left out"
            note = {"event": {"time": None, "kind": "resumed", "source": "record", "text": text}}
            self.opening = self.core.note(note)
            self.keep(self.opening, "N", note)

    def _open_wal(self) -> WriteAhead:
        wal = WriteAhead(wal_path(self.folder, self.segment.number))
        wal.add("B", {"segment": self.segment.number})
        return wal

    def keep(self, outputs: list[Output], kind: str, content: Any) -> None:
        """An input of `Core.handle`, and what came of it; raises OSError where a segment cannot be begun."""
        self._ahead.add(kind, content)
        segment = self.segment
        before = len(segment)
        for output in outputs:
            segment.add(output)
        self.rows_kept += len(segment) - before
        now = content[0] if kind == "S" else content if kind == "T" else None
        if now is not None and segment.size:
            if self._opened is None:
                self._opened = now
            if segment.size >= self._rows or now - self._opened >= self._seconds:
                self._rotate()

    def _rotate(self) -> None:
        old, wal = self.segment, self._ahead
        wal.write()
        state = self.core.state()
        encoded = json.dumps(state)  # now: the state's lists go on changing
        self.segment, self._opened = Segment(old.number + 1), None
        self._ahead = self._open_wal()
        self._ahead.write()
        self._closing.append(self._thread.submit(self._close_segment, old, encoded, wal))

    def _close_segment(self, segment: Segment, state: dict[str, Any] | str, wal: WriteAhead | None) -> None:
        if wal is not None:
            wal.close()
        segment.write(self.folder, self.core.estimator)
        write_snapshot(self.folder, segment.number, state)
        clear(self.folder, segment.number)

    def write(self) -> None:
        """Hand what came in to the system, after which a kill cannot lose it; raises OSError, also a thread's."""
        self._ahead.write()
        while self._closing and self._closing[0].done():
            self._closing.pop(0).result()

    def sync(self) -> None:
        """Have it put on the disk, in the thread; raises OSError of an earlier one."""
        if self._syncing is not None:
            if not self._syncing.done():
                return
            self._syncing.result()
        self._syncing = self._thread.submit(self._ahead.sync)

    def close(self) -> None:
        """Close the open segment and let go of the folder; raises OSError."""
        try:
            if self.segment.size:
                self._rotate()
            for work in self._work():
                work.result()
            self._ahead.close()
        finally:
            self._let_go()

    def abandon(self) -> None:
        """Let go of the folder after a failure, leaving what is there."""
        for work in self._work():
            work.cancel()
        wait(self._work())
        self._let_go()

    def _work(self) -> list[Future[None]]:
        """What was given to the thread and is not known to be done."""
        return self._closing if self._syncing is None else [self._syncing, *self._closing]

    def _let_go(self) -> None:
        if not self._is_shared:
            self._thread.shutdown()
        os.close(self._lock)


def record_thread() -> ThreadPoolExecutor:
    """A thread for records: what one of them gives it is done in that order."""
    return ThreadPoolExecutor(1, thread_name_prefix="record")

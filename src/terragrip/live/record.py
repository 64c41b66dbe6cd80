"""The record: nothing that came in is lost, and a run goes on after a kill as if it had never stopped.

A folder holds closed segments (``recording-NNNNNN.parquet``: rows as measured; ``estimates-NNNNNN.parquet``; where there
are any, ``refused-`` and ``events-NNNNNN.jsonl``), the state at the end of the last closed one (``snapshot-NNNNNN.json``),
and the write-ahead file of the open one (``wal-NNNNNN.log``). A segment is closed in a thread: files, then the snapshot,
then its write-ahead file goes. What a kill leaves between these steps is made anew from the write-ahead file.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import zlib
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import unwritable
from terragrip.live.core import Core, Output, Settings, Values
from terragrip.live.segment import ESTIMATES, RECORDING, Segment, durable, sync_folder
from terragrip.live.wal import Reading, WriteAhead

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

ROWS = 20_000  # a segment is closed after so many rows
_SOILS = "soils.json"
SECONDS = 60.0  # or so long after its first arrival


class Recorder:
    """A `Core` whose inputs are written ahead and whose outputs are kept; it has the core's methods.

    Parameters
    ----------
    folder: made if absent. If it holds a record, the run goes on from its end.
    vehicle, settings, library: as `Core` takes them; must be the record's.
    rows, seconds: when a segment is closed.

    Raises InputError if the folder cannot be used, is in use, or holds the record of another vehicle or other settings.
    """

    def __init__(
        self,
        folder: Path,
        vehicle: Vehicle,
        settings: Settings,
        *,
        library: SoilLibrary | None = None,
        rows: int = ROWS,
        seconds: float = SECONDS,
    ) -> None:
        self.folder = folder
        self._rows, self._seconds = rows, seconds
        self._lock = _locked(folder)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="record")
        self._closing: list[Future[None]] = []
        self._syncing: Future[None] | None = None
        self.opening: list[Output] = []  # what opening brought: that a run goes on
        self._opened: float | None = None  # arrival of the segment's first output
        try:
            self._resume(vehicle, settings, library)
        except OSError as error:
            self.abandon()
            raise unwritable(folder, error, "free space or choose another folder") from error
        except InputError:
            self.abandon()
            raise

    def _resume(self, vehicle: Vehicle, settings: Settings, library: SoilLibrary | None) -> None:
        for part in self.folder.glob(".*.part"):
            part.unlink()
        number = _last_snapshot(self.folder)
        if number is None:
            if library is not None:
                library.write(self.folder / _SOILS)
            self.core = Core(vehicle, settings, library)
            _write_snapshot(self.folder, 0, self.core.state())
            number = 0
        else:
            self.core = _load_snapshot(self.folder, number)
            _clear(self.folder, number)
            _refuse_other(self.folder, self.core, vehicle, settings, library)
        self.segment, self._wal, torn = Segment(number + 1), None, 0
        for segment, reading, more in _replay(self.folder, number, self.core):
            if more:
                self._close_segment(segment, self.core.state(), None)
                self.segment = Segment(segment.number + 1)
            else:
                self.segment, torn = segment, reading.size - reading.good
                if reading.good:
                    path = _wal(self.folder, segment.number)
                    self._wal = WriteAhead(path, append_at=reading.good, names=reading.names)
        if self._wal is None:
            self._wal = self._open_wal()
        if self.core.rows:
            text = f"resumed after {self.core.rows} rows, the last at {self.core.time:.6g} s"
            if torn:
                text += f"; the last {torn} bytes were torn and are left out"
            self.opening = self.note(
                {"event": {"time": None, "kind": "resumed", "source": "record", "text": text}}
            )

    def _open_wal(self) -> WriteAhead:
        wal = WriteAhead(_wal(self.folder, self.segment.number))
        wal.beginning({"segment": self.segment.number})
        return wal

    @property
    def _ahead(self) -> WriteAhead:
        assert self._wal is not None
        return self._wal

    def take(self, arrival: float, source: int, stamp: float, values: Values) -> list[Output]:
        """See `Core.take`; raises OSError where a segment cannot be begun."""
        self._ahead.sample(arrival, source, stamp, values)
        return self._kept(self.core.take(arrival, source, stamp, values), arrival)

    def tick(self, now: float) -> list[Output]:
        """See `Core.tick`."""
        self._ahead.tick(now)
        return self._kept(self.core.tick(now), now)

    def due(self, now: float) -> bool:
        """See `Core.due`."""
        return self.core.due(now)

    def flush(self) -> list[Output]:
        """See `Core.flush`."""
        self._ahead.flush_core()
        return self._kept(self.core.flush(), None)

    def note(self, note: dict[str, Any]) -> list[Output]:
        """See `Core.note`."""
        self._ahead.note(note)
        return self._kept(self.core.note(note), None)

    def _kept(self, outputs: list[Output], now: float | None) -> list[Output]:
        segment = self.segment
        for output in outputs:
            segment.add(output)
        if now is not None and outputs:
            if self._opened is None:
                self._opened = now
            if segment.size >= self._rows or now - self._opened >= self._seconds:
                self._rotate()
        return outputs

    def _rotate(self) -> None:
        old, wal = self.segment, self._ahead
        wal.write()
        state = self.core.state()
        encoded = json.dumps(state)  # now: the state's lists go on changing
        self.segment, self._opened = Segment(old.number + 1), None
        self._wal = self._open_wal()
        self._wal.write()
        self._closing.append(self._thread.submit(self._close_segment, old, encoded, wal))

    def _close_segment(self, segment: Segment, state: dict[str, Any] | str, wal: WriteAhead | None) -> None:
        if wal is not None:
            wal.close()
        segment.write(self.folder, self.core.estimator)
        _write_snapshot(self.folder, segment.number, state)
        _clear(self.folder, segment.number)

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
            self._thread.shutdown()  # the last sync is behind it
            for closing in self._closing:
                closing.result()
            self._ahead.close()
        finally:
            os.close(self._lock)

    def abandon(self) -> None:
        """Let go of the folder after a failure, leaving what is there."""
        self._thread.shutdown(cancel_futures=True)
        os.close(self._lock)


def read_record(folder: str | os.PathLike[str]) -> tuple[Recording, Estimates]:
    """All rows of a record as measured and as estimated, those of an open or broken-off segment too.

    Raises InputError where there is no record or no row. Changes nothing in the folder.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording

    place = Path(folder)
    number = _last_snapshot(place) if place.is_dir() else None
    if number is None:
        raise InputError(
            "holds no record", file=folder, mend="name a folder that terragrip live --record made"
        )
    core = _load_snapshot(place, number)
    tables: dict[str, list[Any]] = {RECORDING: [], ESTIMATES: []}
    for kind, found in tables.items():
        names = sorted(place.glob(f"{kind}-*.parquet"))
        found += [pq.read_table(path) for path in names if _number_of(path) <= number]
    for segment, _, _ in _replay(place, number, core):
        if len(segment) and core.estimator is not None:
            tables[RECORDING].append(segment.to_recording())
            tables[ESTIMATES].append(segment.to_estimates(core.estimator).to_arrow())
    if not tables[RECORDING]:
        raise InputError("the record holds no row yet", file=folder, mend="record some samples first")
    rows = pa.concat_tables(tables[RECORDING], promote_options="default")
    metadata = tables[ESTIMATES][-1].schema.metadata
    estimates = pa.concat_tables(tables[ESTIMATES], promote_options="default").replace_schema_metadata(
        metadata
    )
    return Recording.from_frame(rows, str(folder)), Estimates.from_arrow(estimates, str(folder))


def _replay(folder: Path, number: int, core: Core) -> Iterator[tuple[Segment, Reading, bool]]:
    """Take the inputs behind snapshot ``number`` into the core: each segment, its file, and whether another follows."""
    number += 1
    while _wal(folder, number).exists():
        reading, segment = Reading(_wal(folder, number)), Segment(number)
        for kind, content in reading:
            for output in _apply(core, kind, content):
                segment.add(output)
        number += 1
        yield segment, reading, _wal(folder, number).exists()


def _apply(core: Core, kind: str, content: Any) -> list[Output]:
    if kind == "S":
        return core.take(*content)
    if kind == "T":
        return core.tick(content)
    if kind == "N":
        return core.note(content)
    return core.flush() if kind == "F" else []


def _locked(folder: Path) -> int:
    """A lock on the folder, which the system lets go of with the process."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise unwritable(folder, error, "choose another folder, or make it writable") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(file)
        raise InputError(
            "is in use by another terragrip live", file=folder, place="--record", mend="choose another folder"
        ) from error
    return file


def _refuse_other(
    folder: Path, core: Core, vehicle: Vehicle, settings: Settings, library: SoilLibrary | None
) -> None:
    before, now = core.settings.to_dict(), settings.to_dict()
    for name in before:
        if before[name] != now[name]:
            raise InputError(
                f"the record was made with {name} {before[name]}, not {now[name]}",
                file=folder, place="--record", mend="give the same, or choose another folder",
            )  # fmt: skip
    soils = [None if one is None else one.to_dict() for one in (core.library, library)]
    for what, same in (
        ("vehicle file", core.vehicle.to_dict() == vehicle.to_dict()),
        ("soil library", soils[0] == soils[1]),
    ):
        if same:
            continue
        raise InputError(
            f"the record was made with another {what}", file=folder, place="--record",
            mend="give the same, or choose another folder",
        )  # fmt: skip


def _wal(folder: Path, number: int) -> Path:
    return folder / f"wal-{number:06d}.log"


def _snapshot(folder: Path, number: int) -> Path:
    return folder / f"snapshot-{number:06d}.json"


def _clear(folder: Path, closed: int) -> None:
    """Remove what the snapshot of segment ``closed`` makes superfluous."""
    for path in (*folder.glob("snapshot-*.json"), *folder.glob("wal-*.log")):
        if _number_of(path) < closed + (path.suffix == ".log"):
            path.unlink(missing_ok=True)


def _number_of(path: Path) -> int:
    return int(path.stem.rsplit("-", 1)[1])


def _last_snapshot(folder: Path) -> int | None:
    return max((_number_of(path) for path in folder.glob("snapshot-*.json")), default=None)


def _write_snapshot(folder: Path, number: int, state: dict[str, Any] | str) -> None:
    text = state if isinstance(state, str) else json.dumps(state)
    with durable(_snapshot(folder, number)) as path:
        path.write_text(f"{zlib.crc32(text.encode()):08x}\n{text}\n", encoding="utf-8")
    sync_folder(folder)


def _load_snapshot(folder: Path, number: int) -> Core:
    path = _snapshot(folder, number)
    with contextlib.suppress(OSError, ValueError):
        check, text, *_ = path.read_text(encoding="utf-8").split("\n")
        if int(check, 16) == zlib.crc32(text.encode()):
            soils = folder / _SOILS
            library = None
            if soils.exists():
                from terragrip.soil.library import SoilLibrary

                library = SoilLibrary.load(soils)
            return Core.from_state(json.loads(text), library)
    raise InputError(
        "is damaged, or of another version of Terragrip",
        file=path,
        mend="begin a new record in another folder",
    )

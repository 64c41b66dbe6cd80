"""What stands in a record's folder: snapshots, write-ahead files, the lock; and reading it all back."""

from __future__ import annotations

import contextlib
import json
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.files import lock, sync_folder, unwritable
from terragrip.live.core import Core
from terragrip.live.segment import ESTIMATES, RECORDING, Segment, durable
from terragrip.live.wal import Reading

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording

SOILS = "soils.json"


def read_record(folder: str | os.PathLike[str]) -> tuple[Recording, Estimates]:
    """All rows of a record as measured and as estimated, those of an open or broken-off segment too.

    Raises InputError where there is no record or no row. Changes nothing in the folder.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording

    place = Path(folder)
    number = last_snapshot(place) if place.is_dir() else None
    if number is None:
        raise InputError(
            "holds no record", file=folder, hint="name a folder made by 'terragrip live --record'"
        )
    core = load_snapshot(place, number)
    tables: dict[str, list[Any]] = {RECORDING: [], ESTIMATES: []}
    for kind, parts in tables.items():
        names = sorted(place.glob(f"{kind}-*.parquet"))
        parts += [pq.read_table(path) for path in names if _number_of(path) <= number]
    for segment, _, _ in replay(place, number, core):
        if len(segment) and core.estimator is not None:
            tables[RECORDING].append(segment.to_recording())
            tables[ESTIMATES].append(segment.to_estimates(core.estimator).to_arrow())
    if not tables[RECORDING]:
        raise InputError("the record has no row yet", file=folder, hint="record some samples first")
    rows = pa.concat_tables(tables[RECORDING], promote_options="default")
    metadata = tables[ESTIMATES][-1].schema.metadata
    estimates = pa.concat_tables(tables[ESTIMATES], promote_options="default").replace_schema_metadata(
        metadata
    )
    return Recording.from_frame(rows, str(folder)), Estimates.from_arrow(estimates, str(folder))


def replay(folder: Path, number: int, core: Core) -> Iterator[tuple[Segment, Reading, bool]]:
    """Take the inputs behind snapshot ``number`` into the core: each segment, its file, and whether another follows."""
    number += 1
    while wal_path(folder, number).exists():
        reading, segment = Reading(wal_path(folder, number)), Segment(number)
        for kind, content in reading:
            try:
                for output in core.handle(kind, content):
                    segment.add(output)
            except (ValueError, LookupError, TypeError, AttributeError) as error:
                raise InputError(
                    f"holds an input that is none, before byte {reading.good}", file=wal_path(folder, number),
                    hint="begin a new record in another folder",
                ) from error  # fmt: skip
        number += 1
        yield segment, reading, wal_path(folder, number).exists()


def locked(folder: Path) -> int:
    """A lock on the folder, which the system lets go of with the process."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = lock(folder / "lock")
    except OSError as error:
        raise unwritable(folder, error, "choose another folder, or make it writable") from error
    if file is None:
        raise InputError(
            "is in use by another terragrip live", file=folder, place="--record", hint="choose another folder"
        )
    return file


def refuse_other(folder: Path, kept: Core, wanted: Core) -> None:
    before, now = kept.settings.to_dict(), wanted.settings.to_dict()
    soils = [None if one is None else one.to_dict() for one in (kept.library, wanted.library)]
    others = [f"{name} {before[name]}, not {now[name]}" for name in before if before[name] != now[name]]
    others += ["another vehicle file"] if kept.vehicle.to_dict() != wanted.vehicle.to_dict() else []
    others += ["another soil library"] if soils[0] != soils[1] else []
    if others:
        raise InputError(
            f"the record was made with {others[0]}", file=folder, place="--record",
            hint="give the same, or choose another folder",
        )  # fmt: skip


def wal_path(folder: Path, number: int) -> Path:
    return folder / f"wal-{number:06d}.log"


def snapshot_path(folder: Path, number: int) -> Path:
    return folder / f"snapshot-{number:06d}.json"


def clear(folder: Path, closed: int) -> None:
    """Remove what the snapshot of segment ``closed`` makes superfluous."""
    for path in (*folder.glob("snapshot-*.json"), *folder.glob("wal-*.log")):
        if _number_of(path) < closed + (path.suffix == ".log"):
            path.unlink(missing_ok=True)


def _number_of(path: Path) -> int:
    return int(path.stem.rsplit("-", 1)[1])


def last_snapshot(folder: Path) -> int | None:
    return max((_number_of(path) for path in folder.glob("snapshot-*.json")), default=None)


def write_snapshot(folder: Path, number: int, state: dict[str, Any] | str) -> None:
    text = state if isinstance(state, str) else json.dumps(state)
    with durable(snapshot_path(folder, number)) as path:
        path.write_text(f"{zlib.crc32(text.encode()):08x}\n{text}\n", encoding="utf-8")
    sync_folder(folder)


def load_snapshot(folder: Path, number: int) -> Core:
    path = snapshot_path(folder, number)
    # Another version's snapshot is whole, but has other entries.
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError):
        check, text, *_ = path.read_text(encoding="utf-8").split("\n")
        if int(check, 16) == zlib.crc32(text.encode()):
            soils = folder / SOILS
            library = None
            if soils.exists():
                from terragrip.soil.library import SoilLibrary

                library = SoilLibrary.load(soils)
            return Core.from_state(json.loads(text), library)
    raise InputError(
        "is damaged, or of another version of Terragrip",
        file=path,
        hint="begin a new record in another folder",
    )

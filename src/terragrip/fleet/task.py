"""What a worker does: estimate each log into its files of the data set, or report why it cannot."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from terragrip.errors import InputError, reason_of, system_error
from terragrip.fleet.logs import FleetLog
from terragrip.fleet.store import Store, fetched, safe_name

if TYPE_CHECKING:
    from terragrip.fleet.extra import Extra
    from terragrip.fleet.tally import LogTally

Result = TypeVar("Result")

NO_DAY = "__HIVE_DEFAULT_PARTITION__"
"""The day partition of logs without a clock; readers of Hive partitions see null."""
NOTES, SAMPLES, ESTIMATES = "state/logs", "state/samples", "estimates"
"""Folders within a data set."""
_NO_MEMORY = "not enough memory; raise --memory or split the log"


@dataclass(frozen=True)
class Settings:
    """What all logs of a call share. ``version``: the caller's Terragrip version, which workers must match. ``maps``: also map each log
    that has positions. ``ground``: also find each log's sections and events."""

    method: str
    smooth: bool
    dbc: tuple[str, ...]
    version: str
    maps: bool = False
    ground: bool = False


@dataclass(frozen=True)
class Outcome:
    """The result of a log: its ``note`` (`make_note`), or the ``reason`` why it failed. ``disk_full``: its estimates did not fit on the
    disk. ``fresh``: this call estimated it, in ``seconds`` including reading and writing. ``refused``: the log itself was; where it failed
    by a worker, memory, disk or network that was lost, nothing is known of it.
    """

    log: str
    note: dict[str, Any] | None = None
    reason: str | None = None
    fresh: bool = False
    seconds: float = 0.0
    disk_full: bool = False
    refused: bool = False


@dataclass(frozen=True)
class _Staged:
    """A log that is estimated but not yet stored: its local ``files`` with their names in the store, in the order of storing, and the
    ``seconds`` spent so far.
    """

    log: str
    note: dict[str, Any]
    files: tuple[tuple[Path, str], ...]
    seconds: float


def estimate_logs(logs: Sequence[FleetLog], settings: Settings, store: Store) -> list[Outcome]:
    """One outcome per log. A log that cannot be estimated does not stop the others, and raises nothing.

    A log's files are stored while the next one is estimated.
    """
    outcomes: list[Future[Outcome]] = []
    with store.staging(_scratch()) as staging, ThreadPoolExecutor(1) as storing:
        for number, log in enumerate(logs):
            staged = _attempt(log, _estimated, log, settings, store, staging, number)
            if outcomes:
                outcomes[-1].result()  # so that the disk holds at most two logs
            outcomes.append(storing.submit(_attempt, log, _put, staged, store))
        return [one.result() for one in outcomes]


def _attempt(log: FleetLog, step: Callable[..., Result], *given: Any) -> Result | Outcome:
    """The result of a step for its log, or a failure with the reason."""
    try:
        return step(*given)
    except Exception as error:  # noqa: BLE001 - whatever it is, only this log fails
        number = system_error(error)
        full = number in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        refused = isinstance(error, InputError) and number is None
        return Outcome(log.name, reason=reason_of(error, _NO_MEMORY), disk_full=full, refused=refused)


def _estimated(
    log: FleetLog, settings: Settings, store: Store, staging: Path, number: int
) -> Outcome | _Staged:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip import __version__
    from terragrip.fleet.extra import Extra
    from terragrip.fleet.tally import LogTally
    from terragrip.from_log import estimate_file

    if __version__ != settings.version:
        raise InputError(
            f"the worker has Terragrip {__version__}, the call {settings.version}",
            hint="install one version on all workers",
        )
    began = time.monotonic()
    with fetched(log.url, staging) as source:
        key = key_of(log, source, settings)
        known = store.read(f"{NOTES}/{key}.json")
        if known is not None and is_whole(note := json.loads(known), store):
            return Outcome(log.name, note)
        local, thin, note_file = (
            staging / f"{number}{end}" for end in (".parquet", "-sample.parquet", ".json")
        )
        tally = LogTally()
        estimate_file(
            source,
            log.vehicle,
            local,
            settings.method,
            profile=log.profile,
            dbc=settings.dbc,
            smooth=settings.smooth,
            labels={"log": log.name},
            observe=tally.add,
            summary=False,
        )
    extra = Extra.of(local, log.name, maps=settings.maps, ground=settings.ground)
    note = make_note(log, key, settings, tally, extra)
    files = [(local, note["file"])]
    for name, table in extra.tables.items():
        one = staging / f"{number}-{name}.parquet"
        pq.write_table(table, one)
        files.insert(0, (one, note["extra"][name]))
    if tally.sample:
        pq.write_table(pa.concat_tables([part.to_arrow() for part in tally.sample]), thin)
        files.insert(0, (thin, f"{SAMPLES}/{key}.parquet"))
    note["bytes"] = {name: one.stat().st_size for one, name in files}
    note_file.write_text(json.dumps(note), encoding="utf-8")
    # The note comes last: only a log with a note belongs to the data set.
    files.append((note_file, f"{NOTES}/{key}.json"))
    return _Staged(log.name, note, tuple(files), time.monotonic() - began)


def is_whole(note: Mapping[str, Any], store: Store) -> bool:
    """Whether the files of a log still have the sizes that its note states."""
    sizes = note.get("bytes", {note["file"]: None})  # notes of older versions have none
    return all(
        (there := store.size(name)) is not None and size in (None, there) for name, size in sizes.items()
    )


def _put(staged: Outcome | _Staged, store: Store) -> Outcome:
    if isinstance(staged, Outcome):
        return staged
    began = time.monotonic()
    for local, name in staged.files:
        store.put(local, name)
    return Outcome(staged.log, staged.note, fresh=True, seconds=staged.seconds + time.monotonic() - began)


def make_note(log: FleetLog, key: str, settings: Settings, tally: LogTally, extra: Extra) -> dict[str, Any]:
    """What the data set keeps about a log, ready for JSON: its row of the summary, its rows by soil, its files."""
    row = tally.row()
    day = str(row["start"])[:10] if row["start"] else None
    place = f"vehicle={safe_name(log.machine)}/day={day or NO_DAY}/{safe_name(log.name)}.parquet"
    return {
        "log": log.name,
        "key": key,
        "content": tally.total.about.get("recording", {}).get("sha256"),
        "file": f"{ESTIMATES}/{place}",
        "extra": {name: f"{name}/{place}" for name in extra.tables},
        "sample": bool(tally.sample),
        "summary": {
            "vehicle": log.machine,
            "day": day,
            "source": log.url,
            "method": str(tally.total.about.get("method", settings.method)),
            "smooth": settings.smooth,
            "version": settings.version,
            **row,
            "cells": extra.tables["cells"].num_rows if "cells" in extra.tables else 0,
            "no_map": extra.no_map,
            "no_ground": extra.no_ground,
        },
        "soils": tally.soil_rows(),
    }


def key_of(log: FleetLog, source: Path, settings: Settings) -> str:
    """SHA-256 over everything that the log's estimates depend on: its content and name, vehicle, profile, DBC, method and version."""
    parts = {
        "name": log.name,
        "log": _content(source),
        "machine": log.machine,
        "vehicle": log.vehicle.model_dump(mode="json", exclude_unset=True),
        "profile": None if log.profile is None else log.profile.to_dict(),
        "dbc": [_content(Path(one)) for one in (*settings.dbc, *(log.profile.dbc if log.profile else ()))],
        "method": settings.method,
        "smooth": settings.smooth,
        "version": settings.version,
        **{name: True for name in ("maps", "ground") if getattr(settings, name)},
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _content(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files with their names."""
    from terragrip.files import sha256

    if not path.is_dir():
        return sha256(path)
    inside = sorted(one for one in path.rglob("*") if one.is_file())
    listed = [(os.fspath(one.relative_to(path)), sha256(one)) for one in inside]
    return hashlib.sha256(json.dumps(listed).encode()).hexdigest()


def _scratch() -> str | None:
    """The worker's own folder, removed when it stops; outside a worker None, the system's temporary folder."""
    from distributed import get_worker

    try:
        return str(get_worker().local_directory)
    except ValueError:
        return None

"""A fleet's tables: which logs are in the data set and which failed; in both is one that is still in it from an earlier call."""

from __future__ import annotations

import io
import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from terragrip.errors import InputError
from terragrip.fleet.store import Store
from terragrip.fleet.tally import COUNTED, MEANS
from terragrip.fleet.task import NOTES, SAMPLES, Outcome, is_whole

SUMMARY, FAILURES, BY_SOIL = "summary.parquet", "failures.parquet", "soils.parquet"
SOILS, REPORT = "soils.json", "report.html"

Note = dict[str, Any]


def known_notes(store: Store, named: Collection[str] = ()) -> tuple[dict[str, Note], dict[str, str]]:
    """What earlier calls left: the notes of estimated logs and the reasons of failed ones, by the log's name.

    ``named``: the logs of this call. Raises InputError if the folder holds tables that are not a fleet's, a damaged note, or no note of a
    log of the summary that this call does not name.
    """
    summary = _read(store, SUMMARY)
    keys = {row["key"] for row in summary}
    by_name: dict[str, Note] = {}
    # An interrupted call may have left two notes of a log; the one that is not in the summary yet is newer.
    notes = [_note(store, name, content) for name, content in store.read_all(NOTES).items()]
    for note in sorted(notes, key=lambda one: one["key"] not in keys):
        old = by_name.get(note["log"])
        if old is not None:
            _drop(store, old, keep=note)
        by_name[note["log"]] = note
    # Their rows would silently leave the tables.
    lost = sorted({row["log"] for row in summary} - by_name.keys() - set(named))
    if lost:
        others = f" and {len(lost) - 1} others" if len(lost) > 1 else ""
        raise InputError(
            f"lacks the notes of {lost[0]}{others}",
            file=f"{store.url}/{NOTES}",
            hint=f"restore them, or name these logs too, or remove {SUMMARY}",
        )
    if not by_name:
        _refuse_foreign(store)
    # A worker that was lost may have stored the note before: such a log is no failure.
    stored = {name for name, note in by_name.items() if note["key"] not in keys}
    return by_name, {row["log"]: row["reason"] for row in _read(store, FAILURES) if row["log"] not in stored}


def _refuse_foreign(store: Store) -> None:
    """Raise InputError if a folder without a fleet holds a file that the first call would overwrite, such as a learned soils.json."""
    if any(store.size(name) is not None for name in (SUMMARY, FAILURES)):
        return
    for name in (SOILS, REPORT, BY_SOIL):
        if store.size(name) is not None:
            raise InputError(
                "exists already, and is not a fleet data set",
                file=f"{store.url}/{name}",
                hint="name another folder with -o",
            )


def _note(store: Store, name: str, content: bytes) -> Note:
    try:
        note: Note = json.loads(content)
        if {"log", "key", "file", "sample", "summary", "soils"} <= note.keys():
            return note
    except (ValueError, AttributeError):
        pass
    # Not skipped: its log would silently leave the tables.
    raise InputError(
        "is damaged",
        file=f"{store.url}/{name}",
        hint="remove it and run again: its log is then estimated again",
    )


def settled(
    store: Store, before: Mapping[str, Note], failed: Mapping[str, str], outcomes: Sequence[Outcome]
) -> tuple[list[Note], dict[str, str]]:
    """The notes and failures after a call; files that are no longer referenced are removed.

    Logs of earlier calls that this one did not name are kept. If a log was estimated differently or failed now, its old estimates are
    removed; not so if it failed by something else than itself (`Outcome`).
    """
    notes, reasons = dict(before), dict(failed)
    for one in outcomes:
        old = notes.pop(one.log, None)
        reasons.pop(one.log, None)
        if one.note is not None:
            notes[one.log] = one.note
        else:
            reasons[one.log] = one.reason or "unknown"
            if not one.refused and old is not None and is_whole(old, store):
                notes[one.log] = old
                reasons[one.log] += "; its estimates of an earlier call are kept"
                continue
        if old is not None and (one.note is None or old["key"] != one.note["key"]):
            _drop(store, old, keep=one.note)
    return [notes[name] for name in sorted(notes)], dict(sorted(reasons.items()))


def _drop(store: Store, old: Note, keep: Note | None) -> None:
    for name in sorted(_files(old) - (_files(keep) if keep else set())):
        store.remove(name)
    store.remove(f"{NOTES}/{old['key']}.json")
    store.remove(f"{SAMPLES}/{old['key']}.parquet")


def _files(note: Note) -> set[str]:
    """A log's files in the data set."""
    return {note["file"], *note.get("extra", {}).values()}


def write_tables(store: Store, notes: Sequence[Note], reasons: Mapping[str, str]) -> None:
    """Write summary, soils and failures, each whole or not at all. Raises OSError if the store refuses."""
    import pyarrow as pa

    means = [(name, pa.float64()) for name in ("moving_time", "moving_distance", *MEANS)]
    texts = [
        (name, pa.string()) for name in ("log", "key", "vehicle", "day", "start", "source", "file", "method")
    ]
    summary = pa.schema(
        [
            *texts,
            ("smooth", pa.bool_()),
            ("version", pa.string()),
            ("rows", pa.int64()),
            ("duration", pa.float64()),
            ("distance", pa.float64()),
            *means,
            ("nis", pa.float64()),
            *[(f"{name}_events", pa.int64()) for name in COUNTED],
            ("soils", pa.string()),
            ("left_out", pa.string()),
            ("notes", pa.string()),
            ("cells", pa.int64()),
            ("no_map", pa.string()),
            ("no_ground", pa.string()),
        ]
    )
    rows = [{"log": n["log"], "key": n["key"], "file": n["file"], **n["summary"]} for n in notes]
    _write(store, SUMMARY, pa.Table.from_pylist(rows, summary))
    of_soils = pa.schema([*[(name, pa.string()) for name in ("log", "vehicle", "day", "soil")], *means])
    _write(store, BY_SOIL, pa.Table.from_pylist(soil_rows(notes), of_soils))
    failures = pa.schema([("log", pa.string()), ("reason", pa.string())])
    listed = [{"log": log, "reason": reason} for log, reason in reasons.items()]
    _write(store, FAILURES, pa.Table.from_pylist(listed, failures))


def soil_rows(notes: Sequence[Note]) -> list[dict[str, Any]]:
    """One row per log and soil label."""
    return [
        {"log": n["log"], "vehicle": n["summary"]["vehicle"], "day": n["summary"]["day"], **row}
        for n in notes
        for row in n["soils"]
    ]


def write_text(store: Store, name: str, text: str) -> None:
    """Write a text file, whole or not at all."""
    with store.staging() as staging:
        local = staging / "text"
        local.write_text(text, encoding="utf-8")
        store.put(local, name)


def _write(store: Store, name: str, table: Any) -> None:
    import pyarrow.parquet as pq

    with store.staging() as staging:
        local = staging / "table.parquet"
        pq.write_table(table, local)
        store.put(local, name)


def _read(store: Store, name: str) -> list[dict[str, Any]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    content = store.read(name)
    if content is None:
        return []
    try:
        rows: list[dict[str, Any]] = pq.read_table(io.BytesIO(content)).to_pylist()
        if rows and not ({"log", "key"} <= set(rows[0]) or {"log", "reason"} <= set(rows[0])):
            raise pa.ArrowInvalid("other columns")
    except pa.ArrowException as error:
        raise InputError(
            f"is not a table of a fleet ({error})",
            file=f"{store.url}/{name}",
            hint="remove it and run again, which rebuilds it, or name another folder with -o",
        ) from error
    return rows

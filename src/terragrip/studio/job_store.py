"""Jobs that outlive their studio: a small SQLite database in the folder, in WAL mode, which several studios may use at once."""

from __future__ import annotations

import json
import shlex
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Any

from terragrip.errors import InputError
from terragrip.files import has_ended, this_process
from terragrip.studio.own_folder import OwnFolder

VERSION = 1
"""Of the database, kept as its `user_version`."""
ENDED = ("done", "failed", "cancelled", "interrupted")
"""States of a job that will not change any more."""
STATES = ("queued", "running", *ENDED)
INTERRUPTED = "the studio ended before the job; its output is complete or absent: run the command line again"
_COLUMNS = ("id", "kind", "title", "output", "state", "text", "words", "process")


@dataclass
class Job:
    """One job: `state` is one of `STATES`; `done` of `total` steps; `text` is the summary or the reason;
    `words` are its command line after "terragrip", with paths from the studio's folder."""

    id: str
    kind: str
    title: str
    output: str
    state: str = "queued"
    done: int = 0
    total: int = 0
    text: str = ""
    words: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command line as a shell takes it, in the studio's folder."""
        return shlex.join(("terragrip", *self.words))

    def to_dict(self) -> dict[str, Any]:
        """What a page may see of it."""
        names = ("id", "kind", "title", "output", "state", "done", "total", "text", "words", "command")
        return {name: getattr(self, name) for name in names}


class JobStore:
    """Each job as it last was. ``process``, kept beside each: whose job it is (`this_process`)."""

    def __init__(self, folder: OwnFolder) -> None:
        self._folder = folder
        self._path = folder.path / "jobs.sqlite"

    def load(self) -> list[Job]:
        """Jobs that ended, the oldest first; those whose studio ended before them are `interrupted` from now on.

        Raises InputError where the database is of a newer version or cannot be read.
        """
        if not self._path.exists():
            return []
        with self._opened() as base:
            going = base.execute(
                "SELECT id, process FROM jobs WHERE state IN ('queued', 'running')"
            ).fetchall()
            lost = [
                (INTERRUPTED, id_)
                for id_, process in going
                if has_ended(process) or process == this_process()
            ]
            base.executemany("UPDATE jobs SET state = 'interrupted', text = ? WHERE id = ?", lost)
            rows = base.execute(
                "SELECT id, kind, title, output, state, text, words FROM jobs ORDER BY rowid"
            ).fetchall()
        return [
            Job(id_, kind, title, output, state, text=text, words=tuple(json.loads(words)))
            for id_, kind, title, output, state, text, words in rows
            if state in ENDED
        ]

    def save(self, job: Job) -> None:
        """Keep a job as it is now. Raises InputError where it cannot be written."""
        self._folder.make()
        kept = (
            job.id,
            job.kind,
            job.title,
            job.output,
            job.state,
            job.text,
            json.dumps(job.words),
            this_process(),
        )
        names, marks = ", ".join(_COLUMNS), ", ".join("?" * len(_COLUMNS))
        with self._opened() as base:
            base.execute(
                f"INSERT INTO jobs ({names}) VALUES ({marks}) ON CONFLICT (id) DO UPDATE SET state = excluded.state, text = excluded.text",
                kept,
            )

    def remove(self, identities: Sequence[str]) -> None:
        """Forget jobs. Raises InputError where it cannot be written."""
        if identities:
            with self._opened() as base:
                base.executemany("DELETE FROM jobs WHERE id = ?", [(one,) for one in identities])

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """The database, made where there is none; what is done within is one transaction."""
        try:
            with closing(sqlite3.connect(self._path, timeout=5.0)) as base, base:
                version = int(base.execute("PRAGMA user_version").fetchone()[0])
                if version > VERSION:
                    raise InputError(f"has version {version}", file=self._path, hint="update terragrip")
                if version < VERSION:
                    base.execute("PRAGMA journal_mode = WAL")
                    base.execute(f"CREATE TABLE IF NOT EXISTS jobs ({', '.join(_COLUMNS)}, UNIQUE (id))")
                    base.execute(f"PRAGMA user_version = {VERSION}")
                yield base
        except sqlite3.Error as error:
            raise InputError(
                f"cannot be read or written ({error})",
                file=self._path,
                hint="make it writable, or remove it: it holds past jobs only",
            ) from error

"""Which logs a command line names, which of them are one drive, and by which profile each is read."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

from terragrip.errors import InputError

_COLUMNS = ("log", "profile", "drive")


@dataclass(frozen=True)
class Drive:
    """One drive: its ``name``, its ``logs`` (several sources are joined) and a profile for each, or one for all, or None."""

    name: str
    logs: tuple[Path, ...]
    profiles: tuple[Path | None, ...]

    @property
    def source(self) -> Path | list[Path]:
        """What `terragrip.read` takes as path."""
        return self.logs[0] if len(self.logs) == 1 else list(self.logs)

    @property
    def profile(self) -> Path | list[Path | None] | None:
        """What `terragrip.read` takes as profile."""
        return self.profiles[0] if len(set(self.profiles)) == 1 else list(self.profiles)


def logs_in(paths: Sequence[Path]) -> list[Path]:
    """The logs that arguments name: files, those of each folder that is not a bag itself, those that a pattern matches.

    Raises InputError where a folder holds none, or nothing matches a pattern.
    """
    from terragrip.formats.registry import is_bag

    result: list[Path] = []
    for path in paths:
        if path.is_dir() and not is_bag(path):
            result += _logs_of(path)
        elif glob.has_magic(str(path)) and not path.exists():
            matches = [Path(name) for name in sorted(glob.glob(str(path), recursive=True))]
            if not matches:
                raise InputError("no file matches", file=path, hint="check the pattern and the folder")
            result += matches
        else:
            result.append(path)
    return list(dict.fromkeys(result))


def _logs_of(folder: Path) -> list[Path]:
    entries = sorted(folder.iterdir())
    inside = [entry for entry in entries if _is_log(entry)]
    others = [entry for entry in entries if entry.is_dir() and entry not in inside and entry.name[0] != "."]
    below = next((log for other in others for log in other.iterdir() if _is_log(log)), None)
    if below is None and not inside:
        from terragrip.formats.registry import suffixes

        hint = f"name a folder with files such as *{suffixes()[0]}, or a log"
        raise InputError("holds no log", file=folder, hint=hint)
    if below is not None:
        pattern = f"'{folder}/**/*{below.suffix}'"
        if not inside:
            raise InputError("holds no log, its subfolders do", file=folder, hint=f"name them, or {pattern}")
        typer.echo(f"{folder}: its subfolders are not searched; {pattern} names what is in them.", err=True)
    return inside


def _is_log(entry: Path) -> bool:
    from terragrip.formats.registry import is_bag, suffixes

    if entry.name.startswith("."):
        return False
    return entry.name.lower().endswith(suffixes()) if entry.is_file() else entry.is_dir() and is_bag(entry)


def drives_of(arguments: Sequence[Path], profiles: Sequence[Path], joined: Sequence[Path]) -> list[Drive]:
    """The drives that LOG arguments name, each log its own, or with the ``joined`` sources one.

    One profile is for all; several are one for each source of a joined drive, else one for each argument, for all the logs that a folder
    or pattern names. Raises InputError where the numbers differ, or several logs are to be joined to.
    """
    if joined:
        logs = logs_in(arguments)
        if len(logs) > 1:
            raise InputError(
                "there are several logs",
                place="--with",
                hint="join one drive at a time, or name them in --drives TABLE",
            )
        sources = (*logs, *joined)
        return [Drive(logs[0].name, sources, _each(profiles, len(sources), "source of the drive"))]
    each = _each(profiles, len(arguments), "LOG (a folder or pattern is one)")
    by_log: dict[Path, Path | None] = {}
    for argument, profile in zip(arguments, each, strict=True):
        for log in logs_in([argument]):
            by_log.setdefault(log, profile)
    return [Drive(log.name, (log,), (profile,)) for log, profile in by_log.items()]


def _each(profiles: Sequence[Path], count: int, what: str) -> tuple[Path | None, ...]:
    if len(profiles) <= 1:
        return (profiles[0] if profiles else None,) * count
    if len(profiles) != count:
        raise InputError(
            f"there are {len(profiles)} profiles for {count}",
            place="--profile",
            hint=f"give one, or one for each {what}",
        )
    return tuple(profiles)


def drives_in(table: Path) -> list[Drive]:
    """The drives of a table (CSV: `log`, and where needed `profile` and `drive`): a row a log, those of one drive are joined.

    Paths are from the table's folder. Raises InputError where it is no such table.
    """
    from terragrip.listing import listed_logs, profile_in

    groups: dict[str, list[tuple[Path, Path | None]]] = {}
    for _, row in listed_logs(table, _COLUMNS):
        log = table.parent / row["log"]
        groups.setdefault(row.get("drive") or f"{row['log']}", []).append(
            (log, profile_in(table, row.get("profile", "")))
        )
    return [
        Drive(
            name if len(parts) > 1 else parts[0][0].name,
            tuple(log for log, _ in parts),
            tuple(p for _, p in parts),
        )
        for name, parts in groups.items()
    ]

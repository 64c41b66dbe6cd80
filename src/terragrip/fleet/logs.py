"""The logs of a fleet with their vehicles and profiles, from patterns and an index table."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from terragrip.errors import InputError, nearest
from terragrip.fleet.store import is_remote
from terragrip.listing import listed_logs, profile_in

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.vehicle import Vehicle

COLUMNS = ("log", "vehicle", "profile", "name")
"""Columns of an index table."""


@dataclass(frozen=True)
class FleetLog:
    """One log: its ``name`` in the data set, its path or address, its size [bytes], its machine, vehicle and profile."""

    name: str
    url: str
    size: int
    machine: str
    vehicle: Vehicle
    profile: Profile | None


@dataclass(frozen=True)
class _Entry:
    vehicle: Path | None
    profile: Path | None
    name: str


def matching(pattern: str) -> list[tuple[str, int]]:
    """The files of a store that match a pattern, with their sizes [bytes].

    Raises InputError if the store cannot be reached or nothing matches.
    """
    try:
        from fsspec.core import url_to_fs

        system, path = url_to_fs(pattern)
        found = system.glob(path, detail=True)
    except Exception as error:
        # each store has its own exceptions
        raise InputError(
            f"cannot be reached ({str(error) or type(error).__name__})",
            file=pattern,
            hint="check the address, the network and your access rights",
        ) from error
    files = [
        (system.unstrip_protocol(p), int(i.get("size") or 0)) for p, i in found.items() if i["type"] == "file"
    ]
    if not files:
        raise _no_match(pattern)
    return sorted(files)


def on_disk(paths: Iterable[Path], output: str) -> list[tuple[str, int]]:
    """Local logs with their sizes [bytes], without folders that are not bags and without anything in ``output``.

    Raises InputError if none is left, or a path does not exist.
    """
    from terragrip.formats.registry import is_bag

    paths, own = list(paths), Path(os.path.abspath(output))
    kept = []
    for path in paths:
        whole = Path(os.path.abspath(path))
        if (own in whole.parents and not is_remote(output)) or (whole.is_dir() and not is_bag(whole)):
            continue
        if not whole.exists() and not whole.is_symlink():  # a link to nothing is a log that fails
            raise InputError("no such file", file=path, hint="check the path")
        inside = [whole] if whole.is_file() else [one for one in whole.rglob("*") if one.is_file()]
        kept.append((str(whole), sum(one.stat().st_size for one in inside)))
    if not kept:
        raise _no_match(paths[0] if paths else None)
    return kept


def _no_match(pattern: Path | str | None) -> InputError:
    return InputError("no file matches", file=pattern, hint="check the pattern and the folder")


def fleet_logs(
    files: Sequence[tuple[str, int]],
    vehicle: Path | None,
    profile: Path | None = None,
    index: Path | None = None,
) -> list[FleetLog]:
    """The logs with their vehicles and profiles, in the order of ``files``.

    ``index``: a CSV with the columns `log` (a path relative to the table, an address, or a file name), `vehicle`, `profile` and `name`.
    Empty cells default to ``vehicle``, ``profile`` and the file's name. The table itself, the vehicle files and the profiles are
    no logs, where a pattern matches them too.

    Raises
    ------
    InputError: no log is left; two logs share a name; a log has no vehicle; a row of the index matches no log; two different vehicles
        share a name; a vehicle or profile file is invalid.
    """
    from terragrip.formats import Profile
    from terragrip.vehicle import Vehicle

    entries = {} if index is None else _entries(index, [url for url, _ in files])
    named = (
        index,
        vehicle,
        profile,
        *(path for one in entries.values() for path in (one.vehicle, one.profile)),
    )
    own = {os.path.abspath(path) for path in named if path is not None}
    load_vehicle, load_profile = cache(Vehicle.load), cache(Profile.load)
    names: dict[str, str] = {}
    machines: dict[str, Path] = {}
    logs = []
    for url, size in files:
        if url in own:
            continue
        entry = entries.get(url, _Entry(None, None, ""))
        path = entry.vehicle or vehicle
        if path is None:
            raise InputError(
                f"names no vehicle for {url}" if index else "no vehicle is given",
                file=index,
                place=None if index else "--vehicle",
                hint="add a row for it, or give --vehicle for all others"
                if index
                else "give a vehicle file, or an --index",
            )
        name = entry.name or os.path.basename(url.rstrip("/"))
        if name in names:
            raise InputError(
                f"has the same name as {names[name]}",
                file=url,
                hint="rename one, or set names in the column `name` of an --index",
            )
        names[name] = url
        loaded, read_by = load_vehicle(path), entry.profile or profile
        machine = loaded.name or path.stem
        other = machines.setdefault(machine, path)
        if other != path and load_vehicle(other) != loaded:
            raise InputError(
                f"has the name {machine!r} of another vehicle, {other}",
                file=path,
                place="name",
                hint="give each its own name",
            )
        logs.append(
            FleetLog(name, url, size, machine, loaded, None if read_by is None else load_profile(read_by))
        )
    if not logs:
        raise _no_match(files[0][0] if files else None)
    return logs


def _entries(index: Path, urls: Sequence[str]) -> dict[str, _Entry]:
    """The index's rows by the address of their log, without rows of existing logs that the patterns did not match."""
    known = set(urls)
    by_name: dict[str, list[str]] = {}
    for url in urls:
        by_name.setdefault(os.path.basename(url), []).append(url)
    entries: dict[str, _Entry] = {}
    for number, row in listed_logs(index, COLUMNS):
        given, place = row["log"], f"row {number}"
        whole = given if is_remote(given) else os.path.abspath(index.parent / given)
        alike = [] if "/" in given else by_name.get(given, [])
        if whole not in known and len(alike) == 1:
            whole = alike[0]
        if whole not in known:
            if not is_remote(whole) and os.path.exists(whole):
                continue
            close = nearest(given, by_name)
            hint = f"did you mean {close}?" if close else "write its path relative to the table"
            raise InputError(f"no log is {given}", file=index, place=place, hint=hint)
        if whole in entries:
            raise InputError(f"{given} is listed twice", file=index, place=place, hint="keep one row")
        vehicle = index.parent / row["vehicle"] if row.get("vehicle") else None
        entries[whole] = _Entry(vehicle, profile_in(index, row.get("profile", "")), row.get("name", ""))
    return entries

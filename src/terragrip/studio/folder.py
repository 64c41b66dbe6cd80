"""The one folder that the studio may read and write, and what lies in it."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from terragrip.errors import InputError

DEPTH, MOST = 4, 5000
"""How deep, and how many files the list goes."""

PICTURES = frozenset([".png", ".jpg", ".jpeg", ".webp", ".svg"])


@dataclass(frozen=True)
class Item:
    """One file: `path` relative to the folder, `kind` (recording, estimates, library, ground, vehicle, profile, scenario, report,
    picture, basemap, map, calibration), `size` [bytes], `modified` [s since 1970]."""

    path: str
    kind: str
    size: int
    modified: float


def taken(path: str) -> InputError:
    """Why a file or folder is not written over."""
    return InputError("exists already", file=path, hint="choose another name, or replace it")


class Folder:
    """A folder as the only place that a request can name.

    Paths are relative, with slashes. Raises InputError where the folder does not exist or cannot be read.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        self.root = Path(root).resolve()
        if not self.root.is_dir():
            raise InputError("is no folder", file=root, hint="name a folder with logs, or make it")
        self._kinds: dict[tuple[str, int, float], str | None] = {}

    def resolve(self, path: str) -> Path:
        """The file or folder on disk that `path` names; InputError on whatever would leave the folder (also by a symbolic link)."""
        pure = PurePosixPath(path)
        parts = pure.parts
        bad = not parts or pure.is_absolute() or "\\" in path or any(ord(c) < 32 for c in path)
        if bad or any(part == ".." or part.startswith(".") or len(part.encode()) > 200 for part in parts):
            raise InputError("is not a path in the studio's folder", file=path, hint="give a relative path")
        try:
            target = (self.root / pure).resolve()
        except (OSError, RuntimeError):
            raise InputError("cannot be resolved", file=path) from None
        if not target.is_relative_to(self.root):
            raise InputError("leads out of the studio's folder", file=path)
        return target

    def file(self, path: str, version: str = "") -> Path:
        """As `resolve`, for a file that exists, and where `version` is given is still that one."""
        target = self.resolve(path)
        if not target.is_file():
            raise InputError("no such file in this folder", file=path, hint="reload the list")
        if version and self.version(path) != version:
            raise InputError("was replaced since it was opened", file=path, hint="open it again")
        return target

    def profile(self, name: str) -> str:
        """What reads a log by a profile: a file of the folder as its path on disk, or one that comes with Terragrip by its name."""
        from terragrip.formats.profile import SHIPPED

        return name if name in SHIPPED and not self.resolve(name).exists() else str(self.file(name))

    def new_file(self, path: str, suffixes: tuple[str, ...], *, replace: bool) -> Path:
        """As `resolve`, for a file to be written: its folder exists, its name ends as `suffixes` say, and there is no such file yet
        but one to `replace`."""
        target = self.resolve(path)
        if target.suffix.lower() not in suffixes:
            raise InputError(
                "has another suffix", file=path, hint=f"end the name with {' or '.join(suffixes)}"
            )
        if target.is_dir() or not target.parent.is_dir():
            raise InputError("cannot be written there", file=path, hint="name a file in a folder that exists")
        if target.exists() and not replace:
            raise taken(path)
        return target

    def version(self, path: str) -> str:
        """What tells a file from the one that replaces it: its size and time of change. Raises as `file`."""
        status = self.file(path).stat()
        return f"{status.st_size}-{status.st_mtime_ns}"

    def name(self, target: Path) -> str:
        """The path that names `target`."""
        return target.relative_to(self.root).as_posix()

    def items(self) -> list[Item]:
        """All files that the studio knows what to do with, by path."""
        result = []
        for path, status in self._walk(self.root, DEPTH):
            kind = self._kind(path, status)
            if kind is not None:
                result.append(Item(self.name(path), kind, status.st_size, status.st_mtime))
            if len(result) >= MOST:
                break
        return sorted(result, key=lambda item: item.path)

    def _walk(self, at: Path, depth: int) -> Iterator[tuple[Path, os.stat_result]]:
        try:
            entries = sorted(os.scandir(at), key=lambda entry: entry.name)
        except OSError:
            return
        for entry in entries:
            if entry.name.startswith(".") or entry.is_symlink():
                continue
            try:
                if entry.is_dir():
                    if depth > 1 and entry.name not in ("node_modules", "__pycache__"):
                        yield from self._walk(Path(entry.path), depth - 1)
                elif entry.is_file():
                    yield Path(entry.path), entry.stat()
            except OSError:  # gone, or not ours to see
                continue

    def _kind(self, path: Path, status: os.stat_result) -> str | None:
        key = (os.fspath(path), status.st_size, status.st_mtime)
        if key not in self._kinds:
            if len(self._kinds) > 4 * MOST:
                self._kinds.clear()
            try:
                self._kinds[key] = kind_of(path)
            except OSError:
                return None
        return self._kinds[key]


def kind_of(path: Path) -> str | None:
    """What a file is, by its name and, where that is not enough, by a look inside; None = nothing for the studio."""
    from terragrip.formats.registry import suffixes

    suffix = path.suffix.lower()
    if suffix in (".parquet", ".pq"):
        return "estimates" if _holds_estimates(path) else "recording"
    if suffix == ".json":
        return _kind_of_json(path)
    if suffix in (".yaml", ".yml"):
        return _kind_of_yaml(path)
    if suffix in (".html", ".pdf"):
        return "report"
    if suffix in (".tif", ".tiff"):
        return "basemap"
    if suffix == ".gpkg":
        return "map" if _holds_map(path) else None
    if suffix in PICTURES:
        return "picture"
    return "recording" if path.name.lower().endswith((*suffixes(), ".gz")) else None


def _holds_estimates(path: Path) -> bool:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip.estimation.estimates import METADATA_KEY

    try:
        return METADATA_KEY in (pq.read_schema(path).metadata or {})
    except (pa.ArrowException, OSError):
        return False


def _holds_map(path: Path) -> bool:
    """Whether `terragrip map` wrote a GeoPackage; asked of its tables, since a list of files should not wait for GDAL."""
    from terragrip.maps.about import ABOUT

    try:
        with closing(sqlite3.connect(f"file:{quote(str(path))}?mode=ro&immutable=1", uri=True)) as base:
            found = base.execute("SELECT count(*) FROM gpkg_metadata WHERE metadata LIKE ?", (f"%{ABOUT}%",))
            return bool(found.fetchone()[0])
    except sqlite3.Error:
        return False


def _kind_of_json(path: Path) -> str | None:
    if path.name.endswith(".picture.json"):
        return "calibration"
    if path.stat().st_size > 50_000_000:
        return None
    try:
        data = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return None
    if not isinstance(data, dict):
        return None
    if "soils" in data:
        return "library"
    return "ground" if {"changes", "sections"} <= set(data) else None


def _kind_of_yaml(path: Path) -> str | None:
    with path.open("rb") as stream:
        head = stream.read(20_000).decode("utf-8", errors="replace")
    keys = {line.split(":", 1)[0].strip() for line in head.splitlines() if line[:1].isalpha() and ":" in line}
    if "axles" in keys:
        return "vehicle"
    if keys & {"scenarios", "route", "terrain"}:
        return "scenario"
    return "profile" if keys & {"channels", "time", "columns"} else None

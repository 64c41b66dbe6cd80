"""The drive and map pages: a run over time, the mu-s plane, a sample explained, the track."""

from __future__ import annotations

import json
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Response

from terragrip.errors import InputError
from terragrip.estimation.estimates import Estimates
from terragrip.ground.events import events
from terragrip.studio import drive
from terragrip.studio.api.files import Named, finite
from terragrip.studio.shown import MEASURED
from terragrip.studio.state import Here, Studio
from terragrip.studio.tables import packed

router = APIRouter(tags=["drive"])

BINARY = "application/octet-stream"
PLANE = 3000
"""Points of the mu-s plane."""
TRACK = 20_000
"""Points of a track."""

Columns = Annotated[list[str], Query(max_length=64)]
Width = Annotated[int, Query(ge=10, le=5000)]
Time = Annotated[float, Query(allow_inf_nan=False)]


def _table(studio: Studio, path: str) -> Estimates:
    return studio.estimates.get(studio.folder.file(path))


@router.get("/drive")
def about(studio: Here, path: Named) -> dict[str, Any]:
    """What a run holds: columns, wheels, time, events with their reasons, soils, the recording it came from, the ground where known."""
    table = _table(studio, path)
    found = drive.recording_of(studio, table)
    plain: dict[str, Any] = finite(
        {
            "rows": len(table),
            "start": float(table.time[0]) if len(table) else 0.0,
            "end": float(table.time[-1]) if len(table) else 0.0,
            "columns": list(table.columns),
            "measured": [] if found is None else sorted(found[1].channels),
            "recording": None if found is None else studio.folder.name(found[0]),
            "wheels": list(table.wheels),
            "method": table.method,
            "vehicle": table.vehicle.name,
            "radius": dict(zip(table.vehicle.wheels, table.vehicle.wheel_radius.tolist(), strict=True)),
            "notes": list(table.notes),
            "events": [event.to_dict() for event in events(table)],
            "soils": drive.spans(table["soil"], table.time) if "soil" in table else [],
            "ground": _ground(studio, path),
        }
    )
    return plain


@router.get("/drive/window")
def window(
    studio: Here, path: Named, column: Columns, start: Time, end: Time, width: Width = 1000
) -> Response:
    """Columns between two times as float64 arrays behind a JSON head (see `packed`): min and max of every bucket are kept."""
    table = _table(studio, path)
    if not len(table) or end <= start:
        raise InputError("holds nothing between these times", file=path)
    found = drive.recording_of(studio, table) if any(c.startswith(MEASURED) for c in column) else None
    recording = None if found is None else found[1]
    shown = studio.shown.get(studio.folder.file(path))
    cut, time, columns = shown.window(recording, column, start, end, width)
    head = {"columns": ["time", *column], "count": len(time), "cut": cut}
    return Response(packed(head, [time, *columns]), media_type=BINARY)


@router.get("/drive/plane")
def plane(studio: Here, path: Named, wheel: str, start: Time, end: Time) -> dict[str, Any]:
    """Adhesion over slip of one wheel between two times, thinned evenly; no point where slip alone is known."""
    table = _table(studio, path)
    _known(table, wheel)
    if f"adhesion_{wheel}" not in table.columns:
        return {"slip": [], "adhesion": [], "time": []}
    first, last = np.searchsorted(table.time, [start, end], "left")
    rows = slice(int(first), max(int(last), int(first) + 1), max(int(last - first) // PLANE, 1))
    plain: dict[str, Any] = finite(
        {name: table[f"{name}_{wheel}"][rows].round(5).tolist() for name in ("slip", "adhesion")}
        | {"time": table.time[rows].tolist()}
    )
    return plain


@router.get("/drive/sample")
def sample(studio: Here, path: Named, time: Time) -> dict[str, Any]:
    """Everything known of one sample, and what moved the adhesion there."""
    table = _table(studio, path)
    if not len(table):
        raise InputError("holds no rows", file=path)
    found = drive.recording_of(studio, table)
    plain: dict[str, Any] = finite(drive.sample(table, None if found is None else found[1], time))
    return plain


@router.get("/drive/track")
def track(studio: Here, path: Named, column: Columns = []) -> Response:  # noqa: B006  (FastAPI copies it)
    """Time, longitude, latitude and columns along the way, thinned evenly, rows without a position left out."""
    table = _table(studio, path)
    if "latitude" not in table.columns or "longitude" not in table.columns:
        raise InputError("holds no positions", file=path, mend="estimate a log with latitude and longitude")
    for name in column:
        if name not in table.columns:
            raise InputError("is not in the estimates", place=f"column {name}")
    placed = np.flatnonzero(np.isfinite(table.columns["latitude"]) & np.isfinite(table.columns["longitude"]))
    rows = placed[:: max(len(placed) // TRACK, 1)]
    names = ["time", "longitude", "latitude", *column]
    columns = [table[name][rows].astype(np.float64) for name in names]
    return Response(packed({"columns": names, "count": len(rows), "cut": False}, columns), media_type=BINARY)


def _known(table: Estimates, wheel: str) -> None:
    if wheel not in table.wheels:
        raise InputError(f"there is no wheel {wheel!r}", mend=f"take one of {', '.join(table.wheels)}")


def _ground(studio: Studio, path: str) -> dict[str, Any] | None:
    """ground.json of this run where it lies beside it: NAME.ground.json, NAME-ground.json or ground.json in the same folder."""
    stem = path.removesuffix(".parquet")
    folder = path.rpartition("/")[0]
    for name in (f"{stem}.ground.json", f"{stem}-ground.json", f"{folder}/ground.json".lstrip("/")):
        try:
            data = json.loads(studio.folder.file(name).read_bytes())
        except (InputError, ValueError, OSError):
            continue
        if isinstance(data, dict) and {"changes", "sections"} <= set(data):
            return {"path": name, "changes": data["changes"], "sections": data["sections"]}
    return None

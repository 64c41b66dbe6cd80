"""The drive and map pages: a run over time, a sample explained, the track."""

from __future__ import annotations

import json
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Response

from terragrip.errors import InputError
from terragrip.estimation.estimates import Estimates
from terragrip.ground.events import events
from terragrip.recording import Recording
from terragrip.studio import drive
from terragrip.studio.api.files import Named, finite
from terragrip.studio.shown import FORMULA, MEASURED, Axis
from terragrip.studio.state import Here, Studio
from terragrip.studio.tables import packed

router = APIRouter(tags=["drive"])

TRACK = 20_000
"""Points of a track."""

Columns = Annotated[list[str], Query(max_length=2000)]
"""All panels of four wheels ask for 73; a guard against nonsense, not a share of what a page may draw."""
Width = Annotated[int, Query(ge=10, le=5000)]
Time = Annotated[float, Query(allow_inf_nan=False)]


def table_of(studio: Studio, path: str, version: str = "") -> Estimates:
    """Estimates of the folder. Raises InputError where the file is no longer the `version` that the page was given: what it draws
    would be a mixture of two runs."""
    return studio.estimates.get(studio.folder.file(path, version))


def recording_for(studio: Studio, table: Estimates, columns: list[str]) -> Recording | None:
    """The run's recording, where a column may need it and the folder has it."""
    if not any(name.startswith((MEASURED, FORMULA)) for name in columns):
        return None
    result = drive.recording_of(studio, table)
    return None if result is None else result[1]


@router.get("/drive")
def about(studio: Here, path: Named) -> dict[str, Any]:
    """What a run holds: columns, wheels, time, events with their reasons, soils, the recording it came from, the ground where known."""
    table = table_of(studio, path)
    result = drive.recording_of(studio, table, search=True)
    return finite(
        {
            "rows": len(table),
            "start": float(table.time[0]) if len(table) else 0.0,
            "end": float(table.time[-1]) if len(table) else 0.0,
            "began": None if table.start is None else table.start.isoformat(),
            "distance": _distance(studio, path),
            "columns": list(table.columns),
            "measured": [] if result is None else sorted(result[1].channels),
            "recording": None if result is None else studio.folder.name(result[0]),
            "wheels": list(table.wheels),
            "method": table.method,
            "vehicle": table.vehicle.name,
            "radius": drive.radii(table),
            "version": studio.folder.version(path),
            "notes": list(table.notes),
            "events": [event.to_dict() for event in events(table)],
            "soils": drive.spans(table["soil"], table.time) if "soil" in table else [],
            "ground": _ground(studio, path),
        }
    )


@router.get("/drive/window")
def window(
    studio: Here,
    path: Named,
    column: Columns,
    start: Time,
    end: Time,
    width: Width = 1000,
    version: str = "",
    axis: Axis = "time",
) -> Response:
    """Columns between two places on an axis as float64 arrays behind a JSON head (see `packed`): min and max of every bucket are kept.

    A column is one of the estimates, its limit (``slip_rl:low``), ``measured:NAME`` of the recording, ``axis:time`` or a formula
    (``=slip_rl - slip_rr``).
    """
    table = table_of(studio, path, version)
    if not len(table) or end <= start:
        raise InputError("has no row between these times", file=path)
    shown = studio.shown.get(studio.folder.file(path))
    recording = recording_for(studio, table, column)
    cut, place, columns = shown.window(recording, column, start, end, width, axis)
    head = {"columns": [axis, *column], "cut": cut}
    return packed(head, [place, *columns])


@router.get("/drive/sample")
def sample(studio: Here, path: Named, time: Time, version: str = "") -> dict[str, Any]:
    """Everything known of one sample, and what changed the adhesion there."""
    table = table_of(studio, path, version)
    if not len(table):
        raise InputError("holds no rows", file=path)
    result = drive.recording_of(studio, table)
    return finite(drive.sample(table, None if result is None else result[1], time))


@router.get("/drive/track")
def track(
    studio: Here,
    path: Named,
    column: Columns = [],  # noqa: B006  (FastAPI copies it)
    version: str = "",
) -> Response:
    """Time, longitude, latitude and columns along the way, thinned evenly, rows without a position left out. The head's ``of``
    says how many rows have one."""
    table = table_of(studio, path, version)
    if "latitude" not in table.columns or "longitude" not in table.columns:
        raise InputError("has no positions", file=path, hint="estimate a log with latitude and longitude")
    for name in column:
        if name not in table.columns:
            raise InputError("is not in the estimates", place=f"column {name}")
    placed = np.flatnonzero(np.isfinite(table.columns["latitude"]) & np.isfinite(table.columns["longitude"]))
    rows = placed[:: -(-len(placed) // TRACK) or 1]
    names = ["time", "longitude", "latitude", *column]
    columns = [table[name][rows].astype(np.float64) for name in names]
    head = {"columns": names, "cut": len(rows) < len(placed), "of": len(placed)}
    return packed(head, columns)


def _distance(studio: Studio, path: str) -> float | None:
    """How far the run went [m]; None where it has no ground speed."""
    try:
        return float(studio.shown.get(studio.folder.file(path)).along("distance")[-1])
    except InputError:
        return None


def _ground(studio: Studio, path: str) -> dict[str, Any] | None:
    """The ground of this run: of NAME.ground.json or NAME-ground.json beside it, else of the newest ground file there that has the run
    among its own, else of a ground.json in the folder above (as `terragrip demo` lays it)."""
    stem = path.removesuffix(".parquet")
    folder = path.rpartition("/")[0]
    above = folder.rpartition("/")[0]
    own = [f"{stem}.ground.json", f"{stem}-ground.json"]
    newest = sorted(studio.folder.items(), key=lambda item: -item.modified)
    beside = [
        item.path for item in newest if item.kind == "ground" and item.path.rpartition("/")[0] == folder
    ]
    shared = [*beside, f"{above}/ground.json".lstrip("/")]
    for name in own + shared:
        try:
            data = json.loads(studio.folder.file(name).read_bytes())
        except (InputError, ValueError, OSError):
            continue
        if not isinstance(data, dict) or not {"changes", "sections"} <= set(data):
            continue
        mine = _of_run(data, stem.rpartition("/")[2], alone=name in own)
        if mine is not None:
            return {"path": name, **mine}
    return None


def _of_run(data: dict[str, Any], run: str, *, alone: bool) -> dict[str, Any] | None:
    """Changes and sections of one run in a ground file, None where it holds other runs only. A file that is named after the run
    (`alone`) and holds one run holds this one, whatever it was called when it was written."""
    entries = [*data["changes"], *data["sections"], *data.get("runs", [])]
    runs = {one.get("run", run if alone else None) for one in entries}
    if run not in runs:
        if not (alone and len(runs) == 1):
            return None
        run = next(iter(runs))
    return {key: [one for one in data[key] if one.get("run", run) == run] for key in ("changes", "sections")}

"""Signals of runs: derived by a formula, one over another, as a table or a whole run to download."""

from __future__ import annotations

from pathlib import PurePosixPath
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import numpy.typing as npt
from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, Field
from starlette.background import BackgroundTask

from terragrip.errors import InputError
from terragrip.estimation.export import KINDS
from terragrip.studio.api.drive import Time, recording_for, table_of
from terragrip.studio.api.files import Named
from terragrip.studio.formulas import LONGEST
from terragrip.studio.shown import FORMULA, Axis
from terragrip.studio.state import Here, Studio
from terragrip.studio.tables import packed

router = APIRouter(tags=["signals"])

PAIRS = 3000
"""Points of a plot of one quantity over another."""
WAY = 2000
"""Points of the way between time and another axis."""
CELLS = 20_000_000
"""Numbers in a table: about 300 MB of text."""
DIGITS = 12

Formulas = Annotated[list[Annotated[str, Query(max_length=2 * LONGEST)]], Query(max_length=100)]


@router.get("/drive/formulas")
def formulas(studio: Here, path: Named, text: Formulas, version: str = "") -> list[str | None]:
    """For each formula why it cannot be worked out of this run, in one line; null where it can."""
    table = table_of(studio, path, version)
    shown = studio.shown.get(studio.folder.file(path))
    recording = recording_for(studio, table, [FORMULA])
    return [shown.missing(recording, one) for one in text]


@router.get("/drive/pairs")
def pairs(
    studio: Here,
    path: Named,
    x: str,
    y: str,
    start: Time,
    end: Time,
    axis: Axis = "time",
    version: str = "",
) -> Response:
    """One quantity over another between two places on an axis, as columns (see `packed`): time, x, y; rows where both are known, thinned
    evenly to at most `PAIRS`. The head's ``of`` says how many there are."""
    table = table_of(studio, path, version)
    shown = studio.shown.get(studio.folder.file(path))
    recording = recording_for(studio, table, [x, y])
    _, (time, across, up) = shown.rows(recording, ["axis:time", x, y], axis, start, end)
    known = np.flatnonzero(np.isfinite(across) & np.isfinite(up))
    rows = known[:: -(-len(known) // PAIRS) or 1]
    head = {
        "columns": ["time", "x", "y"],
        "cut": len(rows) < len(known),
        "of": len(known),
    }
    return packed(head, [time[rows], across[rows], up[rows]])


@router.get("/drive/way")
def way(studio: Here, path: Named, axis: Axis, version: str = "") -> Response:
    """Time [s] and the place on an axis, at most `WAY` rows from the first to the last, as columns (see `packed`)."""
    table = table_of(studio, path, version)
    place = studio.shown.get(studio.folder.file(path)).along(axis)
    rows = np.unique(np.linspace(0, len(place) - 1, min(WAY, len(place))).astype(np.intp))
    head = {"columns": ["time", axis], "cut": len(rows) < len(place)}
    return packed(head, [table.time[rows], place[rows]])


@router.get("/drive/kinds")
def kinds() -> dict[str, str]:
    """The files that a run can be had as: what each suffix is."""
    return {suffix: kind.title for suffix, kind in KINDS.items()}


@router.get("/drive/converted")
def converted(studio: Here, path: Named, suffix: str) -> Response:
    """A whole run as a file of another program, as `terragrip convert` writes it. InputError where it cannot hold the run."""
    from terragrip.estimation.converting import convert

    source, name = studio.folder.file(path), f"{PurePosixPath(path).stem}{suffix}"
    if suffix not in KINDS:
        raise InputError("is no kind of file for estimates", file=name, hint=f"one of {', '.join(KINDS)}")
    place = TemporaryDirectory(prefix="terragrip-")  # not in the folder, where it would be listed as a log
    try:
        convert(source, f"{place.name}/{name}")
    except InputError as error:
        place.cleanup()
        raise InputError(
            error.problem, file=name if place.name in str(error.file) else path, hint=error.hint
        ) from None
    return FileResponse(
        f"{place.name}/{name}",
        media_type="application/octet-stream",
        filename=name,
        background=BackgroundTask(place.cleanup),
    )


class Part(BaseModel):
    """A run of a table, and what it is called there."""

    path: str = Field(max_length=1000)
    label: str = Field(max_length=200)
    version: str = ""


class Column(BaseModel):
    """A column of a table: as `window` names it, its heading with the unit, and the factor from SI to that unit."""

    name: str = Field(max_length=2 * LONGEST)
    heading: str = Field(max_length=300)
    scale: float = Field(1.0, allow_inf_nan=False)


class TableRequest(BaseModel):
    """All rows between two places on an axis, of one run or of several one below the other."""

    runs: list[Part] = Field(min_length=1, max_length=20)
    columns: list[Column] = Field(min_length=1, max_length=500)
    axis: Axis = "time"
    heading: str = Field("time [s]", max_length=100, description="Heading of the place on the axis.")
    start: float = Field(allow_inf_nan=False)
    end: float = Field(allow_inf_nan=False)


@router.post("/drive/table")
def table(studio: Here, wanted: TableRequest) -> Response:
    """The rows as CSV: a heading with units, the run where there are several, place, columns, event and labels; empty where unknown.

    A column that only some of the runs have is empty in the others.
    """
    import polars as pl

    headings = [wanted.heading, *(column.heading for column in wanted.columns), "run", "event", "soil"]
    for heading in headings:
        if headings.count(heading) > 1:
            raise InputError(
                "two columns have this heading", place=f"column {heading}", hint="name them apart"
            )
    several = len(wanted.runs) > 1
    absent: list[set[str]] = []
    parts = []
    for run in wanted.runs:
        place, columns, missing = _rows(studio, run, wanted)
        absent.append(missing)
        labels = studio.shown.get(studio.folder.file(run.path))
        words = {
            name: labels.labels(name, wanted.axis, wanted.start, wanted.end) for name in ("event", "soil")
        }
        parts.append(
            pl.DataFrame(
                {
                    **({"run": [run.label] * len(place)} if several else {}),
                    wanted.heading: place.round(6) if wanted.axis == "distance" else place,
                    **{c.heading: values for c, values in zip(wanted.columns, columns, strict=True)},
                    **words,
                }
            )
        )
    for name in set.intersection(*absent):
        raise InputError("is in none of these runs", place=f"column {name}")
    text = pl.concat(parts).fill_nan(None).write_csv()
    return Response(text, media_type="text/csv; charset=utf-8")


def _rows(
    studio: Studio, run: Part, wanted: TableRequest
) -> tuple[npt.NDArray[np.float64], list[npt.NDArray[np.float64]], set[str]]:
    """Places, columns in the units of their headings, and the names that this run has not."""
    table = table_of(studio, run.path, run.version)
    shown = studio.shown.get(studio.folder.file(run.path))
    recording = recording_for(studio, table, [column.name for column in wanted.columns])
    span = (wanted.axis, wanted.start, wanted.end)
    place, _ = shown.rows(recording, [], *span)
    if len(place) * len(wanted.columns) * len(wanted.runs) > CELLS:
        raise InputError(
            f"{len(place)} rows of {len(wanted.columns)} columns are too many for a table",
            file=run.path,
            hint="zoom in, or show fewer panels",
        )
    columns, missing = [], set()
    for column in wanted.columns:
        try:
            values = shown.rows(recording, [column.name], *span)[1][0]
        except InputError:
            missing.add(column.name)
            values = np.full(len(place), np.nan)
        columns.append(_scaled(values, column.scale))
    return place, columns, missing


def _scaled(values: npt.NDArray[np.float64], scale: float) -> npt.NDArray[np.float64]:
    """Values in another unit, to `DIGITS` digits: 0.07 of slip is 7 %, not 7.000000000000001."""
    if scale == 1.0:
        return values
    scaled = values * scale
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        digits = 10.0 ** (DIGITS - 1 - np.floor(np.log10(np.abs(scaled))))
        rounded = np.round(scaled * digits) / digits
    return np.where(np.isfinite(rounded), rounded, scaled)

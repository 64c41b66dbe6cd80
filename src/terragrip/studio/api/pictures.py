"""Background pictures of printed curves: their calibration, kept as JSON beside the picture, and points clicked along a line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field, FiniteFloat, ValidationError

from terragrip.errors import InputError
from terragrip.files import replacing
from terragrip.studio.api.files import Named
from terragrip.studio.state import Here

router = APIRouter(tags=["pictures"])

Pixel = tuple[FiniteFloat, FiniteFloat]
SUFFIX = ".picture.json"
VERSION = 1


class Mark(BaseModel):
    """One clicked point of an axis: where it is in the picture [pixels from its top left corner] and the axis value printed there."""

    pixel: Pixel
    value: FiniteFloat


class Axis(BaseModel):
    """One axis of the picture: two marks, and whether it is logarithmic."""

    marks: Annotated[list[Mark], Field(min_length=2, max_length=2)]
    log: bool = False


class Line(BaseModel):
    """Points digitised along one line of the picture, as slip and adhesion."""

    name: str = Field(max_length=100)
    points: Annotated[list[Pixel], Field(max_length=20_000)] = []


class Calibration(BaseModel):
    """How a picture lies in the plot of adhesion over slip."""

    version: Literal[1] = 1
    slip: Axis | None = None
    adhesion: Axis | None = None
    opacity: FiniteFloat = Field(0.5, ge=0, le=1)
    shown: bool = True
    lines: Annotated[list[Line], Field(max_length=100)] = []


@router.get("/picture")
def get_calibration(studio: Here, path: Named) -> Calibration:
    """The calibration of a picture; an empty one where there is none yet."""
    file = _beside(studio.folder.file(path))
    if not file.is_file():
        return Calibration()
    name = studio.folder.name(file)
    try:
        data = json.loads(file.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError("is not JSON", file=name, hint="remove it and calibrate again") from error
    if isinstance(data, dict) and isinstance(data.get("version"), int) and data["version"] > VERSION:
        raise InputError(f"has version {data['version']}", file=name, hint="update terragrip")
    try:
        return Calibration.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(first["msg"], file=name, place=place, hint="remove it and calibrate again") from None


@router.put("/picture")
async def put_calibration(
    studio: Here, path: Named, calibration: Calibration, by: Annotated[str, Query(max_length=40)] = ""
) -> dict[str, Any]:
    """Keep a picture's calibration beside it; every open page is notified, with the name `by` that the sender gave itself."""
    _check(calibration.slip, "slip", path)
    _check(calibration.adhesion, "adhesion", path)
    file = _beside(studio.folder.file(path))
    with replacing(file) as temporary:
        temporary.write_text(calibration.model_dump_json(indent=1) + "\n", encoding="utf-8")
    studio.notices.publish("picture", path=path, by=by)
    return {"path": studio.folder.name(file)}


def _beside(picture: Path) -> Path:
    return picture.with_name(picture.name + SUFFIX)


def _check(axis: Axis | None, name: str, path: str) -> None:
    if axis is None:
        return
    first, second = axis.marks
    if first.pixel == second.pixel or first.value == second.value:
        raise InputError(
            "two marks of one axis must differ in place and value",
            file=path,
            place=name,
            hint="click two points",
        )
    if axis.log and min(first.value, second.value) <= 0:
        raise InputError("a logarithmic axis has no zero", file=path, place=name, hint="give positive values")

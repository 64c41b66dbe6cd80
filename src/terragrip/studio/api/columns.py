"""Columns of a foreign log, channels made of them by choice, and the profile that keeps the choice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, Field

from terragrip.errors import InputError
from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here

router = APIRouter(tags=["columns"])

HEAD = "Chosen in the studio for {}."


class ProfileRequest(BaseModel):
    """A profile by choice: `time` and `channels` as a profile file has them."""

    log: str
    output: str = Field(description="YAML file to write.")
    time: dict[str, Any]
    channels: dict[str, dict[str, Any]] = Field(min_length=1)
    replace: bool = False


@router.get("/columns")
def columns_of(studio: Here, path: Named, vehicle: str = "", profile: str = "") -> dict[str, Any]:
    """What a log holds, with an outline of each column, and what each channel may be made of, the likeliest first.

    With a vehicle its wheels are among the channels, whether a column looks like theirs or not. With a profile the channels have the
    names that it gives them, and ``kept`` is its choice, `time` and `channels`; null where it has more than a choice of columns, or
    cannot be read, which ``unread`` says.
    """
    from terragrip.vehicle import Vehicle

    look = studio.logs.get(studio.folder.file(path))
    wheels = tuple(Vehicle.load(studio.folder.file(vehicle)).wheels) if vehicle else ()
    kept, unread = _choice(studio, profile) if profile else (None, "")
    return finite(
        {
            "kept": kept,
            "unread": unread,
            "rows": look.inspection.rows,
            "ready": look.inspection.ready,
            "fitting": look.inspection.fitting,
            "refused": look.inspection.refused,
            "remarks": [
                text for text in look.inspection.warnings if not text.startswith("Without a profile")
            ],
            "time": look.time(),
            "columns": look.columns(),
            "channels": look.channels(wheels, kept["channels"] if kept else None),
        }
    )


@router.post("/profile", status_code=201)
def save_profile(studio: Here, wanted: ProfileRequest) -> dict[str, str]:
    """Write a profile beside its log; it must read that log."""
    from terragrip.files import replacing
    from terragrip.formats import Profile
    from terragrip.formats.channel_proposal import Proposal
    from terragrip.formats.proposal import profile_text
    from terragrip.formats.time_column import TimeColumn

    log = studio.folder.file(wanted.log)
    target = studio.folder.new_file(wanted.output, (".yaml", ".yml"), replace=wanted.replace)
    chosen = Profile.from_dict({"time": wanted.time, "channels": wanted.channels}, wanted.output)
    text = profile_text(
        Path(wanted.log).name,
        TimeColumn(chosen.time.column, chosen.time.unit),
        {name: Proposal(entry) for name, entry in wanted.channels.items()},
        since_1970=chosen.time.zero is not None,
        head=HEAD,
    )
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
        if Profile.load(temporary) != chosen:
            raise InputError(
                "a name contains characters that cannot be written",
                file=wanted.output,
                hint="name the wheels in plain letters",
            )
        _read_some(log, temporary)
    return {"path": wanted.output, "text": text}


def _choice(studio: Here, profile: str) -> tuple[dict[str, Any] | None, str]:
    """A profile's `time` and `channels`, None where `save_profile` would lose something of it; and why it cannot be read, if so."""
    from terragrip.formats import Profile

    path = studio.folder.profile(profile)
    try:
        whole = Profile.load(path).to_dict()
    except InputError as error:
        return None, str(error).replace(path, profile)
    time = set(whole.get("time", ()))
    plain = {"channels"} <= set(whole) <= {"time", "channels"} and time <= {"from", "unit", "zero"}
    return (whole if plain else None), ""


def _read_some(log: Path, profile: Path) -> None:
    """Raise InputError unless the log is read by the profile."""
    from terragrip.formats.log_blocks import log_in_blocks

    try:
        log_in_blocks(log, profile)
    except InputError as error:
        raise InputError(error.problem, file=log, place=error.place, hint=error.hint) from None

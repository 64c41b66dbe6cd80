"""What the folder holds; uploads; inspection of a log."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from fastapi import APIRouter, Query, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse

from terragrip.errors import InputError
from terragrip.files import replacing, sync
from terragrip.studio.folder import PICTURES, Folder, kind_of, taken
from terragrip.studio.state import Here

router = APIRouter(tags=["folder"])

Named = Annotated[str, Query(description="Path relative to the folder, with slashes.")]

_REPORT_POLICY = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'none'"
PICTURE_TYPES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
Plain = TypeVar("Plain")


@router.get("/folder")
async def list_folder(studio: Here) -> dict[str, Any]:
    """Every file that the studio knows what to do with."""
    items = await asyncio.to_thread(studio.folder.items)
    return {"name": studio.folder.root.name, "items": [asdict(item) for item in items]}


@router.websocket("/notices")
async def notices(socket: WebSocket, studio: Here) -> None:
    """Changes of the folder and progress of jobs, as they happen."""
    queue = await studio.notices.join()
    await socket.accept()

    async def wait_for_end() -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                await socket.receive_text()

    end = asyncio.create_task(wait_for_end())
    try:
        while not end.done():
            wait = asyncio.create_task(queue.get())
            done, _ = await asyncio.wait({wait, end}, return_when=asyncio.FIRST_COMPLETED)
            if wait in done:
                await socket.send_json(wait.result())
            else:
                wait.cancel()
    except WebSocketDisconnect:
        pass
    finally:
        end.cancel()
        studio.notices.leave(queue)


@router.get("/file")
def get_file(studio: Here, path: Named) -> Response:
    """One file of the folder: a picture to show, anything else as a download."""
    target = studio.folder.file(path)
    shown = PICTURE_TYPES.get(target.suffix.lower())
    if shown is None:
        return FileResponse(target, media_type="application/octet-stream", filename=target.name)
    return FileResponse(target, media_type=shown)


@router.get("/report")
def show_report(studio: Here, path: Named) -> Response:
    """A report as a page of its own: no script runs in it, it loads nothing, and browsers treat it as another site's."""
    target = studio.folder.file(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError("is no page", file=path, hint="download it")
    return FileResponse(target, media_type="text/html", headers={"content-security-policy": _REPORT_POLICY})


@router.put("/file", status_code=201)
async def upload(request: Request, studio: Here, path: Named, replace: bool = False) -> dict[str, Any]:
    """Take a file into the folder, whole or not at all; its content must be what its name says."""
    target = _free(studio.folder, path, replace)
    try:
        with replacing(target) as temporary:
            await _receive(request.stream(), temporary, studio.upload_limit, path)
            await asyncio.to_thread(_check, temporary, path)
            await asyncio.to_thread(sync, temporary)  # a large one takes a while, and other requests go on
            _free(studio.folder, path, replace)  # meanwhile another may have made it
    except InputError as error:
        raise InputError(error.problem, file=path, place=error.place, hint=error.hint) from error
    return {"path": studio.folder.name(target), "kind": await asyncio.to_thread(kind_of, target)}


@router.delete("/file", status_code=204)
def remove_file(studio: Here, path: Named) -> None:
    """Remove a file of the folder."""
    try:
        studio.folder.file(path).unlink()
    except OSError as error:
        raise InputError(
            f"cannot be removed ({error.strerror})", file=path, hint="make its folder writable"
        ) from error


@router.get("/inspect")
def inspect_log(
    studio: Here, path: Named, profile: str = "", vehicle: str = "", method: str = ""
) -> dict[str, Any]:
    """What a log holds, which channels were found, what is missing, and a profile to begin with.

    With a vehicle, `ready` means that an estimate will run: it is begun, and `problem` is the reason where it cannot.
    """
    from terragrip.formats import inspect

    log = studio.folder.file(path)
    chosen = studio.folder.profile(profile) if profile else None
    machine = studio.folder.file(vehicle) if vehicle else None
    inspection = inspect(log, chosen, machine)
    problem = _begun(log, chosen, machine, method) if inspection.ready and machine is not None else None
    root = f"{studio.folder.root}/"
    return {
        **finite(inspection.to_dict()),
        "file": path,
        "text": inspection.to_text().replace(root, ""),
        "ready": inspection.ready and problem is None,
        "problem": None if problem is None else problem.replace(root, ""),
    }


def _begun(log: Path, profile: str | None, vehicle: Path, method: str) -> str | None:
    """Begin to estimate a log: all checks, the pass over all rows, the first rows through the filter; why it fails, or None."""
    from terragrip.estimation import DEFAULT, RunOptions, estimated
    from terragrip.formats.log_blocks import log_in_blocks
    from terragrip.vehicle import Vehicle

    try:
        options = RunOptions(method or DEFAULT)
        next(estimated(log_in_blocks(log, profile), Vehicle.load(vehicle), options), None)
    except InputError as error:
        return str(error)
    return None


def finite(value: Plain) -> Plain:
    """Plain data with null for what JSON cannot hold (NaN, infinities)."""
    plain: Any = value
    if isinstance(plain, float):
        plain = plain if math.isfinite(plain) else None
    elif isinstance(plain, dict):
        plain = {key: finite(one) for key, one in plain.items()}
    elif isinstance(plain, (list, tuple)):
        plain = [finite(one) for one in plain]
    return cast("Plain", plain)


def _free(folder: Folder, path: str, replace: bool) -> Path:
    target = folder.resolve(path)
    if target.exists() and not (replace and target.is_file()):
        raise taken(path)
    if not target.parent.is_dir():
        raise InputError("cannot be written there", file=path, hint="name a folder that exists")
    return target


async def _receive(stream: AsyncIterator[bytes], target: Path, limit: int, path: str) -> None:
    size = 0
    with target.open("wb") as file:
        async for chunk in stream:
            size += len(chunk)
            if size > limit:
                raise InputError(
                    f"is larger than {limit / 1e6:.0f} MB", file=path, hint="copy it into the folder yourself"
                )
            await asyncio.to_thread(file.write, chunk)
    if size == 0:
        raise InputError("is empty", file=path, hint="drop a file with content")


def _check(temporary: Path, path: str) -> None:
    """Raise InputError unless the content is what the name says."""
    try:
        kind = kind_of(temporary)
        if kind == "recording":
            from terragrip.formats import inspect

            inspect(temporary)
        elif kind == "vehicle":
            from terragrip.vehicle import Vehicle

            Vehicle.load(temporary)
        elif kind == "library":
            from terragrip.soil.library import SoilLibrary

            SoilLibrary.load(temporary)
        elif kind == "map":
            from terragrip.maps.reading import read_map

            read_map(temporary)
        elif kind == "picture":
            check_picture(temporary.read_bytes()[:64], temporary.suffix.lower(), path)
        elif kind is None or kind == "report":
            if temporary.suffix.lower() in (".xlsx", ".xlsm", ".xls", ".ods"):
                raise InputError("is a workbook", hint="save the sheet as CSV and drop that")
            raise InputError(
                "is not a file that the studio accepts", hint="drop a log, a vehicle, a profile or a picture"
            )
    except InputError as error:
        raise InputError(error.problem, file=path, place=error.place, hint=error.hint) from None


_MAGIC = {
    ".png": (b"\x89PNG\r\n\x1a\n",),
    ".jpg": (b"\xff\xd8\xff",),
    ".jpeg": (b"\xff\xd8\xff",),
    ".webp": (b"RIFF",),
}


def check_picture(head: bytes, suffix: str, path: str) -> None:
    """Raise InputError unless the first bytes are those of a PNG, JPEG or WebP file, as the suffix says.

    SVG is refused: it is a document that can carry scripts.
    """
    if suffix not in _MAGIC:
        known = ", ".join(sorted(PICTURES & set(_MAGIC)))
        raise InputError("is not a picture that the studio accepts", file=path, hint=f"give one of {known}")
    if not head.startswith(_MAGIC[suffix]):
        raise InputError(f"is no {suffix[1:].upper()} picture, despite its name", file=path)

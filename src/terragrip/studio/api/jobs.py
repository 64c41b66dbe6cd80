"""Long work: estimates and soil libraries, with progress and cancel."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, HTTPException
from pydantic import BaseModel, Field

from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.studio.jobs import Job
from terragrip.studio.state import Here

router = APIRouter(tags=["jobs"])


class EstimateRequest(BaseModel):
    """Estimate one recording. Paths are relative to the folder."""

    recording: str
    vehicle: str
    profile: str | None = None
    method: str = DEFAULT
    smooth: bool = False
    output: str = Field(description="Parquet file to write.")
    replace: bool = False


class SoilsRequest(BaseModel):
    """Learn a soil library from estimates."""

    estimates: list[str] = Field(min_length=1)
    output: str = Field(description="JSON file to write.")
    replace: bool = False


@router.get("/methods")
def methods() -> dict[str, Any]:
    """The methods by name, and the default."""
    from terragrip.estimation.methods import METHODS

    return {"default": DEFAULT, "methods": {name: {"smooth": m.can_smooth} for name, m in METHODS.items()}}


@router.get("/jobs")
async def list_jobs(studio: Here) -> list[dict[str, Any]]:
    """Every job, the oldest first."""
    return [job.to_dict() for job in studio.jobs.all()]


@router.get("/jobs/{identity}")
async def get_job(studio: Here, identity: str) -> dict[str, Any]:
    """One job."""
    return _job(studio, identity).to_dict()


@router.delete("/jobs/{identity}")
async def cancel_job(studio: Here, identity: str) -> dict[str, Any]:
    """Cancel a job; nothing of its output stays."""
    job = _job(studio, identity)
    await studio.jobs.cancel(job)
    return job.to_dict()


@router.post("/jobs/estimate", status_code=202)
async def add_estimate(studio: Here, wanted: EstimateRequest) -> dict[str, Any]:
    """Queue an estimate."""
    folder = studio.folder
    if not method_named(wanted.method).can_smooth and wanted.smooth:
        raise InputError(f"the method {wanted.method} cannot smooth", hint="choose another method")
    output = _output(studio, wanted.output, ".parquet", wanted.replace)
    request = {
        "recording": str(folder.file(wanted.recording)),
        "vehicle": str(folder.file(wanted.vehicle)),
        "profile": str(folder.file(wanted.profile)) if wanted.profile else None,
        "method": wanted.method,
        "smooth": wanted.smooth,
        "output": output,
    }
    if output in (request["recording"], request["vehicle"], request["profile"]):
        raise InputError("is an input of this job", file=wanted.output, hint="choose another name")
    job = studio.jobs.add("estimate", wanted.recording, wanted.output, request)
    return job.to_dict()


@router.post("/jobs/soils", status_code=202)
async def add_soils(studio: Here, wanted: SoilsRequest) -> dict[str, Any]:
    """Queue the learning of a soil library."""
    files = [str(studio.folder.file(path)) for path in wanted.estimates]
    output = _output(studio, wanted.output, ".json", wanted.replace)
    title = wanted.estimates[0] if len(files) == 1 else f"{len(files)} runs"
    return studio.jobs.add("soils", title, wanted.output, {"estimates": files, "output": output}).to_dict()


def _output(studio: Here, path: str, suffix: str, replace: bool) -> str:
    target = studio.folder.new_file(path, (suffix,))
    if target.exists() and not replace:
        raise InputError("exists already", file=path, hint="choose another name, or replace it")
    return str(target)


def _job(studio: Here, identity: str) -> Job:
    job = studio.jobs.get(identity)
    if job is None:
        raise HTTPException(404, "no such job")
    return job

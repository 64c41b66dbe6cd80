"""Long work: every command that makes a file of chosen files, as a job with progress and cancel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fastapi import APIRouter, HTTPException
from pydantic import BaseModel, Field

from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.studio.folder import taken
from terragrip.studio.job_store import Job
from terragrip.studio.state import Here

router = APIRouter(tags=["jobs"])


class Request(BaseModel):
    """What every job is asked for. Paths are relative to the folder."""

    output: str = Field(description="What to write.")
    replace: bool = False


class EstimationRequest(Request):
    """What every estimation is asked for."""

    vehicle: str
    profile: str | None = None
    method: str = DEFAULT
    smooth: bool = False


class EstimateRequest(EstimationRequest):
    """Estimate one recording into a Parquet file."""

    recording: str


class BatchRequest(EstimationRequest):
    """Estimate several recordings into a folder, which is made if need be."""

    recordings: list[str] = Field(min_length=2)


class CalibrateRequest(Request):
    """Calibrate a vehicle from recordings into a new vehicle file."""

    recordings: list[str] = Field(min_length=1)
    vehicle: str
    profile: str | None = None


class SoilsRequest(Request):
    """Learn a soil library (JSON) from estimates."""

    estimates: list[str] = Field(min_length=1)
    soil: str | None = Field(None, description="The soil of all rows, for logs without labels.")


class GroundRequest(Request):
    """Find changes, soils and events of drives (JSON)."""

    estimates: list[str] = Field(min_length=1)
    library: str | None = None


class MapRequest(Request):
    """A map (GeoPackage) of drives with positions."""

    estimates: list[str] = Field(min_length=1)
    cell: float | None = Field(None, description="Size of a cell [m]; by the machine.")
    slip: float | None = Field(None, description="Slip that adhesion is mapped at, as a share.")
    datum: str | None = Field(None, max_length=100, description="Datum of latitude and longitude.")
    library: str | None = None
    ground: str | None = None


class ReportRequest(Request):
    """A report of drives, as a page (HTML) and a PDF beside it."""

    estimates: list[str] = Field(min_length=1)
    library: str | None = None
    ground: str | None = None
    title: str = "Traction report"


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
    return _queue(studio, "estimate", [wanted.recording], wanted, (".parquet",), _estimation(studio, wanted))


@router.post("/jobs/batch", status_code=202)
async def add_batch(studio: Here, wanted: BatchRequest) -> dict[str, Any]:
    """Queue the estimates of several recordings; those that cannot be read do not stop the others."""
    options = _estimation(studio, wanted)
    folder = studio.folder.resolve(wanted.output)
    if folder.is_file() or not folder.parent.is_dir():
        raise InputError(
            "is not a place for several files", file=wanted.output, hint="name a folder, new or there"
        )
    if folder.is_dir() and any(folder.iterdir()) and not wanted.replace:
        raise taken(wanted.output)
    logs = _files(studio, wanted.recordings)
    words = ["estimate", *logs, *options, "--output", _safe(wanted.output)]
    return studio.jobs.add("batch", _title(wanted.recordings, "logs"), wanted.output, words).to_dict()


@router.post("/jobs/calibrate", status_code=202)
async def add_calibrate(studio: Here, wanted: CalibrateRequest) -> dict[str, Any]:
    """Queue a calibration."""
    options = _options(studio, vehicle=wanted.vehicle, profile=wanted.profile)
    return _queue(studio, "calibrate", wanted.recordings, wanted, (".yaml", ".yml"), options)


@router.post("/jobs/soils", status_code=202)
async def add_soils(studio: Here, wanted: SoilsRequest) -> dict[str, Any]:
    """Queue the learning of a soil library."""
    options = [f"--soil={wanted.soil.strip()}"] if wanted.soil and wanted.soil.strip() else []
    return _queue(studio, "soils", wanted.estimates, wanted, (".json",), options)


@router.post("/jobs/ground", status_code=202)
async def add_ground(studio: Here, wanted: GroundRequest) -> dict[str, Any]:
    """Queue the search for changes, soils and events."""
    options = _options(studio, library=wanted.library)
    return _queue(studio, "ground", wanted.estimates, wanted, (".json",), options)


@router.post("/jobs/map", status_code=202)
async def add_map(studio: Here, wanted: MapRequest) -> dict[str, Any]:
    """Queue a map."""
    options = _options(studio, soils=wanted.library, ground=wanted.ground)
    for name, value in (("cell", wanted.cell), ("slip", wanted.slip)):
        options += [f"--{name}={value:g}"] if value is not None else []
    options += [f"--datum={wanted.datum.strip()}"] if wanted.datum and wanted.datum.strip() else []
    return _queue(studio, "map", wanted.estimates, wanted, (".gpkg",), options)


@router.post("/jobs/report", status_code=202)
async def add_report(studio: Here, wanted: ReportRequest) -> dict[str, Any]:
    """Queue a report."""
    options = [
        *_options(studio, library=wanted.library, ground=wanted.ground),
        f"--title={wanted.title.strip()}",
    ]
    return _queue(studio, "report", wanted.estimates, wanted, (".html",), options)


def _estimation(studio: Here, wanted: EstimationRequest) -> list[str]:
    """The options of an estimate; InputError where they do not go together."""
    method_named(wanted.method, smooth=wanted.smooth)
    options = _options(studio, vehicle=wanted.vehicle, profile=wanted.profile)
    options += [f"--method={wanted.method}"] if wanted.method != DEFAULT else []
    return [*options, *(["--smooth"] if wanted.smooth else [])]


def _queue(
    studio: Here,
    kind: str,
    inputs: Sequence[str],
    wanted: Request,
    suffixes: tuple[str, ...],
    options: Sequence[str],
) -> dict[str, Any]:
    """Queue one command over files; InputError on an output that cannot be written, or is an input."""
    files = _files(studio, inputs)
    target = studio.folder.resolve(wanted.output)
    if any(target == (studio.folder.root / word).resolve() for word in (*files, *options)):
        raise InputError("is an input of this job", file=wanted.output, hint="choose another name")
    studio.folder.new_file(wanted.output, suffixes, replace=wanted.replace)
    words = [kind, *files, *options, "--output", _safe(wanted.output)]
    noun = "logs" if kind == "calibrate" else "runs"
    return studio.jobs.add(kind, _title(inputs, noun), wanted.output, words).to_dict()


def _title(files: Sequence[str], noun: str) -> str:
    return files[0] if len(files) == 1 else f"{len(files)} {noun}"


def _files(studio: Here, paths: Sequence[str]) -> list[str]:
    """Files of the folder as words of a command line."""
    for path in paths:
        studio.folder.file(path)
    return [_safe(path) for path in paths]


def _options(studio: Here, **files: str | None) -> list[str]:
    """Options that name a file each, those of no file left out."""
    words = []
    for name, path in files.items():
        if path and name == "profile":
            studio.folder.profile(path)
            words += ["--profile", _safe(path)]
        elif path:
            words += [f"--{name}", *_files(studio, [path])]
    return words


def _safe(path: str) -> str:
    """A path that no command line takes for an option."""
    return f"./{path}" if path.startswith("-") else path


def _job(studio: Here, identity: str) -> Job:
    job = studio.jobs.get(identity)
    if job is None:
        raise HTTPException(404, "no such job")
    return job

"""What the routes share: the folder, the jobs, the notices, the tables in memory."""

from __future__ import annotations

import json
import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fastapi import Depends
from fastapi.requests import HTTPConnection

from terragrip.files import sha256
from terragrip.studio.folder import MOST, Folder
from terragrip.studio.job_store import JobStore
from terragrip.studio.jobs import Jobs
from terragrip.studio.log_preview import LogPreview, preview
from terragrip.studio.notices import Notices
from terragrip.studio.own_folder import OwnFolder
from terragrip.studio.shown import Shown
from terragrip.studio.tables import Tables

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.maps.reading import MapFile
    from terragrip.recording import Recording

UPLOAD_LIMIT = 2_000_000_000
"""Bytes of one upload."""


def _estimates(path: Path) -> Estimates:
    from terragrip.estimation import Estimates

    return Estimates.read(path)


def _recording(path: Path, profile: str = "") -> Recording:
    """A log read by a profile's content (JSON), as estimates hold it."""
    from terragrip.formats import Profile, read

    return read(path, Profile.from_dict(json.loads(profile)) if profile else None)


def _map(path: Path) -> MapFile:
    from terragrip.maps.reading import read_map

    return read_map(path)


class Studio:
    """One studio on one folder.

    Parameters
    ----------
    root: the folder. InputError if it is none, or its list of jobs is of a newer Terragrip or damaged.
    upload_limit: bytes that one upload may have.
    live: address of a live service's WebSocket (ws://127.0.0.1:...), or None.
    """

    def __init__(
        self, root: str | os.PathLike[str], upload_limit: int = UPLOAD_LIMIT, live: str | None = None
    ) -> None:
        self.folder = Folder(root)
        self.notices = Notices(self.folder)
        self.own = OwnFolder(self.folder.root)
        self.jobs = Jobs(self.notices, self.folder.root, JobStore(self.own))
        self.estimates: Tables[Estimates] = Tables(_estimates)
        self.shown: Tables[Shown] = Tables(lambda path: Shown(self.estimates.get(path)))
        self.recordings: Tables[Recording] = Tables(_recording)
        self.maps: Tables[MapFile] = Tables(_map)
        self.logs: Tables[LogPreview] = Tables(preview)
        self.fingerprints: Tables[str] = Tables(sha256, MOST)
        # by SHA-256, rows and times: the recording, None where the folder does not hold it
        self.origins: dict[tuple[str | float, ...], Path | None] = {}
        self.upload_limit, self.live = upload_limit, live

    def prepare_maps(self) -> None:
        """Load what reads a map where the folder holds one: half of what the first map's opening took."""
        # os.walk passes over what goes meanwhile, the folder itself included
        names = (name for _, _, files in os.walk(self.folder.root) for name in files)
        if any(name.endswith(".gpkg") for name in names) and find_spec("pyogrio"):
            import_module("pyogrio")
            import_module("pyproj")


def _studio(connection: HTTPConnection) -> Studio:
    studio: Studio = connection.app.state.studio
    return studio


Here = Annotated[Studio, Depends(_studio)]
"""The studio of the application that serves the request."""

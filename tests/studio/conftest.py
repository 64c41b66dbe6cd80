"""A folder with a short simulated drive, its vehicle and its estimates, made once."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path += [str(Path(__file__).parents[2] / "benchmarks"), str(Path(__file__).parent)]  # studio_session.py, live_service.py
pytest.importorskip("fastapi", reason="the studio needs terragrip[studio]")

from fastapi.testclient import TestClient


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """recording.parquet (a simulated run of the campaign), vehicle.yaml, estimates.parquet, soils.json; not to be changed."""
    import terragrip as tg
    from terragrip.simulation import Scenario
    from terragrip.soil.estimates import soils_of

    folder = tmp_path_factory.mktemp("studio")
    tg.simulate(Scenario.load("grass-05"), 7).save(folder)
    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    tg.estimate(recording, vehicle).write(folder / "estimates.parquet")
    soils_of([folder / "estimates.parquet"]).library().write(folder / "soils.json")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of `made` that a test may change."""
    target = tmp_path / "work"
    shutil.copytree(made, target)
    return target


@pytest.fixture
def client(folder: Path) -> Iterator[TestClient]:
    """A browser-like client of a studio on `folder`."""
    from terragrip.studio.app import create_app

    with TestClient(create_app(folder, upload_limit=2_000_000), base_url="http://127.0.0.1:8750") as client:
        yield client

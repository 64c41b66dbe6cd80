"""A folder with a short simulated drive, its vehicle and its estimates, made once."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

sys.path += [
    str(Path(__file__).parents[2] / "benchmarks"),
    str(Path(__file__).parent),
    str(Path(__file__).parents[1] / "maps"),
]  # studio_session.py, live_service.py, lane_drives.py
pytest.importorskip("fastapi", reason="the studio needs terragrip[studio]")

from fastapi.testclient import TestClient

if TYPE_CHECKING:
    from served import Served


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


@pytest.fixture(scope="session")
def field_maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """field.gpkg (two days over lanes 1 m apart: a wet hole, a firm patch, the western half weaker on the second day), once.gpkg (one
    straight pass, nothing repeated), monday.parquet, nowhere.parquet (without positions); not to be changed."""
    pytest.importorskip("geopandas", reason="maps need terragrip[geo]")
    import numpy as np

    from lane_drives import drive, lanes
    from terragrip.maps import MapSettings, map_of, write_map

    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        hole = (np.abs(east - 12) < 2) & (np.abs(north - 10) < 2)
        firm = (np.abs(east - 40) < 2) & (np.abs(north - 20) < 2)
        return np.where(hole, 0.5, 1.0) * np.where(firm, 1.5, 1.0)

    folder = tmp_path_factory.mktemp("maps")
    way = lanes(30, 52, 1)
    monday = drive(*way, a=ground, noise=0.01)
    monday.labels["soil"][:] = np.where(way[0] < 26, "sand", "clay")
    friday = drive(
        *way, a=lambda e, n: ground(e, n) * np.where(e < 20, 0.85, 1.0), noise=0.01, std=0.02, seed=2
    )
    write_map(map_of([("monday", monday), ("friday", friday)], MapSettings(cell=1.0)), folder / "field.gpkg")
    east = np.arange(0.0, 60.0, 0.05)
    write_map(map_of([("once", drive(east, 0 * east))]), folder / "once.gpkg")
    monday.write(folder / "monday.parquet")
    del monday.columns["latitude"], monday.columns["longitude"]
    monday.write(folder / "nowhere.parquet")
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


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    from studio_session import browser as started

    with started() as running:
        yield running


PATIENCE = 180_000
"""How long [ms] a page may need on a busy machine before a test gives up; no test passes or fails by what it waits less."""
SCREEN = {"width": 1280, "height": 720}


@pytest.fixture(scope="session")
def port() -> Iterator[int]:
    """The port of every studio of this session, kept from others while none listens on it."""
    from served import bound

    with bound(0) as kept:
        yield kept.getsockname()[1]


@pytest.fixture
def served(folder: Path, port: int) -> Iterator[Served]:
    from served import Served

    studio = Served(folder, port)
    yield studio
    studio.stop()


@pytest.fixture(scope="session")
def tab(browser: Any) -> Any:
    """The tab of every `page`: pages of one address in one tab share a process and its compiled scripts, half of what loading one takes."""
    context = browser.new_context(viewport=SCREEN, bypass_csp=False)
    context.set_default_timeout(PATIENCE)
    return context.new_page()


@pytest.fixture
def page(tab: Any, served: Served) -> Iterator[Any]:
    """A tab of 1280 x 720 whose console stays free of errors and whose requests stay on this machine."""
    faults: list[str] = []
    listeners = {
        "console": lambda m: faults.append(m.text) if m.type == "error" else None,
        "pageerror": lambda error: faults.append(str(error)),
        "request": lambda r: (
            faults.append(r.url) if served.url not in r.url and r.url[:5] not in ("data:", "blob:") else None
        ),
    }
    for event, listener in listeners.items():
        tab.on(event, listener)
    yield tab
    for event, listener in listeners.items():
        tab.remove_listener(event, listener)
    make_new(tab, served.url)
    assert [f for f in faults if "422" not in f and "WebSocket" not in f and "ERR_CONNECTION" not in f] == []


def make_new(tab: Any, url: str) -> None:
    """Leave nothing of a test in the tab: on an empty page of the same address, which no studio need answer."""
    for other in tab.context.pages:
        if other is not tab:
            other.close()
    tab.unroute_all(behavior="ignoreErrors")
    tab.route(f"{url}/empty", lambda route: route.fulfill(content_type="text/html", body=""))
    tab.goto(f"{url}/empty")
    tab.unroute(f"{url}/empty")
    tab.context.clear_cookies()
    tab.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
    tab.set_viewport_size(SCREEN)
    tab.emulate_media(color_scheme="light")
    tab.mouse.up()
    tab.mouse.move(-1, -1)

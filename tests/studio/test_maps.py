"""A map's file on its way to the page: what GeoPandas reads of it is what the page is sent; a file that is none is one line."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

geopandas = pytest.importorskip("geopandas", reason="maps need terragrip[geo]")


@pytest.fixture
def maps(folder: Path, field_maps: Path) -> Path:
    """The studio's folder with the maps in it."""
    for file in field_maps.iterdir():
        shutil.copy(file, folder)
    return folder


def unpacked(content: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Head and columns of a message, read as docs/studio.md says."""
    size = int.from_bytes(content[:4], "little")
    head = json.loads(content[4 : 4 + size])
    at, columns = 4 + size, {}
    for name, kind in zip(
        head["columns"], head.get("types", ["float64"] * len(head["columns"])), strict=True
    ):
        columns[name] = np.frombuffer(content, kind, head["count"], at)
        at += columns[name].nbytes
    assert at == len(content)
    return head, columns


def test_the_cells_are_those_that_geopandas_reads(client: TestClient, maps: Path) -> None:
    about = client.get("/api/map", params={"path": "field.gpkg"}).json()
    frame = geopandas.read_file(maps / "field.gpkg", layer="cells")
    assert (about["cell"], about["epsg"], about["cells"]) == (1.0, 32633, len(frame))
    assert about["runs"] == ["monday", "friday"]
    assert about["reference_slip"] == 0.1
    for quantity in ("adhesion", "soil_resistance", "slip", "efficiency"):
        head, sent = unpacked(
            client.get("/api/map/cells", params={"path": "field.gpkg", "quantity": quantity}).content
        )
        mine = frame[frame[quantity].notna()]
        place = mine.geometry.bounds
        np.testing.assert_array_equal(sent["column"], np.rint(place.minx))
        np.testing.assert_array_equal(sent["row"], np.rint(place.miny))
        np.testing.assert_allclose(sent["value"], mine[quantity], rtol=1e-6)
        np.testing.assert_allclose(sent["std"], mine[f"{quantity}_std"], rtol=1e-6)
        for name in ("count", "passes"):
            np.testing.assert_array_equal(sent[name], mine[name])
        np.testing.assert_allclose(sent["headland"], mine["headland"], rtol=1e-6)
        assert [head["soils"][k] for k in sent["soil"]] == mine["soil"].tolist()


def test_changes_lie_in_their_cells(client: TestClient, maps: Path) -> None:
    frame = geopandas.read_file(maps / "field.gpkg", layer="changes")
    frame = frame[frame.quantity == "adhesion"]
    _, sent = unpacked(
        client.get("/api/map/cells", params={"path": "field.gpkg", "quantity": "adhesion"}).content
    )
    there = np.isfinite(sent["difference"])
    assert there.sum() == len(frame)
    mine = dict(
        zip(zip(sent["column"][there], sent["row"][there], strict=True), np.flatnonzero(there), strict=True)
    )
    bounds = frame.geometry.bounds
    at = [mine[int(x), int(y)] for x, y in zip(np.rint(bounds.minx), np.rint(bounds.miny), strict=True)]
    np.testing.assert_allclose(sent["difference"][at], frame["difference"], rtol=1e-5, atol=1e-8)
    np.testing.assert_array_equal(sent["significant"][at], frame["significant"])
    assert not sent["significant"][~there].any()
    about = client.get("/api/map", params={"path": "field.gpkg"}).json()
    counted = {
        one["name"]: sum(pair["significant"] for pair in one["changes"]) for one in about["quantities"]
    }
    assert counted["adhesion"] == int(frame["significant"].sum()) > 100
    assert {(pair["first"], pair["last"]) for pair in about["quantities"][0]["changes"]} >= {
        ("monday", "friday")
    }


def test_places_are_those_of_the_grid(client: TestClient, maps: Path) -> None:
    """Corners of a tile and outlines of anomalies in degrees, against what GeoPandas makes of the file's own geometry."""
    about = client.get("/api/map", params={"path": "field.gpkg"}).json()
    whole = geopandas.read_file(maps / "field.gpkg", layer="cells")
    (tile,) = about["tiles"]
    west, south, east, north = whole.total_bounds
    assert (tile["wide"], tile["high"]) == (round(east - west), round(north - south))
    corners = geopandas.GeoSeries.from_xy([west, east, east, west], [north, north, south, south], crs=32633)
    np.testing.assert_allclose(
        tile["corners"], np.column_stack([corners.to_crs(4326).x, corners.to_crs(4326).y]), atol=1e-9
    )
    frame = geopandas.read_file(maps / "field.gpkg", layer="anomalies").to_crs(4326)
    assert len(about["anomalies"]) == len(frame) >= 2
    for one, row in zip(about["anomalies"], frame.itertuples(), strict=True):
        assert (one["kind"], one["area"]) == (row.kind, row.area)
        assert one["difference"] == pytest.approx(row.difference)
        ends = np.vstack(one["rings"])
        np.testing.assert_allclose([*ends.min(axis=0), *ends.max(axis=0)], row.geometry.bounds, atol=1e-9)


def test_field_and_headland_are_apart(client: TestClient, maps: Path) -> None:
    about = client.get("/api/map", params={"path": "field.gpkg"}).json()
    frame = geopandas.read_file(maps / "field.gpkg", layer="cells")
    for one in about["quantities"]:
        for area, where in (("field", frame.headland <= 0.5), ("headland", frame.headland > 0.5)):
            values = frame[one["name"]][where].dropna()
            assert one["areas"][area]["cells"] == len(values)
            assert one["areas"][area]["middle"] == pytest.approx(values.median())


def test_the_way_is_thinned_and_its_gaps_are_kept(client: TestClient, maps: Path) -> None:
    head, columns = unpacked(client.get("/api/map/way", params={"path": "field.gpkg"}).content)
    frame = geopandas.read_file(maps / "field.gpkg", layer="points").to_crs(4326)
    assert head["of"] == len(frame)
    known = np.isfinite(columns["longitude"])
    np.testing.assert_allclose(columns["longitude"][known], frame.geometry.x, atol=1e-9)
    assert (~known).sum() == 1  # between the two days


def test_a_single_pass_has_no_changes(client: TestClient, maps: Path) -> None:
    about = client.get("/api/map", params={"path": "once.gpkg"}).json()
    assert all(one["changes"] == [] for one in about["quantities"])
    assert any("driven once" in note for note in about["notes"])
    head, _ = unpacked(
        client.get("/api/map/cells", params={"path": "once.gpkg", "quantity": "adhesion"}).content
    )
    assert "difference" not in head["columns"]


def test_only_maps_of_terragrip_are_listed_and_others_are_one_line(client: TestClient, maps: Path) -> None:
    import shapely

    geopandas.GeoDataFrame({"a": [1]}, geometry=[shapely.Point(1, 1)], crs=4326).to_file(
        maps / "farm.gpkg", layer="cells", driver="GPKG", engine="pyogrio"
    )
    (maps / "broken.gpkg").write_bytes((maps / "field.gpkg").read_bytes()[:5000])
    (maps / "text.gpkg").write_text("no map")
    kinds = {one["path"]: one["kind"] for one in client.get("/api/folder").json()["items"]}
    assert kinds["field.gpkg"] == "map"
    assert not {"farm.gpkg", "broken.gpkg", "text.gpkg"} & set(kinds)
    for name in ("farm.gpkg", "broken.gpkg", "text.gpkg", "none.gpkg", "recording.parquet"):
        answer = client.get("/api/map", params={"path": name})
        assert answer.status_code == 422
        assert answer.json()["detail"].startswith(name)
        assert "\n" not in answer.json()["detail"]
    answer = client.get("/api/map/cells", params={"path": "field.gpkg", "quantity": "mud"})
    assert answer.status_code == 422
    assert "adhesion" in answer.json()["detail"]


def test_a_map_that_was_replaced_is_not_mixed_with_the_new_one(client: TestClient, maps: Path) -> None:
    version = client.get("/api/map", params={"path": "field.gpkg"}).json()["version"]
    shutil.copy(maps / "once.gpkg", maps / "field.gpkg")
    asked = {"path": "field.gpkg", "quantity": "adhesion", "version": version}
    answer = client.get("/api/map/cells", params=asked)
    assert answer.status_code == 422
    assert "was replaced" in answer.json()["detail"]


@pytest.mark.sample(2)
@pytest.mark.parametrize(("run", "state"), [("monday", "done"), ("nowhere", "failed")])
def test_a_map_is_made_as_a_job(client: TestClient, maps: Path, run: str, state: str) -> None:
    wanted = {
        "estimates": [f"{run}.parquet"],
        "output": "new.gpkg",
        "cell": 2,
        "slip": 0.15,
        "datum": " EPSG:4258 ",
    }
    job = client.post("/api/jobs/map", json=wanted).json()
    assert job["command"] == (
        f"terragrip map {run}.parquet --cell=2 --slip=0.15 --datum=EPSG:4258 --output new.gpkg"
    )
    while job["state"] in ("queued", "running"):
        time.sleep(0.1)
        job = client.get(f"/api/jobs/{job['id']}").json()
    assert job["state"] == state, job
    if state == "failed":
        assert job["text"].startswith("nowhere.parquet: has no positions")
        assert not (maps / "new.gpkg").exists()
    else:
        about = client.get("/api/map", params={"path": "new.gpkg"}).json()
        assert (about["cell"], about["reference_slip"], about["datum"]) == (2.0, 0.15, "EPSG:4258")

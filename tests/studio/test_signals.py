"""Signals of runs: over time since start and over distance, by a formula, one over another, as a table."""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from fastapi.testclient import TestClient

import terragrip as tg
from terragrip.estimation import Estimates
from test_drive import RUN, unpack, window


def test_a_formula_is_drawn_as_any_column(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / RUN)
    recording = tg.read(folder / "recording.parquet")
    wanted = {
        "=slip_rl - slip_rr": table["slip_rl"] - table["slip_rr"],
        "=drive_torque_rr / 1000": recording["drive_torque_rr"] / 1000,
        "=ground_speed - measured_ground_speed": table["ground_speed"] - recording["ground_speed"],
    }
    shown = window(client, column=list(wanted), start=10.0, end=11.0)
    rows = np.searchsorted(table.time, shown["time"])
    for name, values in wanted.items():
        np.testing.assert_array_equal(shown[name], values[rows])
    whole = window(client, column=["=slip_rl - slip_rr"], start=table.time[0], end=table.time[-1], width=20)
    assert whole["cut"]
    assert np.nanmax(whole["=slip_rl - slip_rr"]) == np.nanmax(wanted["=slip_rl - slip_rr"])


def test_a_fault_in_a_formula_is_one_line(client: TestClient, folder: Path) -> None:
    texts = ["slip_rl - slip_rr", "slip_r1 * 2", "slip_rl +", "drive_torque_rr"]
    query = {"path": RUN, "text": texts}
    said = client.get("/api/drive/formulas", params=query).json()
    assert said[0] is said[3] is None
    assert said[1] == "formula: slip_r1 is not a column of this run; did you mean slip_rr?"
    assert "cannot be read" in said[2]
    (folder / "recording.parquet").unlink()
    said = client.get("/api/drive/formulas", params=query).json()
    assert "drive_torque_rr is not a column of this run" in said[3]
    refused = client.get(
        "/api/drive/window", params={"path": RUN, "column": "=slip_r1", "start": 0, "end": 9}
    )
    assert (refused.status_code, "slip_r1" in refused.json()["detail"]) == (422, True)


def test_distance_is_the_integral_of_speed(client: TestClient, folder: Path) -> None:
    """A made-up run: 10 s at 2 m/s, 10 s of standstill, 10 s backwards at 1 m/s, its speed unknown for a second."""
    whole = Estimates.read(folder / RUN)
    time = 100.0 + np.arange(0, 30, 0.01)
    speed = np.select([time < 110, time < 120], [2.0, 0.0], -1.0)
    speed[500:600] = np.nan
    n = len(time)
    columns = {name: np.resize(values, n) for name, values in whole.columns.items()} | {"ground_speed": speed}
    Estimates(time, columns, np.zeros(n, np.uint8), {}, {**whole.about}).write(folder / "far.parquet")
    about = client.get("/api/drive", params={"path": "far.parquet"}).json()
    assert about["distance"] == pytest.approx(30.0, abs=0.05)
    shown = window(
        client, path="far.parquet", axis="distance", column=["axis:time"], start=8, end=12, width=5000
    )
    at = np.interp(10.0, shown["distance"], shown["axis:time"])
    assert at == pytest.approx(105.0, abs=0.01)
    assert np.all(np.diff(shown["distance"]) > 0)
    elapsed = window(client, path="far.parquet", axis="elapsed", column=["axis:time"], start=1, end=2)
    np.testing.assert_allclose(elapsed["axis:time"] - elapsed["elapsed"], 100.0)
    way = unpack(client.get("/api/drive/way", params={"path": "far.parquet", "axis": "distance"}).content)
    assert (way["time"][0], way["time"][-1]) == (time[0], time[-1])
    assert np.interp(104.0, way["time"], way["distance"]) == pytest.approx(8.0, abs=0.02)


def pairs(client: TestClient, **query: Any) -> tuple[dict[str, Any], int]:
    import json

    answer = client.get("/api/drive/pairs", params={"path": RUN, "start": 0, "end": 1e9, **query})
    assert answer.status_code == 200, answer.text
    size = int.from_bytes(answer.content[:4], "little")
    return unpack(answer.content), json.loads(answer.content[4 : 4 + size])["of"]


def test_one_quantity_over_another_is_thinned_and_says_so(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / RUN)
    both = np.isfinite(table["slip_rr"]) & np.isfinite(table["adhesion_rr"])
    found, count = pairs(client, x="slip_rr", y="adhesion_rr")
    assert count == both.sum() > 3000
    assert (found["cut"], 1000 < len(found["x"]) <= 3000) == (True, True)
    rows = np.searchsorted(table.time, found["time"])
    np.testing.assert_array_equal(found["x"], table["slip_rr"][rows])
    np.testing.assert_array_equal(found["y"], table["adhesion_rr"][rows])
    few, count = pairs(client, x="=slip_rl - slip_rr", y="measured:drawbar_force", start=10, end=11)
    assert (few["cut"], len(few["x"])) == (False, count)
    assert (few["time"][0], few["time"][-1]) == pytest.approx((10, 11), abs=0.01)


def test_sparse_samples_are_not_thinned_away(client: TestClient, folder: Path) -> None:
    """Two quantities known together in every 50th row: all of them are points."""
    table = Estimates.read(folder / RUN)
    sparse = np.where(np.arange(len(table)) % 50 == 7, table["slip_rr"], np.nan)
    table.columns["slip_rr"] = sparse
    table.write(folder / "sparse.parquet")
    found, count = pairs(client, path="sparse.parquet", x="slip_rr", y="adhesion_rr")
    assert len(found["x"]) == count == np.isfinite(sparse * table["adhesion_rr"]).sum() > 50


def csv_of(client: TestClient, **more: Any) -> pl.DataFrame:
    body = {
        "runs": [{"path": RUN, "label": "grass"}],
        "columns": [
            {"name": "slip_rr", "heading": "slip_rr [%]", "scale": 100},
            {"name": "slip_rr:low", "heading": "slip_rr 95 % low [%]", "scale": 100},
            {"name": "=slip_rl - slip_rr", "heading": "difference [-]"},
        ],
        "start": 10.0,
        "end": 12.0,
        **more,
    }
    answer = client.post("/api/drive/table", json=body)
    assert answer.status_code == 200, answer.text
    return pl.read_csv(io.BytesIO(answer.content), infer_schema_length=None)


def test_the_table_holds_every_row_with_units(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / RUN)
    found = csv_of(client)
    assert found.columns == [
        "time [s]",
        "slip_rr [%]",
        "slip_rr 95 % low [%]",
        "difference [-]",
        "event",
        "soil",
    ]
    rows = (table.time >= 10) & (table.time <= 12)
    np.testing.assert_array_equal(found["time [s]"], table.time[rows])
    np.testing.assert_allclose(found["slip_rr [%]"], 100 * table["slip_rr"][rows], rtol=1e-11)
    assert set(found["soil"]) == {"grass"}


def test_a_table_of_several_runs_leaves_blank_what_one_has_not(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / RUN)
    del table.columns["slip_rl"]
    table.write(folder / "other.parquet")
    runs = [{"path": RUN, "label": "grass"}, {"path": "other.parquet", "label": "other"}]
    found = csv_of(client, runs=runs, axis="elapsed", heading="time since start [s]")
    assert found.columns[:2] == ["run", "time since start [s]"]
    by = {label[0]: part for label, part in found.group_by("run", maintain_order=True)}
    assert by["grass"]["difference [-]"].null_count() == 0
    assert by["other"]["difference [-]"].null_count() == len(by["other"]) == len(by["grass"])
    shutil.copy(folder / "other.parquet", folder / "third.parquet")
    both = [{"path": p, "label": p} for p in ("other.parquet", "third.parquet")]
    body = {"runs": both, "columns": [{"name": "slip_rl", "heading": "a"}], "start": 0, "end": 1}
    answer = client.post("/api/drive/table", json=body)
    assert (answer.status_code, "slip_rl" in answer.json()["detail"]) == (422, True)


def test_a_shifted_run_of_a_recording_leaves_the_others_their_channels(
    client: TestClient, folder: Path
) -> None:
    """Two runs name one recording by its SHA-256; the second has other times, so the recording is not its own."""
    table = Estimates.read(folder / RUN)
    shifted = Estimates(table.time + 60, table.columns, table.event_codes, table.labels, table.about)
    shifted.write(folder / "shifted.parquet")
    assert "drawbar_force" in client.get("/api/drive", params={"path": RUN}).json()["measured"]
    assert client.get("/api/drive", params={"path": "shifted.parquet"}).json()["measured"] == []
    assert len(window(client, column=["measured:drawbar_force"], start=10, end=11)["time"]) > 100


def test_a_table_beyond_measure_is_refused_in_a_line(client: TestClient, monkeypatch: Any) -> None:
    monkeypatch.setattr("terragrip.studio.api.signals.CELLS", 100)
    body = {
        "runs": [{"path": RUN, "label": ""}],
        "columns": [{"name": "slip_rr", "heading": "a"}],
        "start": 0,
        "end": 9,
    }
    answer = client.post("/api/drive/table", json=body)
    assert answer.status_code == 422
    assert "zoom in" in answer.json()["detail"]


def test_a_run_that_a_file_cannot_hold_is_refused_in_one_line(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    table.columns.pop("latitude", None)
    table.write(folder / "nowhere.parquet")
    wanted = {"path": "nowhere.parquet", "suffix": ".geojson"}
    answer = client.get("/api/drive/converted", params=wanted)
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("nowhere.geojson: the log has no latitude")
    answer = client.get("/api/drive/converted", params=wanted | {"suffix": "/../x.csv"})
    assert answer.status_code == 422

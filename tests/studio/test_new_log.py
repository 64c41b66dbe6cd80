"""Columns, profiles and vehicle files by the interface, and the commands over chosen files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fastapi.testclient import TestClient

from terragrip.cli import main
from test_jobs import wait


def queued(client: TestClient, kind: str, **wanted: Any) -> dict[str, Any]:
    answer = client.post(f"/api/jobs/{kind}", json=wanted)
    assert answer.status_code == 202, answer.text
    return wait(client, answer.json()["id"])


def test_a_columns_outline_holds_its_extremes(client: TestClient, folder: Path) -> None:
    table = pd.read_parquet(folder / "recording.parquet")
    columns = {
        one["name"]: one for one in client.get("/api/columns?path=recording.parquet").json()["columns"]
    }
    for name in ("ground_speed", "drawbar_force"):
        known = np.array([one for one in columns[name]["outline"] if one is not None])
        assert known[:, 0].min() == pytest.approx(table[name].min(), rel=1e-4)
        assert known[:, 1].max() == pytest.approx(table[name].max(), rel=1e-4)
        assert (known[:, 0] <= known[:, 1]).all()


def test_an_outline_follows_time_and_leaves_out_what_is_missing() -> None:
    from terragrip.formats.outline import outline

    time = np.array([0.0, 1.0, 2.0, 8.0, 9.99, 10.0])
    values = np.array([1.0, 3.0, np.nan, 7.0, -2.0, 5.0])
    assert outline(values, time, 5) == [(1.0, 3.0), None, None, None, (-2.0, 7.0)]
    assert outline(np.full(3, np.nan), None, 2) == [None, None]


def test_proposals_come_ranked_with_reason_and_unit(client: TestClient, folder: Path) -> None:
    time = np.arange(0.0, 60.0, 0.1)
    speed = 1 + 0.3 * np.sin(time / 5)
    table = pd.DataFrame(
        {
            "time [s]": time,
            "speed over ground [km/h]": 3.6 * speed,
            "gps speed [m/s]": speed,
            "wheel speed left [rad/s]": speed / 0.4,
            "wheel speed right [rad/s]": speed / 0.4,
        }
    )
    table.to_csv(folder / "odd.csv", index=False)
    found = client.get("/api/columns", params={"path": "odd.csv"}).json()
    ground = next(one for one in found["channels"] if one["name"] == "ground_speed")["proposals"]
    assert {one["columns"][0] for one in ground} == {"speed over ground", "gps speed"}
    assert [one["confidence"] for one in ground] == sorted(
        (one["confidence"] for one in ground), reverse=True
    )
    assert all(one["evidence"] for one in ground)
    assert {one["columns"][0]: one["unit"] for one in ground} == {
        "speed over ground": "km/h",
        "gps speed": "m/s",
    }


def test_what_inspect_remarks_on_the_log_comes_with_its_columns(client: TestClient, folder: Path) -> None:
    """A time without a unit that is hardly in seconds: the form has the likely unit, and says that it is a guess."""
    speed = np.linspace(0.5, 1.5, 100)
    table = pd.DataFrame({"timestamp": 50 * np.arange(100), "gps_speed": speed, "wheel_speed_l": speed / 0.4})
    table.to_csv(folder / "millis.csv", index=False)
    found = client.get("/api/columns", params={"path": "millis.csv"}).json()
    assert found["time"]["unit"] == "ms"
    assert any("no unit is stated" in text for text in found["remarks"])
    assert not any("Without a profile" in text for text in found["remarks"])


@pytest.mark.parametrize(
    ("channels", "why"),
    [
        ({"ground_speed": {"from": "no such"}}, "no such"),
        ({"ground_speed": {"from": "ground_speed", "unit": "kg"}}, "kg"),
        ({"speed": {"from": "ground_speed"}}, "no such channel"),
        ({"wheel_speed_a: {}\nb": {"from": "ground_speed"}}, ""),
    ],
)
def test_an_unusable_choice_is_refused_and_leaves_no_file(
    client: TestClient, folder: Path, channels: dict[str, Any], why: str
) -> None:
    before = sorted(folder.iterdir())
    wanted = {"log": "recording.parquet", "output": "p.yaml", "time": {"from": "time"}, "channels": channels}
    answer = client.post("/api/profile", json=wanted)
    assert answer.status_code == 422
    assert why in answer.json()["detail"]
    assert sorted(folder.iterdir()) == before


def test_the_vehicle_of_the_page_is_that_of_the_command_line(client: TestClient, folder: Path) -> None:
    known = {"mass": "6.2 t", "wheel_radius": "0.83 m", "front_mass": ""}
    wanted = {"machine": "tractor-4wd", "signals": "torque", "known": known, "output": "mine.yaml"}
    answer = client.post("/api/machines/file", json=wanted)
    assert answer.status_code == 201
    words = shlex.split(answer.json()["command"])
    assert main([*words[1:-1], str(folder / "other.yaml"), "--quiet"]) == 0
    assert (folder / "mine.yaml").read_text() == (folder / "other.yaml").read_text()
    assert client.post("/api/machines/file", json=wanted).status_code == 422  # it is there already


def test_what_a_missing_number_costs_is_the_makers_own_table(client: TestClient) -> None:
    from terragrip.vehicle_maker import interval_costs, make

    known = {"mass": "139 kg"}
    costs = client.post("/api/machines/costs", json={"machine": "field-robot", "known": known}).json()
    expected = interval_costs(make("field-robot", "torque", known))
    assert [(one["what"], one["half_width"]) for one in costs] == [
        (one.what, one.half_width) for one in expected
    ]
    fields = client.post("/api/machines/made", json={"machine": "field-robot", "known": known}).json()[
        "fields"
    ]
    assert {one["name"] for one in fields if one["needed"]} == {"mass", "wheel_radius"}
    assert {one["name"] for one in fields if not one["source"]} == {"payload_x", "payload_z"}


def test_ground_and_report_follow_from_estimates(client: TestClient, folder: Path) -> None:
    runs = ["estimates.parquet"]
    ground = queued(client, "ground", estimates=runs, library="soils.json", output="ground.json")
    assert (ground["state"], ground["text"][:10]) == ("done", "estimates:")
    assert ground["command"] == "terragrip ground estimates.parquet --library soils.json --output ground.json"
    wanted = {"estimates": runs, "ground": "ground.json", "title": "A day", "output": "day.html"}
    report = client.post("/api/jobs/report", json=wanted).json()
    assert report["command"] == (
        "terragrip report estimates.parquet --ground ground.json '--title=A day' --output day.html"
    )
    client.delete(f"/api/jobs/{report['id']}")  # one is run to its end by test_browser_new_user.py
    (folder / "day.html").write_text("<h1>A day</h1>", encoding="utf-8")
    shown = client.get("/api/report?path=day.html")
    assert "A day" in shown.text
    assert shown.headers["content-security-policy"].startswith("sandbox; default-src 'none'")
    assert client.get("/api/report?path=vehicle.yaml").status_code == 422


def test_a_batch_estimates_what_it_can_and_names_the_rest(client: TestClient, folder: Path) -> None:
    (folder / "broken.csv").write_text("time,wheel_speed_zz,ground_speed\n0,1,1\n1,1,1\n2,1,1\n")
    logs = ["broken.csv", "recording.parquet"]
    job = queued(client, "batch", recordings=logs, vehicle="vehicle.yaml", output="all")
    assert job["state"] == "failed"
    assert "broken.csv" in job["text"]
    assert [path.name for path in (folder / "all").iterdir()] == ["recording.parquet"]
    again = client.post(
        "/api/jobs/batch", json={"recordings": logs, "vehicle": "vehicle.yaml", "output": "all"}
    )
    assert "exists already" in again.json()["detail"]


def test_a_calibration_that_finds_nothing_says_why(client: TestClient, folder: Path) -> None:
    job = queued(
        client, "calibrate", recordings=["recording.parquet"], vehicle="vehicle.yaml", output="better.yaml"
    )
    words = ["calibrate", str(folder / "recording.parquet"), "--vehicle", str(folder / "vehicle.yaml")]
    code = main([*words, "--output", str(folder / "other.yaml"), "--quiet"])
    assert job["state"] == ("failed" if code else "done")
    assert (folder / "better.yaml").exists() == (code == 0)


def test_a_file_named_like_an_option_is_a_file(client: TestClient, folder: Path) -> None:
    (folder / "--help.parquet").write_bytes((folder / "estimates.parquet").read_bytes())
    job = queued(client, "ground", estimates=["--help.parquet"], output="-g.json")
    assert job["state"] == "done", job["text"]
    assert (folder / "-g.json").exists()


def test_a_profiles_choice_is_shown_by_its_names_and_nothing_of_a_larger_one(
    client: TestClient, folder: Path
) -> None:
    time = np.arange(0.0, 60.0, 0.1)
    speed = 1 + 0.3 * np.sin(time / 5)
    table = pd.DataFrame({"time [s]": time, "gps speed [m/s]": speed})
    for side in ("left", "right"):
        table[f"wheel speed {side} [rad/s]"] = speed / 0.4
    table.to_csv(folder / "odd.csv", index=False)
    query = {"path": "odd.csv", "profile": "mine.yaml"}
    text = "channels:\n  wheel_speed_rl: {from: wheel speed left, sign: -1}\n  mass: {constant: 900}\n"
    (folder / "mine.yaml").write_text(text)
    found = client.get("/api/columns", params=query).json()
    assert found["kept"]["channels"]["wheel_speed_rl"] == {"from": "wheel speed left", "sign": -1}
    wheels = {one["wheel"] for one in found["channels"] if one["name"].startswith("wheel_speed_")}
    assert wheels == {"rl", "r"}  # what was proposed as l is the profile's rl
    for more in ("rows: {column: x, equals: y}", "channels: nothing"):  # saved again, it would lose the rows
        (folder / "mine.yaml").write_text(f"{text}{more}\n")
        assert client.get("/api/columns", params=query).json()["kept"] is None
    (folder / "mine.yaml").write_text("channels:\n  ground_speed: {from: v\n  mass: x\n")
    found = client.get("/api/columns", params=query).json()
    assert found["kept"] is None
    assert found["unread"].startswith(
        "mine.yaml: line 3: not YAML: "
    )  # "has more than a choice of columns", it was said

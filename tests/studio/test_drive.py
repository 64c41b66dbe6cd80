"""The drive page's server: columns cut without losing a spike, samples explained, the track."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from terragrip.estimation import Estimates
from terragrip.estimation.consistency import NORMAL_95
from terragrip.studio import drive
from terragrip.studio.shown import Shown, consistency
from terragrip.studio.tables import Extremes, are_long, buckets, extremes

RUN = "estimates.parquet"


def unpack(content: bytes) -> dict[str, Any]:
    size = int.from_bytes(content[:4], "little")
    head = json.loads(content[4 : 4 + size])
    values = np.frombuffer(content[4 + size :]).reshape(len(head["columns"]), head["count"])
    return {**dict(zip(head["columns"], values, strict=True)), "cut": head["cut"]}


def window(client: TestClient, **query: Any) -> dict[str, Any]:
    answer = client.get("/api/drive/window", params={"path": RUN, "width": 1000, **query})
    assert answer.status_code == 200, answer.text
    return unpack(answer.content)


@given(
    values=st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=1, max_size=300),
    width=st.integers(1, 40),
    part=st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
def test_buckets_keep_the_extremes_of_what_is_shown(
    values: list[float], width: int, part: tuple[float, float]
) -> None:
    column, time = np.array(values), np.arange(len(values)) * 0.1
    start, end = (x * time[-1] for x in sorted(part))
    starts = buckets(time, start, end, width)
    assert np.all(np.diff(starts) > 0)
    inside = (time >= start) & (time <= end)
    assert starts[0] <= np.flatnonzero(inside)[0] if inside.any() else True
    assert starts[-1] > np.flatnonzero(inside)[-1] if inside.any() else True
    assert len(starts) - 1 <= 2 * width + 1
    low, high = extremes(column, starts)
    shown = column[starts[0] : starts[-1]]
    np.testing.assert_array_equal(np.fmin.reduce(low), np.fmin.reduce(shown))
    np.testing.assert_array_equal(np.fmax.reduce(high), np.fmax.reduce(shown))


@given(
    seed=st.integers(0, 2**32 - 1),
    width=st.integers(1, 12),
    part=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    unknown=st.floats(0, 1),
)
def test_long_buckets_from_blocks_are_those_from_rows(
    seed: int, width: int, part: tuple[float, float], unknown: float
) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.exponential(size=4000) ** 6)  # with long gaps
    column = np.where(rng.random(4000) < unknown, np.nan, rng.standard_normal(4000))
    start, end = (x * time[-1] for x in sorted(part))
    starts = buckets(time, start, end, width)
    if not are_long(int(starts[-1] - starts[0]), width):
        return
    rows = column[starts[0] : starts[-1]]
    expected = extremes(rows, starts - starts[0])
    result = Extremes(column).of(column.__getitem__, starts)
    np.testing.assert_array_equal(result, expected)


def test_a_long_run_shows_every_extreme_whatever_the_window(made: Path) -> None:
    """The run driven over and over, 300 000 rows: what a window shows against its rows looked at one by one."""
    short = Estimates.read(made / RUN)
    laps = -(-300_000 // len(short))
    time = np.concatenate([short.time + k * (short.time[-1] + 0.01) for k in range(laps)])
    columns = {name: np.tile(short[name], laps) for name in ("slip_rr", "slip_rr_std", "ground_speed")}
    table = Estimates(time, columns, np.tile(short.event_codes, laps), {}, short.about)
    shown = Shown(table)
    for start, end in ((0.0, time[-1]), (301.7, 2405.0), (1000.0, 1010.0)):
        cut, at, (slip, high) = shown.window(None, ["slip_rr", "slip_rr:high"], start, end, 200)
        assert cut
        assert len(at) <= 400
        assert np.all(np.diff(at) >= 0)
        inside = (time >= start) & (time <= end)
        edges = np.flatnonzero(inside)[[0, -1]] + (-1, 1)
        wide = slice(max(edges[0], 0), edges[1] + 1)
        assert np.nanmin(slip) == np.nanmin(columns["slip_rr"][wide])
        assert np.nanmax(slip) == np.nanmax(columns["slip_rr"][wide])
        limit = columns["slip_rr"] + NORMAL_95 * columns["slip_rr_std"]
        assert np.nanmax(high) == np.nanmax(limit[wide])


@pytest.mark.parametrize("width", [20, 500])
def test_nothing_is_shown_in_a_hole_of_the_log(made: Path, width: int) -> None:
    """A quarter of an hour without rows was a bar of the last value, as if it had been measured."""
    short = Estimates.read(made / RUN)
    time = np.r_[np.arange(0.0, 100.0), np.arange(1000.0, 1100.0)]
    table = Estimates(time, {"ground_speed": np.ones(200)}, short.event_codes[:200], {}, short.about)
    for axis, name in (("time", "axis:time"), ("distance", "axis:distance")):
        place = Shown(table).along(axis)
        cut, at, (speed, along) = Shown(table).window(
            None, ["ground_speed", name], 0.0, place[-1], width, axis
        )
        assert cut == (width == 20)
        np.testing.assert_allclose(along[::2] if cut else along, at[::2] if cut else at)
        (hole,) = np.flatnonzero(np.isnan(speed[:: 1 + cut])) * (1 + cut)
        assert at[hole] == place[99]
        assert at[hole + 1 + cut] == place[100]
        assert np.all(np.diff(at) >= 0)


def test_nis_is_judged_by_chi_squared_of_the_channels_taken() -> None:
    """Rows of an honest filter with four or five channels, or none: the mean is about 1, 95 % of it in the band."""
    rng = np.random.default_rng(5)
    time = np.arange(0, 2000, 0.1)
    channels = rng.choice([0, 4, 5], size=len(time))
    honest = np.where(
        channels > 0, rng.chisquare(np.maximum(channels, 1)), 7.0
    )  # without a channel it says nothing
    judged = consistency(time, honest, channels.astype(float))
    within = (judged["low"] <= judged["mean"]) & (judged["mean"] <= judged["high"])
    assert 0.94 < within.mean() < 0.96
    assert np.nanmean(judged["mean"]) == pytest.approx(1, abs=0.02)
    too_sure = consistency(time, 2 * honest, channels.astype(float))
    assert np.mean(too_sure["mean"] > too_sure["high"]) > 0.8
    row = 5000
    near = np.abs(time - time[row]) <= 0.5 + 1e-9
    degrees = channels[near].sum()
    assert judged["mean"][row] == pytest.approx(honest[near & (channels > 0)].sum() / degrees)
    assert judged["high"][row] == pytest.approx(chi2.ppf(0.975, degrees) / degrees)
    silent = consistency(time, honest, np.zeros(len(time)))
    assert np.isnan([silent["mean"], silent["low"], silent["high"]]).all()


def test_the_filters_honesty_is_shown_of_an_adaptive_method(client: TestClient, folder: Path) -> None:
    import terragrip as tg

    recording, vehicle = tg.read(folder / "recording.parquet"), tg.Vehicle.load(folder / "vehicle.yaml")
    table = tg.estimate(recording.select(slice(0, 500)), vehicle, "aukf-fs")
    table.write(folder / "adaptive.parquet")
    about = client.get("/api/drive", params={"path": "adaptive.parquet"}).json()
    wanted = ["adaptation_adhesion_rr", "adaptation_soil_resistance", "supervisor", "nis:mean", "nis:low"]
    assert {name.partition(":")[0] for name in wanted} <= set(about["columns"])
    shown = window(client, path="adaptive.parquet", column=wanted, start=table.time[0], end=table.time[-1])
    np.testing.assert_array_equal(shown["adaptation_adhesion_rr"], table["adaptation_adhesion_rr"])
    assert "adaptation_adhesion_rr" not in client.get("/api/drive", params={"path": RUN}).json()["columns"]


def test_a_whole_run_is_cut_and_a_short_window_is_not(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / RUN)
    ends = {"start": table.time[0], "end": table.time[-1]}
    whole = window(client, column=["slip_rr", "slip_rr:low", "slip_rr:high"], width=100, **ends)
    assert whole["cut"]
    assert len(whole["time"]) <= 200
    slip = table["slip_rr"]
    assert np.nanmin(whole["slip_rr"]) == np.nanmin(slip)
    assert np.nanmax(whole["slip_rr"]) == np.nanmax(slip)
    spread = NORMAL_95 * table["slip_rr_std"]
    assert np.nanmin(whole["slip_rr:low"]) == np.nanmin(slip - spread)
    assert np.nanmax(whole["slip_rr:high"]) == np.nanmax(slip + spread)
    few = window(client, column=["slip_rr"], width=1000, start=table.time[500], end=table.time[520])
    assert not few["cut"]
    np.testing.assert_array_equal(few["slip_rr"], slip[499:522])
    np.testing.assert_array_equal(few["time"], table.time[499:522])


def test_measured_channels_come_from_the_unchanged_recording(client: TestClient, folder: Path) -> None:
    about = client.get("/api/drive", params={"path": RUN}).json()
    assert about["recording"] == "recording.parquet"
    assert "drive_torque_rr" in about["measured"]
    shown = window(client, column=["measured:drive_torque_rr"], start=5.0, end=5.2)
    import terragrip as tg

    recording = tg.read(folder / "recording.parquet")
    rows = np.searchsorted(recording.time, shown["time"])
    np.testing.assert_array_equal(shown["measured:drive_torque_rr"], recording["drive_torque_rr"][rows])


def test_another_recording_of_that_name_is_not_taken_for_it(client: TestClient, folder: Path) -> None:
    shutil.copy(folder / "truth.parquet", folder / "recording.parquet")
    about = client.get("/api/drive", params={"path": RUN}).json()
    assert (about["recording"], about["measured"]) == (None, [])
    answer = client.get(
        "/api/drive/window", params={"path": RUN, "column": "measured:ground_speed", "start": 0, "end": 1}
    )
    assert answer.status_code == 422


@pytest.mark.parametrize(
    "query",
    [
        {"column": "nothing"},
        {"column": "supervisor:low"},
        {"column": "slip_rr:mean"},
        {"column": "slip_rr:middle"},
        {"column": "slip_rr", "end": -1},
        {"column": "slip_rr", "start": "nan"},
        {"column": "slip_rr", "path": "vehicle.yaml"},
        {"column": "slip_rr", "width": 0},
    ],
)
def test_unusable_windows_get_one_line(client: TestClient, query: dict[str, Any]) -> None:
    answer = client.get("/api/drive/window", params={"path": RUN, "start": 0, "end": 9, **query})
    assert answer.status_code == 422
    assert "\n" not in answer.json()["detail"]


def test_a_torque_step_is_named_as_what_moved_adhesion(client: TestClient, folder: Path) -> None:
    """A made-up table: torque of one wheel steps by 10 N m, its adhesion by what the torque balance says, nothing else moves."""
    import terragrip as tg

    vehicle = tg.Vehicle.load(folder / "vehicle.yaml")
    time = np.arange(0, 20, 0.01)
    step = np.where(time >= 10, 10.0, 0.0)
    recording = {"time": time, "ground_speed": np.full_like(time, 0.5)}
    load = {"front": 250.0, "rear": 417.0}
    columns = {"ground_speed": np.full_like(time, 0.5), "soil_resistance": np.full_like(time, 0.1)}
    for number, wheel in enumerate(vehicle.wheels):
        radius, axle = vehicle.wheel_radius[number], vehicle.axle_names[vehicle.wheel_axle[number]]
        torque = 20.0 + (step if wheel == "rr" else 0.0 * step)
        recording |= {f"wheel_speed_{wheel}": np.full_like(time, 3.0), f"drive_torque_{wheel}": torque}
        columns |= {
            f"wheel_speed_{wheel}": np.full_like(time, 3.0),
            f"slip_{wheel}": np.full_like(time, 0.1),
            f"adhesion_{wheel}": torque / (radius * load[axle]),
        }
        load_column = np.full_like(time, 2 * load[axle])
        columns[f"vertical_load_{axle}"] = load_column
    path = folder / "step.csv"
    tg.Recording.from_frame(recording).to_pandas().to_csv(path, index=False)
    back = tg.read(path)
    about = {
        "method": "bank",
        "vehicle": vehicle.to_dict(),
        "recording": {"source": "step.csv", "sha256": back.sha256},
    }
    Estimates(time, columns, np.zeros(len(time), np.uint8), {}, about).write(folder / "step.parquet")
    result = client.get("/api/drive/sample", params={"path": "step.parquet", "time": 10.0}).json()
    first = result["why"][0]
    moved = 10.0 / (vehicle.wheel_radius[vehicle.wheels.index("rr")] * load["rear"])
    assert first.startswith("rr: adhesion")
    assert f"{moved:+.3f} within 1 s; torque +10.0 N m ({moved:+.3f})" in first
    assert result["measured"]["drive_torque_rr"] == 30.0
    assert all(f"adhesion {0:+.3f}" in text for text in result["why"][1:])


def test_the_track_holds_every_position(client: TestClient, folder: Path) -> None:
    answer = client.get("/api/drive/track", params={"path": RUN, "column": "slip_rr"})
    track = unpack(answer.content)
    table = Estimates.read(folder / RUN)
    known = np.isfinite(table["latitude"])
    np.testing.assert_array_equal(track["latitude"], table["latitude"][known])
    np.testing.assert_array_equal(track["slip_rr"], table["slip_rr"][known])


def test_ground_of_the_run_is_shown_where_it_lies_beside_it(client: TestClient, folder: Path) -> None:
    assert client.get("/api/drive", params={"path": RUN}).json()["ground"] is None
    ground = {
        "changes": [],
        "sections": [{"start": 0, "end": 9, "soil": "grass", "probabilities": {"grass": 1.0}}],
        "events": [],
    }
    (folder / "estimates-ground.json").write_text(json.dumps(ground))
    assert client.get("/api/drive", params={"path": RUN}).json()["ground"]["sections"] == ground["sections"]


def test_the_ground_that_a_logs_page_finds_is_that_of_its_run(client: TestClient, folder: Path) -> None:
    """It is named after the log, not after the estimates: no page showed it."""
    for name, soil in (("day1-ground", "wet"), ("day1-ground-2", "grass")):
        one = {"run": "estimates", "start": 0, "end": 9, "soil": soil, "probabilities": {soil: 1.0}}
        (folder / f"{name}.json").write_text(json.dumps({"changes": [], "sections": [one]}))
        os.utime(folder / f"{name}.json", (soil == "grass", soil == "grass"))
    other = {"changes": [], "sections": [one | {"run": "day2"}]}
    (folder / "day2-ground.json").write_text(json.dumps(other))
    assert client.get("/api/drive", params={"path": RUN}).json()["ground"]["sections"] == [one]


def test_a_ground_file_of_several_runs_gives_this_runs_sections(client: TestClient, folder: Path) -> None:
    def section(run: str, soil: str) -> dict[str, object]:
        return {"run": run, "start": 0.0, "end": 9.0, "soil": soil, "probabilities": {soil: 0.58}}

    several = {"changes": [], "sections": [section("multi1", "coarse"), section("estimates", "hard")]}
    (folder / "ground.json").write_text(json.dumps(several))
    result = client.get("/api/drive", params={"path": RUN}).json()["ground"]
    assert [one["soil"] for one in result["sections"]] == ["hard"]
    del several["sections"][1]
    (folder / "ground.json").write_text(json.dumps(several))
    assert client.get("/api/drive", params={"path": RUN}).json()["ground"] is None


def test_ground_lies_in_the_folder_above_as_the_demo_has_it(client: TestClient, folder: Path) -> None:
    (folder / "estimates").mkdir()
    (folder / RUN).rename(folder / "estimates" / "multi2.parquet")
    one = {"run": "multi2", "start": 0.0, "end": 9.0, "soil": "hard", "probabilities": {"hard": 1.0}}
    (folder / "ground.json").write_text(json.dumps({"changes": [], "sections": [one]}))
    about = client.get("/api/drive", params={"path": "estimates/multi2.parquet"}).json()
    assert about["ground"]["sections"] == [one]
    assert about["recording"] == "recording.parquet"


def test_a_renamed_recording_is_found_by_its_content(client: TestClient, folder: Path) -> None:
    (folder / "recording.parquet").rename(folder / "monday.parquet")
    about = client.get("/api/drive", params={"path": RUN}).json()
    assert about["recording"] == "monday.parquet"
    assert "drawbar_force" in about["measured"]


def test_a_log_that_needs_a_profile_shows_its_measurements(client: TestClient, folder: Path) -> None:
    import polars as pl

    import terragrip as tg

    log = pl.read_parquet(folder / "recording.parquet")[:400]
    log.rename({"ground_speed": "v_gps", "time": "stamp"}).write_csv(folder / "foreign.csv")
    channels = "\n".join(f"  {n}: {n}" for n in log.columns if n not in ("time", "ground_speed", "soil"))
    text = (
        f"time: {{from: stamp, unit: s}}\nchannels:\n  ground_speed: {{from: v_gps, unit: m/s}}\n{channels}\n"
    )
    (folder / "foreign.yaml").write_text(text)
    recording = tg.read(folder / "foreign.csv", profile=folder / "foreign.yaml")
    tg.estimate(recording, tg.Vehicle.load(folder / "vehicle.yaml")).write(folder / "foreign.parquet")
    (folder / "foreign.yaml").unlink()  # one that comes with Terragrip is in no folder either
    about = client.get("/api/drive", params={"path": "foreign.parquet"}).json()
    assert about["recording"] == "foreign.csv"
    assert "ground_speed" in about["measured"]
    shown = window(client, path="foreign.parquet", column=["measured:ground_speed"], start=0, end=2)
    assert np.isfinite(shown["measured:ground_speed"]).any()


def test_a_page_of_a_replaced_file_is_refused(client: TestClient, folder: Path) -> None:
    version = client.get("/api/drive", params={"path": RUN}).json()["version"]
    query = {"path": RUN, "time": 3.0, "version": version}
    assert client.get("/api/drive/sample", params=query).status_code == 200
    whole = Estimates.read(folder / RUN)
    whole.columns["slip_rr"] = whole.columns["slip_rr"] + 1.0
    whole.write(folder / RUN)
    answer = client.get("/api/drive/sample", params=query)
    assert answer.status_code == 422
    assert "was replaced since it was opened" in answer.json()["detail"]


def test_a_tractors_drive_train_has_a_radius(made: Path) -> None:
    """Its speed in rad/s is drawn in m/s: the mean radius of the driven wheels, by the zero of slip that the log gave."""
    import terragrip as tg

    vehicle = tg.Vehicle.load(made / "vehicle.yaml")
    time = np.arange(0, 60, 0.1)
    speed = 1.5 + 0.5 * np.sin(time / 7)
    log = {"time": time, "ground_speed": speed, "wheel_based_speed": 1.05 * speed}
    table = tg.estimate(tg.Recording.from_frame(log), vehicle)
    radius = drive.radii(table)
    assert set(radius) == set(table.wheels)
    rim = radius[table.wheels[0]] * table[f"wheel_speed_{table.wheels[0]}"]
    assert np.nanmedian(rim / table["ground_speed"]) == pytest.approx(1.0, abs=0.1)


def test_estimates_of_slip_alone_open_as_any(client: TestClient, folder: Path) -> None:
    import terragrip as tg

    recording = tg.read(folder / "recording.parquet")
    bare = {
        n: c
        for n, c in recording.channels.items()
        if not n.startswith(("drive_torque_", "true_", "wheel_force"))
    }
    east = 13 + np.arange(len(recording)) * 1e-7
    frame = {"time": recording.time, **bare, "latitude": np.full(len(recording), 51.0), "longitude": east}
    table = tg.estimate(tg.Recording.from_frame(frame), tg.Vehicle.load(folder / "vehicle.yaml"))
    table.write(folder / "slip.parquet")
    about = client.get("/api/drive", params={"path": "slip.parquet"}).json()
    assert about["method"] == "slip-only"
    wheel, middle = about["wheels"][-1], float(table.time[len(table) // 2])
    ends = {"start": about["start"], "end": about["end"]}
    query: dict[str, Any] = {
        "path": "slip.parquet",
        "column": [f"slip_{wheel}", f"slip_{wheel}:low"],
        "width": 100,
        **ends,
    }
    shown = client.get("/api/drive/window", params=query)
    assert np.isfinite(unpack(shown.content)[f"slip_{wheel}"]).any()
    plane = {"path": "slip.parquet", "x": f"slip_{wheel}", "y": f"adhesion_{wheel}", **ends}
    assert "is not in the estimates" in client.get("/api/drive/pairs", params=plane).json()["detail"]
    sample = client.get("/api/drive/sample", params={"path": "slip.parquet", "time": middle}).json()
    assert sample["why"]
    assert all("Without a torque there is no adhesion." in one or "undefined" in one for one in sample["why"])
    track = client.get("/api/drive/track", params={"path": "slip.parquet", "column": [f"slip_{wheel}"]})
    assert unpack(track.content)["longitude"][-1] > 13

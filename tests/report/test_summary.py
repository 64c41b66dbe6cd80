"""The summary on top, tables by label and by hour, the path and every wheel: against drives whose answer is known."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import made_up
import terragrip as tg
from terragrip.estimation import Estimates
from terragrip.report import path, wheels
from terragrip.report.blocks import blocks_of, shares
from terragrip.report.field_work import HEADLAND, ROAD, STANDING, WORK, parts_of
from terragrip.report.from_estimates import report_of
from terragrip.report.page import Page, Section, Table, render
from terragrip.report.runs import Run

pytestmark = pytest.mark.usefixtures("one_form")

RATE = 2.0
"""Rows a second of the field day."""


def by_anchor(page: Page) -> dict[str, Section]:
    return {section.anchor: section for section in page.sections}


def field_day(passes: int = 8) -> tuple[pd.DataFrame, np.ndarray]:
    """A tractor stands 40 s, drives 90 s on the road at 6 m/s, then passes of 60 s at 2 m/s with turns of 20 s at 1 m/s between them; the
    truth (n,) beside it. Slip is 8 % at work, 2 % in turns, 0 on the road (simulated)."""
    heading, legs = 0.0, [(STANDING, 40, 0.0, 0.0), (ROAD, 90, 6.0, 0.0), (HEADLAND, 10, 1.0, np.pi / 2)]
    for i in range(passes):
        legs += [(WORK, 60, 2.0, 0.0), (HEADLAND, 20, 1.0, np.pi if i % 2 else -np.pi)]
    rows = []
    x = y = 0.0
    for what, seconds, speed, turn in legs:
        for _ in range(int(seconds * RATE)):
            rows.append((what, speed, x, y))
            heading += turn / seconds / RATE
            x, y = x + speed * np.cos(heading) / RATE, y + speed * np.sin(heading) / RATE
    what = np.array([row[0] for row in rows], dtype=object)
    speed, east, north = (np.array([row[i] for row in rows]) for i in (1, 2, 3))
    slip = np.select([what == WORK, what == HEADLAND], [0.08, 0.02], 0.0)
    draws = np.random.default_rng(1000)
    frame = pd.DataFrame(
        {
            "time": np.arange(len(rows)) / RATE,
            "ground_speed": np.maximum(speed + 0.01 * draws.standard_normal(len(rows)) * (speed > 0), 0.0),
            "wheel_based_speed": speed / (1 - slip),
            "latitude": 51 + north / 111_250,
            "longitude": 13 + east / 70_200,
        }
    )
    return frame, what


@pytest.fixture(scope="module", name="tractor")
def tractor_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    axles = {"front": {"mass": 3000, "wheels": ["fl", "fr"]}, "rear": {"mass": 3000, "wheels": ["rl", "rr"]}}
    vehicle = tg.Vehicle.from_dict(
        {"mass": 6000, "wheelbase": 2.8, "center_of_gravity_height": 1.0, "axles": axles,
         "wheel": {"radius": 0.8, "inertia": 50}}
    )  # fmt: skip
    target = tmp_path_factory.mktemp("day") / "day.parquet"
    found = tg.estimate(tg.Recording.from_frame(field_day()[0]), vehicle)
    about = {**found.about, "recording": {"time_zero": "2026-04-01T08:50:00+00:00"}}
    Estimates(found.time, found.columns, found.event_codes, found.labels, about).write(target)
    return target


def run_of(file: Path) -> Run:
    estimates = Estimates.read(file)
    return Run(file.stem, estimates.to_pandas(), estimates.method, vehicle=estimates.vehicle)


def test_work_headland_road_and_standing_are_told_by_the_track_alone(tractor: Path) -> None:
    truth, found = field_day()[1], parts_of(run_of(tractor))
    assert found is not None
    assert np.mean(found == truth) > 0.9
    for what in (WORK, HEADLAND, ROAD, STANDING):
        assert np.mean(found[truth == what] == what) > 0.8, what


def test_what_was_done_before_and_after_a_winter_is_as_without_it(tractor: Path) -> None:
    """A second of it was a point: 1.3 GB for five months."""
    run = run_of(tractor)
    plain, table = parts_of(run), run.estimates.copy()
    assert plain is not None
    standing = np.flatnonzero(plain == STANDING)
    table["time"] += 150 * 86400.0 * (np.arange(len(table)) > standing[len(standing) // 2])
    tracemalloc.start()
    try:
        found = parts_of(Run("winter", table, run.method, vehicle=run.vehicle))
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 100e6
    assert found is not None
    assert np.mean(found == plain) > 0.98  # seconds begin elsewhere


def test_a_mean_counts_what_is_known_of_each_piece() -> None:
    """A minute at 8 %, then four stuck, a second of each half minute between two spells: the mean was that of the spells' edges."""
    time = np.arange(300.0)
    known = (time < 60) | (time % 30 == 0)
    slip = np.where(time < 60, 0.08, 0.9)
    table = pd.DataFrame(
        {"time": time, "slip_drive": slip, "slip_drive_std": np.where(known, 0.01, 1.0), "soil": "field"}
    )
    (field,) = shares([blocks_of(Run("stuck", table, "slip-only"))])
    assert field.slip[0] == pytest.approx(slip[known].mean())


def test_the_hour_of_a_tractor_is_parted_as_its_dataset_labels_it() -> None:
    """Against the dataset's own STATE, which no setting was tuned to."""
    log = Path(__file__).parents[3] / "shared" / "data" / "tractor_t7" / "session2_hour.csv.gz"
    for parent in Path(__file__).resolve().parents:
        if (parent / "shared" / "data").is_dir():
            log = parent / "shared" / "data" / "tractor_t7" / "session2_hour.csv.gz"
    if not log.is_file():
        pytest.skip("SKIPPED LOUDLY: ../shared/data is absent")
    day = pd.read_csv(log)
    table = pd.DataFrame(
        {
            "time": np.arange(len(day), dtype=float),
            "latitude": day["CAN2.gnss_pos.Latitude"],
            "longitude": day["CAN2.gnss_pos.Longitude"],
            "slip_drive": 0.0,
            "slip_drive_std": 0.01,
        }
    )
    found, state = parts_of(Run("t7", table, "slip-only")), day["STATE"].to_numpy()
    assert found is not None
    assert np.mean(found[state == "W"] == WORK) > 0.85
    assert np.mean(found[state == "T"] == HEADLAND) > 0.8
    assert np.mean(found[state == "I"] == STANDING) > 0.95
    assert not np.any(np.isin(state[found == ROAD], ["W", "T"]))


@pytest.mark.usefixtures("undrawn")
def test_a_tractor_without_torque_gets_its_story(tractor: Path) -> None:
    page = report_of([tractor])
    found = by_anchor(page)
    assert page.sections[0].anchor == "summary"
    (table,) = found["summary"].content
    rows = {row[0]: row for row in table.rows}
    assert next(iter(rows)) == "work"
    mean, half = (float(x) for x in rows["work"][4].removesuffix(" %").split(" ± "))
    assert abs(mean - 8.0) < half < 3.0
    assert float(rows["work"][1]) == pytest.approx(8.0, abs=0.8)  # minutes
    assert float(rows["road"][3]) == pytest.approx(6.0, abs=0.5)
    said = " ".join(found["summary"].prose)
    assert "2026-04-01 08:50 to 09:02 UTC" in said
    assert "no drive torque" in said
    bands = {
        row[0]: dict(zip(found["slip-bands"].content[1].header, row, strict=True))
        for row in found["slip-bands"].content[1].rows
    }
    assert float(bands["work"]["5 to 10 %"].removesuffix(" %")) > 85
    assert "track itself" in found["path"].content[0].caption


def test_hours_are_those_of_the_clock_and_hold_all_the_time(tractor: Path) -> None:
    from terragrip.report.from_estimates import _run
    from terragrip.report.work_sections import by_hour

    run = _run(Estimates.read(tractor), "day", (), ())
    labels = parts_of(run)
    (table,) = by_hour([blocks_of(run, labels)]).content
    assert [row[0] for row in table.rows] == ["day, 08:50", "day, 09:00"]  # quarters of the clock
    minutes = sum(float(cell) for row in table.rows for cell in row[1:5])
    assert minutes == pytest.approx(run.time[-1] / 60, abs=0.5)
    assert sum(float(row[5]) for row in table.rows) == pytest.approx(6.0 * 90 + 8 * 120 + 170, rel=0.03)


def test_intervals_by_label_hold_the_truth_and_too_little_has_none() -> None:
    draws, inside = np.random.default_rng(1000), 0
    for _ in range(200):
        time = np.arange(0, 900, 1.0)
        slow = np.repeat(
            draws.normal(0.0, 0.03, 30), 30
        )  # ground that varies from half minute to half minute
        table = pd.DataFrame({"time": time, "slip_l": 0.12 + slow, "slip_l_std": 0.01, "distance": time})
        (one,) = shares([blocks_of(Run("r", table, "bank"), np.full(len(time), "soil", dtype=object))])
        inside += abs(one.slip[0] - 0.12) < one.slip[1]
    assert 182 <= inside <= 198
    short = Run("r", table.iloc[:60], "bank")
    (one,) = shares([blocks_of(short, np.full(60, "soil", dtype=object))])
    assert np.isnan(one.slip[1])
    assert one.seconds == 60


@pytest.mark.usefixtures("undrawn")
def test_means_are_those_of_the_driven_wheels() -> None:
    """A tricycle's driven front wheel slipped by 2.2 %; its summary said .3 %, the mean with two free wheels, and drew one of these."""
    slips = {"f": 0.1, "rl": -0.01, "rr": -0.01}
    table = pd.DataFrame({"time": np.arange(100.0), "event": "", "distance": np.arange(100.0)})
    for wheel, slip in slips.items():
        for quantity, value in (("slip", slip), ("adhesion", 2 * slip)):
            table[f"{quantity}_{wheel}"], table[f"{quantity}_{wheel}_std"] = value, 0.01
    rear = {"mass": 150, "wheels": ["rl", "rr"], "driven": False}
    tricycle = tg.Vehicle.from_dict(
        {
            "mass": 250,
            "wheelbase": 1.2,
            "center_of_gravity_height": 0.4,
            "axles": {"front": {"mass": 100, "wheels": ["f"]}, "rear": rear},
            "wheel": {"radius": 0.2, "inertia": 0.1},
        }
    )
    run = Run("r", table, "bank", vehicle=tricycle)
    (one,) = shares([blocks_of(run, np.full(100, "soil", dtype=object))])
    assert (one.slip[0], one.adhesion[0]) == (pytest.approx(0.1), pytest.approx(0.2))
    assert run.shown_wheel == "f"


@pytest.mark.usefixtures("undrawn")
def test_a_summary_stands_on_top_and_says_what_lacks(tmp_path: Path) -> None:
    for i in range(3):
        made_up.estimates(1000 + i, ("hard",), rows=2400).write(tmp_path / f"hard-{i}.parquet")
        made_up.estimates(1010 + i, ("fine",), rows=2400).write(tmp_path / f"fine-{i}.parquet")
    page = report_of(sorted(tmp_path.glob("*.parquet")))
    top = page.sections[0]
    assert top.title == "Summary"
    (table,) = top.content
    head = table.header
    for row in table.rows:
        cells = dict(zip(head, row, strict=True))
        mu, half = (float(x) for x in cells["µ, 95 % interval"].split(" ± "))
        assert 0 < half < 0.2 * mu
        assert float(cells["time [min]"]) == pytest.approx(12.0, abs=0.1)
    assert any("Best tractive efficiency" in one and "hard" in one for one in top.prose)
    assert "no position" in top.prose[-1]
    assert "no clock time" in top.prose[-1]
    assert "Left out: the logs have no position" in by_anchor(page)["path"].omitted


def test_every_wheel_is_drawn_and_told(tmp_path: Path) -> None:
    made_up.estimates(1000, ("hard",)).write(tmp_path / "a.parquet")
    run = run_of(tmp_path / "a.parquet")
    picture, table = wheels.section(run).content
    for wheel in made_up.WHEELS:
        assert re.search(rf">{wheel}<", picture.svg)
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == list(made_up.WHEELS)
    for row in table.rows:
        mean = float(row[1].split(" ±")[0])
        assert mean == pytest.approx(100 * run.estimated(f"slip_{row[0]}").mean(), abs=0.06)


def test_one_wheel_needs_no_comparison(tractor: Path) -> None:
    assert wheels.section(run_of(tractor)) is None


def test_paths_stand_side_by_side_with_their_labels(tmp_path: Path) -> None:
    runs = []
    for name in ("multi1", "multi2"):
        table = made_up.estimates(1000, ("hard", "grass")).to_pandas()
        table["latitude"], table["longitude"] = 51.0, 13 + table["distance"] / 70_000
        runs.append(Run(name, table, "bank"))
    (picture,) = path.section(runs).content
    for word in ("multi1", "multi2", "hard", "grass", "east [m]", "north [m]"):
        assert f">{word}<" in picture.svg
    assert "arrow marks the start" in picture.caption


@pytest.mark.usefixtures("undrawn")
def test_a_short_log_gives_a_report_without_intervals(tmp_path: Path) -> None:
    made_up.estimates(1000, ("",), rows=40).write(tmp_path / "a.parquet")
    page = report_of([tmp_path / "a.parquet"])
    assert "too short for an interval" in page.sections[0].prose[1]
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", render(page), flags=re.DOTALL).lower().replace(
        "finance", ""
    )

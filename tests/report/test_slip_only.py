"""The report, and the ground, of estimates from speeds alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.report.from_estimates import report_of
from terragrip.report.page import Section, render


def drive(folder: Path, *, position: bool) -> Path:
    """Half of the way at 12 % slip and half without, on a line to the east (simulated)."""
    draws, time = np.random.default_rng(1000), np.arange(3000) / 10
    speed, slip = 2 + 0.3 * np.sin(time / 20), np.where(time < 150, 0.12, 0.0)
    frame = {
        "time": time,
        "ground_speed": speed + 0.02 * draws.standard_normal(3000),
        "wheel_based_speed": 1.03 * speed / (1 - slip) + 0.01 * draws.standard_normal(3000),
    }
    if position:
        frame |= {"latitude": np.full(3000, 51.0), "longitude": 13 + np.cumsum(speed) / 10 / 70_000}
    axles = {"front": {"mass": 3000, "wheels": ["fl", "fr"]}, "rear": {"mass": 3000, "wheels": ["rl", "rr"]}}
    vehicle = tg.Vehicle.from_dict(
        {"mass": 6000, "wheelbase": 2.8, "center_of_gravity_height": 1.0, "axles": axles,
         "wheel": {"radius": 0.8, "inertia": 50}}
    )  # fmt: skip
    path = folder / f"{'placed' if position else 'bare'}.parquet"
    tg.estimate(tg.Recording.from_frame(frame), vehicle).write(path)
    return path


def by_anchor(sections: tuple[Section, ...]) -> dict[str, Section]:
    return {section.anchor: section for section in sections}


def test_slip_over_time_by_way_and_by_place(tmp_path: Path) -> None:
    page = report_of([drive(tmp_path, position=True)])
    result = by_anchor(page.sections)
    for key in ("slip-placed", "slip-histogram-placed", "slip-map-placed", "honesty", "runs"):
        assert not result[key].omitted, key
    table = result["slip-histogram-placed"].content[1]
    shares = {row[0]: float(row[2].removesuffix(" %")) for row in table.rows}
    assert shares["10 to 15 %"] == pytest.approx(50, abs=4)  # half of the time, at the same mean speed
    assert "no drive torque" in result["without-torque"].omitted
    assert not {"tracking-placed", "soils", "residuals"} & set(result)
    assert "east [m]" in render(page)


@pytest.mark.usefixtures("undrawn")
def test_without_positions_the_map_is_left_out_with_its_reason(tmp_path: Path) -> None:
    result = by_anchor(report_of([drive(tmp_path, position=False)]).sections)
    assert "no position" in result["slip-map-bare"].omitted
    assert not result["slip-bare"].omitted


def test_the_ground_says_what_it_needs(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = drive(tmp_path, position=False)
    assert main(["ground", str(path), "-o", str(tmp_path / "ground.json")]) == 2
    text = capfd.readouterr().err.strip().splitlines()
    assert len(text) == 1
    assert "has slip but no adhesion" in text[0]
    assert "estimate a log with torques" in text[0]
    assert not (tmp_path / "ground.json").exists()


@pytest.mark.usefixtures("undrawn")
def test_it_is_said_where_slip_counts_from(tmp_path: Path) -> None:
    result = by_anchor(report_of([drive(tmp_path, position=False)]).sections)
    text = result["slip-bare"].prose[0]
    assert "from the log's own zero" in text
    ratio = float(text.split("ground speed ")[1].split(" ")[0])
    assert ratio == pytest.approx(1 / 1.03, abs=0.005)  # the machine's own speed was made 3 % too fast

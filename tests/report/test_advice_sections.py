"""The chapter of advice: what a manager reads, by soil, with intervals; what is missing, and runs that do not belong."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "advice"))

from advice_drives import VEHICLE, drive, slip_only
from terragrip.advice.analysis import advise
from terragrip.report import advice_sections
from terragrip.report.advice_sections import GatheredAdvice
from terragrip.report.page import Picture, Table


def chapter(*runs):
    gathered = GatheredAdvice()
    for number, one in enumerate(runs):
        gathered.add(one, f"run{number}")
    return gathered.section()


def cells(section):
    return [cell for one in section.content if isinstance(one, Table) for row in one.rows for cell in row]


@pytest.fixture(scope="module")
def runs():
    return [
        drive(soil="firm", seed=1),
        drive(soil="soft", a=0.6, resistance=0.11, seed=2),
        drive(soil="firm", seed=3),
    ]


def test_each_soil_has_the_slip_that_advise_gives_for_the_same_files(runs):
    section = chapter(*runs)
    advice, _ = advise(runs, VEHICLE)
    for name in ("firm", "soft"):
        best = advice[name].best_efficiency
        row = next(row for row in section.content[0].rows if row[0] == name)
        assert row[3].startswith(f"{100 * best.slip:.1f} %")
        assert f"{100 * best.interval[0]:.1f} to {100 * best.interval[1]:.1f}" in row[3]
        for action in advice[name].actions:
            assert action.what in cells(section)
    assert any(isinstance(one, Picture) for one in section.content)


def test_soils_come_by_the_way_driven_on_them(runs):
    assert [row[0] for row in chapter(*runs).content[0].rows] == ["firm", "soft"]


def test_where_no_slip_is_advised_the_missing_drive_is_named_and_nothing_is_drawn():
    section = chapter(drive(top=0.01))
    assert section.content[0].rows[0][3] == "not known"
    assert any("5 to 10 %" in cell for cell in cells(section))
    assert not any(isinstance(one, Picture) for one in section.content)


def test_a_run_of_another_machine_is_left_out_and_said(runs):
    heavy = replace(runs[0], about={"vehicle": {**VEHICLE.to_dict(), "mass": 6010.0}})
    section = chapter(runs[0], heavy)
    assert any("run1" in sentence and "another vehicle" in sentence for sentence in section.prose)


def test_slip_alone_gives_shares_of_the_band_and_no_curve():
    section = chapter(slip_only(np.repeat([0.05, 0.2], [100, 300])))
    assert "0 %" in section.prose[0]
    assert "75 %" in section.prose[0]
    assert not any(isinstance(one, Picture) for one in section.content)


def test_estimates_without_their_vehicle_leave_the_chapter_out():
    assert "no vehicle" in chapter(replace(drive(), about={})).omitted


def test_slip_control_is_shown_as_the_benchmark_wrote_it(monkeypatch, tmp_path):
    kept = tmp_path / "kept.json"
    monkeypatch.setattr(advice_sections, "CONTROL", kept)
    assert "bench_slip_control" in advice_sections.control().omitted
    kept.write_text(
        json.dumps(
            {"tractor": {"machines": 3, "first": 7, "rows": [["work", "fixed speed", "1.00", "1.00", "0 %"]]}}
        )
    )
    section = advice_sections.control()
    assert section.content[0].rows == (("work, fixed speed", "1.00", "1.00", "0 %"),)
    assert "3 seeds" in section.content[0].caption

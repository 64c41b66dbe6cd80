"""The report's map: drawn where there are positions, left out with the reason where there are none or impossible ones."""

from __future__ import annotations

import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

import numpy as np

from lane_drives import drive, lanes
from terragrip.report.map_sections import GatheredMap


def test_the_map_is_drawn_and_its_patches_are_listed() -> None:
    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        return np.where((np.abs(east - 20) < 2) & (np.abs(north - 10) < 2), 0.5, 1.0)

    gathered = GatheredMap()
    gathered.add(drive(*lanes(20, 40, 1), a=ground, noise=0.01), "monday")
    section = gathered.section()
    assert section.omitted is None
    picture, table = section.content
    assert "adhesion at 10 % slip" in picture.svg
    (row,) = table.rows
    assert row[0] == "adhesion"
    assert float(row[1]) == pytest.approx(51.0 + np.degrees(10 / 6378137.0), abs=2e-5)
    assert row[6].startswith("−")


def test_impossible_positions_leave_the_map_out_with_the_reason() -> None:
    estimates = drive(*lanes(12, 30, 4))
    swapped = estimates["longitude"], estimates["latitude"]
    estimates.columns["latitude"], estimates.columns["longitude"] = swapped
    gathered = GatheredMap()
    gathered.add(estimates, "monday")
    assert "swapped" in str(gathered.section().omitted)


def test_no_positions_leave_the_map_out() -> None:
    estimates = drive(*lanes(2, 30, 4))
    del estimates.columns["latitude"]
    gathered = GatheredMap()
    gathered.add(estimates, "monday")
    assert "no position" in str(gathered.section().omitted)

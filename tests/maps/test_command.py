"""``terragrip map``: what is written, what is said, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

from lane_drives import drive, lanes
from terragrip.cli import main


@pytest.fixture
def estimates(tmp_path: Path) -> Path:
    path = tmp_path / "drive.parquet"
    drive(*lanes(4, 30, 3)).write(path)
    return path


def test_the_map_is_written_and_summed_up(
    estimates: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import pyogrio

    out = tmp_path / "map.gpkg"
    assert main(["map", str(estimates), "-o", str(out)]) == 0
    assert [name for name, _ in pyogrio.list_layers(out)] == ["cells", "points"]
    said = capsys.readouterr().out
    assert "adhesion at 20 % slip" in said
    assert "headland" in said
    assert "driven once" in said


@pytest.mark.parametrize(
    ("options", "fix"),
    [
        (["-o", "map.shp"], "name it map.gpkg"),
        (["-o", "map"], "name it map.gpkg"),
        (["-o", "map.gpkg", "--cell", "0"], "--cell"),
        (["-o", "map.gpkg", "--slip", "2"], "--slip"),
        (["-o", "map.geojson", "--layer", "lines"], "cells, points, anomalies, changes"),
        (["-o", "map.gpkg", "--datum", "EPSG:nonsense"], "EPSG:4258"),
        (["-o", "map.gpkg", "--soils", "none.json"], "no such file"),
    ],
)
def test_a_wrong_option_is_one_line(
    estimates: Path, tmp_path: Path, options: list[str], fix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options[1] = str(tmp_path / options[1])
    assert main(["map", str(estimates), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert fix in error
    assert not Path(options[1]).exists()

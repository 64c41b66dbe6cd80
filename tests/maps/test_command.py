"""``terragrip map``: what is written, what is said, what is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

from lane_drives import drive, lanes
from terragrip.cli import main
from terragrip.maps.reading import read_map


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
    assert main(["map", str(estimates), "-o", str(out), "--cell", "1"]) == 0
    assert [name for name, _ in pyogrio.list_layers(out)] == ["cells", "points", "anomalies"]
    assert pyogrio.read_info(out, layer="anomalies")["features"] == 0
    assert "difference_std" in pyogrio.read_info(out, layer="anomalies")["fields"]
    said = capsys.readouterr().out
    assert "10 % and 90 % quantiles" in said
    assert "adhesion at 10 % slip" in said
    assert "headland" in said
    assert "driven once" in said


def test_a_geotiff_tells_what_was_driven_from_what_is_kriged(tmp_path: Path) -> None:
    import rasterio

    source, out = tmp_path / "drive.parquet", tmp_path / "map.tif"
    drive(*lanes(4, 30, 3), noise=0.02).write(source)
    assert main(["map", str(source), "-o", str(out), "--fill", "1", "--quiet"]) == 0
    with rasterio.open(out) as file:
        band = {name: file.read(number) for number, name in enumerate(file.descriptions, 1)}
    known = np.isfinite(band["soil_resistance"])
    kriged = known & (band["count"] == 0)
    assert kriged.any(), "one cell beside the driven ones"
    assert np.all(band["passes"][known & ~kriged] >= 1)
    assert np.all(band["passes"][kriged] == 0)


@pytest.mark.parametrize(
    "name",
    ["map.gpkg", "map.tif", "map.geojson", "map.parquet", pytest.param("map.png", marks=pytest.mark.long)],
)
def test_a_disk_that_is_full_is_one_line_and_no_file(
    estimates: Path,
    tmp_path: Path,
    name: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    resource = pytest.importorskip("resource")
    # Python would cut short the byte code of what is imported here for the first time, and no later import reads that.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(
        resource.RLIMIT_FSIZE, (2048, hard)
    )  # no file may grow further: writing fails as on a full disk
    try:
        code = main(["map", str(estimates), "-o", str(tmp_path / name), "--quiet"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    error = capsys.readouterr().err
    assert (code, error.count("\n")) == (2, 1)
    assert "cannot be written" in error
    assert list(tmp_path.iterdir()) == [estimates]


def test_reading_a_map_leaves_nothing_beside_it(estimates: Path, tmp_path: Path) -> None:
    """A studio shows the maps of a folder that it may only read."""
    out = tmp_path / "map.gpkg"
    assert main(["map", str(estimates), "-o", str(out), "--quiet"]) == 0
    assert read_map(out).about.runs == ["drive"]
    assert sorted(tmp_path.iterdir()) == [estimates, out]


def test_two_days_of_one_file_name_are_told_apart(tmp_path: Path) -> None:
    import geopandas

    paths = [tmp_path / day / "field.parquet" for day in ("monday", "friday")]
    for seed, path in enumerate(paths):
        path.parent.mkdir()
        drive(*lanes(3, 30, 3), noise=0.01, seed=seed).write(path)
    out = tmp_path / "map.gpkg"
    assert main(["map", *map(str, paths), "-o", str(out), "--quiet"]) == 0
    changes = geopandas.read_file(out, layer="changes")
    assert set(changes["first_run"]) == {"monday/field"}
    assert set(changes["last_run"]) == {"friday/field"}


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

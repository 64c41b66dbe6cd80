"""``terragrip map`` of drives that make no map, or not all of one: one line with exit 2, or a sentence beside the map."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

from lane_drives import EARTH, drive, lanes, local_east
from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.maps.field_map import MOST_CELLS

Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def mapped(
    folder: Path, estimates: Estimates, *options: str, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str, str]:
    """What the command returned and said of one drive, and its one line of error; of a failure nothing is left behind."""
    log, out = folder / "drive.parquet", folder / "map.gpkg"
    estimates.write(log)
    code = main(["map", str(log), "-o", str(out), *options])
    said = capsys.readouterr()
    if code:
        assert code == 2
        assert said.err.count("\n") == 1
        assert sorted(path.name for path in folder.iterdir()) == ["drive.parquet"]
    return code, said.out, said.err


def moved(estimates: Estimates, change: Change) -> Estimates:
    """The drive with other positions."""
    bad = change(estimates["latitude"], estimates["longitude"])
    estimates.columns["latitude"], estimates.columns["longitude"] = bad
    return estimates


def blank(values: np.ndarray) -> np.ndarray:
    return np.full(len(values), np.nan)


def coded(values: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(values)) % 50 == 0, -9999.0, values)


@pytest.mark.parametrize("how", ["no columns", "empty columns", "one of two"])
def test_no_positions(tmp_path: Path, how: str, capsys: pytest.CaptureFixture[str]) -> None:
    estimates = drive(*lanes(3, 30, 3))
    if how == "no columns":
        del estimates.columns["latitude"], estimates.columns["longitude"]
    elif how == "one of two":
        del estimates.columns["longitude"]
    else:
        moved(estimates, lambda lat, lon: (blank(lat), blank(lon)))
    code, _, error = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 2
    assert "drive.parquet: has no positions" in error
    assert "latitude and longitude" in error


@pytest.mark.parametrize(
    ("change", "fix"),
    [
        (lambda lat, lon: (lon, lat), "swapped"),
        (lambda lat, lon: (lat, -lon), "a sign of latitude or longitude is lost"),
        (lambda lat, lon: (-lat, lon), "a sign of latitude or longitude is lost"),
        (lambda lat, lon: (np.radians(lat), np.radians(lon)), "radians"),
        (lambda lat, lon: (lat * 111e3, lon * 70e3), "metres"),
        (lambda lat, lon: (coded(lat), coded(lon)), "-9999 looks like a code"),
        (lambda lat, lon: (lat, coded(lon)), "-9999 looks like a code"),
        (lambda lat, lon: (lon + 100, lat), "they look swapped"),
    ],
    ids=[
        "swapped",
        "east for west",
        "south for north",
        "radians",
        "metres",
        "code",
        "code of one",
        "swapped in the east",
    ],
)
def test_positions_that_contradict_speed_or_heading(
    tmp_path: Path, change: Change, fix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    estimates = moved(drive(*lanes(12, 30, 4)), change)
    code, _, error = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 2
    assert "drive.parquet: columns latitude, longitude" in error
    assert fix in error


@pytest.mark.parametrize("far", [500.0, 50_000.0], ids=["a field further", "another place"])
def test_positions_that_do_not_move_as_the_vehicle_did(
    tmp_path: Path, far: float, capsys: pytest.CaptureFixture[str]
) -> None:
    # a unit or a scale of its own: neither swapped nor radians, yet no place of this drive
    def spread(lat: np.ndarray, lon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return lat[0] + (lat - lat[0]) * far / 100, lon[0] + (lon - lon[0]) * far / 100

    code, _, error = mapped(tmp_path, moved(drive(*lanes(12, 30, 4)), spread), capsys=capsys)
    assert code == 2
    assert "as far as the wheels" in error


def test_positions_that_stand_still(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    estimates = moved(drive(*lanes(4, 30, 4)), lambda lat, lon: (0 * lat + 51.0, 0 * lon + 13.5))
    code, _, error = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 2
    assert "positions" in error


def test_a_sign_that_straight_lanes_cannot_show_is_seen_by_the_place_that_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    east = np.arange(0.0, 60.0, 0.05)
    estimates = moved(drive(east, 0 * east), lambda lat, lon: (lat, -lon))
    code, said, _ = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 0
    assert "51.000° N 13.500° W" in said


def test_a_single_pass_makes_no_map_of_changes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import pyogrio

    east = np.arange(0.0, 60.0, 0.05)
    code, said, _ = mapped(tmp_path, drive(east, 0 * east), capsys=capsys)
    assert code == 0
    assert "Every cell was driven once: there is no map of changes." in said
    assert "changes" not in {name for name, _ in pyogrio.list_layers(tmp_path / "map.gpkg")}


def test_positions_in_another_datum_lie_where_that_datum_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Meades Ranch, origin of the North American Datum of 1927: 39°13'26.686" N 98°32'30.506" W by definition, in NAD 83 (within two
    metres WGS 84) 39°13'26.712" N 98°32'31.745" W by the datasheet of the National Geodetic Survey (KG0640): 30 m further west."""
    import geopandas

    old = 39 + 13 / 60 + 26.686 / 3600, -(98 + 32 / 60 + 30.506 / 3600)
    new = 39 + 13 / 60 + 26.712 / 3600, -(98 + 32 / 60 + 31.745 / 3600)
    places = []
    for options in ([], ["--datum", "EPSG:4267"]):
        code, said, _ = mapped(tmp_path, drive(*lanes(3, 30, 3), origin=old), *options, capsys=capsys)
        assert code == 0
        assert ("EPSG:4267" if options else "EPSG:4326") in said
        west, south, _, _ = (
            geopandas.read_file(tmp_path / "map.gpkg", layer="points").to_crs(4326).total_bounds
        )
        places.append((south, west))
        (tmp_path / "map.gpkg").unlink()
    metre = np.degrees(1 / EARTH)
    shift = np.subtract(places[1], places[0]) / metre * (1, np.cos(np.radians(old[0])))
    wanted = np.subtract(new, old) / metre * (1, np.cos(np.radians(old[0])))
    np.testing.assert_allclose(
        shift, wanted, atol=10.0
    )  # without a grid of corrections the datum's own means are that good


@pytest.mark.parametrize("datum", ["EPSG:32633", "EPSG:4978", "EPSG:5621"])
def test_a_datum_that_is_none_of_latitude_and_longitude(
    tmp_path: Path, datum: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, error = mapped(tmp_path, drive(*lanes(3, 30, 3)), "--datum", datum, capsys=capsys)
    assert code == 2
    assert "--datum" in error
    assert "latitude and longitude" in error


@pytest.mark.sample(3)
@pytest.mark.parametrize("heading", [0.0, 45.0, 90.0])
def test_a_grid_too_fine_is_refused_with_a_size_that_does(
    tmp_path: Path, heading: float, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    way = np.arange(0.0, 900.0, 0.05)
    north = way * np.sin(np.radians(heading)) + 400 * (heading != 45.0) * (way > 450) * (way - 450) / 450
    estimates = drive(way * np.cos(np.radians(heading)) + (heading == 90.0) * way / 2, north)
    code, _, error = mapped(tmp_path, estimates, "--cell", "0.05", capsys=capsys)
    assert code == 2
    assert f"{MOST_CELLS} cells" in error
    # of fewer cells, for a map of as many as there may be takes seconds
    monkeypatch.setattr("terragrip.maps.field_map.MOST_CELLS", MOST_CELLS // 100)
    code, _, error = mapped(tmp_path, estimates, "--cell", "0.5", capsys=capsys)
    assert code == 2
    assert "--cell" in error
    size = re.search(r"([\d.]+) m or more", error)
    assert size is not None
    assert mapped(tmp_path, estimates, "--cell", size[1], capsys=capsys)[0] == 0


@pytest.mark.parametrize(
    ("tremble", "said_of_it"),
    [
        (0.0, r"1 outage of the positions, (19|20|21) m"),
        (0.005, r"still while the wheels drive (19|20|21) m"),
    ],
)
def test_an_outage_held_by_the_receiver_is_left_blank(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tremble: float, said_of_it: str
) -> None:
    """A receiver without satellites repeats its last position, or trembles about it [m]; the fix after it lies 20 m further on."""
    import geopandas

    east, north = lanes(1, 100, 2)
    lost = (east > 40) & (east < 60)
    keep = np.where(lost, np.flatnonzero(lost)[0], np.arange(len(east)))
    noise = lost * np.degrees(tremble / EARTH) * np.random.default_rng(1).standard_normal(len(east))
    estimates = moved(drive(east, north), lambda lat, lon: (lat[keep] + noise, lon[keep] + noise))
    code, said, _ = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 0
    assert re.search(f"{said_of_it}.*left empty", said)
    cells = geopandas.read_file(tmp_path / "map.gpkg", layer="cells")
    x = local_east(cells)
    assert not ((x > 42) & (x < 58)).any()
    assert ((x > 1) & (x < 38)).sum() > 30
    assert ((x > 62) & (x < 98)).sum() > 30
    assert cells["count"].max() < 120


def test_a_jump_leaves_no_cell_off_the_lane(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import geopandas

    east, north = lanes(1, 100, 2)
    off = (east > 50) & (east < 60)
    estimates = moved(drive(east, north), lambda lat, lon: (lat + off * np.degrees(8.0 / EARTH), lon))
    code, said, _ = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 0
    assert "2 jumps of the positions cut, the first at 50" in said
    cells = geopandas.read_file(tmp_path / "map.gpkg", layer="cells")
    centre = cells.geometry.representative_point().to_crs(4326)
    y = np.radians(centre.y - 51.0) * EARTH
    on_lane, shifted = np.abs(y) < 2.5, np.abs(y - 8.0) < 2.5
    assert np.all(on_lane | shifted)  # none between: nothing is smeared from one to the other


def test_a_stray_fix_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import geopandas

    east, north = lanes(1, 60, 2)
    stray = np.isin(np.arange(len(east)), [400, 700, 701])
    estimates = moved(drive(east, north), lambda lat, lon: (lat + stray * np.degrees(300.0 / EARTH), lon))
    code, said, _ = mapped(tmp_path, estimates, capsys=capsys)
    assert code == 0
    assert "jumps of the positions cut" in said
    cells = geopandas.read_file(tmp_path / "map.gpkg", layer="cells")
    assert np.ptp(cells.geometry.bounds.miny) < 10


def test_drives_on_two_continents_are_no_one_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / "here.parquet", tmp_path / "there.parquet"]
    drive(*lanes(3, 30, 3)).write(files[0])
    drive(*lanes(3, 30, 3), origin=(-33.0, 151.0)).write(files[1])
    assert main(["map", *map(str, files), "-o", str(tmp_path / "map.gpkg")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "there.parquet" in error
    assert not (tmp_path / "map.gpkg").exists()

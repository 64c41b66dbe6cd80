"""Positions that contradict the motion are refused with what they look like."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

from lane_drives import drive, lanes
from terragrip.errors import InputError
from terragrip.maps import map_of


@pytest.mark.parametrize(
    "origin", [(51.0, 13.5), (-33.0, 151.0), (40.0, -100.0), (64.0, 20.0), (0.5, -78.0), (45.2, 45.1)]
)
def test_right_positions_pass_anywhere_on_earth(origin: tuple[float, float]) -> None:
    made = map_of([("a", drive(*lanes(8, 40, 4), origin=origin))])
    assert made.epsg == (32600 if origin[0] > 0 else 32700) + int((origin[1] + 180) // 6) + 1


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        (lambda lat, lon: (lon, lat), "swapped"),
        (lambda lat, lon: (lat, -lon), "sign"),
        (lambda lat, lon: (-lat, lon), "sign"),
        (lambda lat, lon: (np.radians(lat), np.radians(lon)), "radians"),
        (lambda lat, lon: (lat * 111e3, lon * 70e3), "metres"),
        (lambda lat, lon: (lat + 69, lon), "swapped"),
    ],
)
def test_impossible_positions_are_refused(
    change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]], reported: str
) -> None:
    estimates = drive(*lanes(12, 30, 4))
    bad = change(estimates["latitude"], estimates["longitude"])
    estimates.columns["latitude"], estimates.columns["longitude"] = bad
    with pytest.raises(InputError, match=reported):
        map_of([("a", estimates)])


def test_swapped_columns_are_found_by_the_turns_of_lanes_along_one_direction() -> None:
    """Lanes from south to north are as long either way, and the drive's one speed shows no turn: only the headlands are too wide."""
    north, east = lanes(10, 60, 6)
    estimates = drive(east, north, antenna=(1.5, 0.5))
    for wheel in estimates.vehicle.wheels:
        estimates.columns[f"wheel_speed_{wheel}"] = np.full(len(estimates), 5.0)
    columns = estimates.columns
    assert map_of([("a", estimates)]).epsg == 32633
    columns["latitude"], columns["longitude"] = columns["longitude"], columns["latitude"]
    with pytest.raises(InputError, match="swapped"):
        map_of([("a", estimates)])


def test_no_positions_is_one_line() -> None:
    estimates = drive(*lanes(2, 30, 4))
    del estimates.columns["latitude"]
    with pytest.raises(InputError, match="has no positions"):
        map_of([("a", estimates)])

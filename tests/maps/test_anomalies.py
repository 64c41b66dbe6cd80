"""Patches of other ground, against the field that the drive was made of."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")

from pyproj import Transformer

from lane_drives import EARTH, REFERENCE, drive, lanes, local_east
from terragrip.maps import FieldMap, MapSettings, map_of
from terragrip.maps.anomalies import least_difference
from terragrip.maps.layers import layer
from terragrip.physics.adhesion import CURVES


def test_patches_are_listed_and_borders_are_not() -> None:
    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        hole = (np.abs(east - 12) < 2) & (np.abs(north - 10) < 2)
        firm = (np.abs(east - 40) < 2) & (np.abs(north - 20) < 2)
        return np.where(east < 26, 0.8, 1.1) * np.where(hole, 0.5, 1.0) * np.where(firm, 1.5, 1.0)

    made = map_of([("a", drive(*lanes(30, 52, 1), a=ground, noise=0.01))], MapSettings(cell=1.0))
    found = layer(made, "anomalies")
    found = found[found.quantity == "adhesion"]
    assert sorted(found.kind) == ["grips", "slips"]
    assert np.all(found.p < 0.05)
    assert np.all(found.area.between(9, 60))


def test_noise_in_a_field_of_one_soil_is_no_anomaly_beside_a_real_one() -> None:
    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        return np.where((np.abs(east - 20) < 2) & (np.abs(north - 10) < 2), 0.5, 1.0)

    for seed in (1, 2):
        made = map_of([("a", drive(*lanes(20, 40, 1), a=ground, noise=0.01, seed=seed))])
        assert [len(found) for found in made.anomalies.values()] == [1, 0]
        (one,) = made.anomalies["adhesion"]
        to_degrees = Transformer.from_crs(made.epsg, 4326)
        place = np.array(to_degrees.transform(one.column * made.cell, one.row * made.cell)) - (51.0, 13.5)
        metres = np.radians(place) * EARTH * (1.0, np.cos(np.radians(51.0)))
        np.testing.assert_allclose(metres, (10, 20), atol=0.6)


def test_a_patch_is_found_in_a_field_of_two_soils_that_vary() -> None:
    rng = np.random.default_rng(5)
    waves = rng.normal(0, 0.5, (40, 2)), rng.uniform(0, 6.3, 40)

    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        own = np.cos(np.outer(east, waves[0][:, 0]) + np.outer(north, waves[0][:, 1]) + waves[1]).sum(axis=1)
        firm = (np.abs(east - 30) < 2) & (np.abs(north - 9) < 2)
        return np.where(north > 14, 1.3, 1.0) * (1 + 0.01 * own) + 0.35 * firm

    made = map_of([("a", drive(*lanes(20, 60, 1), a=ground, noise=0.01))])
    found = layer(made, "anomalies")
    assert np.any(
        np.abs(local_east(found[(found.quantity == "adhesion") & (found.kind == "grips")]) - 30) < 1
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_soil_whose_strength_comes_and_goes_everywhere_has_no_anomalies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    waves = rng.normal(0, 1 / 8, (60, 2)), rng.uniform(0, 6.3, 60)

    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        own = np.cos(np.outer(east, waves[0][:, 0]) + np.outer(north, waves[0][:, 1]) + waves[1]).sum(axis=1)
        return np.exp(0.022 * own)

    made = map_of([("a", drive(*lanes(20, 50, 1), a=ground, noise=0.01, seed=seed))])
    assert not made.anomalies["adhesion"]


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", [1, 3])
def test_a_strip_of_another_soil_along_the_edge_is_no_patch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    waves = rng.normal(0, 0.5, (40, 2)), rng.uniform(0, 6.3, 40)

    def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        own = np.cos(np.outer(east, waves[0][:, 0]) + np.outer(north, waves[0][:, 1]) + waves[1]).sum(axis=1)
        return np.where(north > 16.5, 1.2, 1.0) * (1 + 0.015 * own)

    made = map_of([("a", drive(*lanes(20, 60, 1), a=ground, noise=0.01, seed=seed))])
    assert not any(one.difference > 0 for one in made.anomalies["adhesion"])


def test_ground_driven_at_another_slip_is_no_anomaly_where_its_curve_may_bend_otherwise() -> None:
    """One soil of another form than the paper's: carried to the reference from below it is too high, from above it too low."""
    east, north = lanes(20, 40, 1)
    one, curve = drive(east, north), CURVES["burckhardt"]
    slip = np.where((np.abs(east - 20) < 4) & (np.abs(north - 10) < 3), 0.15, 0.07)
    for wheel in one.wheels:
        one.columns[f"slip_{wheel}"] = slip
        one.columns[f"adhesion_{wheel}"] = np.asarray(curve.value(slip, {}))
    made = map_of([("a", one)], MapSettings(reference_slip=0.1))
    assert np.ptp(made.cells["adhesion"].value) > 0.1
    assert not made.anomalies["adhesion"]


def test_a_map_says_from_which_difference_on_a_patch_is_found() -> None:
    """Patches of nine cells in white noise: below half of that none is found; of three times it all are."""

    def made(difference: float, seed: int) -> FieldMap:
        def ground(east: np.ndarray, north: np.ndarray) -> np.ndarray:
            inside = (np.abs(east - 20.5) < 1.5) & (np.abs(north - 10.5) < 1.5)
            return 1.0 + np.where(inside, difference / REFERENCE, 0.0)

        way = lanes(20, 40, 1)
        return map_of([("a", drive(*way, a=ground, noise=0.02, std=0.02, seed=seed))], MapSettings(cell=1.0))

    least = least_difference(made(0.0, 1).cells["adhesion"], [])
    assert 0.0 < least < 0.1 * REFERENCE
    found = [len(made(share * least, 0).anomalies["adhesion"]) for share in (0.5, 3)]
    assert found == [0, 1]

"""Cells, anomalies and changes against what the drive was made of."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("geopandas", reason="needs terragrip[geo]")


from lane_drives import EARTH, REFERENCE, drive, lanes, local_east
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.maps import MapMaker, MapSettings, map_of, write_map
from terragrip.maps.layers import cell_table, layer
from terragrip.maps.places import places_of, zone_of
from terragrip.maps.values import _adhesion_constants, _resistance_constants, driven_slip
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    import geopandas


@pytest.mark.parametrize("slip", [0.05, 0.1, 0.3])
def test_adhesion_is_carried_to_the_reference_slip_whatever_the_slip_was(slip: float) -> None:
    made = map_of([("a", drive(*lanes(2, 30, 3), slip=slip))], MapSettings(reference_slip=0.1))
    np.testing.assert_allclose(made.cells["adhesion"].value, REFERENCE, rtol=2e-3)


@pytest.mark.parametrize(("slip", "mapped_at"), [(0.01, 0.02), (0.04, 0.05), (0.12, 0.1), (0.5, 0.2)])
def test_adhesion_is_mapped_near_the_slip_that_was_driven(slip: float, mapped_at: float) -> None:
    """From 4 % to 20 % of slip one soil's adhesion grows twofold, another's fourfold."""
    made = map_of([("a", drive(*lanes(2, 30, 3), slip=slip))])
    assert made.reference_slip == mapped_at


def test_adhesion_far_from_the_slip_driven_says_that_the_curves_form_is_unknown() -> None:
    firm, curve = drive(*lanes(2, 30, 3), slip=0.04), CURVES["burckhardt"]
    for wheel in firm.wheels:
        firm.columns[f"adhesion_{wheel}"] = np.full(len(firm), float(curve.value(0.04, {})))
    for at, far in ((0.05, 0.0), (0.2, 0.15)):
        cells = map_of([("a", firm)], MapSettings(reference_slip=at)).cells["adhesion"]
        assert np.all(np.abs(cells.value - float(curve.value(at, {}))) < 2 * cells.std + 0.01)
        assert np.all(cells.constant >= far * cells.value)


def test_a_librarys_curve_is_not_sure_of_slips_beyond_its_data() -> None:
    """Burckhardt's wet asphalt, known to 4 % of slip as the paper's form, and mapped at 20 %, where it has half of that form's adhesion."""
    firm, curve = drive(*lanes(2, 30, 3), slip=0.04), CURVES["burckhardt"]
    given = {"c1": 0.857, "c2": 33.8, "c3": 0.347}
    for wheel in firm.wheels:
        firm.columns[f"adhesion_{wheel}"] = np.full(len(firm), float(curve.value(0.04, given)))
    firm.labels["soil"] = np.full(len(firm), "road", dtype=object)
    slip, run = np.tile(np.linspace(0.005, 0.04, 500), 6), np.repeat(np.arange(6), 500)
    fit = AdhesionCurve(bins=BinSettings(0.005, 0.005, 0.045)).fit(
        slip, curve.value(slip, given) * (1 + 0.02 * np.sin(run)), run
    )
    library = SoilLibrary({"road": Soil.from_curve("road", fit)})
    cells = map_of([("a", firm)], MapSettings(reference_slip=0.2), library=library).cells["adhesion"]
    assert np.all(np.abs(cells.value - float(curve.value(0.2, given))) < 2.5 * cells.std)


@pytest.mark.parametrize("until", [0.3, 1.0])
def test_cells_without_adhesion_are_counted_with_the_reason(until: float) -> None:
    idle = drive(*lanes(2, 30, 3), slip=0.01)
    vague = idle["distance"] < until * idle["distance"][-1]
    for wheel in idle.wheels:
        idle.columns[f"slip_{wheel}_std"] = np.where(vague, 0.05, 0.001)
    (note,) = [note for note in map_of([("a", idle)]).notes if note.startswith("adhesion")]
    assert re.match(r"adhesion: \d+ of \d+ cells; .* slip was too low or too uncertain .* \(--cell\)", note)


def test_cells_whose_slip_is_large_by_error_alone_have_no_adhesion() -> None:
    idle = drive(*lanes(12, 40, 1), slip=0.005)
    rng, metre = np.random.default_rng(3), idle["distance"].astype(int)
    for wheel in idle.wheels:
        idle.columns[f"slip_{wheel}"] = 0.005 + (0.02 * rng.standard_normal(metre[-1] + 1))[metre]
        idle.columns[f"slip_{wheel}_std"] = np.full(len(idle), 0.02)
    assert "adhesion" not in map_of([("a", idle)], MapSettings(cell=1.0)).cells


def test_the_slip_driven_is_that_of_the_middle_of_the_way() -> None:
    one = drive(*lanes(2, 30, 3))
    share = one["distance"] / one["distance"][-1]
    for wheel in one.wheels:
        one.columns[f"slip_{wheel}"] = np.select([share < 0.2, share < 0.7], [0.02, 0.05], 0.15)
    assert driven_slip(one) == 0.05


def test_a_torques_zero_weighs_by_the_load_that_it_turns() -> None:
    """In closed form: the zero over radius and load; of the resistance that of all wheels, by chance, over the weight."""
    one = drive(*lanes(1, 30, 1))
    one.about["vehicle"]["uncertainty"] = {"drive_torque_offset": 0.3}
    vehicle, mu = one.vehicle, one["adhesion_rl"]
    rear = vehicle.wheels.index("rl")
    load = vehicle.axle_mass[vehicle.wheel_axle[rear]] / 2 * STANDARD_GRAVITY
    offset = 0.3 / vehicle.wheel_radius[rear]
    np.testing.assert_allclose(_adhesion_constants(vehicle, mu, rear)[:, 1], offset / load)
    zeros = _resistance_constants(vehicle, one)[0][:, -1]
    np.testing.assert_allclose(zeros, 2 * offset / (vehicle.mass * STANDARD_GRAVITY))


def test_errors_of_slip_do_not_draw_a_cell_down() -> None:
    # least squares would, for E[x²] > E[x]²: to about 0.6 of the truth here
    estimates = drive(*lanes(2, 60, 3), slip=0.04)
    rng = np.random.default_rng(3)
    for wheel in estimates.wheels:
        estimates.columns[f"slip_{wheel}"] = 0.04 + 0.03 * rng.standard_normal(len(estimates))
        estimates.columns[f"slip_{wheel}_std"] = np.full(len(estimates), 0.03)
    made = map_of([("a", estimates)], MapSettings(reference_slip=0.1))
    assert np.median(made.cells["adhesion"].value) == pytest.approx(REFERENCE, rel=0.15)


def test_stretches_without_demand_on_the_ground_leave_the_other_cells_as_certain() -> None:
    one = drive(*lanes(6, 40, 2), noise=0.01)
    before = map_of([("a", one)], MapSettings(reference_slip=0.1)).cells["adhesion"]
    rng, idle = np.random.default_rng(1), one["distance"] % 40 < 6
    for wheel in one.wheels:
        one.columns[f"slip_{wheel}"] = np.where(idle, 0.002 * rng.standard_normal(len(idle)), 0.1)
        one.columns[f"adhesion_{wheel}"][idle] = 0.03 + 0.02 * rng.standard_normal(int(idle.sum()))
    after = map_of([("a", one)], MapSettings(reference_slip=0.1)).cells["adhesion"]
    assert len(before) > len(after) > 100
    assert np.median(after.std) < 3 * np.median(before.std)


def test_a_cell_lies_where_the_wheels_were_not_the_antenna() -> None:
    ground = drive(*lanes(3, 30, 3), a=lambda e, n: np.where(e < 15, 0.5, 1.0), antenna=(3.0, 1.0))
    made = map_of([("a", ground)], MapSettings(cell=1.0))
    frame = layer(made, "cells").dropna(subset="adhesion")
    east, low = local_east(frame), frame.adhesion.to_numpy() < 0.75 * REFERENCE
    assert abs(east[low].max() - 15) < 1.3
    assert abs(east[~low].min() - 15) < 1.3


def test_ninety_percent_intervals_hold_where_errors_are_as_stated() -> None:
    cells = map_of([("a", drive(*lanes(6, 60, 2), noise=0.02, std=0.02))]).cells["adhesion"]
    held = np.abs(cells.value - REFERENCE) < 1.645 * cells.std
    assert held.mean() > 0.85


def test_constants_are_not_averaged_away_by_passes() -> None:
    estimates = drive(*lanes(2, 30, 3), std=0.05)
    estimates.about["vehicle"]["uncertainty"] = {"drive_torque_gain_common": 0.05}
    once = map_of([("a", estimates)]).cells["adhesion"]
    often = map_of([(name, estimates) for name in "abcdefgh"]).cells["adhesion"]
    assert np.all(often.passes >= 8)
    thrust = often.value + estimates.vehicle.tire_rolling_resistance
    np.testing.assert_allclose(often.constant / thrust, 0.05, rtol=0.02)
    assert np.all(often.std >= often.constant)
    assert np.median(often.std) < np.median(once.std)


@pytest.mark.parametrize(
    ("known", "adhesion", "resistance"),
    [
        ({"tire_rolling_resistance": 0.02}, 0.02, 0.02),
        ({"drawbar_gain": 0.1}, 0.0, 0.1 * (REFERENCE - 0.1)),
        ({"mass": 0.1}, 0.1 * (REFERENCE + 0.03), 0.1 * (0.1 + 0.03)),
    ],
)
def test_every_constant_that_is_stated_stays_in_each_cell(
    known: dict[str, float], adhesion: float, resistance: float
) -> None:
    """In closed form (docs/physics.md 6): mu = T/(r F) - rho_t, rho_s = sum T/(r m g) - rho_t - D/(m g)."""
    one = drive(*lanes(2, 30, 3), std=0.2)
    one.about["vehicle"] |= {"uncertainty": known, "tire_rolling_resistance": 0.03}
    cells = map_of([("a", one)], MapSettings(reference_slip=0.1)).cells
    np.testing.assert_allclose(cells["adhesion"].constants[:, :3].sum(axis=1), adhesion, atol=1e-6)
    np.testing.assert_allclose(cells["soil_resistance"].constant, resistance, atol=1e-6)


def repeated(stated: float, passes: int) -> list[tuple[str, Estimates]]:
    """The same lanes again and again, errors of 0.02 a row of which `stated` is said."""
    way = lanes(6, 60, 2)
    return [(f"run {k}", drive(*way, noise=0.02, std=stated, seed=k)) for k in range(passes)]


def test_intervals_that_repeated_passes_show_to_be_too_wide_are_narrowed() -> None:
    made = map_of(repeated(0.02, 3))  # white, so it averages out within a cell more than is stated
    cells = made.cells["adhesion"]
    held = np.abs(cells.value - REFERENCE) < 1.645 * cells.std
    assert 0.8 < held.mean() < 0.96
    assert any(re.match(r"adhesion: passes over one cell agree better", note) for note in made.notes)


def test_a_drive_mapped_twice_is_no_evidence_that_it_is_exact() -> None:
    once = drive(*lanes(6, 60, 2), noise=0.02, std=0.02)
    twice = map_of([("a", once), ("b", once)]).cells["adhesion"].std
    assert np.median(twice) > 0.15 * np.median(map_of([("a", once)]).cells["adhesion"].std)


def test_intervals_stay_where_no_pass_is_repeated_or_passes_differ_more_than_they_say() -> None:
    once = map_of(repeated(0.02, 1), MapSettings(cell=1.0))
    assert not any("agree better" in note for note in once.notes)
    assert np.median(once.cells["adhesion"].std) > 0.01  # 0.02 over a few independent metres
    days = [
        ("monday", drive(*lanes(6, 60, 2))),
        ("friday", drive(*lanes(6, 60, 2), a=lambda e, n: 0.5 + 0 * e)),
    ]
    changed = map_of(days)
    assert not any(re.match("adhesion: passes", note) for note in changed.notes)
    assert changed.changes["adhesion"].significant.mean() > 0.9


@pytest.mark.parametrize(
    ("mass", "lanes_apart", "width", "cell"),
    [
        (5.0, 3.0, None, 0.4),
        (139.0, 8.0, None, 1.0),
        (139.0, 2.9, None, 2.9),
        (12000.0, 3.3, None, 3.3),
        (12000.0, 2.0, None, 5.0),
        (12000.0, 8.0, None, 8.0),
        (60.0, 3.0, 0.5, 0.5),
        (12000.0, 8.0, 6.0, 6.0),
    ],
)
def test_cells_are_as_wide_as_the_machine_works_or_as_large_as_it_is(
    mass: float, lanes_apart: float, width: float | None, cell: float
) -> None:
    """Its lanes show the width where nobody states it; cells narrower than lanes are stripes with nothing between them."""
    one = drive(*lanes(6, 60, lanes_apart))
    data = one.about["vehicle"] | {"mass": mass, "working_width": width}
    data["axles"] = {name: axle | {"mass": mass / 2} for name, axle in data["axles"].items()}
    one.about["vehicle"] = {key: value for key, value in data.items() if value is not None}
    assert map_of([("a", one)]).cell == cell


@pytest.mark.parametrize(("rounded", "noise", "cell"), [(0.0, 0.0, 1.0), (0.9, 0.0, 2.0), (0.0, 0.4, 2.0)])
def test_cells_are_no_smaller_than_the_positions_are_good(rounded: float, noise: float, cell: float) -> None:
    one, rng = drive(*lanes(6, 40, 5)), np.random.default_rng(1)
    for name in ("latitude", "longitude"):
        degree = np.radians(EARTH) * (1.0 if name == "latitude" else np.cos(np.radians(51.0)))
        moved = one[name] * degree + noise * rng.standard_normal(len(one))
        one.columns[name] = (np.round(moved / rounded) * rounded if rounded else moved) / degree
    assert map_of([("a", one)]).cell == cell


def test_change_between_days_is_significant_where_it_is_one() -> None:
    way = lanes(10, 40, 2)
    before = drive(*way, noise=0.01, seed=1)
    after = drive(*way, a=lambda e, n: np.where(e < 20, 0.8, 1.0), noise=0.01, seed=2)
    changes = layer(map_of([("monday", before), ("friday", after)]), "changes")
    changes = changes[(changes.quantity == "adhesion") & (changes.first_run != changes.last_run)]
    east = local_east(changes)
    assert changes.significant[east < 18].mean() > 0.9
    assert changes.significant[east > 22].mean() < 0.06
    assert np.median(changes["difference"][east < 18]) == pytest.approx(-0.2 * REFERENCE, rel=0.05)


@pytest.mark.parametrize(("share", "doubted"), [(0.04, True), (0.3, False)])
def test_a_field_that_changed_as_a_whole_may_be_a_machine_whose_zeros_moved(
    share: float, doubted: bool
) -> None:
    """Its torques are stated to 3 %: 4 % more everywhere on another day is no evidence of other ground, 30 % more is."""
    days = []
    for day, more in (("monday", 0.0), ("friday", share)):
        one = drive(*lanes(8, 40, 2), noise=0.005, std=0.02)
        one.about["vehicle"]["uncertainty"] = {"drive_torque_gain_common": 0.03}
        for wheel in one.wheels:
            one.columns[f"adhesion_{wheel}"] *= 1 + more
        days.append((day, one))
    made = map_of(days)
    assert made.changes["adhesion"].significant.mean() > 0.5
    assert any("adhesion: most cells changed" in note for note in made.notes) is doubted


def test_an_uncertain_zero_of_slip_is_no_change_where_another_day_slips_less() -> None:
    way, days = lanes(6, 40, 2), []
    for slip in (0.1, 0.05):
        one = drive(*way, slip=slip, noise=0.01)
        one.about["vehicle"]["uncertainty"] = {"wheel_radius": 0.01}
        for wheel in one.wheels:  # the rolling radius is 1 % less than the file says
            one.columns[f"slip_{wheel}"] = np.full(len(one), slip + 0.01)
            one.columns[f"slip_{wheel}_std"] = np.full(len(one), 0.011)
        days.append((f"{slip}", one))
    assert not map_of(days).changes["adhesion"].significant.any()


def on_a_slope(way: tuple[np.ndarray, np.ndarray], grade: float) -> Estimates:
    """A drive up to the east by `grade`, which no sensor measures, over soil of resistance .1."""
    one = drive(*way)
    heading = np.arctan2(np.gradient(way[1]), np.gradient(way[0]))
    one.columns["soil_resistance"] = 0.1 + grade * np.cos(heading)
    one.columns["soil_resistance_std"] = np.full(len(one), 0.022)
    one.about["vehicle"]["uncertainty"] = {"slope": 0.02, "acceleration_bias": 0.03}
    one.about["settings"] = {"channels": ["ground_speed"]}
    return one


def test_a_slope_that_nothing_measures_is_found_by_lanes_driven_both_ways() -> None:
    cells = map_of([("a", on_a_slope(lanes(6, 40, 2), 0.03))]).cells["soil_resistance"]
    np.testing.assert_allclose(cells.value, 0.1, atol=0.004)
    assert np.median(cells.std) < 0.011


def test_lanes_driven_one_way_leave_a_slope_in_the_interval() -> None:
    east = np.arange(0.0, 40.0, 0.05)
    up, down = (on_a_slope((x, 0 * x), 0.015) for x in (east, east[::-1]))
    assert np.all(map_of([("up", up)]).cells["soil_resistance"].std > 0.0199)
    assert not map_of([("up", up), ("down", down)]).changes["soil_resistance"].significant.any()


def test_a_single_pass_has_no_changes_and_says_so() -> None:
    made = map_of([("a", drive(*lanes(1, 40, 2)))])
    assert not made.changes
    assert any("driven once" in note for note in made.notes)


@pytest.mark.parametrize(
    ("latitude", "longitude", "epsg"),
    [
        (-16.8, (179.999, -179.999), {32701, 32760}),
        (60.4, (5.3, 5.31), {32632}),
        (51.2, (11.999, 12.002), {32633}),
    ],
    ids=["both sides of 180 degrees", "Norway", "two zones"],
)
def test_the_grid_is_the_zone_of_the_middle(
    latitude: float, longitude: tuple[float, float], epsg: set[int]
) -> None:
    assert zone_of(np.full(2, latitude), np.array(longitude)) in epsg


def test_headlands_are_apart_from_the_field() -> None:
    made = map_of([("a", drive(*lanes(6, 40, 6)))])
    assert 0.05 < np.mean(cell_table(made)["headland"] > 0.5) < 0.4
    assert made.points.headland.any()


def test_outages_and_jumps_are_cut_not_smeared() -> None:
    east, north = lanes(1, 100, 2)
    estimates = drive(east, north)
    latitude = estimates["latitude"].copy()
    latitude[(east > 40) & (east < 60)] = np.nan
    latitude[(east > 70) & (east < 72)] += np.degrees(20.0 / EARTH)
    estimates.columns["latitude"] = latitude
    made = map_of([("a", estimates)])
    x = local_east(layer(made, "cells"))
    assert not ((x > 42) & (x < 58)).any()
    assert ((x > 80) & (x < 99)).sum() > 15
    assert any("outage" in note for note in made.notes)
    assert any("jump" in note for note in made.notes)


@pytest.mark.parametrize("pause", [0.0, 30 * 86400.0])
def test_positions_behind_the_wheels_are_moved_back(pause: float) -> None:
    estimates = drive(*lanes(4, 60, 3))
    time = estimates.time
    pace = 1 + 0.6 * np.sin(0.5 * time) * (time > 5)  # a drive whose speed varies, or no lag could be seen
    scaled = np.r_[0.0, np.cumsum(np.diff(time) / pace[1:])]
    for wheel in estimates.wheels:
        estimates.columns[f"wheel_speed_{wheel}"] = estimates[f"wheel_speed_{wheel}"] * pace
    estimates.columns["ground_speed"] = pace
    late = {n: np.interp(scaled - 0.4, scaled, estimates[n]) for n in ("latitude", "longitude")}
    estimates.columns.update(late)
    scaled = scaled + pause * (np.arange(len(scaled)) > len(scaled) // 2)
    places = places_of(replace(estimates, time=scaled), 32633)
    assert any(
        re.match(r"The positions are 0\.(3[5-9]|4[0-5]) .* behind the wheels", note) for note in places.notes
    )


def test_kriging_fills_between_lanes_with_a_wider_interval() -> None:
    pytest.importorskip("pykrige", reason="needs terragrip[geo]")
    estimates = drive(*lanes(8, 40, 4), a=lambda e, n: 1 + 0.2 * np.sin(e / 8), noise=0.01)
    cells = map_of([("a", estimates)], MapSettings(cell=1.0, fill=2.0)).cells["adhesion"]
    filled = cells.count == 0
    assert filled.sum() > 100
    assert np.all(np.isfinite(cells.value))
    assert np.median(cells.std[filled]) > np.median(cells.std[~filled])


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # rasterio's own products of affine maps
@pytest.mark.parametrize("suffix", [".gpkg", ".parquet", ".geojson", ".tif", ".png"])
def test_files_are_read_back_by_others(tmp_path: Path, suffix: str) -> None:
    import rasterio

    made = map_of([("a", drive(*lanes(3, 30, 2), a=lambda e, n: np.where(e < 15, 0.5, 1.0)))])
    path = tmp_path / f"map{suffix}"
    write_map(made, path)
    cells, table = made.cells["adhesion"], cell_table(made)
    if suffix == ".tif":
        with rasterio.open(path) as file:
            assert file.crs.to_epsg() == made.epsg == 32633
            about, bands = (
                file.tags()["TERRAGRIP_MAP"],
                dict(zip(file.descriptions, file.read(), strict=True)),
            )
            row = round(file.bounds.top / made.cell) - 1 - cells.row[0]
            column = cells.column[0] - round(file.bounds.left / made.cell)
        assert bands["adhesion"][row, column] == pytest.approx(cells.value[0], rel=1e-6)
        assert bands["adhesion_std"][row, column] == pytest.approx(cells.std[0], rel=1e-6)
        assert np.isfinite(bands["adhesion"]).sum() == len(cells)
        assert json.loads(about)["reference_slip"] == made.reference_slip
    elif suffix == ".png":
        assert path.read_bytes()[:4] == b"\x89PNG"
    else:
        frame = _read(path)
        np.testing.assert_allclose(frame["adhesion"], table["adhesion"], rtol=1e-9)
        wanted = {"adhesion_std", "count", "passes", "soil", "soil_probability", "soil_resistance"}
        assert wanted <= set(frame.columns)
        assert frame.crs.to_epsg() == (4326 if suffix == ".geojson" else 32633)
        np.testing.assert_allclose(frame.to_crs(32633).geometry.area, made.cell**2, rtol=1e-2)


def _read(path: Path) -> geopandas.GeoDataFrame:
    import geopandas

    if path.suffix == ".parquet":
        return geopandas.read_parquet(path)
    return geopandas.read_file(path, layer="cells") if path.suffix == ".gpkg" else geopandas.read_file(path)


def test_soil_of_a_cell_is_the_label_of_most_metres() -> None:
    east, north = lanes(2, 40, 3)
    estimates = drive(east, north)
    estimates.labels["soil"][:] = np.where(east < 20, "sand", "clay")
    made = map_of([("a", estimates)])
    assert {name for name, _ in made.soil.values()} == {"sand", "clay"}
    assert sum(share == 1.0 for _, share in made.soil.values()) > 0.8 * len(made.soil)


def test_slip_alone_gives_a_map_of_slip() -> None:
    estimates = drive(*lanes(4, 40, 3))
    for name in [n for n in estimates.columns if n.startswith(("adhesion", "soil_res", "efficiency"))]:
        del estimates.columns[name]
    assert list(map_of([("a", estimates)]).cells) == ["slip"]


def test_a_cell_too_small_for_the_memory_is_refused_with_one_that_would_do() -> None:
    maker = MapMaker(MapSettings(cell=0.001))
    with pytest.raises(InputError, match=r"--cell.*take [\d.]+ m or more"):
        maker.add(drive(*lanes(4, 60, 3)), "a")


def test_a_drive_trains_speed_alone_gives_a_map_of_slip_in_the_middle_of_the_driven_wheels() -> None:
    """A stock tractor tells one slip for all driven wheels; its estimates have no column of a wheel."""
    wheels = drive(*lanes(2, 60, 6), slip=0.12)
    columns = {
        n: v
        for n, v in wheels.columns.items()
        if not n.startswith(("slip_", "adhesion_", "efficiency_", "net_", "soil_"))
    }
    columns |= {"slip_drive": np.full(len(wheels), 0.12), "slip_drive_std": np.full(len(wheels), 0.02)}
    made = map_of([("a", replace(wheels, columns=columns))])
    assert set(made.cells) == {"slip"}
    np.testing.assert_allclose(made.cells["slip"].value, 0.12)
    assert len(made.cells["slip"]) > 0.8 * len(map_of([("a", wheels)]).cells["slip"]) / 2

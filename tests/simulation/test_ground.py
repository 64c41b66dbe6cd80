"""Random fields, routes and borders."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.simulation import Scenario
from terragrip.simulation import terrain as terrain_module
from terragrip.simulation.fields import Field, clods, roughness, stream
from terragrip.simulation.route import EARTH_RADIUS, geographic, inside, lay
from terragrip.simulation.scenario import Plot, Route


def test_field_has_the_matern_covariance():
    """Matérn 3/2: (1 + √3 d/l) exp(-√3 d/l), averaged over many fields."""
    distance, length = np.array([0.0, 0.4, 0.8, 2.0]), 0.8
    values = np.array(
        [Field(np.random.default_rng(k), length).at(distance, 0 * distance) for k in range(4000)]
    )
    u = np.sqrt(3) * distance / length
    np.testing.assert_allclose((values[:, :1] * values).mean(axis=0), (1 + u) * np.exp(-u), atol=0.06)
    assert abs(values.mean()) < 0.05


def test_field_is_the_same_place_whatever_path_crosses_it():
    east, north = np.random.default_rng(0).uniform(-20, 20, (2, 50))
    field = Field(stream(7, "adhesion fine"), 1.0)
    again = Field(stream(7, "adhesion fine"), 1.0)
    np.testing.assert_array_equal(field.at(east, north)[::-1], again.at(east[::-1], north[::-1]))
    assert not np.allclose(field.at(east, north), Field(stream(7, "adhesion wet"), 1.0).at(east, north))


def test_slope_is_the_derivative_along_the_heading():
    field, heading, h = Field(np.random.default_rng(1), 5.0, smooth=True), np.full(20, 0.7), 1e-4
    east, north = np.random.default_rng(2).uniform(-20, 20, (2, 20))
    ahead = field.at(east + h * np.cos(0.7), north + h * np.sin(0.7))
    behind = field.at(east - h * np.cos(0.7), north - h * np.sin(0.7))
    np.testing.assert_allclose(field.slope(east, north, heading), (ahead - behind) / (2 * h), atol=1e-7)


def test_roughness_has_unit_variance_and_no_bump_shorter_than_the_tyre():
    profiles = np.array([roughness(np.random.default_rng(k), 2000, 0.02) for k in range(200)])
    assert profiles.var() == pytest.approx(1.0, rel=0.1)
    power = (np.abs(np.fft.rfft(profiles[:, :2000] * np.hanning(2000))) ** 2).mean(axis=0)
    wave = np.fft.rfftfreq(2000, 0.02)
    assert power[wave > 1 / 0.12].sum() < 1e-3 * power.sum()


def test_clods_lie_where_their_soil_is():
    x = np.arange(0, 400, 0.02)
    density = np.where(x < 200, 0.5, 0.0)
    bumps = clods(np.random.default_rng(4), x, density, np.full(len(x), 0.02), np.full(len(x), 0.2))
    assert np.all(bumps[x > 200.2] == 0)
    tops = np.flatnonzero((bumps[1:-1] > bumps[:-2]) & (bumps[1:-1] >= bumps[2:]) & (bumps[1:-1] > 0.005))
    assert 70 < len(tops) < 130  # 100 expected, a few merge
    assert bumps[tops + 1].min() >= 0.01


def test_polygon():
    plot = Plot(soil="fine", corners=((0, 0), (4, 0), (4, 3), (2, 1), (0, 3)))
    points = np.array([[1, 1], [2, 0.5], [2, 2], [3.9, 2.5], [5, 1], [-1, 1], [1, -0.1]])
    assert inside(plot, *points.T).tolist() == [True, True, False, True, False, False, False]


def test_rounded_path_keeps_its_corners_and_closes_up():
    route = Route(path=((0, 0), (20, 0), (20, 6), (0, 6)), around="grass", turn_radius=3)
    path = lay(route, 2.0, 1.0, 0.01)
    arc = np.pi / 2 * 3
    assert path.x[-1] - 1.0 == pytest.approx(17 + arc + 0 + arc + 17, abs=0.02)
    end = np.searchsorted(path.x, 34 + 2 * arc)
    assert (path.east[end], path.north[end]) == (pytest.approx(0, abs=0.03), pytest.approx(6, abs=0.03))
    assert path.heading[end] == pytest.approx(np.pi, abs=0.01)
    assert path.curvature.max() == pytest.approx(1 / 3)


def test_left_is_left():
    path = lay(Route(path=((0, 0), (0, 10)), around="grass"), 0, 0, 0.1)
    east, north = path.beside(0.5)
    np.testing.assert_allclose(east, -0.5, atol=1e-12)
    np.testing.assert_allclose(north, path.north, atol=1e-12)


def two_soils(border, skew=0.0, **route):
    return Scenario.from_dict(
        {
            "sensors": {"use": "exact"},
            "route": {
                "segments": [{"soil": "fine", "length": 5}, {"soil": "grass", "length": 9}],
                "border": border,
                "skew": skew,
            }
            | route,
            "soils": {
                "fine": {"curve": {"name": "exponential", "a": 0.85}, "resistance": 0.12},
                "grass": {"curve": {"name": "exponential", "a": 0.4}, "resistance": 0.07},
            },
            "tools": [{"mass": 40, "dig_in": 20}],
            "speed": [[0, 0], [1, 0.5]],
            "duration": 25,
        }
    )


@pytest.mark.parametrize("border", [0.2, 0.6])
def test_border_is_a_ramp_of_its_width(border):
    ground = terrain_module.build(two_soils(border), two_soils(border).nominal_vehicle(), 0)
    x, rho = ground.path.x, ground.tracks[0].resistance
    np.testing.assert_allclose(
        rho, np.interp(x, [5 - border / 2, 5 + border / 2], [0.12, 0.07]), atol=0.05 * 0.02 / border
    )


def test_axles_and_tool_cross_a_border_one_after_another():
    from terragrip.simulation import simulate

    truth = simulate(two_soils(0.4)).truth
    when = {
        name: truth.time[(truth[f"soil_{name}"] == "grass").idxmax()] for name in ("front", "rear", "tool1")
    }
    assert when["front"] < when["rear"] < when["tool1"]
    where = {name: truth.true_distance[truth.time == t].iloc[0] for name, t in when.items()}
    assert where["front"] == pytest.approx(5 - 0.638, abs=0.03)
    assert where["rear"] == pytest.approx(5, abs=0.03)
    assert where["tool1"] == pytest.approx(5 + 2.1, abs=0.06)
    mixed = truth[truth.transition]
    assert mixed.time.min() < when["front"]
    assert mixed.time.max() > when["tool1"]
    assert not truth.transition.iloc[-1]


def test_front_wheels_feel_the_new_soil_first_and_the_right_track_later():
    from terragrip.simulation import simulate

    truth = simulate(two_soils(0.4, skew=0.3)).truth
    reached = {}
    for wheel in ("fl", "fr", "rl", "rr"):
        stiffness = truth[f"true_adhesion_{wheel}"] / truth[f"true_slip_{wheel}"]
        reached[wheel] = truth.true_distance[(stiffness < 3.0) & (truth.time > 3)].min()
    assert reached["fl"] < reached["fr"] < reached["rl"] < reached["rr"]
    assert reached["fr"] - reached["fl"] == pytest.approx(0.3, abs=0.06)


def test_geographic_metres():
    route = Route(segments=({"soil": "fine", "length": 5},), latitude=51, longitude=13)
    latitude, longitude = geographic(route, np.array([0.0, 100.0]), np.array([0.0, 50.0]))
    north = np.radians(latitude[1] - latitude[0]) * EARTH_RADIUS
    east = np.radians(longitude[1] - longitude[0]) * EARTH_RADIUS * np.cos(np.radians(51))
    assert (east, north) == (pytest.approx(100), pytest.approx(50))


@pytest.mark.parametrize(
    ("soil", "low", "high"), [("hard", 0.7, 2.0), ("fine", 1.4, 4.0), ("coarse", 2.8, 12.0)]
)
def test_rough_ground_shifts_load_between_wheels_but_not_on_average(drive, soil, low, high):
    """Per cent of each wheel's load (docs/simulation.md)."""
    scenario = Scenario.from_dict(
        {
            "sensors": {"use": "exact"},
            "route": {"segments": [{"soil": soil, "length": 60}]},
            "speed": [[0, 0], [1, 0.6]],
            "duration": 60,
        }
    )
    trace = drive(scenario, stride=10)
    load = trace["load"][trace["time"] > 5]
    spread = 100 * load.std(axis=0) / load.mean(axis=0)
    assert np.all(spread > low)
    assert np.all(spread < high)
    np.testing.assert_allclose(load.sum(axis=1).mean(), 139 * 9.80665, rtol=2e-3)


def test_soil_variation_has_the_asked_mean_and_spread():
    """Over many metres and seeds: mean 1, relative SD as the library says."""
    scenario = two_soils(0.4)
    soil = scenario.soils["fine"].model_copy(update={"adhesion_variation": 0.15, "correlation_length": 0.5})
    scenario = scenario.model_copy(update={"soils": scenario.soils | {"fine": soil}})
    scales = []
    for seed in range(80):
        ground = terrain_module.build(scenario, scenario.nominal_vehicle(), seed)
        scales.append(ground.tracks[0].adhesion_scale[ground.path.x < 4.5])
    assert np.mean(scales) == pytest.approx(1.0, abs=0.02)
    assert np.std(scales) == pytest.approx(0.15, rel=0.08)

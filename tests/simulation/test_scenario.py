"""Scenario files: what is read, what is merged, what is refused and how."""

from __future__ import annotations

import pytest

from terragrip.errors import InputError
from terragrip.simulation import Scenario, scenario_names, set_runs

BASE = """
sensors: {use: exact}
route: {segments: [{soil: fine, length: 30 m}]}
tools: [cultipacker]
speed: [[0, off], [2, 0], [3, 0.5]]
duration: 10 s
"""


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "drive.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_every_scenario_of_the_package_is_valid():
    names = scenario_names()
    assert {"constant", "accuracy-clean", "accuracy-faults", "multi1", "multi2", "hard-01"} <= set(names)
    for name in names:
        scenario = Scenario.load(name)
        assert scenario.name == name
        assert scenario.nominal_vehicle().wheels == ("fl", "fr", "rl", "rr")


def test_the_campaign_is_the_papers():
    runs = set_runs("campaign")
    assert len(runs) == len(set(runs)) == 68
    assert runs[-2:] == ("multi1", "multi2")
    soils = {Scenario.load(name).route.soils() for name in runs[:-2]}
    assert soils == {("hard",), ("fine",), ("wet",), ("coarse",), ("grass",)}
    a = {s: Scenario.load(f"{s}-01").soils[s].curve["a"] for (s,) in soils}
    assert a == {"hard": 1.42, "fine": 0.85, "wet": 0.83, "coarse": 0.91, "grass": 0.40}


def test_file_with_units_and_library(file):
    scenario = Scenario.load(file(BASE))
    assert scenario.name == "drive"
    assert scenario.tools[0].mass == 60
    assert scenario.speed[0][1] == "off"
    assert scenario.route.segments[0].length == 30
    assert scenario.sensors.drawbar_force.rate == 100


def test_use_merges_and_extends_inherits(file):
    scenario = Scenario.load(
        file(
            "extends: accuracy-clean\ntools: [{use: frame, dig_in: {hard: 5}}]\n"
            "sensors: {ground_speed: {noise: 0.5}}\nsoils: {hard: {use: hard, resistance: 0.06}}\n"
        )
    )
    clean = Scenario.load("accuracy-clean")
    assert scenario.route == clean.route
    assert scenario.sensors.ground_speed.noise == 0.5
    assert scenario.sensors.ground_speed.rate == 100
    assert scenario.sensors.wheel_speed == clean.sensors.wheel_speed
    assert scenario.tools[0].dig_in["hard"] == 5
    assert scenario.tools[0].dig_in["coarse"] == 60
    assert (scenario.soils["hard"].resistance, scenario.soils["hard"].curve["a"]) == (0.06, 1.42)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ("duration: 10 s\nspede: 3", r"drive.yaml: spede \(line \d+\): unknown key; did you mean speed"),
        ("duration: -3", r"duration \(line 6\): -3 is impossible; it must be at least 0.1"),
        ("duration: 10 kg", r"duration \(line 6\): .*measures a mass"),
        ("duration: 10\ntools: [plough]", r"the key occurs twice"),
        ("duration: 10\nvehicle: tractor", r"vehicle: nothing called 'tractor' in the library's vehicles"),
        (
            "duration: 10\nextends: acuracy-clean",
            r"extends: no scenario 'acuracy-clean'; did you mean accuracy-clean",
        ),
        (
            "duration: 10\nsoils: {mud: {curve: {name: magic}, resistance: 0.2}}",
            r"soils.mud.curve.name.*no such curve; curves are",
        ),
        (
            "duration: 10\nsoils: {mud: {curve: {name: exponential, b: 1}, resistance: 0.2}}",
            r"exponential has no such parameter",
        ),
        ("duration: 10\nsoft_spots: [{rear: 1}]", r"soft_spots.0.*needs one place"),
        ("duration: 10\nlog_rate: 333", r"log_rate.*whole number of steps"),
        ("duration: 10\nfaults: [{kind: gap}]", r"faults.0.*a gap needs a duration"),
    ],
)
def test_refusals_name_file_place_and_mend(file, change, complaint):
    path = file(BASE.replace("duration: 10 s", change))
    with pytest.raises(InputError, match=complaint) as caught:
        Scenario.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("soil: fine", "soil: fien", "the route's soil 'fien' is not known; soils are hard"),
        ("length: 30 m", "length: 0.3 m", "shorter than two borders"),
        ("length: 30 m", "length: 90 km", "is 90000 m long"),
        ("[cultipacker]", "[{use: cultipacker, friction: {hrad: 0.1}}]", "no such soil; soils are hard"),
        ("[cultipacker]", "[cultipacker, roller, frame]", "at most 2"),
        ("[[0, off], [2, 0], [3, 0.5]]", "[[0, 0], [3, 0.5], [3, 0]]", "times must start at 0 and rise"),
        ("[[0, off], [2, 0], [3, 0.5]]", "fast", "not a list of points"),
        ("{segments: [{soil: fine, length: 30 m}]}", "{}", "needs either segments or a path"),
        (
            "{segments: [{soil: fine, length: 30 m}]}",
            "{path: [[0, 0], [5, 5]]}",
            "two points and the soil around",
        ),
    ],
)
def test_impossible_scenarios_are_refused(file, old, new, complaint):
    with pytest.raises(InputError, match=complaint):
        Scenario.load(file(BASE.replace(old, new)))


def test_unknown_names(tmp_path):
    with pytest.raises(InputError, match=r"no scenario 'multi3'; did you mean multi[12]"):
        Scenario.load("multi3")
    with pytest.raises(InputError, match="no such file"):
        Scenario.load(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="no scenario set 'campain'"):
        set_runs("campain")


def test_a_machine_the_plant_does_not_know_is_refused(quiet):
    from terragrip.simulation import simulate

    robot = {
        "mass": 50,
        "axles": {"only": {"mass": 50, "wheels": ["l", "r"]}},
        "wheel": {"radius": 0.2, "inertia": 0.1},
    }
    with pytest.raises(InputError, match="one to four axles"):
        simulate(quiet(vehicle=robot))


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"robot": {"tire_stiffness": 9e5}, "step": 0.005, "log_rate": 200}, "robot.tire_stiffness"),
        ({"tools": [{"mass": 1, "damping": 900}]}, "tools.0.stiffness"),
    ],
)
def test_what_a_step_cannot_resolve_is_refused(quiet, change, place):
    from terragrip.simulation import simulate

    with pytest.raises(
        InputError, match=rf"quiet: {place}: .* too stiff for steps of .*; use a smaller 'step:'"
    ):
        simulate(quiet(**change))


def test_nothing_left_to_record_is_refused(quiet):
    from terragrip.simulation import simulate

    with pytest.raises(InputError, match="no sensor reads anything"):
        simulate(quiet(faults=[{"kind": "gap", "at": 0, "duration": 100}]))
    with pytest.raises(InputError, match="seed -1 is negative"):
        simulate(quiet(), seed=-1)


def test_a_sensor_on_a_wheel_that_is_not_there_is_refused(quiet):
    from terragrip.simulation import simulate

    with pytest.raises(
        InputError, match=r"sensors.wheel_speed.wheels: no wheel 'xx'; wheels are fl, fr, rl, rr"
    ):
        simulate(quiet(sensors={"wheel_speed": {"rate": 10, "wheels": ["xx"]}}))


@pytest.mark.parametrize(
    ("spot", "expected"),
    [
        ({"at": 5, "length": 1.0, "edge": 0.6}, "two edges are longer than it"),
        ({"at": 5, "adhesion_loss": 0.6, "adhesion_fall": 0.6}, "more adhesion is lost than there is"),
    ],
)
def test_an_impossible_soft_spot_is_refused(spot, expected):
    with pytest.raises(InputError, match=expected):
        Scenario.from_dict({"extends": "constant", "soft_spots": [spot]})

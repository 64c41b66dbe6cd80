"""The vehicle file: what it gives, and what it refuses with file, key, line and hint."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.vehicle import Vehicle
from terragrip.vehicle_parts import Axle, Calibration, Sensors, Uncertainty, Wheel

GOOD = """\
name: Innok Heros 444
mass: 139 kg
wheelbase: 0.638 m
track: 0.554 m
center_of_gravity_height: 0.30 m
hitch_height: 0.25 m
axles:
  front: {mass: 54 kg, wheels: [fl, fr]}
  rear:  {mass: 85 kg, wheels: [rl, rr]}
wheel: {radius: 0.20 m, inertia: 0.15 kg m^2}
tire_rolling_resistance: 0.02
bearing_resistance: 2.0 N s/rad
sensors: {wheel_speed: 0.03 rad/s, drawbar_force: 4 N}
uncertainty: {drive_torque_gain: 0.02, drawbar_offset: 3 N, slope: 0.5 deg}
"""


def load(folder: Path, text: str) -> Vehicle:
    path = folder / "vehicle.yaml"
    path.write_text(text)
    return Vehicle.load(path)


def test_numbers_are_si(tmp_path: Path) -> None:
    vehicle = load(tmp_path, GOOD.replace("0.638 m", "638 mm"))
    assert (vehicle.mass, vehicle.bearing_resistance) == (139.0, 2.0)
    assert vehicle.wheelbase == pytest.approx(0.638)
    assert vehicle.uncertainty.slope == pytest.approx(np.deg2rad(0.5))
    assert vehicle.sensors.ground_speed is None


def test_arrays_follow_the_wheels(tmp_path: Path) -> None:
    text = GOOD.replace(
        "  rear:  {mass: 85 kg, wheels: [rl, rr]}",
        "  rear:  {mass: 85 kg, wheels: [rl, rr], driven: false, wheel: {radius: 0.3 m, inertia: 0.5 kg m^2}}",
    )
    text += "calibration: {drive_torque_gain: {fr: 1.02}, drive_torque_offset: {fl: -0.5 N m}}\n"
    vehicle = load(tmp_path, text)
    assert vehicle.wheels == ("fl", "fr", "rl", "rr")
    assert vehicle.axle_names == ("front", "rear")
    np.testing.assert_array_equal(vehicle.wheel_axle, [0, 0, 1, 1])
    np.testing.assert_array_equal(vehicle.wheel_radius, [0.2, 0.2, 0.3, 0.3])
    np.testing.assert_array_equal(vehicle.wheel_inertia, [0.15, 0.15, 0.5, 0.5])
    np.testing.assert_array_equal(vehicle.driven, [True, True, False, False])
    np.testing.assert_array_equal(vehicle.drive_torque_gain, [1, 1.02, 1, 1])
    np.testing.assert_array_equal(vehicle.drive_torque_offset, [-0.5, 0, 0, 0])
    # Moments about the rear axle: the front one carries m_f at the wheelbase.
    assert vehicle.center_of_gravity_to_rear == pytest.approx(0.638 * 54 / 139)
    with pytest.raises(ValueError, match="read-only"):
        vehicle.wheel_radius[0] = 1.0


FORWARDER = """\
mass: 16 t
wheelbase: 5 m
center_of_gravity_height: 1.2 m
payload: {x: 0.5 m, z: 1.9 m}
axles:
  front1: {mass: 5 t, wheels: [a, b], x: 5 m}
  front2: {mass: 5 t, wheels: [c, d], x: 500 cm}
  rear1: {mass: 3 t, wheels: [e, f], x: 0}
  rear2: {mass: 3 t, wheels: [g, h]}
wheel: {radius: 0.65 m, inertia: 90 kg m^2}
"""


def test_axles_of_a_bogie_share_what_its_pivot_carries(tmp_path: Path) -> None:
    vehicle = load(tmp_path, FORWARDER)
    np.testing.assert_allclose(vehicle.axle_to_rear, [5, 5, 0, 0])
    # a tenth of the timber is on the front pivot, and a pull lifts that as if there were two axles
    np.testing.assert_allclose(vehicle.payload_share, [0.05, 0.05, 0.45, 0.45])
    lifted = 16e3 * 1.0 * 1.2 / 5 / 2
    change = vehicle.axle_loads(acceleration=1.0) - vehicle.axle_loads()
    np.testing.assert_allclose(change, [-lifted, -lifted, lifted, lifted])


@pytest.mark.parametrize(
    ("old", "new", "wrong"),
    [
        (", x: 500 cm", "", ("axles.front2.x", "is missing")),
        ("x: 5 m}", "x: 6.5 m}", ("axles.front1.x", "is 6.5 m; the first axle is the wheelbase, 5 m")),
        ("wheels: [g, h]", "wheels: [g, h], x: 0.2 m", ("axles.rear2.x", "is 0.2 m")),
        ("x: 500 cm", "x: 6 m", ("axles.front2.x", "is ahead of the axle before it")),
    ],
)
def test_places_of_axles_that_cannot_be_are_refused(
    tmp_path: Path, old: str, new: str, wrong: tuple[str, str]
) -> None:
    with pytest.raises(InputError) as refused:
        load(tmp_path, FORWARDER.replace(old, new, 1))
    assert all(part in str(refused.value) for part in wrong)


def test_one_axle_needs_no_wheelbase() -> None:
    vehicle = Vehicle.from_dict(
        {
            "mass": 250,
            "axles": {"all": {"mass": 250, "wheels": ["l", "r"], "wheel": {"radius": 0.3, "inertia": 1}}},
        }
    )
    assert vehicle.center_of_gravity_to_rear == 0.0
    assert vehicle.wheelbase is None


def test_three_axles_are_evenly_spaced() -> None:
    axles = {f"a{k}": {"mass": mass, "wheels": [f"l{k}", f"r{k}"]} for k, mass in enumerate((100, 50, 50))}
    vehicle = Vehicle.from_dict(
        {
            "mass": 200,
            "wheelbase": 2,
            "center_of_gravity_height": 0.5,
            "axles": axles,
            "wheel": {"radius": 0.3, "inertia": 1},
        }
    )
    np.testing.assert_allclose(vehicle.axle_to_rear, [2, 1, 0])
    assert vehicle.center_of_gravity_to_rear == pytest.approx((100 * 2 + 50 * 1) / 200)


@pytest.mark.parametrize(
    "model",
    [
        "{name: fixed}",
        "{name: hadekel, pressure: 80 kPa}",
        "{name: biderman, C1: 1e-6 m^2/N, C2: 2 1/m, p0: 20 kPa, pressure: 0.8 bar}",
    ],
)
def test_save_and_load_round_trip(tmp_path: Path, model: str) -> None:
    text = GOOD.replace("0.15 kg m^2}", f"0.15 kg m^2, width: 0.1 m, radius_model: {model}}}")
    text += "calibration: {drive_torque_gain: {fr: 1.0234567890123}, pitch_offset: -0.3 deg}\n"
    vehicle = load(tmp_path, text)
    vehicle.save(tmp_path / "saved.yaml")
    assert Vehicle.load(tmp_path / "saved.yaml") == vehicle
    assert Vehicle.from_dict(vehicle.to_dict()) == vehicle
    assert sorted(p.name for p in tmp_path.iterdir()) == ["saved.yaml", "vehicle.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "place", "problem", "hint"),
    [
        ("mass: 139 kg", "mass: -139 kg", "mass (line 2)", "-139 kg is impossible", "exceed 0 kg"),
        ("mass: 139 kg", "mass: 139 N", "mass (line 2)", "measures a force, where a mass is needed", "kg"),
        ("mass: 139 kg", "mass: 139 kilo", "mass (line 2)", "is not a unit", "N m"),
        ("mass: 139 kg", "mass: heavy", "mass (line 2)", "not a number with a unit", "1.5 kg"),
        ("mass: 139 kg", "mass: .nan", "mass (line 2)", "not a finite number", "1.5 kg"),
        ("mass: 54 kg", "mass: 45 kg", "axles (line 7)", "the axles carry 130 kg, the vehicle has 139 kg", "add up"),
        ("track:", "trak:", "trak (line 4)", "unknown key", "did you mean track?"),
        ("mass: 54 kg", "mas: 54 kg", "axles.front.mas (line 8)", "unknown key", "did you mean mass?"),
        ("0.20 m", "200", "wheel.radius (line 10)", "200 m is impossible", "200 mm or 200 cm? write '200 mm' or '200 cm'"),
        ("0.20 m", "8", "wheel.radius (line 10)", "8 m is impossible", "write '8 cm' or '8 in'"),
        ("0.20 m", "0,20 m", "wheel.20 m (line 10)", "unknown key", "write a decimal point ('0.20 m')"),
        ("0.20 m", "0 m", "wheel.radius (line 10)", "0 m is impossible", "at least 0.01 m"),
        ("0.30 m", "12 m", "center_of_gravity_height (line 5)", "12 m is impossible", "not exceed 5 m"),
        ("slope: 0.5 deg", "tire_rolling_resistance: 30 %",
         "uncertainty.tire_rolling_resistance (line 14)", "0.3 is impossible", "not exceed 0.15"),
        ("slope: 0.5 deg", "slope: 5", "uncertainty.slope (line 14)", "5 rad is impossible", "write '5 deg'"),
        ("[fl, fr]", "[rl, fr]", "axles.front.wheels (line 8)", "the wheel rl occurs twice", "own name"),
        ("[fl, fr]", "[yes, no]", "axles.front.wheels (line 8)", "reads a wheel name as yes or no", "quotes"),
        ("[fl, fr]", "[f l, fr]", "axles.front.wheels (line 8)", "'f l' is not a wheel name", "underscores"),
        ("[fl, fr]", "[a, b, c, d, e, f, g]", "axles (line 7)", "there are 9 wheels", "1 to 8"),
        ("[fl, fr]", "[]", "axles.front.wheels (line 8)", "not a list of wheels", "[fl, fr]"),
        ("wheelbase: 0.638 m\n", "", "wheelbase", "is missing", "two or more axles need it"),
        ("center_of_gravity_height: 0.30 m\n", "", "center_of_gravity_height", "is missing", "two or more axles"),
        ("[rl, rr]}\nwheel: {radius: 0.20 m, inertia: 0.15 kg m^2}\n", "[rl, rr], wheel: {radius: 0.2, inertia: 0.1}}\n",
         "axles.front (line 8)", "no wheel data, and another axle has", "wheel:"),
        (", inertia: 0.15 kg m^2", "", "wheel.inertia (line 10)", "is missing", "add it"),
        ("0.15 kg m^2}", "0.15, radius_model: {name: soft}}", "wheel.radius_model", "no known name", "'hadekel'"),
        ("0.15 kg m^2}", "0.15, radius_model: {name: hadekel, pressure: 1 bar}}", "wheel.width", "missing", "width"),
        ("0.15 kg m^2}", "0.15, radius_model: {name: fixed, pressure: 1}}", "wheel.radius_model.pressure", "unknown", "name"),
        ("mass: 139 kg", "mass: 139 kg\nmass: 140 kg", "mass (line 3)", "the key occurs twice", "line 2"),
        ("mass: 139 kg", "mass: [139 kg", "line 3", "not YAML", "key: value"),
        ("wheels: [fl, fr]", "wheels: fl, fr", "axles.front.fr", "unknown key", "write it in brackets ('[..., fr]')"),
        ("mass: 139 kg", "\tmass: 139 kg", "line 2", "not YAML", "by blanks, not by tabs"),
        ("name: Innok Heros 444", "name: 444", "name (line 1)", "is not text", "quotes"),
        ("sensors: {wheel_speed: 0.03 rad/s", "sensors: {wheel_speed: 0", "sensors.wheel_speed", "impossible", "exceed"),
        ("sensors:", "sensors: 3\nx:", "x (line 14)", "unknown key", "known keys are"),
    ],
)  # fmt: skip
def test_refusal(tmp_path: Path, old: str, new: str, place: str, problem: str, hint: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        load(tmp_path, GOOD.replace(old, new, 1))
    error = caught.value
    assert error.file == str(tmp_path / "vehicle.yaml")
    assert place in (error.place or "")
    assert problem in error.problem
    assert hint in (error.hint or "")
    assert "\n" not in str(error)


def test_one_percent_of_mass_is_tolerated(tmp_path: Path) -> None:
    assert load(tmp_path, GOOD.replace("mass: 54 kg", "mass: 55.3 kg")).axle_mass[0] == 55.3
    with pytest.raises(InputError):
        load(tmp_path, GOOD.replace("mass: 54 kg", "mass: 55.5 kg"))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b"- 1\n- 2\n", "not a mapping"),
        (b"\xff\xfe\x00\x81", "is not text"),
        (b"a: " + b"[" * 5000, "YAML"),
    ],
)
def test_not_a_vehicle_file(tmp_path: Path, content: bytes, problem: str) -> None:
    path = tmp_path / "vehicle.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        Vehicle.load(path)
    assert problem in caught.value.problem


def test_no_such_file_names_the_nearest(tmp_path: Path) -> None:
    load(tmp_path, GOOD)
    with pytest.raises(InputError, match=r"vehicel\.yaml: no such file; did you mean vehicle\.yaml\?"):
        Vehicle.load(tmp_path / "vehicel.yaml")
    with pytest.raises(InputError, match=r"is a folder; name a file in it, such as vehicle\.yaml"):
        Vehicle.load(tmp_path)


def test_saving_into_no_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        load(tmp_path, GOOD).save(tmp_path / "none" / "vehicle.yaml")


_scalar = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
_value = st.recursive(
    _scalar,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)
_base: dict[str, Any] = {
    "mass": 139, "wheelbase": 0.6, "center_of_gravity_height": 0.3, "wheel": {"radius": 0.2, "inertia": 0.1},
    "axles": {"front": {"mass": 54, "wheels": ["fl", "fr"]}, "rear": {"mass": 85, "wheels": ["rl", "rr"]}},
}  # fmt: skip
_fields = tuple(Vehicle.model_fields)


@settings(max_examples=200)
@given(st.dictionaries(st.sampled_from(_fields), _value, min_size=1, max_size=3))
def test_any_mapping_is_a_vehicle_or_refused(changes: dict[str, Any]) -> None:
    try:
        Vehicle.from_dict({**_base, **changes})
    except InputError as refusal:
        message = str(refusal)
    else:
        return
    assert message
    assert "\n" not in message


@settings(max_examples=100)
@given(st.binary(max_size=60))
def test_any_bytes_are_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("bytes") / "vehicle.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError):
        Vehicle.load(path)


def test_the_page_on_the_vehicle_file_holds_a_file_that_loads_and_names_every_key() -> None:
    page = (Path(__file__).parents[1] / "docs" / "vehicle.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    vehicle = Vehicle.from_dict(yaml.safe_load("".join(blocks)))
    assert vehicle.wheels == ("fl", "fr", "rl", "rr")
    assert vehicle.uncertainty.drive_torque_gain == pytest.approx(0.02)
    named = set(re.findall(r"\w+", page))
    for part in (Vehicle, Axle, Wheel, Sensors, Uncertainty, Calibration):
        assert named.issuperset(part.model_fields), part


@pytest.mark.parametrize(
    ("front", "rear", "whole", "wanted"),
    [
        ({}, {}, {}, [False, False]),
        ({"steered": True}, {}, {}, [True, False]),
        ({"steered": True, "pivots": False}, {}, {}, [False, False]),
        ({"steered": True}, {"steered": True}, {}, [False, False]),
        ({}, {}, {"articulated": True}, [False, True]),
        ({"pivots": True}, {"pivots": False}, {"articulated": True}, [True, False]),
        ({"pivots": True}, {}, {"articulated": True}, [True, False]),  # else nothing kept it upright
        ({"steered": True}, {"pivots": True}, {}, [False, True]),
        ({"steered": True}, {"wheels": ["r"]}, {}, [False, False]),  # a single wheel behind holds no roll
    ],
)
def test_an_axle_that_steers_and_the_last_of_a_machine_that_bends_pivot_unless_the_file_says_no(
    front: dict[str, Any], rear: dict[str, Any], whole: dict[str, Any], wanted: list[bool]
) -> None:
    data = yaml.safe_load(GOOD) | whole
    data["axles"]["front"] |= front
    data["axles"]["rear"] |= rear
    assert Vehicle.from_dict(data).pivoting.tolist() == wanted


def test_a_body_that_no_axle_keeps_upright_is_refused() -> None:
    data = yaml.safe_load(GOOD)
    for axle in data["axles"].values():
        axle["pivots"] = True
    with pytest.raises(InputError, match=r"axles.front.pivots.*no axle keeps the body from rolling"):
        Vehicle.from_dict(data)


def test_a_lateral_force_on_an_axle_on_a_pin_is_held_by_the_other() -> None:
    """By the file's words alone: where they say nothing, each axle holds its own part of the roll."""
    data = yaml.safe_load(GOOD)
    rigid = Vehicle.from_dict(data).wheel_shares[1]
    data["axles"]["front"]["pivots"] = True
    _, leaning = Vehicle.from_dict(data).wheel_shares
    assert leaning[0] == pytest.approx(rigid[0] * 0.20 / 0.30)
    assert 85 * (leaning[2] - rigid[2]) == pytest.approx(54 * (rigid[0] - leaning[0]))


def test_vehicles_that_were_used_compare_by_what_their_files_say() -> None:
    """Arrays that their properties keep made `==` raise ValueError."""
    one, other, third = (Vehicle.from_dict(yaml.safe_load(GOOD) | more) for more in ({}, {}, {"track": 0.6}))
    for vehicle in (one, other, third):
        assert vehicle.wheel_radius.size == 2 * vehicle.axle_mass.size
    assert one == other
    assert one != third

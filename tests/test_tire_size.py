"""Tyres by their size and pressure in a vehicle file."""

from __future__ import annotations

import pytest

from terragrip.errors import InputError
from terragrip.tire_size import tire_size
from terragrip.vehicle import Vehicle


def vehicle(**wheel):
    front = {"mass": 2500, "wheels": ["fl", "fr"], "wheel": {"size": "420/70R24", "inertia": 20}}
    rear = {"mass": 3500, "wheels": ["rl", "rr"], "wheel": {"inertia": 50, **wheel}}
    return Vehicle.from_dict(
        {
            "mass": 6000,
            "wheelbase": 2.7,
            "center_of_gravity_height": 1.0,
            "axles": {"front": front, "rear": rear},
        }
    )


def test_a_size_is_what_its_digits_say():
    size = tire_size("VF 520/70 R38 150D")
    assert size.width == 0.52
    assert 2 * size.radius == pytest.approx(
        38 * 0.0254 + 2 * 0.7 * 0.52
    )  # 1693 mm, as makers' tables have it


@pytest.mark.parametrize("text", ["18.4R38", "tall", "", "520R38"])
def test_other_texts_are_no_metric_size(text):
    assert tire_size(text) is None


def test_without_a_pressure_the_radius_rolls_without_a_model():
    made = vehicle(size="520/70R38")
    assert list(made.wheel_radius[2:]) == [pytest.approx(3.05 / 3.14159265 * 0.8466, rel=1e-4)] * 2
    assert made.wheel_data[2].radius_model is None
    assert made.wheel_data[2].width == 0.52


def test_with_a_pressure_the_radius_yields_to_the_load():
    made = vehicle(size="520/70R38", pressure="1.2 bar")
    assert made.wheel_radius[2] == pytest.approx(0.8466)
    assert made.wheel_data[2].radius_model.pressure == pytest.approx(1.2e5)


def test_what_is_measured_wins_over_the_size(tmp_path):
    made = vehicle(size="520/70R38", radius=0.81, pressure="1.2 bar")
    assert made.wheel_radius[2] == 0.81
    assert made.wheel_data[2].radius_model is None
    made.save(tmp_path / "v.yaml")
    assert Vehicle.load(tmp_path / "v.yaml") == made


def test_an_inch_size_without_a_radius_is_refused_with_what_to_write():
    with pytest.raises(InputError) as caught:
        vehicle(size="18.4R38")
    assert "520/70R38" in caught.value.hint
    assert vehicle(size="18.4R38", radius=0.83).wheel_radius[2] == 0.83


def test_a_pressure_in_the_wrong_unit_is_named():
    with pytest.raises(InputError, match="impossible"):
        vehicle(size="520/70R38", pressure=1.2)

"""What the vehicle file's spreads become in the kernel's settings."""

from __future__ import annotations

import math

import pytest

from drives import robot
from terragrip._kernel import ffi
from terragrip.estimation.settings import _set_uncertainty

SENSED = math.radians(0.2)


@pytest.mark.parametrize(
    ("stated", "channels", "slope"),
    [
        ({"slope": 0.1}, (), 0.1),
        ({"slope": 0.1}, ("pitch",), SENSED),
        ({"slope": SENSED / 2}, ("pitch",), SENSED / 2),
        ({"slope": 0.1, "pitch_offset": 0.02}, ("pitch",), 0.02),
        ({"slope": 0.1, "pitch_offset": 0.02}, (), 0.1),
        ({}, ("pitch",), 0.0),
    ],
)
def test_a_measured_pitch_leaves_its_mounting_unknown_alone(
    stated: dict[str, float], channels: tuple[str, ...], slope: float
) -> None:
    settings = ffi.new("tg_settings *")
    _set_uncertainty(settings, robot(uncertainty=stated), channels)
    assert settings.uncertainty.slope == pytest.approx(slope)

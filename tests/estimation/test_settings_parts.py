"""What the vehicle file's spreads become in the kernel's settings."""

from __future__ import annotations

import pytest

from drives import robot
from terragrip._kernel import ffi
from terragrip.estimation.settings import _set_uncertainty
from terragrip.vehicle_parts import PITCH_ZERO


@pytest.mark.parametrize(
    ("stated", "channels", "slope"),
    [(0.1, (), 0.1), (0.1, ("pitch",), PITCH_ZERO), (PITCH_ZERO / 2, ("pitch",), PITCH_ZERO / 2)],
)
def test_a_measured_pitch_leaves_its_mounting_unknown_alone(
    stated: float, channels: tuple[str, ...], slope: float
) -> None:
    settings = ffi.new("tg_settings *")
    _set_uncertainty(settings, robot(uncertainty={"slope": stated}), channels)
    assert settings.uncertainty.slope == pytest.approx(slope)

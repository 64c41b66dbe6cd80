"""From engine to wheels: power in is power out and what is lost on the way."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.physics.driveline import torque_into_gears, torque_spread, wheel_torque


@pytest.mark.parametrize("torque", [300.0, 0.4, -0.4, -90.0])
@pytest.mark.parametrize("ratio", [25.0, -18.0])
def test_power_is_lost_whichever_way_it_goes(torque: float, ratio: float) -> None:
    """Forward and in reverse gear: of the power that goes in at one end, nine tenths come out at the other."""
    speed = 150.0
    engine = torque * speed
    wheels = float(wheel_torque(np.array([torque]), np.array([ratio]), 0.9)[0]) * speed / ratio
    if torque > 0:
        assert wheels == pytest.approx(0.9 * engine)
    else:
        assert engine == pytest.approx(0.9 * wheels)


def test_what_is_left_for_the_gears() -> None:
    # 400 N m less 9 kW at 150 rad/s (60 N m) less 1.5 kg m2 at 4 rad/s2 (6 N m)
    left = torque_into_gears(
        np.array([400.0, 400.0, 400.0]),
        np.array([150.0, 0.0, 0.5]),
        np.array([4.0, 4.0, 0.0]),
        other_power=np.array(9000.0),
        engine_inertia=1.5,
    )
    assert left[0] == pytest.approx(334.0)
    assert np.isnan(left[1])
    assert left[2] == pytest.approx(400.0 - 18000.0)


def test_spreads_of_torque_and_power_add_as_squares() -> None:
    spread = torque_spread(np.array([100.0, 0.0, 0.5]), np.array([-20.0, 20.0, 20.0]), 0.9, 3.0, 400.0)
    assert spread[0] == pytest.approx(0.9 * 20 * 5.0)  # 3 N m and 400 W / 100 rad/s
    assert np.isnan(spread[1])
    assert spread[2] == pytest.approx(0.9 * 20 * np.hypot(3.0, 800.0))

"""The windows that calibration works on, of a log whose every number is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terragrip.estimation.calibration.windows import windows
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def test_each_axle_is_where_it_is_on_the_track(drive: Callable[..., Recording], vehicle: Vehicle) -> None:
    log = drive(60.0)
    table = windows([log], vehicle, 1.0)
    travelled = np.trapezoid(log.channels["ground_speed"], log.time)
    front, rear = table.position[:, 0], table.position[:, 2]
    np.testing.assert_allclose(front - rear, vehicle.wheelbase)  # the rear axle follows
    assert abs(front[-1] - travelled) < 0.02 * travelled

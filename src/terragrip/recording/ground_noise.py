"""A ground speed that is noisier than the vehicle file states, as of a receiver far from its data sheet."""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.held import measurable, quantum
from terragrip.recording.lag import measured, wheels_of
from terragrip.recording.noise import rounding_noise, white_noise

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_LATE = (0.0, 0.15, 0.3, 0.45)  # s by which a receiver's speed may follow the rims'
_TWICE = 2.0  # the noise stated; right logs show up to 1.7 times, at any rate from 1 to 100 Hz (432 logs of 72 development machines)


def understated_noise(recording: Recording, vehicle: Vehicle) -> float | None:
    """SD [m/s] of the ground speed's white noise by the log, where it is more than the vehicle file states and the log rounds; else None.

    What the rims do as well is motion, though between the samples of a slow receiver it is no quadratic: at 1 Hz `white_noise` alone is up
    to 3.3 times the sensor's, beside the rims .8 to 1.4 times. Less than a step of the log's values is no noise: of coarse ones
    `white_noise` shows up to one step, however quiet the sensor is.
    """
    stated, ground = vehicle.sensors.ground_speed, recording.channels.get("ground_speed")
    ground = None if ground is None else measurable(ground)
    own = None if stated is None or "ground_speed" in recording.noise else measured(recording.time, ground)
    if own is None or ground is None or stated is None:
        return None
    time, speed = own
    most = max(_TWICE * hypot(stated, rounding_noise(ground, stated)), quantum(speed))
    shown = white_noise(time, speed) or 0.0
    if shown > most and (rims := wheels_of(recording.time, recording.channels)) is not None:
        for late in _LATE:
            rim = np.interp(time - late, rims.time, rims.values)
            scale = np.abs(speed) @ rim / max(float(rim @ rim), np.finfo(float).tiny)
            shown = min(shown, white_noise(time, np.abs(speed), scale * rim) or shown)
    return shown if shown > most else None


def noisy_ground_speed_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on a ground speed of `understated_noise`, which an estimate uses in place of the vehicle file's."""
    shown, stated = understated_noise(recording, vehicle), vehicle.sensors.ground_speed
    if shown is None or stated is None:
        return []
    return [
        f"ground_speed: noise of {shown:.2g} m/s, {shown / stated:.2g} times what the vehicle file states, with which slip's interval "
        "would be too narrow: estimates use the log's unless their call gives one. Write "
        f"'sensors: {{ground_speed: {shown:.2g} m/s}}', or leave it out."
    ]

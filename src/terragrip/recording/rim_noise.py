"""Wheel speeds that are noisier than the vehicle file states, as of an encoder's uneven teeth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from terragrip.recording.lag import measured
from terragrip.recording.noise import rounding_noise, white_noise
from terragrip.recording.ranks import median
from terragrip.recording.table import Recording
from terragrip.vehicle import Vehicle

_TWICE = 2.0  # the noise stated; 1.6 at most on 16 right machines at 10 Hz, 1.15 at 20 Hz
_SLOWEST = 0.11  # s between a wheel's samples: in longer ones a wheel's motion is no longer smooth
_PARTS, _ROWS = 4, 2500  # parts of a long log, each of so many rows, in which noise shows as well as in all


def noisy_rim_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on wheel speeds whose noise [rad/s] is over twice what the vehicle file states, of logs that are not coarser."""
    stated = vehicle.sensors.wheel_speed
    if stated is None:
        return []
    rims = {name: v for name, v in recording.channels.items() if name.startswith("wheel_speed_")}
    part = replace(recording, channels=rims, labels={})
    if len(part) > _PARTS * _ROWS:
        begins = np.linspace(0, len(part) - _ROWS, _PARTS).astype(np.intp)
        part = part.select((begins[:, None] + np.arange(_ROWS)).ravel())
    noisy: dict[str, float] = {}
    for name, values in part.channels.items():
        own = measured(part.time, values)
        # In a coarse log the steps are the noise, and the estimator adds them by itself.
        if own and median(np.diff(own[0])) <= _SLOWEST and rounding_noise(values, stated) < stated:
            sd = part.noise.get(name) or white_noise(*own) or 0.0
            noisy |= {name: sd} if sd > _TWICE * stated else {}
    if not noisy:
        return []
    most, (first, *others) = max(noisy.values()), noisy
    which = f"{first} and {len(others)} more" if others else first
    return [
        f"{which}: noise of {most:.2g} rad/s, {most / stated:.2g} times what the vehicle file states, as of uneven teeth of an encoder. "
        f"Slip is less sure than its interval: write 'sensors: {{wheel_speed: {most:.2g} rad/s}}', or average over a turn by 'window' "
        "in the profile."
    ]

"""A ground speed that is not 0 where the vehicle stands: sentences for the user, never errors."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import rim_names
from terragrip.recording.stretches import LONG, gaps
from terragrip.recording.turns import filled

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_STILL = 0.01  # of a rim's speed that a twentieth of the drive exceeds
_ROLLING_OUT = 1.0  # s after the wheels stop, and before they start
_FEWEST = 4  # values of a stop
_SHIFT = 0.03  # of the usual speed, which slip is off by
_SURE = 4.0  # standard deviations at rest: noise without a sign has a mean of 1.9 of its own (Rayleigh)
_ALIKE = 0.5  # of the shift, by which stops differ


def rest_warnings(recording: Recording) -> list[str]:
    """A sentence where the ground speed reads much the same value, not 0, whenever all wheels stand for long."""
    ground, rims = recording.channels.get("ground_speed"), rim_names(recording.channels)
    if ground is None or not rims or not np.isfinite(ground).any() or np.any(np.diff(recording.time) <= 0):
        return []
    time, still = recording.time, np.ones(len(recording), dtype=bool)
    for name in rims:
        turning = np.abs(filled(recording.time, recording.channels[name]))
        if not np.isfinite(turning).all():
            return []
        usual = quantile(turning, 0.95)
        if not usual > 0:  # dead, or it hardly ever turns: it shows no stop
            return []
        still &= turning <= _STILL * usual
    cut = np.flatnonzero(np.r_[True, (still[1:] != still[:-1]) | gaps(time), True])
    stops = []
    for first, after in pairwise(cut.tolist()):
        start, end = time[first] + _ROLLING_OUT, time[after - 1] - _ROLLING_OUT
        if still[first] and end - start >= LONG - 2 * _ROLLING_OUT:
            rows = slice(*np.searchsorted(time, [start, end]))
            values = ground[rows][np.isfinite(ground[rows])]
            if len(values) >= _FEWEST:
                stops.append((float(np.mean(values)), float(np.std(values))))
    if not stops:
        return []
    means, scatter = np.array(stops).T
    shift = median(means)
    driven = np.abs(ground[~still & np.isfinite(ground)])
    usual = quantile(driven, 0.95) if len(driven) else 0.0
    if not usual > 0 or not abs(shift) > max(_SHIFT * usual, _SURE * median(scatter)):
        return []
    if quantile(np.abs(means - shift), 0.75) > _ALIKE * abs(shift):
        return []
    return [
        f"ground_speed reads {shift:.2g} m/s in {len(stops)} stop{'s' if len(stops) > 1 else ''} of all wheels: its zero is off, and slip "
        f"at usual speed by {abs(shift) / usual:.2g}, unless the vehicle slid. Write 'offset:' for it in the profile."
    ]

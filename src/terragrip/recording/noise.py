"""White noise of the sensors, estimated from the log itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.held import fresh_samples, held_periods, measured_part, quantum, usual_values
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import REFERENCE

if TYPE_CHECKING:
    from terragrip.recording.table import Recording


_FEWEST = 20
_ENOUGH = 20_000  # third differences: their median is then known to a per cent
MAD_TO_SD = 1.482602218505602  # of a normal distribution
_ROWS, _SAMPLES = 1000, 500  # of eight parts of a channel, and of those together: they show a resolution
_RESTLESS = 0.1  # share of values unlike the one before: a channel that changes less often has set-points
_COARSE = 1 / 6  # of a channel's size: larger steps are few
_HIDDEN = 4.0  # times the noise: smaller steps change with it from row to row
_NOT_SENSED = ("latitude", "longitude", "altitude", "fuel_rate")


def sensor_noise(recording: Recording, held: dict[str, float] | None = None) -> dict[str, float]:
    """Standard deviation of each channel's white noise, in the channel's unit.

    From third differences of the fresh samples (see `white_noise`); a value that the reader of the log knows
    (``recording.noise``) takes precedence. ``held`` as `held_periods` gives it, None: find it. A channel with too
    few samples, or one that never changes, is absent.
    """
    held = held_periods(recording) if held is None else held
    outcome = {}
    for name, values in recording.channels.items():
        if name.startswith(REFERENCE) or name in _NOT_SENSED:
            continue
        known = recording.noise.get(name)
        if known is None:
            time, sample = measured_part(recording.time, values)
            if name in held:
                fresh = fresh_samples(time, sample, held[name])
                time, sample = time[fresh], sample[fresh]
            known = white_noise(time, sample)
        if known is not None:
            outcome[name] = known
    return outcome


def white_noise(time: Floats, values: Floats, motion: Floats | None = None) -> float | None:
    """Robust standard deviation of the white noise on a smooth signal (n,); None if it cannot be determined.

    The third divided difference Σ c_j x_j, c_j = Π 1/(t_j - t_i), of four samples does not respond to any motion
    that is quadratic over them. Over √Σc² it has the noise's variance, and its median absolute value
    is robust against spikes. Four samples that are all equal (standstill) or straddle a gap do not count. The
    result is never under q/√12 for a resolution q, nor under 1e-4 of the signal's size. Noise with
    memory (a filtered channel) is underestimated. ``motion`` (n,), known from elsewhere, is no noise, however fast it is.
    """
    if len(values) < _FEWEST:
        return None
    steps = np.diff(time)
    three = steps[:-2], steps[1:-1], steps[2:]
    even = np.maximum(np.maximum(*three[:2]), three[2]) < 4 * np.minimum(np.minimum(*three[:2]), three[2])
    moving = (values[:-3] != values[1:-2]) | (values[1:-2] != values[2:-1]) | (values[2:-1] != values[3:])
    first = np.flatnonzero(even & moving)
    if len(first) < _FEWEST:
        return None
    first = first[:: max(1, len(first) // _ENOUGH)]
    a, b, c, d = (time[first + k] for k in range(4))
    ab, ac, ad, bc, bd, cd = a - b, a - c, a - d, b - c, b - d, c - d
    weights = [1.0 / (ab * ac * ad), -1.0 / (ab * bc * bd), 1.0 / (ac * bc * cd), -1.0 / (ad * bd * cd)]
    what = values if motion is None else values - motion
    third = sum(weight * what[first + k] for k, weight in enumerate(weights)) / np.sqrt(
        sum(w**2 for w in weights)
    )
    scale = MAD_TO_SD * median(np.abs(third))
    floor = quantum(values) / np.sqrt(12.0)
    return max(scale, floor, 1e-4 * quantile(np.abs(usual_values(values)), 0.95))


def rounding_noise(values: Floats, noise: float = 0.0) -> float:
    """Standard deviation q/√12 of the error that rounding to multiples of q gives a channel (n,), NaN = missing; 0 where it is not rounded.

    By a sample of the values: all their differences are multiples of q. It is q/2 where a channel has few of them and the sensor's own
    ``noise`` (SD) is far less: that error lasts as long as the value, and counted pulses err by one more or less.
    """
    last = max(len(values) - _ROWS, 0)
    part = np.concatenate([values[k : k + _ROWS] for k in np.unique(np.linspace(0, last, 8, dtype=int))])
    known = part[np.isfinite(part)]
    if np.count_nonzero(np.diff(known)) <= _RESTLESS * len(known):
        return 0.0
    step = quantum(known[:: max(1, len(known) // _SAMPLES)])
    if step == 0.0:
        return 0.0
    lasts = step > max(_COARSE * quantile(np.abs(known), 0.95), _HIDDEN * noise)
    return step / 2.0 if lasts else step / float(np.sqrt(12.0))

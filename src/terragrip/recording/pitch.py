"""The pitch against the accelerometer's reading beyond the change of ground speed, g sin(pitch): sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.ranks import median
from terragrip.recording.stretches import step_of
from terragrip.recording.window_means import window_means
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import moment

if TYPE_CHECKING:
    from terragrip.recording.mechanics import Means
    from terragrip.recording.table import Recording


_ALIKE = 0.7  # correlation from which two signals are proportional
_SURE = 3.0  # standard errors
_SCALE = 1.3  # an accelerometer's own scale is 2 % off at most
_LATE = 0.1  # s, surely beyond it: filters; and half a window of slow samples
_FEWEST = 5  # samples of a window, of which the mean is that of its middle (2 of 120 right drives at 1 and 2 Hz had a lag)
_FAR = 1.0  # windows: beyond it, the first order does not hold
_BLOCKS = 20  # of windows, for the jackknife: with half as many, right logs had lags of 4.9 standard errors (299 drives; now 3.1)
_LONG = 20  # windows before and after a zero moves
_MOVED = 0.2  # m/s², .02 of the weight: calibrated zeros are known to .03, and warm up by less than this
_BEYOND = 6.0  # standard deviations of a window
_CAUSES = (
    (1.745, "the grade in per cent, declared as degrees: write 'unit: \"%\"'"),
    (100.0, "the grade in per cent: write 'unit: \"%\"'"),
    (57.3, "in degrees: write 'unit: deg'"),
    (1 / 57.3, "in radians, but was converted from degrees: write 'unit: rad'"),
    (0.01, "a grade, but was converted from per cent: write 'unit: rad'"),
)


def pitch_warnings(recording: Recording, means: Means, forward: Floats) -> list[str]:
    """Sentences on a pitch of another sign, axis or scale than the accelerometer's; ``forward`` (n,) [m/s²] is its reading."""
    if means.climb is None:
        return []
    observed = forward - means.change
    fit = means.fit(observed, means.climb)
    if fit.is_opposite:
        note = WrongSign.of(["pitch"], "falls where the accelerometer shows a climb", "nose up is")
        moved = means.fit(forward, means.change, beside=means.climb)
        if moved.slope > _SURE * moved.error:
            return [note]
        both = "pitch and acceleration_x show opposite climbs"
        return [WrongSign(note, ["pitch", "acceleration_x"], both, sure=False)]
    roll = recording.channels.get("roll")
    if roll is not None and abs(fit.alike) < _ALIKE < abs(means.fit(observed, means.of(np.sin(roll))).alike):
        return [
            "The accelerometer shows climbs that vary with roll and not with pitch: the two may be exchanged."
        ]
    if fit.alike < _ALIKE:
        return []
    times = 1 / fit.slope
    low, high = fit.slope - _SURE * fit.error, fit.slope / fit.alike**2 + _SURE * fit.error
    if low > _SCALE or high < 1 / _SCALE:
        distance, cause = min((abs(float(np.log(times / size))), text) for size, text in _CAUSES)
        reason = f"it may be {cause} for it in the profile" if distance < 0.25 else "check its unit and scale"
        return [f"pitch is {times:.2g} times the climb that the accelerometer shows: {reason}."]
    return []


def zero_warnings(means: Means, forward: Floats) -> list[str]:
    """A sentence where the accelerometer's reading beyond speed and pitch leaps and stays so: a zero that moved in the drive."""
    if means.climb is None:
        return []
    rest = forward - means.change - means.climb
    known = np.isfinite(rest)
    step = step_of(rest[known], _MOVED, beyond=_BEYOND, long=_LONG)
    if step is None:
        return []
    at, leap = step
    when = means.middles[known][at] - means.length
    return [
        f"From {moment(when)} s on acceleration_x reads {abs(leap):.2g} m/s² {'more' if leap > 0 else 'less'} beyond speed and pitch than "
        f"before: the zero of one of the two moved, and soil resistance is {abs(leap) / STANDARD_GRAVITY:.2g} off before or after. Correct "
        "it there, or calibrate and estimate both parts apart."
    ]


def pitch_lag_warnings(recording: Recording, means: Means | None) -> list[str]:
    """A sentence on a pitch that is late or early by the accelerometer, whose signs and scales are right: to first order the measured climb
    is the pitch and its rate times the lag."""
    if means is None or means.climb is None or "acceleration_x" not in recording.channels:
        return []
    pitch, climb = recording.channels["pitch"], means.climb
    observed = means.of(recording.channels["acceleration_x"]) - means.change
    if _FEWEST * median(np.diff(recording.time[np.isfinite(pitch)])) > means.length:
        return []
    if means.fit(observed, climb).alike < _ALIKE:
        return []
    plain = STANDARD_GRAVITY * window_means(np.sin(pitch), means.place, means.count)
    rate = np.r_[np.nan, (plain[2:] - plain[:-2]) / (2 * means.length), np.nan][means.rows]
    design = np.column_stack([np.ones(len(observed)), climb, rate, observed])
    design = design[np.isfinite(design).all(axis=1)]
    block = np.arange(len(design)) * _BLOCKS // len(design)

    def lag(rows: Floats) -> float:
        found = np.linalg.lstsq(rows[:, :3], rows[:, 3], rcond=None)[0]
        return float(found[2] / found[1]) if found[1] else np.nan

    seconds = lag(design)
    without = np.array([lag(design[block != k]) for k in range(_BLOCKS)])
    error = float(np.sqrt((_BLOCKS - 1) * np.var(without)))
    if abs(seconds) > _FAR * means.length or not abs(seconds) > max(
        _LATE + _SURE * error, means.length / 2 if means.length > 1 else 0.0
    ):
        return []
    side, by = ("behind", "it is late") if seconds > 0 else ("ahead of", "the accelerometer is late")
    size = f"{abs(seconds):.1f} s"
    return [
        f"pitch is about {size} {side} the climb that the accelerometer shows: if {by}, give it 'delay: {size}' "
        "in the profile."
    ]

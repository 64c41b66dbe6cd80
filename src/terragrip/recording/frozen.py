"""Channels that keep one value while the vehicle's motion changes, or end at one: sentences for the user, never errors.

A channel with noise hardly has one value twice as often as the next. Where its greatest or least value is its most frequent by far, a
sensor's range ends there, and what was beyond is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import known_part, quantum, usual_values
from terragrip.recording.noise import MAD_TO_SD, white_noise
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import speed_names
from terragrip.recording.stretches import DRIVING, LONG, gaps, is_one_value, longest, may_last
from terragrip.recording.turns import filled_channel
from terragrip.written_times import moment, span

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

_TIMES = 20.0  # ... and of its usual repetition
_CHANGED = 0.2  # of the others' speed that a twentieth of the drive exceeds: what they change meanwhile
_COARSE = 0.1  # of the size of a speed: larger steps hide the changes; of a force, which follows the ground, half of it
_SEVERAL = 4  # channels
_OFTEN = 5  # short runs of one value,
_SECOND, _RUN = 1.0, 10.0  # each of these seconds and times its usual repetition at least
_RESOLVED = 0.5  # of the noise: larger steps hide it, and a sound speed keeps its value in a cruise
_MEASURED = 4  # values that are the same
_FINE, _NOISY = 0.02, 3e-4  # of a channel's size: smaller steps show its noise, and less is a simulated one's
_CHANGES = 20  # of a channel's value: fewer show no resolution
_GAINED = 0.3  # m/s: a speed that changes by this has an acceleration
_RANGED = ("drive_torque_", "drawbar_force", "acceleration_", "angular_velocity_")
_SHARE, _LEAST = 0.01, 20  # of the driving, and rows, that a channel is at the end of its range
_OFTENER = 5.0  # than any other value
_COMES = 10  # times to this value: a channel held or switched off there comes seldom
_SLOWEST = 0.15  # s between samples: within more a force may go from end to end
# Of all that a channel goes through: leaps from end to end, and what no other step is. Commands of full, none and full back step by half.
_WHOLE, _PART = 0.8, 0.45
_EVEN = 0.9  # between the sizes of its ends: those of a signed number are alike
_SWITCHED = 0.9  # of its end
_STEADY = 5.0  # usual steps, by which a number that overflows goes on


def frozen_warnings(recording: Recording) -> list[str]:
    """Sentences on a ground speed or an acceleration that never changes while the wheels do, and on speeds, torques, a drawbar force and
    inertial sensors that repeat a value for long, as a receiver does that lost its fix, or a logger whose bus went silent."""
    speeds = {name: recording.channels[name] for name in speed_names(recording.channels)}
    ground = recording.channels.get("ground_speed")
    rims = [name for name in speeds if name != "ground_speed"]
    notes = []
    acceleration = recording.channels.get("acceleration_x")
    for name, values, others, goes_on in (
        ("ground_speed", ground, "the wheels turn", any(not is_one_value(speeds[name]) for name in rims)),
        ("acceleration_x", acceleration, "the speed does", any(_range(v) > _GAINED for v in _metric(speeds))),
    ):
        if values is not None and goes_on and is_one_value(values):
            value = values[np.isfinite(values)][0]
            notes.append(
                f"{name} ({value:.3g}) never changes while {others}: the sensor is dead, or the column is wrong."
            )
    for name, speed in speeds.items():
        beside = [speeds[one] for one in (["ground_speed"] if name in rims else rims) if one in speeds]
        notes += _repeats(name, recording.time, speed, beside) or _often(name, recording.time, speed)
    forces = {
        n: v for n, v in recording.channels.items() if n.startswith("drive_torque_") or n == "drawbar_force"
    }
    for name, force in forces.items():
        beside = [other for one, other in forces.items() if one != name]
        notes += _repeats(name, recording.time, force, beside, forces=True)
    for name in ("acceleration_x", "acceleration_y", "angular_velocity_z", "pitch"):
        values = recording.channels.get(name)
        if values is None or not np.isfinite(values).any():
            continue
        found = _repeats(name, recording.time, values, _metric(speeds))
        # only the first follows from the speeds' changes: the others need noise of their own
        if found and (name == "acceleration_x" or _is_restless(recording.time, values)):
            notes += found
    return notes + _together(recording, speeds)


def _by_steps(what: Floats, step: float) -> bool:
    """Whether a channel (n,) changes from one of its ``step`` values to the next: no plateaus of a few speeds."""
    changes = np.abs(np.diff(what))
    changes = changes[changes > 0]
    return len(changes) > _CHANGES and float(np.mean(changes < 1.5 * step)) > 0.5


def _together(recording: Recording, speeds: dict[str, Floats]) -> list[str]:
    """A sentence where all channels, or all speeds while others go on, keep their values for long while the vehicle drives."""
    changing = {n: v for n, v in recording.channels.items() if not is_one_value(v) and np.isfinite(v).any()}
    if "ground_speed" not in changing or len(recording) < 3:
        return []
    if len(changing) >= _SEVERAL and (stretch := _kept(recording, changing)):
        return [_hung(stretch)]
    moved = {n: v for n, v in speeds.items() if n in changing}
    if len(moved) < 2 or not (stretch := _kept(recording, moved)):
        return []
    if not all(_is_restless(recording.time, v) for v in moved.values()):
        return []
    rows = (recording.time >= stretch[0]) & (recording.time <= stretch[1])
    if not any(_range(v[rows]) > 0 for n, v in changing.items() if n not in moved):
        return [_hung(stretch)]
    return [
        f"All speeds keep their values {span(*stretch)} while other channels go on: not measured, it seems. "
        "Leave these cells empty: the intervals then show how little is known."
    ]


def _hung(stretch: tuple[float, float]) -> str:
    return (
        f"All channels keep their values {span(*stretch)}: the logger hung, it seems. Leave these rows out."
    )


def _is_restless(time: Floats, values: Floats) -> bool:
    """Whether a channel (n,) has noise, and steps fine enough to show it: one that has not may keep its value in a cruise."""
    when, what = known_part(time, values)
    size = quantile(np.abs(what), 0.95)
    return quantum(what) < _FINE * size and (white_noise(when, what) or 0.0) > _NOISY * size


def _kept(recording: Recording, channels: dict[str, Floats]) -> tuple[float, float] | None:
    """The longest stretch of driving in which all of some ``channels``, the ground speed among them, repeat their values."""
    time, ground = recording.time, channels["ground_speed"]
    if not may_last(*known_part(time, ground)):
        return None
    same = np.abs(filled_channel(recording, "ground_speed")[1:]) > DRIVING * quantile(
        np.abs(ground[np.isfinite(ground)]), 0.95
    )
    usual = 0.0
    for name in channels:
        whole = filled_channel(recording, name)
        alike = whole[1:] == whole[:-1]
        same &= alike
        if not same.any():
            return None
        usual = max(usual, median(np.diff(time[1:][~alike])) if np.sum(~alike) > 2 else np.inf)
    stretch = longest(time[1:], same, np.ones(len(same), dtype=bool))
    if stretch is None or stretch[1] - stretch[0] < _TIMES * usual:
        return None
    inside = (time >= stretch[0]) & (time <= stretch[1])
    measured = all(np.isfinite(values[inside]).sum() >= _MEASURED for values in channels.values())
    return stretch if measured else None


def _metric(speeds: dict[str, Floats]) -> list[Floats]:
    return [v for n, v in speeds.items() if n in ("ground_speed", "wheel_based_speed")]


def _range(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


def _repeats(
    name: str, time: Floats, values: Floats, others: list[Floats], *, forces: bool = False
) -> list[str]:
    """A sentence on the longest run of one value while others change much. Speeds may stay at 0; ``forces`` that are 0 may be
    switched off, and at their limits be as great as they can; an accelerometer, a gyroscope or a pitch keeps no value, but 0 within
    a dead band: it is beyond on either side, and has no small values."""
    when, what = known_part(time, values)
    if not others or not may_last(when, what) or is_one_value(what):
        return []
    first = np.flatnonzero(np.r_[True, (np.diff(what) != 0.0) | gaps(when)])
    last = np.r_[first[1:], len(what)] - 1
    lasting = when[last] - when[first]
    usual = median(np.diff(when[first])) if len(first) > 2 else np.inf
    step, size = quantum(what), quantile(np.abs(what), 0.95)
    if forces and step > _COARSE / 2 * size:
        return []
    if step > _COARSE * size > 0.0 and _by_steps(what, step):
        return [
            f"{name} comes in steps of {step:.3g}, where {size:.3g} is fast: it and slip may be off by half a step while it keeps "
            "one value. Log it in finer steps; of counted pulses, take the mean in a profile ('window: 1 s')."
        ]
    at_zero = what[first] == 0.0
    least = max(2 * step, _FINE * size)
    dead_band = what.min() < 0.0 < what.max() and np.abs(what[what != 0.0]).min() > least
    usable = ~at_zero | (not forces and "speed" not in name and not dead_band)
    if forces and name != "drawbar_force":  # a motor is held at its limit, a load cell never
        usable &= (what[first] > what.min()) & (what[first] < what.max())
    long = (lasting >= max(LONG, _TIMES * usual)) & usable
    found = [
        (float(lasting[k]), float(when[first[k]]), float(what[first[k]]))
        for k in np.flatnonzero(long)
        if any(_changes(other, (time >= when[first[k]]) & (time <= when[last[k]])) for other in others)
    ]
    if not found:
        return []
    seconds, start, value = max(found)
    return [
        f"{name} repeats {value:.4g} {span(start, start + seconds)}"
        + (f", and {len(found) - 1} times more," if len(found) > 1 else "")
        + f" while other {'forces' if forces else 'speeds' if 'speed' in name else 'channels'} change: not measured, it seems. Leave "
        "these cells empty: the intervals then show how little is known."
    ]


def _changes(other: Floats, rows: Bools) -> bool:
    """Whether another speed (n,) changes much within ``rows`` (n,)."""
    size = np.abs(other[np.isfinite(other)])
    return bool(len(size)) and _range(usual_values(other[rows])) > _CHANGED * quantile(size, 0.95) > 0.0


def _often(name: str, time: Floats, values: Floats) -> list[str]:
    """On a speed (n,) that again and again keeps one value at speed, however shortly, though its noise moves each sample by more than its
    resolution: other speeds hardly change then."""
    when, what = known_part(time, values)
    changes = np.diff(what) != 0.0
    if np.count_nonzero(~changes) < _OFTEN:
        return []
    first = np.flatnonzero(np.r_[True, changes | gaps(when)])
    lasting = when[np.r_[first[1:], len(what)] - 1] - when[first]
    rows = lasting >= _SECOND
    if rows.sum() < _OFTEN or is_one_value(what):
        return []
    rows &= lasting >= _RUN * median(np.diff(when[first]))
    rows &= np.abs(what[first]) > DRIVING * quantile(np.abs(what), 0.95)
    if rows.sum() < _OFTEN or not _is_restless(time, values):
        return []
    # A lag that was corrected leaves the step in the kept values alone.
    step = max(quantum(what), quantum(what[first[rows]]))
    if step >= _RESOLVED * (white_noise(when, what) or 0.0):
        return []
    k = int(np.argmax(rows))
    return [
        f"{name} keeps one value for {_SECOND:g} s or more in {rows.sum()} places at speed (first {what[first[k]]:.4g} from "
        f"{when[first[k]]:.4g} s, for {lasting[k]:.2g} s), and never by its noise: not measured, it seems. Leave these cells empty."
    ]


def cut_warnings(recording: Recording) -> list[str]:
    """A sentence on the channels whose greatest or least value while driving is a limit of what they can show."""
    ground = recording.channels.get("ground_speed")
    if ground is None or is_one_value(ground):
        return []
    speed = np.abs(filled_channel(recording, "ground_speed"))
    driving = speed > DRIVING * quantile(speed, 0.95)
    ends: dict[tuple[float, str], dict[str, float]] = {}
    for name, values in recording.channels.items():
        if name.startswith(_RANGED) and not is_one_value(values):
            for value, beyond, share in _cut(recording.time, np.where(driving, values, np.nan)):
                ends.setdefault((value, beyond), {})[name] = share
    return [
        f"{', '.join(shares)} {'are' if len(shares) > 1 else 'is'} {value:.4g} in {max(shares.values()):.0%} of the driving and never "
        f"{beyond}: the range of sensor or column ends there, and what was beyond is lost. Take a wider range, or leave these cells empty; "
        "a motor's own limit may stay."
        for (value, beyond), shares in ends.items()
    ]


def _cut(time: Floats, values: Floats) -> list[tuple[float, str, float]]:
    """Each end of a channel (n,) of rows of driving, what never comes beyond it, and in which share of them the channel is there."""
    when, what = known_part(time, values)
    if len(what) < 2 * _LEAST:
        return []
    ends = []
    for value, beyond in ((what.min(), "less"), (what.max(), "more")):
        at = what == value
        times, comes = np.count_nonzero(at), np.count_nonzero(at[1:] & ~at[:-1])
        if times >= max(_LEAST, _SHARE * len(what)) and comes >= _COMES:
            ends.append((float(value), beyond, times))
    if not ends:  # of most channels that is known already
        return []
    counts = np.unique(what, return_counts=True)[1]
    if len(counts) < _LEAST or not _is_restless(when, what):
        return []
    most = float(counts[1:-1].max())
    return [(value, beyond, times / len(what)) for value, beyond, times in ends if times >= _OFTENER * most]


def overflow_warnings(recording: Recording) -> list[str]:
    """A sentence on the channels that go on from the greatest to the least value that they have, as a signed number does that overflows."""
    channels = recording.channels.items()
    overflown = {
        name: seen
        for name, values in channels
        if name.startswith(_RANGED) and (seen := _overflows(recording.time, values))
    }
    return [
        f"{', '.join(overflown)} {'leap' if len(overflown) > 1 else 'leaps'} from one end of the range to the other and back ({seen}): "
        "a number that overflows. Record it with more bits or another scale, or leave these cells empty."
        for seen in list(overflown.values())[:1]
    ]


def _overflows(time: Floats, values: Floats) -> str:
    """How often a channel (n,) does, when first, and between which values; empty where it does not."""
    when, what = known_part(time, values)
    low, high = np.min(what, initial=0.0), np.max(what, initial=0.0)
    if len(what) < 2 * _LEAST or min(-low, high) < _EVEN * max(-low, high):
        return ""
    steps = np.abs(np.diff(what))
    leaps = (steps > _WHOLE * (high - low)) & (np.diff(when) <= _SLOWEST)
    if np.count_nonzero(leaps) < _OFTEN or steps[~leaps].max() > _PART * (high - low):
        return ""
    if (
        np.count_nonzero(np.abs(what) > _SWITCHED * high) > len(what) / 2
    ):  # one that is switched stays at its ends
        return ""
    # One that is limited stays at its end, or leaps one way only: what overflows is beyond one end or the other at most.
    held = np.count_nonzero((steps == 0.0) & ((what[1:] == low) | (what[1:] == high)))
    beyond = np.cumsum(np.sign(np.diff(what)[leaps]))
    if 2 * held > np.count_nonzero(leaps) or np.ptp([0.0, *beyond]) > 2:
        return ""
    # From there it goes on by steps as all others, were it not for the bits that are missing.
    if median(high - low - steps[leaps]) > _STEADY * MAD_TO_SD * median(steps[~leaps]):
        return ""
    times, first = np.count_nonzero(leaps), float(when[np.argmax(leaps)])
    return f"{times} times, first at {moment(first)} s, {low:.4g} to {high:.4g}"

"""What a log has twice, a column for several wheels or rows of a buffer: sentences for the user, never errors.

Noise never repeats. One motor's torque, or the speed of a drive train, is sometimes entered for each wheel: what is noise in one column is
then the same noise in the other. And a run of rows whose channels change as those of an earlier run do, to the last digit, is a copy of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.recording.held import measured_part
from terragrip.recording.lag import is_copy
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import quantile
from terragrip.recording.stretches import DRIVING, is_one_value
from terragrip.recording.turns import filled_channel
from terragrip.written_times import span

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FEW = 100  # rows
_NOISY = 1e-3  # of a channel's size: less need not be noise
_APART = 0.1  # of the pace, that hubs of an axle differ by in a turn
_CHANNELS = 4  # that change within the rows
_CHANGES = 10  # of each of these: a coarse channel has two values to choose from each time, all together 2^40
_MISSING = np.int64(0x7FF8 << 48)
_FACTOR = np.int64(
    6364136223846793005
)  # Knuth's of a linear congruential generator: it spreads all bits but the last


def torque_copy_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """Sentences on torques of several wheels that are one signal."""
    return [
        f"{', '.join(group)} are one signal: how wheels share it was not measured, so only their mean adhesion is. Single wheels' "
        "intervals hold an open differential's friction, a lock only where their speed is one signal, too. If it is the sum of their "
        "torques, divide it ('scale:' in the profile)."
        for group in one_signal(recording, [f"drive_torque_{wheel}" for wheel in vehicle.wheels])
    ]


def speed_copy_warnings(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A sentence on speeds of both sides of an axle that are one signal."""
    turns, pairs = _turns(recording, vehicle), []
    for axle in vehicle.axles.values():
        names = [f"wheel_speed_{wheel}" for wheel in (axle.wheels[0], axle.wheels[-1])]
        own = len(axle.wheels) < 2 or not one_signal(recording, names, turns)
        if not own and not _is_of_the_ground(recording, names[0]):
            pairs.append(" and ".join(names))
    if not pairs:
        return []
    return [
        f"{', '.join(pairs)} are {'each ' * (len(pairs) > 1)}one signal: in turns the slips of both sides are wrong, unless a lock "
        "couples the wheels. Give it once, as wheel_based_speed [m/s], or the wheels' own speeds."
    ]


def _turns(recording: Recording, vehicle: Vehicle) -> bool:
    """Whether the gyroscope shows turns in which no two wheels of an axle go alike, and so need no noise to be one signal."""
    yaw, ground = (recording.channels.get(name) for name in ("angular_velocity_z", "ground_speed"))
    if yaw is None or ground is None:
        return False
    apart = np.abs(filled_channel(recording, "angular_velocity_z")) * (vehicle.track or 0.0)
    pace = np.abs(filled_channel(recording, "ground_speed"))
    usual = quantile(pace, 0.95)
    return bool(np.sum((pace > DRIVING * usual) & (apart > _APART * pace)) > _FEW)


def one_signal(recording: Recording, names: list[str], noiseless: bool = False) -> list[list[str]]:
    """Groups of columns that are in proportion to each other, noise included unless it need not be there (``noiseless``)."""
    left = [name for name in names if name in recording.channels]
    groups = []
    while left:
        first, *others = left
        same = [name for name in others if _is_same(recording.channels[name], recording.channels[first])]
        if same and (noiseless or _is_noisy(recording, first)):
            groups.append([first, *same])
        left = [name for name in others if name not in same]
    return groups


def _is_same(one: Floats, other: Floats) -> bool:
    for rows in (slice(_FEW), slice(None)):  # of most channels the first show it already, but at rest
        known = np.isfinite(one[rows]) & np.isfinite(other[rows])
        moves = bool(np.any(other[rows][known]))
        if moves and not is_copy(one[rows][known], other[rows][known]):
            return False
    return moves and bool(known.sum() > _FEW)


def _is_noisy(recording: Recording, name: str) -> bool:
    time, values = measured_part(recording.time, recording.channels[name])
    size = quantile(np.abs(values), 0.95) if len(values) else 0.0
    return (white_noise(time, values) or 0.0) > _NOISY * size > 0.0


def _is_of_the_ground(recording: Recording, name: str) -> bool:
    """Whether a wheel's speed was made of the ground speed, as that of a free wheel may be (docs/vehicle.md)."""
    ground = recording.channels.get("ground_speed")
    return ground is not None and _is_same(recording.channels[name], ground)


def replay_warnings(recording: Recording) -> list[str]:
    """A sentence on the longest run of rows that are those of an earlier run."""
    values = [v for v in recording.channels.values() if not is_one_value(v)]
    if len(values) < _CHANNELS:
        return []
    hashes = _hashes(values)
    kept = np.r_[0, np.flatnonzero(np.diff(hashes)) + 1]  # a row that keeps all values is none of its own
    first, last, distance = _longest(hashes[kept])
    if not distance or last - first < _CHANGES:
        return []
    rows = slice(kept[first], kept[last] + 1)
    if sum(np.count_nonzero(np.diff(_coded(v[rows]))) >= _CHANGES for v in values) < _CHANNELS:
        return []
    start, end, before, until = (
        recording.time[kept[k]] for k in (first, last, first - distance, last - distance)
    )
    return [
        f"The rows {span(start, end)} repeat those {span(before, until)} to the last digit: the logger wrote a "
        "buffer twice. Leave the second ones out."
    ]


def _coded(values: Floats) -> Ints:
    """A channel's values (n,) as whole numbers, equal where they are."""
    coded = (values + 0.0).view(np.int64)
    coded[np.isnan(values)] = _MISSING
    return coded


def _hashes(channels: list[Floats]) -> Ints:
    """A number for each row (n,) of the channels, equal where all values are."""
    hashes = np.zeros(len(channels[0]), dtype=np.int64)
    for values in channels:
        coded = _coded(values)
        hashes = hashes * _FACTOR + (coded ^ (coded >> np.int64(29)))
    return hashes * _FACTOR


def _longest(rows: Ints) -> tuple[int, int, int]:
    """First and last of the longest run of rows (n,) equal to those at one distance before them, and that distance (0: none is)."""
    last_bits = (1 << len(rows).bit_length()) - 1
    # Each row's place in its last bits: a stable order, in a tenth of argsort's time.
    keys = np.sort((rows & ~last_bits) | np.arange(len(rows)))
    order = keys & last_bits
    again = np.flatnonzero(keys[1:] & ~last_bits == keys[:-1] & ~last_bits)
    distance = np.zeros(len(rows), dtype=np.intp)
    distance[order[again + 1]] = order[again + 1] - order[again]
    cut = np.flatnonzero(np.r_[True, distance[1:] != distance[:-1], True])
    lengths = np.where(distance[cut[:-1]] > 0, np.diff(cut), 0)
    k = int(np.argmax(lengths))
    return int(cut[k]), int(cut[k + 1] - 1), int(distance[cut[k]])

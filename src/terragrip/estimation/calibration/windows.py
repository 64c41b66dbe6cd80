"""Recordings as means over short windows: the rows that calibration works on.

A window's mean has little noise, needs no common sampling and no filter, and the wheel equation (physics.md 1) is
linear in the channels that are averaged, so it holds for the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats, Ints
from terragrip.physics.loads import GRAVITY
from terragrip.physics.slip import hub_speed, middle_speed
from terragrip.recording import Recording
from terragrip.recording.window_means import window_means, windows_of
from terragrip.vehicle import Vehicle

_BLOCK_COUNT = 40  # stretches of track wanted,
_SHORTEST_BLOCK, _LONGEST_BLOCK = 4.0, 20.0  # m, and their lengths
_LEAST_LOAD = 0.02  # share of the static load below which no wheel load is assumed to fall


@dataclass(frozen=True)
class Windows:
    """Means over windows of equal length, a row each: SI, NaN where nothing was measured.

    ``recording`` (n,) index of the log; ``start`` (n,) s; ``count`` (n,) samples of ground speed, ``torque_count``,
    ``drawbar_count`` and ``acceleration_count`` (n,) of these channels; ``torque``,
    ``wheel_speed``, ``wheel_acceleration``, ``hub_speed``, ``load``, ``position`` (n, wheels), position being
    the metres of track that the wheel itself has come; ``push`` (n,) dv/dt + g sinθ, m/s², by the accelerometer where there is one,
    ``kinematic_push`` by ground speed and pitch alone; ``soil`` (n,) label.
    """

    recording: Ints
    start: Floats
    count: Floats
    torque_count: Floats
    drawbar_count: Floats
    acceleration_count: Floats
    ground_speed: Floats
    drawbar: Floats
    push: Floats
    kinematic_push: Floats
    acceleration: Floats
    pitch: Floats
    yaw_rate: Floats
    lateral: Floats
    hub_speed: Floats
    wheel_speed: Floats
    wheel_acceleration: Floats
    torque: Floats
    load: Floats
    position: Floats
    soil: npt.NDArray[np.object_]
    length: float

    def __len__(self) -> int:
        return len(self.start)

    def select(self, rows: Bools) -> Windows:
        """The windows of a mask (n,)."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return Windows(**{name: v if name == "length" else v[rows] for name, v in values.items()})


def windows(recordings: Sequence[Recording], vehicle: Vehicle, length: float) -> Windows:
    """Cut recordings into windows of ``length`` [s].

    Channels are used as they are: remove held samples and zeros first. Without ``drawbar_force`` it is 0. A free wheel without a
    speed goes as its hub does.
    """
    parts = [_windows_of(index, r, vehicle, length) for index, r in enumerate(recordings)]
    joined = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Windows)
        if f.name != "length"
    }
    return Windows(**joined, length=length)


def _windows_of(index: int, recording: Recording, vehicle: Vehicle, length: float) -> Windows:
    bin_of, starts = windows_of(recording.time, length)
    n, wheels = len(starts), vehicle.wheels

    def mean(name: str, absent: float = np.nan, power: int = 1) -> Floats:
        values = recording.channels.get(name)
        return np.full(n, absent) if values is None else window_means(values**power, bin_of, n)

    def samples(name: str) -> Floats:
        values = recording.channels.get(name)
        known = np.zeros(0, dtype=np.intp) if values is None else bin_of[np.isfinite(values)]
        return np.bincount(known, minlength=n).astype(np.float64)

    def per_wheel(quantity: str) -> Floats:
        return np.stack([mean(f"{quantity}_{wheel}") for wheel in wheels], axis=1)

    def rate_within(name: str) -> Floats:
        """Mean rate in each window alone, [unit/s]: the slope of its samples; NaN of fewer than two."""
        values, since = recording.channels.get(name), recording.time - starts[bin_of]
        if values is None:
            return np.full(n, np.nan)
        when = np.where(np.isfinite(values), since, np.nan)
        t, v, tt, tv = (window_means(x, bin_of, n) for x in (when, values, when**2, when * values))
        spread = tt - t**2
        slopes = np.divide(tv - t * v, spread, out=np.full(n, np.nan), where=spread > 1e-9 * length**2)
        # A slope counts the middle most; with this it is within 1 % of the mean of every wave of three windows or more.
        slopes[1:-1] += np.nan_to_num(np.diff(slopes, 2)) / 45
        return slopes

    yaw, lateral = mean("angular_velocity_z"), mean("acceleration_y")
    turn = np.nan_to_num(yaw)
    ahead, side = vehicle.receiver
    speed = middle_speed(mean("ground_speed"), turn, ahead=ahead, side=side)
    if not np.isfinite(lateral).any():  # what an accelerometer would read, as in estimates (physics.md 3)
        lateral = speed * turn + GRAVITY * np.sin(np.nan_to_num(mean("roll")))
    across = np.sqrt(np.nan_to_num(mean("angular_velocity_z", power=2)))[:, None] * vehicle.wheel_ahead
    # a steered wheel's way grows with the square of the turn, so the mean's does with its mean square
    hubs = hub_speed(speed[:, None] - turn[:, None] * vehicle.wheel_side, across)
    rolls = [wheel in vehicle.rolling_wheels(recording.channels) for wheel in wheels]
    wheel_speed = np.where(rolls, hubs / vehicle.wheel_radius, per_wheel("wheel_speed"))
    pitch, measured = mean("pitch"), mean("acceleration_x")
    slope = np.nan_to_num(pitch)
    own = rate_within("ground_speed")
    kinematic = np.where(np.isfinite(own), own, _rate(speed, length)) + GRAVITY * np.sin(slope)
    push = np.where(np.isfinite(measured), measured, kinematic)
    drawbar = mean("drawbar_force", 0.0)
    within = np.stack([rate_within(f"wheel_speed_{wheel}") for wheel in wheels], axis=1)
    wheel_acceleration = np.where(np.isfinite(within), within, _rate(wheel_speed, length))
    travelled = np.cumsum(np.nan_to_num(np.abs(speed))) * length
    behind = (vehicle.axle_to_rear[0] - vehicle.axle_to_rear)[vehicle.wheel_axle]
    torque = per_wheel("drive_torque") - vehicle.wheel_friction * np.sign(wheel_speed)
    torque[:, ~vehicle.driven] = np.nan_to_num(torque[:, ~vehicle.driven])
    spin = np.nansum(vehicle.wheel_inertia * wheel_acceleration, axis=1)
    load = wheel_loads(
        vehicle,
        drawbar=drawbar,
        push=push,
        slope=slope,
        spin_torque=spin,
        lateral=np.nan_to_num(lateral),
        measured=np.stack([mean(f"vertical_load_{axle}") for axle in vehicle.axle_names], axis=1),
    )
    return Windows(
        recording=np.full(n, index, dtype=np.intp),
        start=starts,
        count=samples("ground_speed"),
        torque_count=np.min(
            [samples(f"drive_torque_{w}") for w in vehicle.driven_wheels] or [np.zeros(n)],
            axis=0,
        ),
        drawbar_count=samples("drawbar_force"),
        acceleration_count=samples("acceleration_x"),
        ground_speed=speed,
        drawbar=drawbar,
        push=push,
        kinematic_push=kinematic,
        acceleration=measured,
        pitch=pitch,
        yaw_rate=yaw,
        lateral=lateral,
        hub_speed=hubs,
        wheel_speed=wheel_speed,
        wheel_acceleration=wheel_acceleration,
        torque=torque,
        load=load,
        position=travelled[:, None] - behind,
        soil=_labels(recording, bin_of, n),
        length=length,
    )


def track_blocks(table: Windows) -> Ints:
    """Which stretch of track each window is on (n,), counted from 0 over all recordings."""
    length = 0.0
    for index in np.unique(table.recording):
        length += float(np.nanmax(table.position[table.recording == index], initial=0.0))
    step = float(np.clip(length / _BLOCK_COUNT, _SHORTEST_BLOCK, _LONGEST_BLOCK))
    blocks = np.zeros(len(table), dtype=np.intp)
    first = 0
    for index in np.unique(table.recording):
        own = table.recording == index
        place = np.floor(table.position[own, 0] / step).astype(np.intp)
        blocks[own] = first + place
        first += int(place.max()) + 1
    return blocks


def wheel_loads(
    vehicle: Vehicle,
    *,
    drawbar: Floats,
    push: Floats,
    slope: Floats,
    spin_torque: Floats,
    lateral: Floats,
    measured: Floats,
) -> Floats:
    """Vertical load of each wheel (n, wheels), N (physics.md 3); a measured axle load (n, axles) wins, the other of two
    takes the rest.

    push is dv/dt + g sinθ [m/s²], slope θ [rad], lateral a_y [m/s²], all (n,).
    """
    axles = vehicle.axle_loads(
        drawbar=drawbar,
        acceleration=push - GRAVITY * np.sin(slope),
        slope=slope,
        spin_torque=spin_torque,
    )
    total = axles.sum(axis=1)
    known = np.isfinite(measured)
    axles = np.where(known, measured, axles)
    if axles.shape[1] == 2:
        for here, other in ((0, 1), (1, 0)):
            rest = known[:, here] & ~known[:, other]
            axles[rest, other] = total[rest] - axles[rest, here]
    level, leaning = vehicle.wheel_shares
    shares = level - leaning * lateral[:, np.newaxis]
    static = vehicle.axle_mass[vehicle.wheel_axle] * GRAVITY * level
    return np.asarray(np.maximum(shares * axles[:, vehicle.wheel_axle], _LEAST_LOAD * static))


def _rate(values: Floats, step: float) -> Floats:
    """Central difference along the windows, one-sided at the ends, [unit/s]."""
    return np.gradient(values, step, axis=0) if len(values) > 1 else np.zeros_like(values)


def _labels(recording: Recording, bin_of: Ints, n: int) -> npt.NDArray[np.object_]:
    """The soil of each window: empty where it is unlabelled or changes within."""
    result = np.full(n, "", dtype=object)
    labels = recording.labels.get("soil")
    if labels is None:
        return result
    # Few rows change the label: compare the runs between them, not every row.
    edge = np.flatnonzero(labels[1:] != labels[:-1]) + 1
    first = np.searchsorted(bin_of, np.arange(n))
    here = np.minimum(first, len(labels) - 1)
    result[:] = labels[here]
    result[np.bincount(bin_of, minlength=n) == 0] = ""
    inside = edge[bin_of[edge] == bin_of[edge - 1]]
    result[bin_of[inside]] = ""
    return result

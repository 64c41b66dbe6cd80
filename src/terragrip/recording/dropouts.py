"""Speeds, torques and a drawbar force that drop to 0 while the rest of the drive goes on: sentences for the user, never errors."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.held import known_part
from terragrip.recording.lag import measured
from terragrip.recording.mechanics import Means
from terragrip.recording.noise import white_noise
from terragrip.recording.pace import GRIP
from terragrip.recording.pulls import PULL
from terragrip.recording.ranks import median, quantile
from terragrip.recording.schema import rim_names, speed_names
from terragrip.recording.stretches import DRIVING, LONG, is_one_value, longest, may_last
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import span

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle


_BLINK = 1.0  # s, or three samples: a speed that is 0 no longer
_GOES_ON = 0.5  # of another speed around
_SURE = 5.0  # standard deviations of the noise: less is rounded to 0 by chance
_FEWEST = 5  # such samples
_LOST = 0.5  # of the usual pull: less is what soil and hills change


def dropout_warnings(recording: Recording) -> list[str]:
    """Sentences on speeds that read 0 for long while others go on, on each torque that alone does, and on zeros between other values."""
    return _wheels(recording) + _ground(recording) + _torques(recording) + _blinks(recording)


def zero_warnings(recording: Recording, vehicle: Vehicle, means: Means | None) -> list[str]:
    """A sentence on all torques, and on a drawbar force, that are exactly 0 for long where the balance of forces shows they were not."""
    if means is None or not means.thrusts:
        return []
    pull = recording.channels.get("drawbar_force")
    left = means.thrust - means.change - (0.0 if means.climb is None else means.climb)
    found = _zeros(recording, means, left, [f"drive_torque_{wheel}" for wheel in means.thrusts])
    notes = []
    # A vehicle that coasts is left with its resistance.
    if found and -median(left[found[0]]) > PULL * STANDARD_GRAVITY:
        notes.append(f"{found[2]} the vehicle pulls or climbs: no drive does that. Leave these cells empty.")
    if pull is not None and (found := _zeros(recording, means, left, ["drawbar_force"])):
        rows, others, text = found  # a tool that is lifted is no thrust that goes on
        lost, drawn = median(left[rows]) - median(left[others]), median(means.of(pull)[others])
        if lost > max(PULL * STANDARD_GRAVITY, _LOST * drawn / vehicle.mass):
            notes.append(
                f"{text} the wheels drive on as hard as before: not measured, it seems. Leave these cells empty."
            )
    return notes


def _zeros(
    recording: Recording, means: Means, left: Floats, names: list[str]
) -> tuple[Bools, Bools, str] | None:
    """Windows (n,) in which channels are 0 throughout, the others, and the beginning of a sentence; None where either last for less than
    `LONG`."""
    columns = [recording.channels[name] for name in names]
    zero = np.logical_and.reduce([values == 0.0 for values in columns])
    stretch = longest(recording.time, zero, np.isfinite(np.sum(columns, axis=0)))
    rows = (means.of(zero.astype(np.float64)) == 1.0) & np.isfinite(left)
    others = ~rows & np.isfinite(left)
    if not stretch or min(rows.sum(), others.sum()) * means.length < LONG:
        return None
    verb = "are" if len(names) > 1 else "is"
    text = f"{', '.join(names)} {verb} exactly 0 {span(*stretch)} while"
    return rows, others, text


def _often_zero(recording: Recording, names: Iterable[str]) -> list[str]:
    """Those channels that are 0, not always, and may keep a value for `LONG`."""
    return [
        name
        for name in names
        if np.any((values := recording.channels[name]) == 0.0)
        and not is_one_value(values)
        and may_last(*known_part(recording.time, values))
    ]


def _lost(recording: Recording, name: str, meanwhile: Bools, others: Floats) -> tuple[float, float] | None:
    """The longest stretch in which a channel is 0 in rows ``meanwhile`` (n,), where it and ``others`` (n,) are known."""
    values = recording.channels[name]
    return longest(recording.time, (values == 0.0) & meanwhile, np.isfinite(values + others))


def _wheels(recording: Recording) -> list[str]:
    """A sentence on wheels that read 0 for long while the ground speed goes on."""
    rims = rim_names(recording.channels)
    ground, notes = recording.channels.get("ground_speed"), []
    if ground is None or len(rims) < 2 or not (suspects := _often_zero(recording, rims)):
        return []
    stretches: dict[tuple[float, float], list[str]] = {}
    driving = _drives(ground)
    for name in suspects:
        if stretch := _lost(recording, name, driving, ground):
            stretches.setdefault(stretch, []).append(name)
    for stretch, names in stretches.items():
        few = len(names) == 1
        notes.append(
            f"{', '.join(names)} {'is' if few else 'are'} 0 {span(*stretch)} while the vehicle drives: "
            f"{'the wheel is locked, or its sensor' if few else 'the wheels are locked, or their sensors'} lost the signal. If "
            f"{'it' if few else 'they'} did, leave these cells empty."
        )
    return notes


def _drives(speed: Floats) -> Bools:
    """Where a speed (n,) is that of a drive."""
    known = np.abs(speed[np.isfinite(speed)])
    return np.abs(speed) > DRIVING * (quantile(known, 0.95) if len(known) else 0.0)


def _ground(recording: Recording) -> list[str]:
    """A sentence on a ground speed that reads 0 for long while all wheels go on."""
    rims = [recording.channels[name] for name in rim_names(recording.channels)]
    if "ground_speed" not in recording.channels or not rims or not _often_zero(recording, ["ground_speed"]):
        return []
    driving = np.logical_and.reduce([_drives(rim) for rim in rims])
    stretch = _lost(recording, "ground_speed", driving, np.sum(rims, axis=0))
    if not stretch:
        return []
    return [
        f"ground_speed is 0 {span(*stretch)} while all wheels turn: the vehicle is stuck, or its sensor lost "
        "the signal. If it did, leave these cells empty."
    ]


def _torques(recording: Recording) -> list[str]:
    """A sentence on each torque that alone is 0 for long: an axle that is switched off has two of them."""
    notes = []
    torques = {n: v for n, v in recording.channels.items() if n.startswith("drive_torque_")}
    for name in _often_zero(recording, torques):
        others = [other != 0.0 for one, other in torques.items() if one != name]
        if others and (stretch := _lost(recording, name, np.logical_and.reduce(others), torques[name])):
            notes.append(
                f"{name} is 0 {span(*stretch)} while all other torques are not: its sensor lost the signal, "
                "or its motor is off. If the sensor did, leave these cells empty."
            )
    return notes


def _blinks(recording: Recording) -> list[str]:
    """A sentence on each speed that is 0 for single samples while another speed continues: zeros in place of missing values."""
    speeds = {name: recording.channels[name] for name in speed_names(recording.channels)}
    ground, notes = speeds.get("ground_speed"), []
    rims = [v for n, v in speeds.items() if n != "ground_speed" and np.isfinite(v).any()]
    if ground is None or not rims or not np.isfinite(ground).any():
        return []
    for name, values in speeds.items():
        if np.count_nonzero(values == 0.0) < _FEWEST:
            continue
        when, what = measured(recording.time, values) or (np.empty(0), np.empty(0))
        zero = what == 0.0
        if zero.sum() < _FEWEST or zero.all():
            continue
        edges = np.flatnonzero(np.diff(zero)) + 1
        edges = edges[1:] if zero[0] else edges
        first, after = edges[: len(edges) // 2 * 2 : 2], edges[1::2]
        size = np.abs(what)
        around = np.minimum(size[first - 1], size[after])
        short = when[after] - when[first - 1] <= max(_BLINK, 3 * median(np.diff(when)))
        short &= around > DRIVING * quantile(size, 0.95)
        if short.sum() >= _FEWEST:
            short &= around > _SURE * (white_noise(when[~zero], what[~zero]) or 0.0)
        if short.sum() < _FEWEST:
            continue
        known = [known_part(recording.time, v) for v in (rims if name == "ground_speed" else [ground])]
        other = np.mean([np.abs(np.interp(when, *one)) for one in known], axis=0)
        goes_on = other[first] > _GOES_ON * np.maximum(other[first - 1], other[after])
        if name == "ground_speed":  # all speeds are 0 where a join of unlike rates filled its holes
            goes_on |= 2 * around > GRIP * (when[after] - when[first - 1])
        count = int((after - first)[short & goes_on].sum())
        if count >= _FEWEST:
            notes.append(
                f"{name} is 0 in {count} samples between others at speed, as no vehicle drives: zeros for values that were not there. "
                "Leave these cells empty (in a profile 'invalid: [0]', where no stop matters)."
            )
    return notes

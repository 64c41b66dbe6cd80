"""A logger's code for "not measured": values that no machine can have and that come again and again, or numbers that loggers use so (-1,
65535 after any decimal scale) to which a channel leaps for single samples; sentences for the user."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.checks import PLACES
from terragrip.recording.held import known_part, quantum
from terragrip.recording.noise import MAD_TO_SD
from terragrip.recording.ranks import median
from terragrip.recording.schema import split_channel
from terragrip.units import STANDARD_GRAVITY
from terragrip.written_times import moment

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FASTEST = 100.0  # m/s
_LIMITS = {
    "pitch": 7.0,
    "roll": 7.0,  # rad: more than a turn
    **PLACES,
    **{f"acceleration_{axis}": 500.0 for axis in "xyz"},
    **{f"angular_velocity_{axis}": 50.0 for axis in "xyz"},
}
_SMALLEST = 0.02  # m, the radius of a wheel
_WEIGHTS = 5.0  # a force over the weight
_CODES, _TIMES = 3, 3  # different values, and how often each is there at least
_BEYOND = 5.0  # times all others
_MOST = 0.5  # of a channel: where more is impossible, its unit is wrong
# 65534: J1939's "error"; -32768: the lowest of two bytes
_USED = (255.0, 9999.0, 99999.0, 32767.0, 65535.0, 65534.0, -9999.0, -99999.0, -32767.0, -65535.0, -32768.0)
_SCALED = np.r_[-1.0, np.outer([1.0, 1 / 3.6], np.outer([1.0, 0.1, 0.01, 1e-3, 1e-4], _USED)).ravel()]
_SHORT, _FEWEST = 3, 5  # rows at such a value, and how often
_LEAP = 5.0  # standard deviations, and steps, of what single samples differ from their neighbours
_SLOWEST = 0.15  # s between samples: within more a machine may stop and go


def without_codes(recording: Recording, vehicle: Vehicle | None) -> tuple[Recording, list[str]]:
    """The recording with such values missing, and a sentence on each code."""
    channels: dict[str, Floats] = {}
    by_code: dict[str, list[tuple[str, str]]] = {}
    for name, values in recording.channels.items():
        limit = _limit(name, vehicle)
        if limit is None:
            continue
        codes = _codes(values, limit)
        beyond = len(codes) > 0
        if not beyond:
            codes = _leapt_to(recording.time, values)
        if not len(codes):
            continue
        bad = np.isin(values, codes)
        channels[name] = np.where(bad, np.nan, values)
        shown = " and ".join(f"{code:.6g}" for code in codes)
        seen = (
            f"and at most {np.nanmax(np.abs(channels[name])):.3g} in all others"
            if beyond
            else f"(the first at {moment(recording.time[np.argmax(bad)])} s), and leaps there and back"
        )
        by_code.setdefault(shown, []).append((name, f"is {shown} in {bad.sum()} rows {seen}"))
    notes = [_sentence(shown, each) for shown, each in by_code.items()]
    return (replace(recording, channels={**recording.channels, **channels}) if channels else recording), notes


def _sentence(shown: str, each: list[tuple[str, str]]) -> str:
    """On the channels that have one code, each with the sentence's part on it."""
    names = [name for name, _ in each]
    text = f"{names[0]} {each[0][1]}"
    if len(each) > 1:
        more = f" and {len(names) - 6} more" if len(names) > 6 else ""
        text = f"{', '.join(names[:6])}{more} are {shown} in some rows"
    return (
        f"{text}: a code for 'not measured', it seems. Leave these cells empty, or write 'invalid: [...]' in the profile, in the log's own "
        "numbers."
    )


def _limit(name: str, vehicle: Vehicle | None) -> float | None:
    """What no machine, or not this one, can exceed, in the channel's unit; None where nothing is known."""
    if name in _LIMITS:
        return _LIMITS[name]
    if name in ("ground_speed", "wheel_based_speed"):
        return _FASTEST
    quantity, wheel = split_channel(name) or ("", "")
    radius = 1.0 if quantity == "drive_torque" else _SMALLEST
    if vehicle is not None and vehicle.knows_wheels:
        radius = vehicle.radii.get(wheel, radius)
    if quantity == "wheel_speed":
        return _FASTEST / radius
    if vehicle is None:
        return None
    weight = _WEIGHTS * vehicle.mass * STANDARD_GRAVITY
    return {"drive_torque": weight * radius}.get(quantity, weight if name == "drawbar_force" else None)


def _codes(values: Floats, limit: float) -> Floats:
    """Values beyond a limit that come again, of a channel (n,); none where there are many different ones, or hardly others."""
    none = np.empty(0)
    if not len(values) or not max(np.fmax.reduce(values), -np.fmin.reduce(values)) > limit:
        return none
    known = values[np.isfinite(values)]
    beyond = known[np.abs(known) > limit]
    codes, counts = np.unique(beyond, return_counts=True)
    rest = np.abs(known[np.abs(known) <= limit])
    if len(codes) > _CODES or counts.min() < _TIMES or len(beyond) > _MOST * len(known):
        return none
    return codes if _BEYOND * float(rest.max(initial=0.0)) < float(np.abs(codes).min()) else none


def _leapt_to(time: Floats, values: Floats) -> Floats:
    """Numbers that loggers use as codes, far beyond all others of a channel (n,), or that it leaps to and back from, each second time
    that it has them or more often."""
    found = _used_in(values)
    found = found[[np.count_nonzero(values == code) >= _FEWEST for code in found]] if len(found) else found
    if not len(found):
        return found
    others = np.abs(values[np.isfinite(values) & ~np.isin(values, found)])
    far = found[np.abs(found) > _BEYOND * others.max(initial=0.0)]
    if len(far) and others.any() and len(others) > _MOST * np.isfinite(values).sum():
        return far
    when, what = known_part(time, values)
    first = np.flatnonzero(np.r_[True, np.diff(what) != 0.0])
    if len(first) < 3 or not 0 < median(np.diff(when)) <= _SLOWEST:
        return np.empty(0)
    held, rows = what[first], np.diff(np.r_[first, len(what)])[1:-1]
    before, after = held[1:-1] - held[:-2], held[1:-1] - held[2:]
    spread = max(MAD_TO_SD * median(np.abs(before + after) / 2), quantum(what))
    leaps = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > _LEAP * spread)
    return np.array([code for code in found if _mostly(leaps & (rows <= _SHORT), held[1:-1] == code)])


def _mostly(leaps: Bools, there: Bools) -> bool:
    """Whether a channel leaps each second time, or more often, that it is at a value, and often enough."""
    count = np.count_nonzero(leaps & there)
    return bool(count >= _FEWEST and 2 * count >= np.count_nonzero(there))


def _used_in(values: Floats) -> Floats:
    """Those of a channel's values (n,) that loggers use as codes: -1, or one of `_USED` by any decimal scale, in km/h, too."""
    ordered, near = np.sort(values), 1e-9 * np.abs(_SCALED)
    first, last = np.searchsorted(ordered, [_SCALED - near, _SCALED + near])
    return np.unique(
        np.concatenate([ordered[i:j] for i, j in zip(first, last, strict=True) if j > i] or [ordered[:0]])
    )

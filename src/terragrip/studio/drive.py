"""A drive for the screen: which columns there are, the events, and why an estimate changed."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.rims import DRIVE, supposed_radius

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.recording import Recording
    from terragrip.studio.folder import Item
    from terragrip.studio.state import Studio


SPAN = 0.5
"""Seconds before and after a sample that `why` compares."""
MOST_SPANS = 2000


def spans(labels: npt.NDArray[Any], time: Floats) -> list[dict[str, Any]]:
    """Stretches of one label, empty ones left out: name, start and end [s]."""
    if not len(labels):
        return []
    edges = np.flatnonzero(labels[1:] != labels[:-1]) + 1
    starts, ends = np.r_[0, edges], np.r_[edges, len(labels)] - 1
    result = [
        {"name": str(labels[a]), "start": float(time[a]), "end": float(time[b])}
        for a, b in zip(starts, ends, strict=True)
        if labels[a]
    ]
    return result[:MOST_SPANS]


def radii(table: Estimates) -> dict[str, float]:
    """Rolling radius [m] of each wheel of the table: the vehicle file's, by the zero of slip where the log gave one. The drive train
    of a tractor, which stands for all driven wheels, has their mean."""
    vehicle = table.vehicle
    if not vehicle.knows_wheels:
        return {}
    known = dict(vehicle.radii)
    if DRIVE in table.wheels:
        known[DRIVE] = supposed_radius(vehicle)
    zero = table.about.get("zero_slip", {})
    return {
        wheel: known[wheel] * float(zero.get(wheel, {}).get("ratio", 1.0))
        for wheel in table.wheels
        if wheel in known
    }


def recording_of(studio: Studio, table: Estimates, *, search: bool = False) -> tuple[Path, Recording] | None:
    """The recording that the estimates were made from, where the folder holds it unchanged: same SHA-256, whatever its name now,
    and rows at the same times. A log that needed a profile is read by the one that the estimates hold, wherever its file is now.

    The folder is searched the first time, and again where `search` asks for it: a walk through all of it, so not for every request.
    """
    about = table.about.get("recording", {})
    wanted, name = about.get("sha256"), Path(str(about.get("source") or "")).name
    if not wanted:
        return None
    # Estimates of a part of a recording are not those of the whole.
    key = (wanted, len(table), *(table.time[[0, -1]].tolist() if len(table) else ()))
    place = studio.origins.get(key)
    if place is None and key in studio.origins and not search:
        return None
    if place is None or not place.is_file() or studio.fingerprints.get(place) != wanted:
        place = _find(studio, studio.folder.items(), name, wanted)
    recording = None if place is None else _read(studio, place, table)
    studio.origins[key] = None if recording is None else place
    return None if place is None or recording is None else (place, recording)


def _find(studio: Studio, items: Sequence[Item], name: str, wanted: str) -> Path | None:
    """The file with a SHA-256, those of the recording's own name first."""
    paths = [studio.folder.file(item.path) for item in items if item.kind == "recording"]
    paths.sort(key=lambda path: path.name != name)
    return next((path for path in paths if studio.fingerprints.get(path) == wanted), None)


def _read(studio: Studio, path: Path, table: Estimates) -> Recording | None:
    """The log as it was estimated; None where it is now read otherwise, or was joined with others."""
    profile = table.about["recording"].get("profile")
    with contextlib.suppress(InputError):
        recording = studio.recordings.get(path, *([json.dumps(profile)] if isinstance(profile, dict) else []))
        if len(recording) == len(table) and np.array_equal(recording.time, table.time):
            return recording
    return None


def sample(table: Estimates, recording: Recording | None, time: float) -> dict[str, Any]:
    """Everything known of the sample nearest to `time`, and for each wheel what changed its adhesion."""
    row = int(np.clip(np.searchsorted(table.time, time), 0, len(table) - 1))
    if row and abs(table.time[row - 1] - time) < abs(table.time[row] - time):
        row -= 1
    values = {name: float(column[row]) for name, column in table.columns.items()}
    labels = {name: str(column[row]) for name, column in table.labels.items()}
    measured = {} if recording is None else {n: float(c[row]) for n, c in recording.channels.items()}
    return {
        "row": row,
        "time": float(table.time[row]),
        "values": values,
        "labels": labels,
        "measured": measured,
        "event": str(table["event"][row]),
        "why": why(table, recording, row),
    }


def why(table: Estimates, recording: Recording | None, row: int) -> list[str]:
    """Why adhesion changed around a sample: a sentence for each wheel, the largest change first.

    Compares the half second before with the half second after by the torque balance of a wheel (physics.md 1):
    mu = (M - J domega/dt - r rho_w omega)/(r F_z) - rho_t, one term changed at a time. Of slip alone: how that changed.
    """
    before, after = _half_seconds(table.time, row)
    if before.stop - before.start < 2 or after.stop - after.start < 2:
        return ["Too close to an end of the drive to compare before and after."]
    if not table.has_adhesion:
        return [_of_slip(table, wheel, before, after) for wheel in table.wheels]
    sentences = []
    for wheel in table.wheels:
        moved = _mean(table[f"adhesion_{wheel}"], after) - _mean(table[f"adhesion_{wheel}"], before)
        if np.isfinite(moved):
            sentences.append((abs(moved), _sentence(table, recording, wheel, before, after, moved)))
    sentences.sort(key=lambda pair: -pair[0])
    return [text for _, text in sentences]


def _of_slip(table: Estimates, wheel: str, before: slice, after: slice) -> str:
    """How slip changed, and which of the speeds changed it; there is no torque, so no adhesion."""
    moved = [
        _mean(table[name], after) - _mean(table[name], before)
        for name in (f"slip_{wheel}", f"wheel_speed_{wheel}", "ground_speed")
    ]
    if not np.isfinite(moved).all():
        return f"{wheel}: slip is undefined before or after."
    return (
        f"{wheel}: slip {100 * moved[0]:+z.1f} points within {2 * SPAN:g} s; wheel speed {moved[1]:+z.2f} rad/s, ground speed "
        f"{moved[2]:+z.2f} m/s. Without a torque there is no adhesion."
    )


def _half_seconds(time: Floats, row: int) -> tuple[slice, slice]:
    first = int(np.searchsorted(time, time[row] - SPAN))
    last = int(np.searchsorted(time, time[row] + SPAN, "right"))
    return slice(first, row), slice(row, last)


def _mean(values: npt.NDArray[Any], rows: slice) -> float:
    part = values[rows]
    known = part[np.isfinite(part)]
    return float(known.mean()) if known.size else float("nan")


def _rate(values: Floats, time: Floats, rows: slice) -> float:
    t = time[rows] - time[rows].mean()
    return float(np.sum(t * values[rows]) / max(float(np.sum(t * t)), 1e-12))


def _sentence(
    table: Estimates, recording: Recording | None, wheel: str, before: slice, after: slice, moved: float
) -> str:
    vehicle = table.vehicle
    number = vehicle.wheels.index(wheel)
    axle = vehicle.axle_names[int(vehicle.wheel_axle[number])]
    radius, inertia = float(vehicle.wheel_radius[number]), float(vehicle.wheel_inertia[number])
    share = 1.0 / max(sum(int(a == vehicle.wheel_axle[number]) for a in vehicle.wheel_axle), 1)
    load = [share * _mean(table[f"vertical_load_{axle}"], rows) for rows in (before, after)]
    speed = table[f"wheel_speed_{wheel}"]
    rate = [_rate(speed, table.time, rows) for rows in (before, after)]
    arm = radius * load[1]
    parts = []
    channel = f"drive_torque_{wheel}"
    if recording is not None and channel in recording.channels:
        torque = [_mean(recording.channels[channel], rows) for rows in (before, after)]
        parts.append((f"torque {torque[1] - torque[0]:+z.1f} N m", (torque[1] - torque[0]) / arm))
        parts.append((f"load {load[1] - load[0]:+z.0f} N", torque[0] / radius * (1 / load[1] - 1 / load[0])))
    else:
        parts.append((f"load {load[1] - load[0]:+z.0f} N", float("nan")))
    parts.append(
        (f"wheel acceleration {rate[1] - rate[0]:+z.1f} rad/s²", -inertia * (rate[1] - rate[0]) / arm)
    )
    wheels = ", ".join(
        f"{text} ({effect:+z.3f})" if np.isfinite(effect) else text
        for text, effect in sorted(parts, key=lambda part: -abs(part[1]) if np.isfinite(part[1]) else 0.0)
    )
    slip = _mean(table[f"slip_{wheel}"], after) - _mean(table[f"slip_{wheel}"], before)
    return f"{wheel}: adhesion {moved:+z.3f} within {2 * SPAN:g} s; {wheels}; slip {100 * slip:+z.1f} points."

"""Slip where no torque is measured: a stock tractor's bus, a robot that logs its wheel speeds and position.

Slip, ground speed, wheel speed and distance come from speeds alone; adhesion, soil resistance, traction and efficiency
cannot be had, so their columns are absent.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation import zero_slip
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.noise import channel_noise, logged_noise, sensor_of
from terragrip.estimation.rim_speeds import DRIVE, RimSpeed, rim_speeds, zero_of
from terragrip.estimation.slip_filter import Walks, choose_walks, run
from terragrip.physics.slip import slip
from terragrip.recording import Recording, held_periods, unit_warnings, without_held
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

METHOD = "slip-only"
_STANDSTILL = 0.05  # m/s
_GAP = 2.0  # s
_PASSED_ON = ("drawbar_force", "latitude", "longitude", "altitude")
_OUTLIER, _STILL, _AWAY = (EVENTS.index(name) for name in ("outlier", "standstill", "gap"))


def is_slip_only(recording: Recording, vehicle: Vehicle) -> bool:
    """Whether the recording has speeds, and no torque of any wheel though the vehicle drives some."""
    torque = any(name.startswith("drive_torque_") for name in recording.channels)
    return bool(vehicle.driven.any()) and not torque


def estimate_slip(
    recording: Recording,
    vehicle: Vehicle,
    *,
    smooth: bool = False,
    sensors: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
    gap: float | None = None,
    standstill_speed: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Estimates:
    """Estimate slip from speeds alone; arguments as for `terragrip.estimate`.

    Slip of a wheel is against the radius of the vehicle file. The drive train's speed (``wheel_based_speed``) is by a
    radius that the machine supposes: it is held against the log's own zero-slip ratio, unless the vehicle's calibration
    names the radii. ``about["zero_slip"]`` holds each wheel's zero-slip radius in this log with its SD.

    Raises InputError where a wheel of the log is not the vehicle's.
    """
    periods = dict(held_periods(recording) if held is None else held)
    log = without_held(recording, periods)
    mine = dict(sensors or {})
    logged = {
        name: sd
        for name, sd in logged_noise(recording, vehicle, periods).items()
        if sensor_of(name) not in mine
    }
    used = tuple(
        n for n in log.channels if n == "ground_speed" or n.startswith(("wheel_speed_", "wheel_based"))
    )
    noise, guessed = channel_noise(vehicle, used, {**{k: v for k, v in logged.items() if k in used}, **mine})
    zero = {name: zero_of(recording, vehicle, name) for name in used if name != "ground_speed"}
    rims, notes = rim_speeds(log, vehicle, noise, zero)
    step = _STANDSTILL if standstill_speed is None else standstill_speed
    speeds = np.stack([log.channels["ground_speed"], *(rim.values for rim in rims)], axis=1)
    sds = np.array([noise["ground_speed"], *(rim.noise for rim in rims)])
    anew = _anew(log.time, speeds, _GAP if gap is None else gap)
    walks = choose_walks(log.time, speeds, sds, anew)
    found = run(log.time, speeds, sds, anew, walks, smooth=smooth)
    notes += _against_travel(found.state, rims)
    columns = _columns(found.state, found.covariance, rims, log.time, step)
    columns |= {"nis": found.nis, "channels": found.channels}
    event = _events(found.state, rims, found.outlier, anew, step)
    for name in (*_PASSED_ON, *recording.references):
        if name in recording.channels:
            columns[name] = recording.channels[name]
    if progress is not None:
        progress(len(log), len(log))
    if guessed:
        shown = ", ".join(f"{name} ({noise[name]:.3g})" for name in guessed)
        notes.append(f"The noise of {shown} is a guess from the vehicle's size: give it under 'sensors'.")
    heard = [note for note in recording.notes if not note.startswith("There is no drawbar_force")]
    said = (*heard, *unit_warnings(recording, vehicle), _WHAT_IS_MISSING, *notes)
    about = _about(recording, vehicle, noise, periods, walks, zero, smooth=smooth)
    return Estimates(log.time, columns, event, dict(recording.labels), about, tuple(dict.fromkeys(said)))


_WHAT_IS_MISSING = (
    "There is no drive torque: slip, speeds and distance are estimated, and maps of slip can be drawn; adhesion, soil "
    "resistance, net traction and efficiency cannot be had."
)


def _anew(time: Floats, speeds: Floats, gap: float) -> npt.NDArray[np.bool_]:
    """Rows (n,) before which no speed was measured for longer than ``gap`` [s], and the first."""
    measured = np.isfinite(speeds).any(axis=1)
    last = np.maximum.accumulate(np.where(measured, time, -np.inf))
    silence = time - np.r_[-np.inf, last[:-1]]
    return np.asarray(silence > gap)


def _columns(
    state: Floats, covariance: Floats, rims: list[RimSpeed], time: Floats, standstill: float
) -> dict[str, Floats]:
    """The table's columns (n,) from the filter's state and covariance."""
    v = state[:, 0]
    steps = np.diff(time, prepend=time[0])
    found = {
        "distance": np.cumsum(steps * (np.abs(v) + np.abs(np.r_[v[:1], v[:-1]])) / 2),
        "ground_speed": v,
        "ground_speed_std": np.sqrt(np.maximum(covariance[:, 0, 0], 0.0)),
    }
    slips: dict[str, Floats] = {}
    for i, rim in enumerate(rims):
        k = i + 2
        u = v + state[:, k]
        with_v = covariance[:, 0, 0] + covariance[:, 0, k]
        spread = with_v + covariance[:, 0, k] + covariance[:, k, k]
        found[f"wheel_speed_{rim.wheel}"] = u / rim.radius
        found[f"wheel_speed_{rim.wheel}_std"] = np.sqrt(np.maximum(spread, 0.0)) / rim.radius
        slips[f"slip_{rim.wheel}"], slips[f"slip_{rim.wheel}_std"] = _slip(
            v, u, np.stack([covariance[:, 0, 0], with_v, spread], axis=1), rim.spread, standstill
        )
    return found | slips


def _slip(v: Floats, u: Floats, spread: Floats, radius: float, standstill: float) -> tuple[Floats, Floats]:
    """Slip (paper eq. 5) and its SD (n,) by first derivatives; ``spread`` (n, 3): variances of v, of v with u, of u."""
    value = slip(u, v, 1.0, standstill_speed=standstill)
    travel, rim = np.abs(v), np.abs(u)
    driving = rim >= travel
    safe = np.where(np.isfinite(value), np.maximum(travel, rim), 1.0)
    # Driving: 1 - |v|/|u|; braking: -1 + |u|/|v|.
    by_v = -np.sign(v) * np.where(driving, safe, rim) / safe**2
    by_u = np.sign(u) * np.where(driving, travel, safe) / safe**2
    variance = by_v**2 * spread[:, 0] + 2 * by_v * by_u * spread[:, 1] + by_u**2 * spread[:, 2]
    variance += (radius * np.where(driving, travel, rim) / safe) ** 2
    return value, np.where(np.isfinite(value), np.sqrt(np.maximum(variance, 0.0)), np.nan)


def _against_travel(state: Floats, rims: list[RimSpeed]) -> list[str]:
    """A sentence on wheels that turn backward while the machine goes forward, most of the time."""
    v = state[:, 0]
    odd = []
    for i, rim in enumerate(rims):
        u = v + state[:, i + 2]
        moving = (np.abs(v) > _STANDSTILL) & (np.abs(u) > _STANDSTILL)
        if moving.any() and np.mean((u * v)[moving] < 0) > 0.5:
            odd.append(rim.wheel)
    if not odd:
        return []
    return [
        f"The wheel speed of {', '.join(odd)} is against the travel: write 'sign: -1' for it in the profile."
    ]


def _events(
    state: Floats,
    rims: list[RimSpeed],
    outlier: npt.NDArray[np.bool_],
    anew: npt.NDArray[np.bool_],
    standstill: float,
) -> npt.NDArray[np.uint8]:
    event = np.where(outlier, _OUTLIER, 0).astype(np.uint8)
    fastest = np.abs(state[:, 0])
    for i in range(len(rims)):
        fastest = np.maximum(fastest, np.abs(state[:, 0] + state[:, i + 2]))
    event[fastest <= standstill] = _STILL
    after = anew.copy()
    after[0] = False
    event[after | np.r_[after[1:], False]] = _AWAY
    return event


def _about(
    recording: Recording,
    vehicle: Vehicle,
    noise: Mapping[str, float],
    held: Mapping[str, float],
    walks: Walks,
    zero: Mapping[str, zero_slip.Ratio | None],
    *,
    smooth: bool,
) -> dict[str, Any]:
    """What the table was made from, ready for JSON."""
    from terragrip import __version__

    about = {
        "version": __version__,
        "method": METHOD,
        "smooth": smooth,
        "vehicle": vehicle.to_dict(),
        "recording": {"source": recording.source, "sha256": recording.sha256},
        "settings": {
            "noise": dict(noise),
            "held": dict(held),
            "walks": {"jerk": walks.jerk, "change": walks.change},
        },
        "zero_slip": {
            name.removeprefix("wheel_speed_").replace("wheel_based_speed", DRIVE): {
                "ratio": ratio.value,
                "std": ratio.std,
                "windows": ratio.windows,
            }
            for name, ratio in zero.items()
            if ratio is not None
        },
    }
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain

"""Slip where no torque is measured: a stock tractor's bus, a robot that logs its wheel speeds and position.

Slip, ground speed, wheel speed and distance come from speeds alone; adhesion, soil resistance, traction and efficiency
cannot be had, so their columns are absent.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation import zero_slip
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.noise import channel_noise, logged_noise, sensor_of
from terragrip.estimation.rim_speeds import rim_speeds, wheel_of, zero_of
from terragrip.estimation.slip_columns import GAP, METHOD, STANDSTILL, Place, Rim, columns_of
from terragrip.estimation.slip_filter import Filtered, SlipFilter, Walks, choose_walks, run
from terragrip.recording import Recording, held_periods, unit_warnings, without_held
from terragrip.recording.schema import has_torque
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

_PASSED_ON = ("drawbar_force", "latitude", "longitude", "altitude")
_BLOCK = 1_000_000  # rows
_OUTLIER, _STILL, _GAP = (EVENTS.index(name) for name in ("outlier", "standstill", "gap"))


def is_slip_only(recording: Recording, vehicle: Vehicle) -> bool:
    """Whether the recording has speeds, and no torque of any wheel though the vehicle drives some."""
    return bool(vehicle.driven.any()) and not has_torque(recording.channels)


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
    found = _prepared(recording, vehicle, sensors, held, gap, standstill_speed)
    filtered = run(found.time, found.speeds, found.sds, found.anew, found.walks, smooth=smooth)
    if progress is not None:
        progress(len(recording), len(recording))
    return found.estimates(recording, filtered, found.whole(), smooth=smooth)


def slip_in_parts(recording: Recording, vehicle: Vehicle, rows: int) -> Iterator[Estimates]:
    """What `estimate_slip` gives, ``rows`` rows at a time, so that the estimates need not fit memory."""
    found = _prepared(recording, vehicle, None, None, None, None)
    going, since = SlipFilter(found.sds, found.walks), None
    place = Place()
    for first in range(0, len(recording), rows):
        part = slice(first, first + rows)
        time, anew = found.time[part], found.anew[part]
        filtered = run(time, found.speeds[part], found.sds, anew, found.walks, going=going, since=since)
        estimates = found.estimates(recording.select(part), filtered, _Rows(part, place))
        since = float(time[-1])
        place = Place(float(estimates["distance"][-1]), since, float(estimates["ground_speed"][-1]))
        yield estimates


@dataclass(frozen=True)
class _Rows:
    """Rows of a log, and where the machine was before them."""

    rows: slice
    before: Place


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What a log's filter needs: instants (n,), speeds (n, 1 + wheels), their SDs, where motion begins anew and
    which rows stand at such a gap; and what is told of it."""

    time: Floats
    speeds: Floats
    sds: Floats
    anew: npt.NDArray[np.bool_]
    away: npt.NDArray[np.bool_]
    walks: Walks
    rims: tuple[Rim, ...]
    standstill: float
    about: dict[str, Any]
    notes: tuple[str, ...]

    def whole(self) -> _Rows:
        return _Rows(slice(None), Place())

    def estimates(
        self, recording: Recording, found: Filtered, of: _Rows, *, smooth: bool = False
    ) -> Estimates:
        """The table of the recording's rows."""
        columns = columns_of(
            found.state, found.covariance, self.rims, self.time[of.rows], self.standstill, of.before
        )
        columns |= {"nis": found.nis, "channels": found.channels}
        event = _events(found.state, self.rims, found.outlier, self.away[of.rows], self.standstill)
        for name in (*_PASSED_ON, *recording.references):
            if name in recording.channels:
                columns[name] = recording.channels[name]
        notes = (*self.notes, *_against_travel(found.state, self.rims))
        about = {**self.about, "smooth": smooth}
        return Estimates(
            self.time[of.rows], columns, event, dict(recording.labels), about, tuple(dict.fromkeys(notes))
        )


def _prepared(
    recording: Recording,
    vehicle: Vehicle,
    sensors: Mapping[str, float] | None,
    held: Mapping[str, float] | None,
    gap: float | None,
    standstill_speed: float | None,
) -> _Prepared:
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
    speeds = np.stack([log.channels["ground_speed"], *(rim.values for rim in rims)], axis=1)
    sds = np.array([noise["ground_speed"], *(rim.noise for rim in rims)])
    radii = tuple(Rim(rim.wheel, rim.radius, rim.spread) for rim in rims)
    del rims  # whose speeds stand in the array now
    anew = _anew(log.time, speeds, GAP if gap is None else gap)
    walks = choose_walks(log.time, speeds, sds, anew)
    if guessed:
        shown = ", ".join(f"{name} ({noise[name]:.3g})" for name in guessed)
        notes.append(f"The noise of {shown} is a guess from the vehicle's size: give it under 'sensors'.")
    heard = [note for note in recording.notes if not note.startswith("There is no drawbar_force")]
    return _Prepared(
        log.time,
        speeds,
        sds,
        anew,
        _away(anew),
        walks,
        radii,
        STANDSTILL if standstill_speed is None else standstill_speed,
        _about(recording, vehicle, noise, periods, walks, zero),
        (*heard, *unit_warnings(recording, vehicle), _WHAT_IS_MISSING, *notes),
    )


_WHAT_IS_MISSING = (
    "There is no drive torque: slip, speeds and distance are estimated, and maps of slip can be drawn; adhesion, soil "
    "resistance, net traction and efficiency cannot be had."
)


def _anew(time: Floats, speeds: Floats, gap: float) -> npt.NDArray[np.bool_]:
    """Rows (n,) before which no speed was measured for longer than ``gap`` [s], and the first. In blocks, since logs are long."""
    found, heard = np.empty(len(time), dtype=bool), -np.inf
    for first in range(0, len(time), _BLOCK):
        part = slice(first, first + _BLOCK)
        measured = np.isfinite(speeds[part]).any(axis=1)
        last = np.maximum.accumulate(np.r_[heard, np.where(measured, time[part], -np.inf)])
        found[part] = time[part] - last[:-1] > gap
        heard = float(last[-1])
    return found


def _against_travel(state: Floats, rims: Sequence[Rim]) -> list[str]:
    """A sentence on wheels that turn backward while the machine goes forward, most of the time."""
    v = state[:, 0]
    odd = []
    for i, rim in enumerate(rims):
        u = v + state[:, i + 2]
        moving = (np.abs(v) > STANDSTILL) & (np.abs(u) > STANDSTILL)
        if moving.any() and np.mean((u * v)[moving] < 0) > 0.5:
            odd.append(rim.wheel)
    if not odd:
        return []
    return [
        f"The wheel speed of {', '.join(odd)} is against the travel: write 'sign: -1' for it in the profile."
    ]


def _events(
    state: Floats,
    rims: Sequence[Rim],
    outlier: npt.NDArray[np.bool_],
    away: npt.NDArray[np.bool_],
    standstill: float,
) -> npt.NDArray[np.uint8]:
    event = np.where(outlier, _OUTLIER, 0).astype(np.uint8)
    fastest = np.abs(state[:, 0])
    for i in range(len(rims)):
        fastest = np.maximum(fastest, np.abs(state[:, 0] + state[:, i + 2]))
    event[fastest <= standstill] = _STILL
    event[away] = _GAP
    return event


def _away(anew: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Rows (n,) on both sides of a gap."""
    after = anew.copy()
    after[0] = False
    return np.asarray(after | np.r_[after[1:], False])


def _about(
    recording: Recording,
    vehicle: Vehicle,
    noise: Mapping[str, float],
    held: Mapping[str, float],
    walks: Walks,
    zero: Mapping[str, zero_slip.Ratio | None],
) -> dict[str, Any]:
    """What the table was made from, ready for JSON."""
    from terragrip import __version__

    about = {
        "version": __version__,
        "method": METHOD,
        "smooth": False,
        "vehicle": vehicle.to_dict(),
        "recording": {"source": recording.source, "sha256": recording.sha256},
        "settings": {
            "noise": dict(noise),
            "held": dict(held),
            "walks": {"jerk": walks.jerk, "change": walks.change},
        },
        "zero_slip": {
            wheel_of(name): {
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

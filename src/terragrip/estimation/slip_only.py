"""Properties of a whole log without torque: the zero of slip, and the speed below which the rims read nothing.

The estimates are the kernel's method TG_SPEEDS; while samples come in, the vehicle file alone gives the zero of slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.rims import DRIVE, Rim, at_zero, calibrated_scale, rims_of
from terragrip.estimation.zero_slip import REMEDY, Zero, zero_of
from terragrip.recording import Recording
from terragrip.recording.schema import has_engine_torque
from terragrip.vehicle import Vehicle

_MOVING = 0.1  # m/s
_APART = 2.0  # s between ground speeds
_BLIND = 5  # rows with rims at rest while the vehicle moves
_OF_KMH = 1 / 3.6  # m: the radius of any rim whose speed in km/h is read as rad/s
_NEARLY = 0.01  # of it
_WIDEST = 0.5  # m/s: a wider dead band is a missing speed
WHAT_IS_MISSING = (
    "There is no drive torque: slip, speeds and distance are estimated, and maps of slip can be drawn; adhesion, soil "
    "resistance, net traction and efficiency need a torque."
)

DRIVELINE = (
    "The log has the engine's torque: with a 'driveline' in the vehicle file, adhesion, soil resistance, net traction and efficiency of "
    "all driven wheels together can be estimated."
)

_WHICH = " wheel ... "


@dataclass(frozen=True)
class SlipReference:
    """Rims of a log, the zero of each that has one, the rims' dead band [m/s], and sentences for the user."""

    rims: tuple[Rim, ...]
    zero: dict[str, Zero]
    dead_band: float
    notes: tuple[str, ...]


def slip_reference_in(log: Recording, vehicle: Vehicle) -> SlipReference:
    """The slip reference from a log without torque; raises InputError if a wheel of it is not the vehicle's, or none of them is driven.

    Slip of a wheel is relative to the radius of the vehicle file. The drive train's speed depends on a radius set in the machine. It
    is compared with the log's own zero, unless the vehicle's calibration gives the radii.
    """
    _require_driven(log, vehicle)
    rims, zero, notes = [], {}, [WHAT_IS_MISSING]
    if has_engine_torque(log.channels) and vehicle.driveline is None:
        notes.append(DRIVELINE)
    radii = vehicle.radii if vehicle.knows_wheels else {}
    alike = dict[str, list[str]]()  # a sentence, and the wheels of which it is true
    for rim in rims_of(vehicle, log.channels, log.source):
        radius = 1.0 if rim.wheel == DRIVE else rim.radius
        at = zero_of([log], rim.channel, radius, radii=radii, half_track=(vehicle.track or 0.0) / 2)
        if at is not None:
            zero[rim.wheel] = at
        learns = rim.wheel == DRIVE and calibrated_scale(vehicle) is None
        rims.append(at_zero(rim, at) if learns and at is not None else rim)
        if at is not None and REMEDY in at.doubt and not learns and _calibrated(rim, vehicle):
            continue  # the pass without load has been driven
        for one in _notes(rim, at, learns):
            alike.setdefault(one.replace(f" wheel {rim.wheel} ", _WHICH), []).append(rim.wheel)
    for one, wheels in alike.items():
        remedied = any(REMEDY in note for note in notes)  # which once is enough for all wheels
        sentence = one.replace(_WHICH, f" wheel{'s' * (len(wheels) > 1)} {', '.join(wheels)} ")
        notes.append(sentence.replace(f": {REMEDY}", "") if remedied else sentence)
    if "wheel_based_speed" in log.channels and not any(rim.wheel == DRIVE for rim in rims):
        notes.append("wheel_based_speed is not used: the wheels have speeds of their own.")
    band, rows = _dead_band(log, rims)
    if rows:
        why = f"while the vehicle moves, at up to {band:.2g} m/s: they cannot measure less, so slip is missing there (event gap)."
        if band == _WIDEST:
            why = (
                f"where ground_speed is {band:.2g} m/s or more: wheel speeds are missing, or the ground speed is wrong at rest. "
                "Slip is missing where the rims are slower (event gap)."
            )
        notes.append(f"The rims read 0 in {rows} rows {why}")
    return SlipReference(tuple(rims), zero, band, tuple(notes))


def _require_driven(log: Recording, vehicle: Vehicle) -> None:
    free = [wheel for wheel in log.wheels if wheel in vehicle.free_wheels]
    if free and free == list(log.wheels):
        drive = "leave these out, for wheel_based_speed" if "wheel_based_speed" in log.channels else ""
        raise InputError(
            f"is missing: the log has speeds of free wheels alone ({', '.join(free)}), whose slip says nothing",
            file=log.source,
            place=f"column wheel_speed_{vehicle.driven_wheels[0]}",
            hint=drive or "name its column in a profile, or correct 'driven' in the vehicle file",
            page="vehicle#signals-that-are-missing",
        )


def _calibrated(rim: Rim, vehicle: Vehicle) -> bool:
    return rim.wheel == DRIVE or rim.wheel in vehicle.calibration.wheel_radius


def _notes(rim: Rim, zero: Zero | None, learns: bool) -> list[str]:
    """Sentences on the zero of slip of a rim."""
    what = "the drive" if rim.wheel == DRIVE else f"wheel {rim.wheel}"
    if zero is None:
        if not learns:
            return []
        return [
            "The log is too short to determine the zero-slip radius: slip counts from the speed that the machine reports, to about "
            f"{rim.spread:.0%}."
        ]
    base = rim.scale if rim.wheel == DRIVE else rim.radius
    beside = "the vehicle file says" if learns or rim.wheel != DRIVE else "before calibration"
    if rim.has_radius:
        at, beside = (
            f"radius of {what} in this log: {zero.ratio * base:.4f} ± {zero.std * base:.4f} m",
            f" ({beside} {base:.4f} m)",
        )
    else:
        at, beside = (
            f"ground speed in this log: {zero.ratio:.4f} ± {zero.std:.4f} of the speed that the machine reports",
            "",
        )
    sentence = f"Zero-slip {at}, from {zero.windows} windows of the lightest work{beside}"
    if (
        rim.has_radius
        and abs(zero.ratio * base / _OF_KMH - 1) < _NEARLY
        and abs(zero.ratio - 1) > max(2 * rim.spread, zero.std)
    ):
        # nearly the file's: no other check can tell them apart
        scale = f"'scale: {_OF_KMH / base:.5g}, unit: rad/s'"
        return [
            f"{sentence}. It is 1/3.6 m: is the wheel speed its rim's in km/h? Then give {scale} in a profile."
        ]
    if zero.doubt:
        return [f"{sentence}; {zero.doubt}."]
    if learns:
        return [f"{sentence}. Slip counts from there."]
    own = rim.wheel != DRIVE and f"{zero.ratio:.3f}" != "1.000"
    return [f"{sentence}." + " Slip counts from the file's; 'terragrip calibrate' takes this one." * own]


def _dead_band(log: Recording, rims: Sequence[Rim]) -> tuple[float, int]:
    """Ground speed [m/s] up to which the rims read 0 while the vehicle moves, and the number of such rows."""
    ground = log.channels["ground_speed"]
    speeds = [log.channels[rim.channel] for rim in rims]
    measured = np.isfinite(speeds).any(axis=0)
    still = measured & np.all([~np.isfinite(s) | (s == 0) for s in speeds], axis=0)
    known = np.isfinite(ground)
    if not still.any() or known.sum() < 2:
        return 0.0, 0
    # By the slower of the speeds before and after, which must be close: a stop may lie between them.
    when, speed, at = log.time[known], np.abs(ground[known]), log.time[still]
    before = np.clip(np.searchsorted(when, at, side="right") - 1, 0, len(when) - 1)
    after = np.clip(np.searchsorted(when, at), 0, len(when) - 1)
    slower = np.minimum(speed[before], speed[after])
    moving = slower[(slower > _MOVING) & (when[after] - when[before] < _APART)]
    if len(moving) < _BLIND:
        return 0.0, 0
    return min(float(np.quantile(moving, 0.9)), _WIDEST), len(moving)

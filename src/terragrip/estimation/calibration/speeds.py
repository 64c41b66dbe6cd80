"""Rolling radii from speeds alone, where no torque was logged: the zero of slip, found as `estimate` finds it."""

from __future__ import annotations

from collections.abc import Sequence

from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown
from terragrip.estimation.zero_slip import UNTOLD, WINDOW, Span, zero_of
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def calibrate_radii(
    logs: Sequence[Recording],
    vehicle: Vehicle,
    sources: Sequence[str],
    light: Sequence[Span | None] | None = None,
) -> Calibration:
    """The radius at which each wheel does not slip in these logs, as a `Calibration`.

    Of the drive train's speed (``wheel_based_speed``) all driven wheels get the one radius at which it would be right. ``light``: of
    each log the span [s] without load, where the user knows one.
    """
    found: list[Quantity] = []
    unknown: list[Unknown] = []
    for wheel, data, driven in zip(vehicle.wheels, vehicle.wheel_data, vehicle.driven, strict=True):
        channel, radius = f"wheel_speed_{wheel}", data.radius
        if not any(channel in log for log in logs):
            if not driven:
                continue
            channel, radius = "wheel_based_speed", 1.0
        zero = zero_of(logs, channel, radius, light)
        name = f"wheel_radius {wheel}"
        if zero is None:
            why = "too few windows of steady motion; 40 s without load are needed"
            unknown.append(Unknown(name, why))
        elif zero.std >= UNTOLD and zero.ratio == 1:
            unknown.append(Unknown(name, zero.doubt))
        else:
            sentence = f"ground speed over wheel speed in {zero.windows} windows of the lightest work, which are called zero slip"
            if zero.doubt:
                sentence += f" (the interval holds the doubt: {zero.doubt})"
            value, std = zero.ratio * data.radius, zero.std * data.radius
            told = tuple(
                Evidence(
                    source,
                    float(log.time[0]),
                    float(log.time[-1]),
                    int(log.time[-1] - log.time[0]) // int(WINDOW),
                )
                for log, source in zip(logs, sources, strict=True)
                if channel in log
            )
            found.append(Quantity("wheel_radius", value, std, "m", told, sentence, wheel=wheel))
    relative = max((q.std / q.value for q in found), default=0.0)
    return Calibration(tuple(found), tuple(unknown), {"wheel_radius": relative} if relative else {})

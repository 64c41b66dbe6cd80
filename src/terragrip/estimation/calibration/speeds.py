"""Rolling radii from speeds alone, where no torque was logged: the zero of slip, found as `estimate` finds it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown
from terragrip.estimation.zero_slip import UNDETERMINED, WINDOW, Span, Zero, zero_of
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def calibrate_radii(
    logs: Sequence[Recording],
    vehicle: Vehicle,
    sources: Sequence[str],
    light: Sequence[Span | None] | None = None,
) -> Calibration:
    """The radius at which each wheel does not slip in these logs, as a `Calibration`.

    Of the drive train's speed (``wheel_based_speed``) all driven wheels get the one radius at which it would be right, or, where the
    vehicle file gives no radii, that speed its gain. ``light``: of each log the span [s] without load, where the user knows one.
    """
    quantities: list[Quantity | Unknown] = []
    if vehicle.knows_wheels:
        for wheel, data, driven in zip(vehicle.wheels, vehicle.wheel_data, vehicle.driven, strict=True):
            channel, radius = f"wheel_speed_{wheel}", data.radius
            if not any(channel in log for log in logs):
                if not driven:
                    continue
                channel, radius = "wheel_based_speed", 1.0
            zero = zero_of(logs, channel, radius, light, vehicle.radii, (vehicle.track or 0.0) / 2)
            radius_of = Quantity(
                "wheel_radius", data.radius, 0.0, "m", _evidence(logs, sources, channel), "", wheel=wheel
            )
            quantities.append(_scaled(radius_of, zero))
    else:
        zero = zero_of(logs, "wheel_based_speed", 1.0, light)
        gain = Quantity(
            "wheel_based_speed_gain", 1.0, 0.0, "1", _evidence(logs, sources, "wheel_based_speed"), ""
        )
        quantities.append(_scaled(gain, zero))
    known = tuple(q for q in quantities if isinstance(q, Quantity))
    relative = max((q.std / q.value for q in known), default=0.0)
    unknown = tuple(u for u in quantities if isinstance(u, Unknown))
    return Calibration(known, unknown, {"wheel_radius": relative} if relative else {})


def _scaled(stated: Quantity, zero: Zero | None) -> Quantity | Unknown:
    """What the vehicle file states (a radius, or a gain, its inverse) at the zero of slip."""
    if zero is None:
        return Unknown(stated.name, "too few windows of steady motion; 40 s without load are needed")
    if zero.std >= UNDETERMINED and zero.ratio == 1:
        return Unknown(stated.name, zero.doubt)
    sentence = (
        f"ground speed over wheel speed in {zero.windows} windows of the lightest work, taken as zero slip"
    )
    if zero.doubt:
        sentence += f" (the interval covers the doubt: {zero.doubt})"
    if stated.key == "wheel_based_speed_gain":
        value, std = stated.value / zero.ratio, stated.value * zero.std / zero.ratio**2
    else:
        value, std = stated.value * zero.ratio, stated.value * zero.std
    return replace(stated, value=value, std=std, sentence=sentence)


def _evidence(logs: Sequence[Recording], sources: Sequence[str], channel: str) -> tuple[Evidence, ...]:
    return tuple(
        Evidence(
            source, float(log.time[0]), float(log.time[-1]), int(log.time[-1] - log.time[0]) // int(WINDOW)
        )
        for log, source in zip(logs, sources, strict=True)
        if channel in log
    )

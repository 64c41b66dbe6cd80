"""Rolling radii from speeds alone, where no torque was logged: the drive must have been without load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terragrip.estimation import zero_slip
from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle


def calibrate_radii(logs: Sequence[Recording], vehicle: Vehicle, sources: Sequence[str]) -> Calibration:
    """The radius at which each wheel does not slip in these logs, as a `Calibration`.

    Of the drive train's speed (``wheel_based_speed``) all driven wheels get the one radius at which it would be right.
    """
    found: list[Quantity] = []
    unknown: list[Unknown] = []
    for wheel, radius, driven in zip(vehicle.wheels, vehicle.wheel_data, vehicle.driven, strict=True):
        channel = f"wheel_speed_{wheel}"
        if any(channel in log for log in logs):
            ratio, told = _ratio(logs, channel, radius.radius, sources)
        elif driven:
            ratio, told = _ratio(logs, "wheel_based_speed", 1.0, sources)
        else:
            continue
        if ratio is None:
            why = "too few windows of steady straight motion; 40 s without load are needed"
            unknown.append(Unknown(f"wheel_radius {wheel}", why))
            continue
        sentence = (
            f"ground speed over wheel speed in {ratio.windows} steady windows, taken to be without slip"
        )
        value, std = ratio.value * radius.radius, ratio.std * radius.radius
        found.append(Quantity("wheel_radius", value, std, "m", told, sentence, wheel=wheel))
    relative = max((q.std / q.value for q in found), default=0.0)
    return Calibration(tuple(found), tuple(unknown), {"wheel_radius": relative} if relative else {})


def _ratio(
    logs: Sequence[Recording], channel: str, radius: float, sources: Sequence[str]
) -> tuple[zero_slip.Ratio | None, tuple[Evidence, ...]]:
    ratios, told = [], []
    for log, source in zip(logs, sources, strict=True):
        if channel not in log:
            continue
        of_log, _ = zero_slip.ratios(log, channel, radius)
        ratios.append(of_log)
        told.append(Evidence(source, float(log.time[0]), float(log.time[-1]), len(of_log)))
    return zero_slip.average(np.concatenate([np.empty(0), *ratios])), tuple(told)

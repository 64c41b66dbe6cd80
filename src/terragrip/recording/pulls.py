"""The drawbar force over a whole drive against the weight and the wheels' thrust: sentences for the user, never errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.recording.ranks import quantile
from terragrip.recording.stretches import is_one_value
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.mechanics import Means
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

PULL = 0.03  # of the weight: a mean larger than any offset of a sensor
_NO_PULL = 1e-3  # of the weight: less than any tool, or than a load cell resolves
_LEAST = 25  # windows
_SURE = 3.0  # standard errors


def pull_warnings(means: Means, recording: Recording, vehicle: Vehicle) -> list[str]:
    """The drawbar force against its limits: backward, and less than the wheels' thrust, over a whole drive."""
    if "drawbar_force" not in recording.channels or not means.thrusts:
        return []
    pull = means.of(recording.channels["drawbar_force"]) / vehicle.mass / STANDARD_GRAVITY
    left = means.thrust / STANDARD_GRAVITY
    known = np.isfinite(pull) & np.isfinite(left)
    if known.sum() < _LEAST:
        return []
    moved = means.moved(recording) / STANDARD_GRAVITY
    pulled, thrust, rest = (float(np.mean(each[known])) for each in (pull, left + pull, left - moved))
    together = means.fit(left + pull - moved, pull)
    if pulled < -PULL and together.slope < _SURE * together.error:  # else a trailer pushes downhill
        shown = f"is {pulled:.2g} of the weight on average"
        return [WrongSign.of(["drawbar_force"], shown, "a backward pull is")]
    if rest < -PULL and -2 * thrust + rest > -PULL:  # turned, they leave a resistance
        shown = f"{thrust:.2g} of the weight on average, against a drawbar force of {pulled:.2g}"
        names = [f"drive_torque_{wheel}" for wheel in vehicle.driven_radii]
        return [WrongSign.of(names, shown, "forward is", who="The drive torques over the wheel radius are")]
    if rest < -PULL:
        shown = f"torques over the radius of {thrust:.2g} of the weight and a pull of {pulled:.2g}: the units of both?"
        sentence = (
            f"The drive torques over the wheel radius are {thrust:.2g} of the weight on average and the drawbar force {pulled:.2g}, "
            "which leaves nothing to drive the vehicle: check the units of both, and that each wheel has its torque."
        )
        names = ["drawbar_force", *(f"drive_torque_{wheel}" for wheel in vehicle.driven_radii)]
        return [WrongSign(sentence, names, shown, sure=False)]
    cell = recording.channels["drawbar_force"] / vehicle.mass / STANDARD_GRAVITY
    if 0 < quantile(np.abs(cell[np.isfinite(cell)]), 0.95) < _NO_PULL:  # one without a tool shows its noise
        return [
            "drawbar_force stays below a thousandth of the weight: it may be in kN: write 'unit: kN' for it in the profile."
        ]
    return []


def silent_cell(recording: Recording, vehicle: Vehicle) -> list[str]:
    """A drawbar force of one value in all rows, which no cell reads; of 0 only where the vehicle file has one's noise, zero or gain."""
    pull, unsure = recording.channels.get("drawbar_force"), vehicle.uncertainty
    stated = (vehicle.sensors.drawbar_force, unsure.drawbar_gain, unsure.drawbar_offset)
    if pull is None or not is_one_value(pull):
        return []
    value = float(pull[np.isfinite(pull)][0])
    if value:
        return [
            f"drawbar_force is {value:.4g} N in all rows: a cell's zero with nothing towed, which 'terragrip calibrate' finds, or one that "
            "is not connected, and then what a tool pulls is taken for soil resistance: leave the column out."
        ]
    if not (any(stated) or vehicle.calibration.drawbar_offset):
        return []
    return [
        "drawbar_force is exactly 0 in all rows, which no cell reads, but the vehicle file has a cell's errors: if it was not connected, "
        "leave the column out."
    ]

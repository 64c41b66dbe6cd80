"""Signs that names and motion alone show, without a vehicle file: sentences for the user, never errors.

Straight ahead the torques of an axle's two wheels rise together: where one falls as the other rises, by as much, one of the two counts
backward, and it is not the one that pulls while the vehicle drives forward. More pull needs more torque, and the side of the faster wheels
is the outer one of a turn. None of that needs a radius, a mass, or a torque in N m.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.recording.mechanics import means_of
from terragrip.recording.ranks import quantile
from terragrip.recording.sides import are_opposed, one_pulls, opposed_note
from terragrip.recording.turn_rates import opposite_turn
from terragrip.recording.turns import SURE, agreement, filled, filled_channel, windows
from terragrip.recording.wrong_sign import WrongSign

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

# Of the pace that a twentieth of the windows exceed; of the pace, from side to side.
_DRIVING, _STRAIGHT = 0.3, 0.05
_LEAST = 15  # windows of 2 s
# Of their difference, the sum of two mean torques of which one is turned: gains of 25 % leave .11.
_EVEN = 0.3
_AGAINST = 0.7  # correlation, of the other sign
_ERRORS = 3.0  # standard errors


def plain_sign_warnings(recording: Recording, *, by_wheels: bool) -> list[str]:
    """Sentences on torques, drawbar force and yaw rate of the opposite sign; ``by_wheels``: no position shows the turns."""
    pairs = _pairs(recording)
    torques = [note for pair in pairs for note in _opposed(recording, *pair)] or _pull(recording)
    return [*torques, *(_yaw(recording, pairs) if by_wheels else [])]


def _pairs(recording: Recording) -> list[tuple[str, str]]:
    """The wheels of which one is the left and one the right of two, by their names, both with a speed."""
    known = {w for w in recording.wheels if np.isfinite(recording.channels[f"wheel_speed_{w}"]).any()}
    ends = (("l", "r"), ("left", "right"))
    pairs = [(w, w.removesuffix(a) + b) for a, b in ends for w in sorted(known) if w.endswith(a)]
    return [pair for pair in pairs if pair[1] in known]


def _straight(left: Floats, right: Floats) -> Bools:
    """Windows (n,) of driving forward and straight ahead, by the speeds of two wheels."""
    pace = (left + right) / 2
    return (pace > _DRIVING * quantile(pace, 0.95)) & (np.abs(right - left) < _STRAIGHT * pace)


def _opposed(recording: Recording, left: str, right: str) -> list[str]:
    names = [f"{quantity}_{w}" for quantity in ("wheel_speed", "drive_torque") for w in (left, right)]
    known = [recording.channels.get(name, np.empty(0)) for name in names]
    if not all(np.isfinite(values).any() for values in known) or np.any(np.diff(recording.time) < 0):
        return []
    *rims, one, other = windows(recording.time, np.array([filled(recording.time, v) for v in known]))
    rows = _straight(rims[0], rims[1])
    if rows.sum() < _LEAST:
        return []
    means = np.array([one[rows].mean(), other[rows].mean()])
    even = abs(float(means.sum())) < _EVEN * abs(float(means[0] - means[1]))
    if not even or not are_opposed(one[rows], other[rows]):
        return []
    if one_pulls(one[rows], other[rows]):
        return [opposed_note((left, right)[int(np.argmin(means))])]
    shown = "one falls where the other rises, straight ahead"
    sentence = f"Of {names[2]} and {names[3]} {shown}: write 'sign: -1' for that which counts backward in the profile."
    return [WrongSign(sentence, names[2:], shown, sure=False)]


def _pull(recording: Recording) -> list[str]:
    """The sum of all torques against the drawbar force over windows of driving forward."""
    channels = recording.channels
    names = [n for n in channels if n.startswith("drive_torque_") and np.isfinite(channels[n]).any()]
    means = means_of(recording) if names and "drawbar_force" in channels else None
    if means is None:
        return []
    torque, pull = np.sum([means.of(channels[n]) for n in names], axis=0), means.of(channels["drawbar_force"])
    fit, known = means.fit(torque, pull), np.isfinite(torque) & np.isfinite(pull)
    if fit.alike > -_AGAINST or fit.slope + _ERRORS * fit.error > 0 or not known.any():
        return []
    signs = float(np.mean(torque[known])), float(np.mean(pull[known]))
    if signs[0] > 0 > signs[1]:
        odd, shown, rule = ["drawbar_force"], "falls where the wheels' torques rise", "a backward pull is"
    elif signs[1] > 0 > signs[0]:
        odd, shown, rule = names, "falls where the drawbar force rises", "forward is"
    else:
        return []
    return [WrongSign.of(odd, shown, rule)]


def _yaw(recording: Recording, pairs: list[tuple[str, str]]) -> list[str]:
    yaw = recording.channels.get("angular_velocity_z")
    if yaw is None or not pairs:
        return []
    speeds = [[filled_channel(recording, f"wheel_speed_{w}") for w in p] for p in pairs]
    turn = np.mean([right - left for left, right in speeds], axis=0)
    return [opposite_turn(["the wheels' speeds"])] if agreement(recording.time, yaw, turn) < -SURE else []

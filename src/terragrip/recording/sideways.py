"""Acceleration to the left and roll against turns: sentences for the user, never errors.

An accelerometer across the vehicle reads v psi' + g sin(roll), left and left side up positive, which moves loads from side to side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.mechanics import Means
    from terragrip.recording.table import Recording

_SURE = 3.0  # standard errors


def sideways_warnings(recording: Recording, means: Means | None, turn: Floats | None) -> list[str]:
    """Sentences on an acceleration_y, or a roll, of another sign than turns and the two of them show; ``turn`` (rows,) [rad/s] is the
    rate of turn by sensor or positions."""
    sideways, roll = (recording.channels.get(name) for name in ("acceleration_y", "roll"))
    if means is None or sideways is None:
        return []
    felt, still = means.of(sideways), np.zeros(means.rows.sum())
    turning = still if turn is None else means.speed * np.nan_to_num(means.of(turn))
    leaning = still if roll is None else STANDARD_GRAVITY * means.of(np.sin(roll))
    by_turns, by_roll = means.fit(felt, turning, beside=leaning), means.fit(felt, leaning, beside=turning)
    if by_turns.is_opposite:
        return [WrongSign.of(["acceleration_y"], "falls in turns to the left", "left is")]
    if not by_roll.is_opposite:
        return []
    if by_turns.slope > _SURE * by_turns.error:
        return [
            WrongSign.of(["roll"], "falls where acceleration_y shows the left side up", "left side up is")
        ]
    both = "roll and acceleration_y lean to opposite sides"
    sentence = (
        f"{both}: left, and left side up, are positive; write 'sign: -1' for one of them in the profile."
    )
    return [WrongSign(sentence, ["roll", "acceleration_y"], both, sure=False)]

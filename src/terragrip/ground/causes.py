"""Whose a change is: the ground's, or also what a tool does that is lowered or raised.

Where the drawbar force is measured, a tool moves the pull (mu - rho_s) and leaves rho_s. Where it is not, its pull is part of rho_s, and mu
balances rho_s on any ground: then the scale of mu = a g(s) is the ground's alone.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from terragrip.arrays import Floats
from terragrip.ground.signals import signals_of
from terragrip.ground.steps import A_LENGTH
from terragrip.soil.blocks import Blocks
from terragrip.vehicle import Vehicle

GROUND_ALONE, OR_TOOL = "ground", "tool or ground"
Pull = Literal["measured", "unknown", "none"]
"""What is known of the drawbar force."""
LEVELS = ("soil_resistance", "curve_scale")
_NEAR = 2 * A_LENGTH
"""Steps compared on each side: two lengths of vehicle and tool."""
_RATIO = 2.0
"""The ground's: the pull moves less than so many times as far as rho_s; of an unknown pull, rho_s than the scale, in SDs of a step."""


def pull_of(vehicle: Vehicle, measured: bool) -> Pull:
    """What a log of `vehicle` shows of the pull; `measured`: it has a drawbar force."""
    if measured:
        return "measured"
    return "none" if vehicle.uncertainty.drawbar_force == 0 else "unknown"


def signs_of(steps: Blocks) -> Floats:
    """What distinguishes the two (steps, 4): ln of rho_s and of the curve's scale, rho_s, mu - rho_s; NaN where not shown."""
    levels = signals_of(steps, LEVELS)
    forces = np.column_stack([steps.resistance, steps.mean_adhesion - steps.resistance])
    return np.hstack([levels, np.where(np.isfinite(levels[:, :1]), forces, np.nan)])


def cause_of(one: Floats, other: Floats, within: Floats, pull: Pull) -> str:
    """The cause of a change by its signs before it and after it (steps, 4); `within`: SDs of a step in `LEVELS`.

    A tool's where nothing shows that it is not.
    """
    if pull == "none":
        return GROUND_ALONE
    logs, scale, resistance, force = np.abs(_means(other[:_NEAR]) - _means(one[-_NEAR:]))
    if pull == "measured":
        return GROUND_ALONE if force < _RATIO * resistance else OR_TOOL
    return GROUND_ALONE if _RATIO * scale / within[1] > logs / within[0] else OR_TOOL


def _means(signs: Floats) -> Floats:
    """By column; NaN where a column shows nothing."""
    shown = np.isfinite(signs)
    count = shown.sum(axis=0)
    total = np.where(shown, signs, 0.0).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))

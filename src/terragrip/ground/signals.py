"""What a change of the ground shows in: signals of blocks that the driver's own doing (speed, pull, tool) leaves alone.

Slip and adhesion move together with the pull on one and the same ground. So the signal is their relation: the scale a of
mu = a g(s). With it rho_s, and how much rho_s and mu vary within a block. Slip and adhesion themselves are offered for those who want them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import FLOOR, LARGEST_SLIP, Blocks
from terragrip.soil.signature import USUAL_CURVE

GROUND = ("soil_resistance", "curve_scale", "soil_resistance_sd", "adhesion_sd")
"""The signals that depend on the ground only. `_sd`: ln of the SD within a block."""
_SCALE, _SCALE_SD, _ADHESION_SD = USUAL_CURVE["a"], 0.5, 0.03
"""Before any mu is known a is 0.85 +- 0.5, as the kernel's curve has it; a block's mu scatters by 0.03 about its curve."""
_SHOWN = 0.25
"""The scale counts from where slip and mu tell at least this much of it (inverse variance) beside what is known before."""
_SLIPS = np.linspace(0, LARGEST_SLIP, 601)
_OFFSET = 0.02
"""rho_s at which its errors (drawbar's zero, slope) are as much additive as the ground's variation is proportional."""


@dataclass(frozen=True)
class Law:
    """What is known of a signal before a drive: mean and SD over all grounds, and SD on one, from place to place.

    Resistance and scale are in logarithms: ground varies by a share of itself, hard ground by little and soft ground by much.
    """

    mean: float
    sd: float
    within: float


LAWS: dict[str, Law] = {
    "soil_resistance": Law(-1.97, 0.5, 0.12),
    "curve_scale": Law(-0.16, 0.45, 0.10),
    "soil_resistance_sd": Law(-5.7, 0.8, 0.45),
    "adhesion_sd": Law(-5.1, 0.8, 0.4),
    "slip": Law(0.12, 0.12, 0.03),
    "adhesion": Law(0.25, 0.15, 0.03),
    "curve_a": Law(0.77, 0.4, 0.1),
    "slip_sd": Law(-4.2, 0.5, 0.35),
    "soil_resistance_std": Law(-5.2, 0.5, 0.2),
    "adhesion_std": Law(-4.8, 0.5, 0.2),
    "slip_std": Law(-3.6, 0.5, 0.2),
}
SIGNALS = tuple(LAWS)
"""All signals on offer. `curve_a`: the kernel's curve while driving, which lags by seconds; `_std`: ln of the estimates' own SD."""


def signals_of(blocks: Blocks, names: tuple[str, ...] = GROUND) -> Floats:
    """Signals (blocks, names); NaN where a block shows nothing, or its slip is known to no better than 30 %.

    Raises InputError on a name that is none of `SIGNALS`.
    """
    slip, adhesion = blocks.mean_slip, blocks.mean_adhesion
    every = {
        "soil_resistance": np.log(np.maximum(blocks.resistance, -_OFFSET / 2) + _OFFSET),
        "curve_scale": _log_scale(slip, adhesion, blocks.slip_variance.mean(axis=1)),
        "soil_resistance_sd": blocks.roughness[:, 0],
        "adhesion_sd": blocks.roughness[:, 1],
        "slip": slip,
        "adhesion": adhesion,
        "curve_a": blocks.curve_a,
        "slip_sd": blocks.slip_sd,
        "soil_resistance_std": _log_sd(blocks.resistance_variance),
        "adhesion_std": _log_sd(blocks.adhesion_variance.mean(axis=1)),
        "slip_std": _log_sd(blocks.slip_variance.mean(axis=1)),
    }
    for name in names:
        if name not in every:
            raise InputError(f"there is no signal {name!r}", hint=f"choose one of {', '.join(SIGNALS)}")
    creeps = 2 * np.sqrt(blocks.slip_variance.mean(axis=1)) > LARGEST_SLIP  # as just before a standstill
    shown = blocks.known & ~creeps
    out = np.column_stack([every[name] for name in names])
    return np.asarray(np.where(shown[:, None], out, np.nan))


def _log_sd(variance: Floats) -> Floats:
    return np.asarray(0.5 * np.log(variance + FLOOR**2))


def _log_scale(slip: Floats, adhesion: Floats, slip_variance: Floats) -> Floats:
    """ln of the curve's scale, (blocks,); NaN where slip is too small beside its own error to show the curve: the slip itself, and the
    one that mu has on a usual curve, lest noise choose."""
    curve = CURVES["exponential"]
    usual = np.interp(np.abs(adhesion), curve.value(_SLIPS, {"a": _SCALE}), _SLIPS)
    shown = slip * adhesion > 0
    for one in (slip, usual):
        variance = _ADHESION_SD**2 + curve.slope(one, {"a": _SCALE}) ** 2 * slip_variance
        shown &= (_SCALE_SD * curve.value(one, {"a": 1.0})) ** 2 > _SHOWN * variance
    scale = np.maximum(curve_scale(slip, adhesion), 0.1 * _SCALE)
    return np.where(shown, np.log(scale), np.nan)


def curve_scale(slip: Floats, adhesion: Floats) -> Floats:
    """a of mu = a g(s), g the paper's prototype (eq. 8), drawn towards 0.85 where slip is too small to determine it; any shape."""
    shape = CURVES["exponential"].value(slip, {"a": 1.0})
    ridge = (_ADHESION_SD / _SCALE_SD) ** 2
    return np.asarray((adhesion * shape + ridge * _SCALE) / (shape**2 + ridge))

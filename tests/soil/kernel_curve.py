"""The kernel's adhesion curve while driving, `tg_curve_update`, pair by pair: what makes the columns `curve_a` and `curve_a_<wheel>`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from terragrip._kernel import ffi, lib

_MOST = 8
_REFUSED = {
    lib.TG_BAD_ARGUMENT: f"more than {_MOST} pairs of one instant",
    lib.TG_NOT_FINITE: "a step of time or distance, or a pair, that is not a number",
    lib.TG_NOT_POSITIVE: "a negative spread",
    lib.TG_TIME_REVERSED: "a step back in time",
}


class OnlineCurve:
    """The current a of mu = a g(s), g the paper's prototype (eq. 8), with its standard deviation (docs/kernel.md)."""

    def __init__(self) -> None:
        self._curve = ffi.new("tg_curve *", lib.tg_curve_unknown())

    def update(
        self,
        dt: float,
        slip: ArrayLike,
        adhesion: ArrayLike,
        *,
        slip_std: ArrayLike = 0.0,
        adhesion_std: ArrayLike = 0.0,
        adhesion_constant_std: ArrayLike = 0.0,
        radius_std: float = 0.0,
        distance: float = 0.0,
        share: ArrayLike = 1.0,
    ) -> OnlineCurve:
        """Take the pairs of one instant, `dt` s and `distance` m after the last; returns itself.

        slip, adhesion: a number, or up to eight of one instant, weighted by `share` (their loads). The `_std` are 1 SD: of random errors,
        of adhesion's constant error, of the rolling radius (relative). NaN: no pair. Raises ValueError on a negative spread or step back.
        """
        columns = np.broadcast_arrays(
            *(
                np.atleast_1d(np.asarray(x, dtype=float))
                for x in (slip, adhesion, slip_std, adhesion_std, adhesion_constant_std, share)
            )
        )
        if len(columns[0]) > _MOST:
            raise ValueError(_REFUSED[lib.TG_BAD_ARGUMENT])
        if min(np.nanmin(np.append(column, 0.0)) for column in columns[2:5]) < 0:
            raise ValueError(_REFUSED[lib.TG_NOT_POSITIVE])
        pairs = [
            {
                "adhesion": mu,
                "slip": s,
                "adhesion_variance": mu_std**2,
                "slip_variance": s_std**2,
                "adhesion_constant": constant,
                "radius_error": radius_std,
            }
            for s, mu, s_std, mu_std, constant, _ in zip(*columns, strict=True)
        ]
        status = lib.tg_curve_update(
            self._curve,
            dt,
            distance,
            len(pairs),
            ffi.new("tg_pair[]", pairs),
            ffi.new("double[]", columns[5].tolist()),
        )
        if status != lib.TG_OK:
            raise ValueError(_REFUSED[status])
        return self

    def new_ground(self) -> None:
        """Forget: the ground is another one."""
        self._curve[0] = lib.tg_curve_unknown()

    @property
    def a(self) -> float:
        """Scale of the curve."""
        return float(self._curve.a)

    @property
    def a_std(self) -> float:
        """One standard deviation of `a`, random and constant errors."""
        return float(lib.tg_curve_std(self._curve))

"""From curves over slip to the slip of best efficiency, that of best productivity and the front between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats

GRID = np.linspace(0.0, 0.6, 601)
LEVEL = 0.95


@dataclass(frozen=True)
class Best:
    """A slip that is best in one respect: ``slip`` with its ``interval`` (95 %), ``efficiency`` and ``net_traction`` there with theirs."""

    slip: float
    interval: tuple[float, float]
    efficiency: float
    efficiency_interval: tuple[float, float]
    net_traction: float
    net_traction_interval: tuple[float, float]


@dataclass(frozen=True)
class OverSlip:
    """Curves over ``slip`` (slips,), each (draws, slips), the first row the best fit.

    ``efficiency``: useful pull power over the wheels' power; ``net_traction``: pull over the vehicle's weight; ``productivity``:
    net traction times 1 - slip, the pull power per weight and wheel speed ("ground speed times the working area", the paper).
    """

    slip: Floats
    efficiency: Floats
    net_traction: Floats

    @property
    def productivity(self) -> Floats:
        """kappa (1 - s)."""
        return np.asarray(self.net_traction * (1 - self.slip))

    def loss(self, slip: float, level: float = LEVEL) -> float:
        """Efficiency that at ``slip`` all but 1 - ``level`` of the curves lose at most against their own best."""
        at = min(int(np.searchsorted(self.slip, slip)), len(self.slip) - 1)
        drawn = self.efficiency[1:] if len(self.efficiency) > 1 else self.efficiency
        return float(np.quantile(drawn.max(axis=1) - drawn[:, at], level))


def over_slip(
    adhesion: Floats,
    resistance: Floats,
    slip: Floats,
    tire_resistance: float,
    driven: float = 1.0,
    transfer: float = 0.0,
) -> OverSlip:
    """Efficiency and net traction of a vehicle whose driven wheels carry the share ``driven`` of its weight without a pull, and
    ``transfer`` more for each pull of its weight.

    adhesion, resistance: (draws, slips). With all wheels driven this is paper eq. 5 and 7; else the vehicle pulls
    phi mu - (1 - phi) rho_t - rho_s, phi = driven + transfer kappa, and takes in phi (mu + rho_t). 0 where it pulls nothing.
    """
    grip = adhesion + tire_resistance
    alone = driven * grip - tire_resistance - resistance
    phi = np.clip(driven + transfer * alone / np.maximum(1 - transfer * grip, 1e-3), 0.0, 1.0)
    net, gross = phi * grip - tire_resistance - resistance, phi * grip
    efficiency = np.where(net > 0, net / np.where(gross > 0, gross, np.inf) * (1 - slip), 0.0)
    return OverSlip(slip, efficiency, net)


def best_of(curves: OverSlip, values: Floats, level: float = LEVEL) -> Best:
    """Where ``values`` (draws, slips) is largest."""
    at = _peaks(curves.slip, values)
    rows = np.arange(len(values))
    nearest = np.searchsorted(curves.slip, at[0])
    tail = 50 * (1 - level)

    def interval(x: Floats) -> tuple[float, float]:
        low, high = np.percentile(x[1:] if len(x) > 1 else x, [tail, 100 - tail])
        return float(low), float(high)

    nearest = min(int(nearest), len(curves.slip) - 1)
    efficiency, net = curves.efficiency[rows, nearest], curves.net_traction[rows, nearest]
    return Best(
        float(at[0]), interval(at), float(efficiency[0]), interval(efficiency), float(net[0]), interval(net)
    )


def _peaks(slip: Floats, values: Floats) -> Floats:
    """Slip of the largest value of each row (draws,): the grid's, moved by a parabola through the best three.

    Where no value is above 0 there is no best slip: the grid's end stands for it, so that an interval over such rows is wide.
    """
    i = np.clip(np.argmax(values, axis=1), 1, len(slip) - 2)
    rows = np.arange(len(values))
    left, middle, right = (values[rows, i + k] for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, -1.0), 0.0)
    at = slip[i] + np.clip(shift, -1, 1) * (slip[1] - slip[0])
    return np.asarray(np.where(values.max(axis=1) > 0, at, slip[-1]))

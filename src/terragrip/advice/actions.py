"""What to do, in the user's words: load, speed, ballast and its split, tyre pressure; each with what it gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.advice.optimum import Best, OverSlip
from terragrip.advice.result import Action
from terragrip.arrays import Floats
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

WORTH = 0.005
"""Efficiency gained under which nothing is advised."""
MOST_BALLAST = 0.3
"""Share of the mass that ballast is added or taken by at most."""
STEERING = 0.2
"""Share of the weight on the front axle under which steering suffers."""
SOFT = 0.08
"""Soil resistance from which a lower tyre pressure is worth trying."""
PRESSURE = (
    "Try a lower tyre pressure, within what the tyre's maker allows for load and speed.",
    "A longer contact patch lowers rolling resistance and raises grip on soft ground. This drive cannot show how much: drive the same "
    "stretch at both pressures and compare.",
)


@dataclass(frozen=True)
class Work:
    """One soil's work: curves, best slip, and the drive's mean pull over weight and slip by level of pull (levels,), all of equal way."""

    over: OverSlip
    best: Best
    slip: Floats
    pull: Floats
    speed: float
    resistance: float

    @property
    def efficiency(self) -> Floats:
        """Useful over wheel energy of the drive's slips, by each curve (draws,)."""
        net, gross = self._at(self.slip)
        return np.asarray(np.maximum(net, 0).sum(axis=1) / gross.sum(axis=1))

    def _at(self, slip: Floats) -> tuple[Floats, Floats]:
        """(pull, wheel energy per metre), each over weight, (draws, slips)."""
        i = np.clip(np.searchsorted(self.over.slip, slip), 1, len(self.over.slip) - 1)
        net, eta = self.over.net_traction[:, i], self.over.efficiency[:, i]
        pulls = (net > 0.005) & (eta > 0)
        return net, np.where(pulls, net / np.where(pulls, eta, 1.0), 0.02)

    def efficiency_at(self, slip: float) -> Floats:
        """eta of each curve at one slip (draws,)."""
        i = int(np.clip(np.searchsorted(self.over.slip, slip), 0, len(self.over.slip) - 1))
        return self.over.efficiency[:, i]

    def efficiency_of_pull(self, pull: float) -> Floats:
        """eta of each curve where it pulls ``pull`` of its weight (draws,); 0 where it cannot."""
        top = self.over.net_traction.argmax(axis=1)
        enough = self.over.net_traction >= pull
        first = np.where(enough.any(axis=1), enough.argmax(axis=1), top)
        eta = np.take_along_axis(self.over.efficiency, first[:, None], axis=1)[:, 0]
        return np.asarray(np.where(enough.any(axis=1), eta, 0.0))


def gained(difference: Floats) -> tuple[float, tuple[float, float]]:
    """The first curve's gain, and the 95 % interval of all, from draws (draws,)."""
    low, high = np.percentile(difference, [2.5, 97.5])
    return float(difference[0]), (float(min(low, difference[0])), float(max(high, difference[0])))


def actions_for(work: Work, vehicle: Vehicle) -> list[Action]:
    """All that is worth doing, the most gain first."""
    found = [*_load(work, vehicle), *_ballast(work, vehicle), *_drive_more_axles(work, vehicle)]
    found.sort(key=lambda one: -(one.gain or 0.0))
    return [*found, *_speed(work, vehicle), *_split(work, vehicle), *_pressure(work, vehicle)]


def _load(work: Work, vehicle: Vehicle) -> list[Action]:
    """The drawbar load that brings slip to its best."""
    gain, interval = gained(work.efficiency_at(work.best.slip) - work.efficiency)
    now, best = float(np.mean(work.pull)), work.best.net_traction
    low, high = work.best.interval
    slip, more = float(np.mean(work.slip)), best > now
    if low <= slip <= high or more != (slip < low) or gain < WORTH or interval[0] < 0:
        return [
            Action(
                f"Keep the load: no other is certainly better; slip is best at {work.best.slip:.1%} ({low:.1%} to {high:.1%}).",
                "The mean slip lies within the interval of the best one, the load goes up and down about it, or the gain by another is "
                "small or uncertain: "
                f"{100 * gain:.1f} points of efficiency ({100 * interval[0]:.1f} to {100 * interval[1]:.1f}).",
            )
        ]  # fmt: skip
    weight = vehicle.mass * STANDARD_GRAVITY
    what = (
        f"{'Load more' if more else 'Load less'}: pull about {_force(best * weight)} instead of {_force(max(now, 0) * weight)} "
        f"on average ({'a deeper or wider tool' if more else 'a shallower or narrower tool'}), until slip is {work.best.slip:.1%} "
        f"({low:.1%} to {high:.1%})."
    )
    why = (
        "Below the best slip, the machine spends its power on rolling rather than pulling."
        if more
        else "Above the best slip, more of the way is lost in slip than the pull gains."
    )
    return [Action(what, why, gain, interval)]


def _force(newtons: float) -> str:
    return f"{newtons:.0f} N" if newtons < 1e3 else f"{newtons / 1e3:.3g} kN"


def _ballast(work: Work, vehicle: Vehicle) -> list[Action]:
    """The mass at which the present pull is pulled at the best slip."""
    now, best = float(np.mean(work.pull)), work.best.net_traction
    if now <= 0.02 or best <= 0:
        return []
    change = float(np.clip(now / best - 1, -MOST_BALLAST, MOST_BALLAST))
    gain, interval = gained(work.efficiency_of_pull(now / (1 + change)) - work.efficiency_of_pull(now))
    if gain < WORTH or interval[0] < 0 or abs(change) < 0.03:
        return []
    mass = abs(change) * vehicle.mass
    what = (
        f"{'Add' if change > 0 else 'Take off'} about {_round(mass)} kg of ballast if the load stays as it is"
        f"{'' if change > 0 else ', as far as it carries that much'}"
    )
    what += ", distributed so that the axles keep their shares." if len(vehicle.axles) > 1 else "."
    why = (
        "The pull needs more grip than the weight gives at the best slip."
        if change > 0
        else "The machine is heavier than this pull needs: weight that rolls costs power. Keep what steering, lifting and slopes need."
    )
    return [Action(what, why + " Adhesion and resistance per load are assumed unchanged.", gain, interval)]


def _drive_more_axles(work: Work, vehicle: Vehicle) -> list[Action]:
    """Ballast onto the driven axle where one axle only rolls."""
    if vehicle.driven.all() or work.best.net_traction <= 0:
        return []
    return [
        Action(
            "Move ballast from the axle that only rolls to the driven one, as far as steering allows; engage its drive where there is one.",
            "Load on wheels that are not driven costs rolling resistance and gives no grip.",
        )
    ]


def _speed(work: Work, vehicle: Vehicle) -> list[Action]:
    """How fast the advised load can be pulled with the power that there is."""
    best = work.best
    if vehicle.power is None or best.net_traction <= 0:
        return []
    fastest = vehicle.power * best.efficiency / (best.net_traction * vehicle.mass * STANDARD_GRAVITY)
    if fastest < 0.95 * work.speed:
        what = f"At the advised load drive no faster than {fastest:.2g} m/s ({3.6 * fastest:.2g} km/h): that is the limit of the power."
    else:
        what = f"The power allows up to {fastest:.2g} m/s ({3.6 * fastest:.2g} km/h) at the advised load; {work.speed:.2g} m/s were driven."
    why = "While draught does not grow with speed, slip follows the pull alone: beyond the best slip, increase speed, not load."
    return [Action(what, why)]


def _split(work: Work, vehicle: Vehicle) -> list[Action]:
    """The loads of two axles at the advised pull, by the quasi-static formula (physics.md 3)."""
    if len(vehicle.axles) != 2:
        return []
    load = vehicle.axle_loads(drawbar=max(work.best.net_traction, 0.0) * vehicle.mass * STANDARD_GRAVITY)
    share = float(load[0] / load.sum())
    if share >= STEERING:
        return []
    mass = (STEERING - share) * vehicle.mass
    return [
        Action(
            f"Put about {_round(mass)} kg of the ballast onto the front axle.",
            f"At the advised pull the front axle carries {share:.0%} of the weight; under {STEERING:.0%} steering suffers.",
        )
    ]


def _pressure(work: Work, vehicle: Vehicle) -> list[Action]:
    if work.resistance <= SOFT:
        return []
    what, why = PRESSURE
    known = dict.fromkeys(f"{one.pressure / 1e5:.2g} bar" for one in vehicle.wheel_data if one.pressure)
    return [Action(f"{what} The vehicle file has {' and '.join(known)}." if known else what, why)]


def _round(mass: float) -> str:
    """A mass to two digits."""
    return f"{float(f'{mass:.2g}'):g}"

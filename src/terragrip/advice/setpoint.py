"""A set-point of slip for a user's own controller: from estimates to wheel speeds, with rate limits and a safe state.

It advises wheel speeds and commands nothing. Slip follows the pull, so wheel speed alone cannot hold a slip against any
load: what it can do is to let the wheels turn no faster than the ground speed at the set slip allows, so that they do not dig.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from terragrip.errors import InputError
from terragrip.vehicle import Vehicle

FOLLOW, SLOW, STOP = "follow", "slow", "stop"


class Estimated(Protocol):
    """One row of estimates: `Estimate` of the estimator, or anything with columns by name."""

    def __getitem__(self, name: str) -> float: ...


@dataclass(frozen=True)
class Limits:
    """What a set-point may do and when estimates are trusted; SI.

    speed_up, slow_down: the rim speed's change [m/s²]; crawl: share of the wanted speed that it goes with when it is not led by
    slip (starting, untrusted, warned); hold: seconds that a lapse of trust is bridged by the last speed; widest_slip: SD of slip at the
    wanted speed, and widest_nis: NIS a channel, from which an estimate is not trusted; longest_step: seconds between estimates from
    which there was a gap, unless the step before was at least half as long: estimates of a slow bus, up to longest_period [s] apart.
    """

    speed_up: float = 0.5
    slow_down: float = 1.0
    crawl: float = 0.4
    hold: float = 0.5
    widest_slip: float = 0.05
    widest_nis: float = 9.0
    longest_step: float = 0.5
    longest_period: float = 2.0


class SlipSetpoint:
    """Wheel speeds that keep slip at or under a set-point.

    Parameters
    ----------
    vehicle: whose driven wheels are led; radii are the vehicle file's, calibrated ones where it has them.
    slip: the set-point, 0 to 0.6, such as the advice's ``best_efficiency.slip``; speed: the ground speed wanted [m/s], forward.
    limits: see `Limits`.

    ``state`` says what it does: "follow" (led by slip), "slow" (crawls: starting, warned, or estimates not trusted), "stop" (stuck: stays
    until `resume`), ``why`` for what reason. Raises InputError on a slip or speed outside its range.
    """

    def __init__(self, vehicle: Vehicle, slip: float, speed: float, limits: Limits | None = None) -> None:
        if not 0 < slip < 0.6:
            raise InputError(
                f"the slip {slip:g} is not a set-point", hint="give more than 0 and less than 0.6"
            )
        if not (speed > 0 and math.isfinite(speed)):
            raise InputError(f"the speed {speed:g} m/s is not forward", hint="give a positive speed in m/s")
        self.slip, self.speed, self.limits = slip, speed, limits or Limits()
        self._radius = vehicle.driven_radii
        if not self._radius:
            raise InputError("the vehicle drives no wheel", hint="leave out 'driven: false' of one axle")
        self._wheels = tuple(self._radius)
        self._rim = 0.0
        self._time: float | None = None
        self._step = 0.0
        self._trusted_at: float | None = None
        self.state, self.why = SLOW, "starting"

    def resume(self) -> None:
        """Start anew after a stop, from rest."""
        self._rim, self.state, self.why, self._trusted_at = 0.0, SLOW, "starting", None

    def update(self, estimates: Estimated) -> dict[str, float]:
        """The wheel speeds [rad/s] by driven wheel for one row of estimates (``time``, ``event``, ``ground_speed``, ``slip_<w>``,
        ``slip_<w>_std``, ``nis``, ``channels``, as the estimator gives them). The first row only sets the clock. Never NaN."""
        time = float(estimates["time"])
        step = 0.0 if self._time is None else time - self._time
        usual = min(2 * self._step, self.limits.longest_period)
        self._time, self._step = time, step
        late = not 0 <= step <= max(self.limits.longest_step, usual)
        self._judge(estimates, time, "a gap in time" if late else "")
        aim = self._aim(estimates)
        step = min(max(step, 0.0), self.limits.longest_step)
        most, least = self._rim + self.limits.speed_up * step, self._rim - self.limits.slow_down * step
        self._rim = max(min(max(aim, least), most), 0.0)
        return {wheel: self._rim / radius for wheel, radius in self._radius.items()}

    def _judge(self, estimates: Estimated, time: float, lapse: str) -> None:
        """Set state and why."""
        if self.state == STOP:
            return
        event = str(estimates["event"])
        if event == "stuck":
            self.state, self.why = STOP, "stuck"
        elif event in ("immobilization", "push"):
            self.state, self.why = SLOW, event
        elif event == "standstill":
            self.state, self.why = SLOW, "standstill"
        else:
            doubt = lapse or event or self.doubt(estimates)
            if not doubt:
                self.state, self.why, self._trusted_at = FOLLOW, "", time
            else:
                bridged = self._trusted_at is not None and 0 <= time - self._trusted_at <= self.limits.hold
                self.state, self.why = (FOLLOW if bridged else SLOW), doubt

    def doubt(self, estimates: Estimated) -> str:
        """Why a row without an event is not trusted; "" where it is."""
        slips, spreads = (
            [float(estimates[f"slip_{w}{tail}"]) for w in self._wheels] for tail in ("", "_std")
        )
        if not np.isfinite([*slips, *spreads, float(estimates["ground_speed"])]).all():
            return "no slip"
        pace = (
            abs(float(estimates["ground_speed"])) / self.speed
        )  # slip's SD goes with 1/speed: it is judged as it would be at the wanted one
        if max(spreads) * min(pace, 1.0) > self.limits.widest_slip:
            return "slip not known well enough"
        channels = float(estimates["channels"])
        if channels > 0 and float(estimates["nis"]) / channels > self.limits.widest_nis:
            return "measurements contradict each other"
        return ""

    def _aim(self, estimates: Estimated) -> float:
        """The rim speed aimed at [m/s]."""
        crawl = self.limits.crawl * self.speed
        wanted = self.speed / (1 - self.slip)
        if self.state == STOP:
            return 0.0
        if self.state == SLOW:
            return crawl
        if self.why:  # a lapse that is bridged: nothing is raised
            return self._rim
        led = abs(float(estimates["ground_speed"])) / (1 - self.slip)
        actual = max(float(estimates[f"slip_{w}"]) for w in self._wheels)
        return max(min(wanted, led), crawl) if actual > self.slip else wanted

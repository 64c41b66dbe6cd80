"""The warning of immobilization in plain Python: the twin of the kernel's immobilization.c, for tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, isnan

STEEPNESS = 11.36
FAST, MIDDLE, GRIP_FAST, SLOW, MEMORY, LONGEST_LOOK, SELDOM, BACK = 0.1, 0.3, 0.2, 1.0, 5.0, 1.5, 0.15, 3


def curve_at(slip: float) -> float:
    """1 - exp(-k s), the shape of the paper's prototype curve (PHYSICS 5)."""
    return 1 - exp(-STEEPNESS * slip) if slip > 0 else 0.0


@dataclass
class Watch:
    """Told each measurement of the ground speed, says whether the wheels dig or the vehicle is stuck.

    ``limits``: as :func:`~terragrip.estimation.engine.watch_limits` gives them.
    """

    limits: Mapping[str, float]
    age: float = 0.0
    mean_slip: float = 0.0
    mean_adhesion: float = 0.0
    mean_curve: float = 0.0

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """What was seen of the motion; the ground's grip is kept."""
        self.time: float | None = None
        self.evidence = self.spinning = 0.0
        self.looks = 0
        self.sinking = self.stuck = False

    def look(self, time: float, slip: float, sd: float, adhesion: float, rim: float, travel: float) -> str:
        """The event after a measurement at ``time`` [s]: means over the driven wheels of slip, its SD and adhesion, of the
        rims' speed and the ground speed along the travel [m/s]. NaN slip: standstill."""
        if isnan(slip):
            self.forget()
            return ""
        slip = max(slip, -0.2)
        if self.time is not None and time - self.time > LONGEST_LOOK:
            self.forget()
        dt = 0.0 if self.time is None else time - self.time
        confidence = self.limits["confidence"] * max(1.0, dt / SELDOM)
        sure = curve_at(slip - confidence * sd)
        if self.time is None:
            self.slip = self.middle = self.slow = slip
            self.rim = self.slow_rim = rim
            self.adhesion, self.curve = adhesion, sure
        self.time = time
        self.slip += dt / (FAST + dt) * (slip - self.slip)
        self.middle += dt / (MIDDLE + dt) * (slip - self.middle)
        self.slow += dt / (SLOW + dt) * (slip - self.slow)
        self.rim += dt / (FAST + dt) * (rim - self.rim)
        self.slow_rim += dt / (SLOW + dt) * (rim - self.slow_rim)
        self.adhesion += dt / (GRIP_FAST + dt) * (adhesion - self.adhesion)
        self.curve += dt / (GRIP_FAST + dt) * (sure - self.curve)
        self._learn(dt, slip, adhesion, max(curve_at(slip), 0.05))
        self._judge(dt, self.slip - confidence * sd, rim, travel)
        return "stuck" if self.stuck else "immobilization" if self.sinking else ""

    def _learn(self, dt: float, slip: float, adhesion: float, curve: float) -> None:
        if dt > 0:
            gain = dt / (min(MEMORY, self.age) + dt)
            self.mean_slip += gain * (slip - self.mean_slip)
            self.mean_adhesion += gain * (adhesion - self.mean_adhesion)
            self.mean_curve += gain * (curve - self.mean_curve)
        self.age += dt

    def _judge(self, dt: float, sure: float, rim: float, travel: float) -> None:
        limits, turning = self.limits, self.rim > 3 * self.limits["standstill_speed"]
        before = self.mean_adhesion / self.mean_curve * self.curve if self.mean_curve > 0 else self.adhesion
        worse = sure > limits["slip"] and self.adhesion + 0.03 < limits["grip"] * (max(before, 0.0) + 0.03)
        steady = turning and self.rim < 1.12 * self.slow_rim + 0.02
        rises = self.slip - self.slow > limits["rise"] and self.slip > self.middle
        rises = rises and sure - self.mean_slip > limits["level"]
        digs = steady and rises and (worse or sure > limits["high_slip"])
        digs = digs or (self.sinking and self.slip > limits["high_slip"])
        change = dt if digs else -BACK * dt
        self.evidence = min(max(self.evidence + change, 0.0), 2 * limits["duration"])
        self.looks = self.looks + 1 if digs else 0
        begins = self.evidence >= limits["duration"] and self.looks >= limits["looks"]
        self.sinking = begins or (self.sinking and self.evidence > 0)
        self.spinning = self.spinning + dt if turning and travel < limits["stuck_travel"] * rim else 0.0
        held = self.stuck and travel < limits["free_travel"] * rim
        self.stuck = turning and (self.spinning >= limits["duration"] or held)
        if self.stuck:
            self.evidence, self.sinking = 0.0, False

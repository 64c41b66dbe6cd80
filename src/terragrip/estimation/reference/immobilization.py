"""The warning of immobilization in plain Python: the twin of the kernel's immobilization.c and digging.c.

The signs are worked out here a second time; the score is the kernel's, a table made by benchmarks/fit_immobilization.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, isnan, log, sqrt

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation.engine import EVENTS, digging_score
from terragrip.estimation.estimates import Estimates

Array = NDArray[np.float64]

SIGNS = (
    "slip", "slip_calm", "slip_rise", "slip_unusual",
    "asymmetry_change", "asymmetry_level", "asymmetry_unusual", "grip_unusual",
    "adhesion_change", "adhesion_level", "resistance_change", "resistance_level", "rim_change", "rim_level",
)  # fmt: skip
"""The kernel's TG_SIGN_*, in their order; terragrip.h tells what each is."""

STEEPNESS, FORCES, LOOK, LONGEST_STEP, LONGEST_LOOK, FAST = 11.36, 0.2, 0.095, 0.6, 1.5, 0.1
NO_SCORE, HIGH_SLIP, SILENT = -6.0, 10.0, 0.55
MEMORY = np.array([0.1, 0.3, 1.0, 3.0, 20.0])
RESTARTED = MEMORY < 3
SPREAD_MEMORY = 8.0
SLIP, ASYMMETRY, GRIP, ADHESION, RESISTANCE, RIM = range(6)


@dataclass(frozen=True)
class Row:
    """Means over the driven wheels, along the travel. NaN ``slip``: standstill, or a gap.

    ``time`` [s], ``deviation``: SD of slip, ``leading`` and ``trailing``: adhesion of these axles (of one axle: ``adhesion``),
    ``rim`` and ``travel`` [m/s], ``measured``: the ground speed was.
    """

    time: float
    slip: float
    deviation: float
    leading: float
    trailing: float
    adhesion: float
    resistance: float
    rim: float
    travel: float
    measured: bool = True


def rows_of(estimates: Estimates, measured: NDArray[np.bool_], rows: slice = slice(None)) -> list[Row]:
    """Rows of a table of estimates as the kernel sees them; ``measured``: whether each row's ground speed was.

    Raises InputError where the estimates hold no vehicle.
    """
    vehicle, event = estimates.vehicle, estimates.event_codes[rows]
    driven = np.array([axle.driven for axle in vehicle.axles.values()])[vehicle.wheel_axle]
    if not driven.any():
        driven[:] = True
    time, speed = estimates.time[rows], estimates["ground_speed"][rows]

    def mean(name: str, chosen: NDArray[np.bool_] = driven) -> Array:
        return np.mean(
            [estimates[name.format(w)][rows] for w, of in zip(vehicle.wheels, chosen, strict=True) if of],
            axis=0,
        )

    adhesion, direction = mean("adhesion_{}"), np.where(mean("wheel_speed_{}") < 0, -1.0, 1.0)
    place = vehicle.axle_to_rear - np.mean(vehicle.axle_to_rear)
    front, rear = (driven & (sign * place[vehicle.wheel_axle] > 0) for sign in (1, -1))
    ends = (
        (mean("adhesion_{}", front), mean("adhesion_{}", rear))
        if front.any() and rear.any()
        else (adhesion,) * 2
    )
    slip = np.where(
        np.isin(event, [EVENTS.index("gap"), EVENTS.index("standstill")]), np.nan, mean("slip_{}")
    )
    radius = np.mean(np.asarray(vehicle.wheel_radius)[driven])
    table = np.stack(
        [
            time, slip, np.nan_to_num(mean("slip_{}_std")),
            np.where(direction > 0, *ends), np.where(direction > 0, *ends[::-1]), adhesion,
            estimates["soil_resistance"][rows], radius * np.abs(mean("wheel_speed_{}")), direction * speed,
        ]
    )  # fmt: skip
    names = ("time", "slip", "deviation", "leading", "trailing", "adhesion", "resistance", "rim", "travel")
    return [
        Row(**dict(zip(names, column, strict=True)), measured=bool(seen))
        for column, seen in zip(table.T.tolist(), measured[rows], strict=True)
    ]


@dataclass
class Signs:
    """Means of six signals over five memories, and what follows from them."""

    mean: Array = field(default_factory=lambda: np.zeros((6, 5)))
    square: Array = field(default_factory=lambda: np.zeros(3))
    force: Array = field(default_factory=lambda: np.zeros(4))
    age: float = 0.0
    moved: float = 0.0
    seen: bool = False

    def rest(self) -> None:
        """A rest or a gap."""
        self.seen, self.moved = False, 0.0

    def take(self, look: Array, dt: float) -> None:
        """A look: slip, its SD, adhesion leading, trailing and of all, resistance, rim speed; ``dt`` s after the last one."""
        slip, _, leading, trailing, adhesion, resistance, rim = look.tolist()
        curve = 1 - exp(-STEEPNESS * slip) if slip > 0 else 0.0
        gain = dt / (FORCES + dt) if self.seen else 1.0
        self.force += gain * (np.array([leading, trailing, adhesion, curve]) - self.force)
        ahead, behind, level, shape = (
            log(max(x, 0.0) + floor)
            for x, floor in zip(self.force.tolist(), (0.05, 0.05, 0.03, 0.05), strict=True)
        )
        now = np.array([slip, ahead - behind, level - shape, level, resistance, log(rim + 0.02)])[:, None]
        tau = np.where(RESTARTED, MEMORY, np.minimum(MEMORY, self.age))
        if dt > 0:
            self.mean += dt / (tau + dt) * (now - self.mean)
        if not self.seen:
            anew = RESTARTED if self.age > 0 else np.ones(5, bool)
            self.mean[:, anew] = now
        if self.moved > 1 and dt > 0:
            wander = (self.mean[:3, 1] - self.mean[:3, 3]) ** 2
            self.square += dt / (min(SPREAD_MEMORY, self.age) + dt) * (wander - self.square)
        self.seen = True
        self.age += dt
        self.moved += dt

    def features(self) -> list[float]:
        """The signs, in the order of SIGNS."""
        m, q = self.mean.tolist(), self.square.tolist()
        return [
            m[SLIP][0],
            m[SLIP][1],
            m[SLIP][0] - m[SLIP][2],
            (m[SLIP][1] - m[SLIP][4]) / sqrt(q[0] + 0.01**2),
            m[ASYMMETRY][0] - m[ASYMMETRY][2],
            m[ASYMMETRY][2] - m[ASYMMETRY][4],
            (m[ASYMMETRY][1] - m[ASYMMETRY][4]) / sqrt(q[1] + 0.05**2),
            (m[GRIP][1] - m[GRIP][4]) / sqrt(q[2] + 0.1**2),
            m[ADHESION][0] - m[ADHESION][2],
            m[ADHESION][1] - m[ADHESION][4],
            m[RESISTANCE][0] - m[RESISTANCE][2],
            m[RESISTANCE][1] - m[RESISTANCE][3],
            m[RIM][0] - m[RIM][2],
            m[RIM][1] - m[RIM][3],
        ]


@dataclass
class Watch:
    """Told each row, says whether the wheels dig or the vehicle is stuck.

    ``limits``: as :func:`~terragrip.estimation.engine.watch_limits` gives them.
    """

    limits: Mapping[str, float]
    signs: Signs = field(default_factory=Signs)
    looked: bool = False
    """The last row ended a look."""

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """What was seen of the motion; what is usual is kept."""
        self.signs.rest()
        self.sum, self.rows = np.zeros(7), 0
        self.look_time: float | None = None
        self.stuck_time: float | None = None
        self.score, self.spinning, self.rim, self.seen_time = NO_SCORE, 0.0, 0.0, -1e9
        self.sinking = self.stuck = False

    def take(self, row: Row) -> str:
        """The event after a row."""
        self.looked = False
        if isnan(row.slip):
            self.forget()
            return ""
        if row.measured:
            self.seen_time = row.time
            self._judge_stuck(row)
        self._judge_digging(row)
        return "stuck" if self.stuck else "immobilization" if self.sinking else ""

    def _judge_digging(self, row: Row) -> None:
        slip = max(row.slip, -0.2)
        self.sum += (slip, row.deviation, row.leading, row.trailing, row.adhesion, row.resistance, row.rim)
        self.rows += 1
        since = 0.0 if self.look_time is None else row.time - self.look_time
        if self.look_time is not None and since < LOOK:
            return
        look = self.sum / self.rows
        self.sum, self.rows, self.look_time, self.looked = np.zeros(7), 0, row.time, True
        self.signs.take(look, since)
        if self.stuck or float(look[6]) < 3 * self.limits["standstill_speed"]:
            self.score, self.sinking = NO_SCORE, False
            return
        signs = self.signs.features()
        step = min(since, LONGEST_STEP)
        score = min(max(digging_score(signs), NO_SCORE), -NO_SCORE)
        self.score += step / (self.limits["memory"] + step) * (score - self.score)
        high = signs[0] - self.limits["confidence"] * float(look[1]) - self.limits["high_slip"]
        score = self.score + (HIGH_SLIP * max(high, 0.0) if row.time - self.seen_time < SILENT else 0.0)
        warn = self.limits["warn"]
        begins = score > warn and self.spinning <= 0
        self.sinking = begins or (self.sinking and score > warn - self.limits["release"])

    def _judge_stuck(self, row: Row) -> None:
        limits = self.limits
        dt = 0.0 if self.stuck_time is None else row.time - self.stuck_time
        if dt > LONGEST_LOOK:
            dt, self.stuck_time, self.stuck, self.spinning = 0.0, None, False, 0.0
        self.rim = row.rim if self.stuck_time is None else self.rim + dt / (FAST + dt) * (row.rim - self.rim)
        self.stuck_time = row.time
        turning = self.rim > 3 * limits["standstill_speed"]
        self.spinning = (
            self.spinning + dt if turning and row.travel < limits["stuck_travel"] * row.rim else 0.0
        )
        held = self.stuck and row.travel < limits["free_travel"] * row.rim
        self.stuck = turning and (self.spinning >= limits["stuck_duration"] or held)
        if self.stuck:
            self.sinking = False

"""The warning of immobilization in plain Python: the twin of the kernel's immobilization.c and digging.c, settings included."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import expm1, hypot, isnan, log, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import estimator
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimates import Estimates
from terragrip.physics.loads import GRAVITY
from terragrip.vehicle import Vehicle

Array = NDArray[np.float64]

SHORT, FLOOR, SHARP = 0.1, 0.1, 0.02
LEARNED, FORGOTTEN, BEYOND = 0.5, 8, 2
CALM, NEAREST, LONGEST_LOOK, HALF_TURN, SURE = 0.1, 0.51, 1.5, 3.14, 2
SLIP, DEVIATION, BALANCE, RESISTANCE, RIM, TRAVEL, BALANCE_DEVIATION, RESISTANCE_DEVIATION = range(8)


@dataclass(frozen=True)
class Row:
    """What the driven wheels do in a row, along the travel. NaN ``slip``: standstill, or a gap.

    ``time`` [s]; ``slip``, ``deviation`` (its SD) and ``fastest`` (rim speed [m/s]): of the worst wheel of each side, their mean;
    ``leading`` and ``trailing``: adhesion of these axles, alike where there is but one; ``resistance``; ``rim`` (mean) and
    ``travel`` [m/s]; ``measured``: the ground speed was. Rim speeds are 0 where the sides turn against each other. ``..._deviation``:
    SDs, of the adhesion of either end.
    """

    time: float
    slip: float
    deviation: float
    fastest: float
    leading: float
    trailing: float
    resistance: float
    rim: float
    travel: float
    measured: bool = True
    adhesion_deviation: float = 0.0
    resistance_deviation: float = 0.0
    travel_deviation: float = 0.0


@contextmanager
def undisputed() -> Iterator[None]:
    """Within it estimates do not doubt a ground speed for what the filter has not followed of it, nor a resistance for unseen hills, and
    uneven ground is not learned.

    The kernel's watch leaves these out of the SDs or counts more of them, and a table does not say how much of an SD they are: only without
    them are the table's rows what the kernel sees. No figure depends on them but SDs.
    """
    made_by = estimator.settings_of

    def settings_of(*args: Any, **more: Any) -> Any:
        made = made_by(*args, **more)
        made.tuned.alike_sure, made.tuned.longest_walk, made.tuned.soil_spread = 1e12, 1e-12, 1e12
        made.tuned.uneven_memory = 1e12
        return made

    estimator.settings_of = settings_of
    try:
        yield
    finally:
        estimator.settings_of = made_by


def rows_of(estimates: Estimates, measured: NDArray[np.bool_]) -> list[Row]:
    """Rows of a table of estimates as the kernel sees them; ``measured``: whether each row's ground speed was.

    Estimates made within :func:`undisputed`. Raises InputError where the estimates contain no vehicle.
    """
    vehicle = estimates.vehicle
    driven = np.array(vehicle.driven, bool)
    if not driven.any():
        driven[:] = True

    def columns(name: str) -> Array:
        return np.stack([estimates[name.format(w)] for w in vehicle.wheels], axis=1)

    slip, deviation = columns("slip_{}"), np.nan_to_num(columns("slip_{}_std"))
    adhesion_sd = columns("adhesion_{}_std")[:, driven]
    rims, adhesion = columns("wheel_speed_{}") * np.asarray(vehicle.wheel_radius), columns("adhesion_{}")
    direction = np.where(rims[:, driven].mean(axis=1) < 0, -1.0, 1.0)
    sides = [driven & (sign * side_of_wheels(vehicle) >= 0) for sign in (-1, 1)]
    worst = [_worst(slip[:, on], deviation[:, on], rims[:, on]) for on in sides if on.any()]
    ends = [adhesion[:, on].mean(axis=1) for on in _ends(vehicle, driven)]
    blind = np.isin(estimates.event_codes, [EVENTS.index(e) for e in ("gap", "standstill", "restart")])
    sums = [rims[:, on].sum(axis=1) for on in sides if on.any()]
    onward = sums[0] * sums[-1] > 0 if len(sums) == 2 else np.ones(len(rims), bool)
    table = np.stack(
        [
            estimates.time,
            np.where(blind, np.nan, np.maximum(np.mean([w[0] for w in worst], axis=0), -0.2)),
            np.mean([w[1] for w in worst], axis=0),
            np.abs(np.mean([w[2] for w in worst], axis=0)) * onward,
            np.where(direction > 0, *ends),
            np.where(direction > 0, *ends[::-1]),
            estimates["soil_resistance"],
            np.abs(rims[:, driven].mean(axis=1)) * onward,
            direction * estimates["ground_speed"],
            np.sqrt(2 * np.sum(adhesion_sd**2, axis=1)) / driven.sum(),
            estimates["soil_resistance_std"],
            estimates["ground_speed_std"],
        ],
        axis=1,
    )
    names = (
        "time", "slip", "deviation", "fastest", "leading", "trailing", "resistance", "rim", "travel",
        "adhesion_deviation", "resistance_deviation", "travel_deviation",
    )  # fmt: skip
    return [
        Row(**dict(zip(names, row, strict=True)), measured=bool(seen))
        for row, seen in zip(table.tolist(), measured, strict=True)
    ]


def side_of_wheels(vehicle: Vehicle) -> Array:
    """-1 left, 1 right, 0 the middle, by a wheel's place on its axle (n,)."""
    axle = np.asarray(vehicle.wheel_axle)
    place = np.arange(len(axle))
    return np.array(
        [np.sign(np.sum(axle[:i] == axle[i]) - np.sum(axle[i + 1 :] == axle[i])) for i in place], float
    )


def _worst(slip: Array, deviation: Array, rim: Array) -> tuple[Array, Array, Array]:
    """Slip and SD of the wheel whose slip is surely largest, and the fastest rim; each (n,) of (n, wheels)."""
    rows = np.arange(len(slip))
    most = np.argmax(np.nan_to_num(slip - deviation, nan=-9.0), axis=1)
    return slip[rows, most], deviation[rows, most], rim[rows, np.argmax(np.abs(rim), axis=1)]


def _ends(vehicle: Vehicle, driven: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """The driven wheels in front of the middle and behind it; twice all of them where one of these is empty."""
    place = (vehicle.axle_to_rear - np.mean(vehicle.axle_to_rear))[np.asarray(vehicle.wheel_axle)]
    ends = [driven & (sign * place > 0) for sign in (1, -1)]
    return ends if all(end.any() for end in ends) else [driven, driven]


def pace(vehicle: Vehicle, limits: Mapping[str, float]) -> float:
    """The watch's unit of time [s]; ``limits`` as :func:`~terragrip.estimation.settings.watch_limits` gives them."""
    place = vehicle.axle_to_rear - np.mean(vehicle.axle_to_rear)
    length = sqrt(2 * float(np.sum(place**2))) if len(place) > 1 else 3 * float(vehicle.wheel_radius[0])
    return limits["pace"] * sqrt(length / GRAVITY)


def _low_pass(mean: float, dt: float, tau: float, x: float) -> float:
    return mean - expm1(-dt / tau) * (x - mean) if dt > 0 else mean


@dataclass
class Watch:
    """Given each row, says whether the wheels dig or the vehicle is stuck.

    ``limits``: as :func:`~terragrip.estimation.settings.watch_limits` gives them; ``pace``: the unit of
    time [s]; ``radius``: mean wheel radius [m].
    """

    limits: Mapping[str, float]
    pace: float
    radius: float = 0.0
    usual: list[float] = field(default_factory=lambda: [0.0, 0.0])
    age: float = 0.0

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """What was seen of the motion; what is usual is kept."""
        self._rest()
        self.stuck_time: float | None = None
        self.spinning, self.rim, self.turned = 0.0, 0.0, 0.0
        self.sinking = self.stuck = self.held = False

    def _rest(self) -> None:
        self.sum, self.weight, self.moving, self.slips = np.zeros(9), 0.0, False, False
        self.points, self.score, self.time = [0.0] * 5, 0.0, 0.0

    def update(self, row: Row) -> str:
        """The event after a row."""
        if isnan(row.slip):
            self.forget()
            return ""
        if row.measured:
            self._judge_stuck(row)
        if row.rim < 3 * self.limits["standstill_speed"]:
            self._rest()
            self.sinking = False
        elif row.measured and self._evaluate(row):
            begins = self.score > self.limits["warn"] and self.slips and not self.held
            holds = self.sinking and 2 * self.score > self.limits["warn"]
            self.sinking = not self.stuck and (begins or holds)
        return "stuck" if self.stuck else "immobilization" if self.sinking else ""

    def _evaluate(self, row: Row) -> bool:
        weight = 1 / (row.deviation + SHARP) ** 2
        seen = (
            row.slip, row.deviation, row.leading, row.trailing, row.resistance, row.rim, row.travel,
            row.adhesion_deviation, row.resistance_deviation,
        )  # fmt: skip
        self.sum += weight * np.array(seen)
        self.weight += weight
        since = row.time - self.time if self.moving else 0.0
        if self.moving and since < 0.95 * SHORT * self.pace:
            return False
        now = self._signals(self.sum / self.weight)
        if not self.moving:
            self.now, self.mean = list(now), list(now)
        for k, x in enumerate(now):
            self.now[k] = _low_pass(self.now[k], since, SHORT * self.pace, x)
            self.mean[k] = _low_pass(self.mean[k], since, self.pace, x)
        slip = min(self.now[SLIP], self.limits["high_slip"])
        for k, (x, memory) in enumerate(
            [(slip, LEARNED if slip > self.usual[0] else FORGOTTEN), (self.now[BALANCE], 1)]
        ):
            tau = min(self.age, memory * self.limits["usual"] * self.pace)
            self.usual[k] = _low_pass(self.usual[k], since, tau, x) if self.age > 0 else x
        self.sum, self.weight, self.moving, self.time = np.zeros(9), 0.0, True, row.time
        self.age += since
        self._judge(since)
        return True

    def _signals(self, mean: Array) -> tuple[float, ...]:
        slip, deviation, leading, trailing, resistance, rim, travel, adhesion_sd, resistance_sd = (
            mean.tolist()
        )
        ahead, behind, still = max(leading, 0.0), max(trailing, 0.0), self.limits["standstill_speed"]
        both = ahead + behind + FLOOR
        return (
            slip, deviation, (ahead - behind) / both, 0.0 if isnan(resistance) else resistance,
            log(rim + still), log(max(travel, 0.0) + still),
            adhesion_sd * hypot(2 * behind + FLOOR, 2 * ahead + FLOOR) / both**2, 0.0 if isnan(resistance_sd) else resistance_sd,
        )  # fmt: skip

    def _judge(self, since: float) -> None:
        limits, most = self.limits, self.limits["most"]

        def change(signal: int) -> float:
            return self.now[signal] - self.mean[signal]

        def bounded(points: float, least: float, most: float) -> float:
            return min(max(points, least), most)

        deviation = self.now[DEVIATION]
        sure = self.now[SLIP] - limits["sure"] * deviation
        rims = max(change(RIM) + min(change(TRAVEL), 0.0), -change(RIM) / 2) / limits["command"]
        command = max(rims, change(TRAVEL) / hypot(limits["command"], deviation))
        leading = hypot(limits["leading"], self.now[BALANCE_DEVIATION])
        resistance = hypot(limits["resistance"], self.now[RESISTANCE_DEVIATION])
        self.points = [
            bounded(change(SLIP) / hypot(limits["rise"], deviation), -most, most),
            bounded(most * (sure / limits["high_slip"] - 1), 0.0, 2 * most),
            bounded((self.usual[1] - self.now[BALANCE]) / leading, -most, most),
            bounded(change(RESISTANCE) / resistance, -most, most),
            -bounded(command, 0.0, 2 * most),
        ]
        tau = limits["memory"] * self.pace
        self.score = _low_pass(self.score, min(since, self.pace), tau, sum(self.points))
        self.slips = sure + change(SLIP) > max(limits["ahead"], BEYOND * self.usual[0])

    def _judge_stuck(self, row: Row) -> None:
        limits, still = self.limits, self.limits["standstill_speed"]
        dt = 0.0 if self.stuck_time is None else row.time - self.stuck_time
        if dt > LONGEST_LOOK:
            dt, self.stuck_time, self.stuck, self.spinning = 0.0, None, False, 0.0
        before = row.fastest if self.stuck_time is None else self.rim
        self.rim = _low_pass(before, dt, CALM, row.fastest)
        self.stuck_time = row.time
        self.turned += dt * row.fastest
        hardly = max(limits["stuck_travel"] * row.fastest, still)
        freely, unsure = limits["free_travel"] * row.fastest, SURE * row.travel_deviation
        turning = min(self.rim, row.fastest) > 3 * still
        may_stand = abs(row.travel) - unsure < hardly
        spinning = min(max(self.spinning + (dt if may_stand else -dt), 0.0), limits["stuck_duration"])
        self.spinning = spinning if turning else 0.0
        likely = may_stand and (self.sinking or row.travel < hardly)
        self.held = turning and likely and max(row.travel, 0.0) + unsure < freely
        sure = (
            self.held
            and self.spinning + NEAREST * dt >= limits["stuck_duration"]
            and self.turned > HALF_TURN * self.radius
        )
        self.stuck = turning and (sure or (self.stuck and abs(row.travel) < freely))
        if self.stuck:
            self.sinking = False

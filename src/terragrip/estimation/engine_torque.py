"""Row by row from engine torque and speed to the driveline's torque at the wheels; rows of a gear shift are set aside."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError
from terragrip.physics.driveline import torque_into_gears, torque_spread, wheel_torque
from terragrip.physics.loads import GRAVITY
from terragrip.vehicle_parts import Driveline

_HOLD = 2.0  # s that a value is used for
_LAGS = (0.5, 1.0)  # s: over them the ratio is compared
_CHANGE = 0.1  # s, over which the engine's acceleration is taken: in a low gear its inertia is several times the machine's mass
_REACH = 3.0  # s: no older value is compared with
TAIL = 2 * _HOLD + _REACH
"""s of the rows before that a row's torque depends on."""
# Change of the ratio that makes a shift: a step of a gearbox is 15 to 25 %, slip and noise less.
_SHIFT = 0.08
_SLOWEST = 0.07  # of √(g r): slower rims do not determine the ratio
SHARE_STD = 0.02
"""SD of a controller's torque, which is a model's, of the reference torque."""
_TURNING = 1.0  # rad/s (10 rpm): a PTO that turns
_FRICTION = (0.08, 0.04)  # of the reference torque, where the bus does not state it (ours)


@dataclass(frozen=True)
class EngineTorque:
    """How a log has its engine's torque: ``reference`` [N m] of its shares (None: it is in N m; NaN: not sent yet).

    ``stated`` [N m]: SD of its error as a constant; None: the ``share`` of the reference. ``notes``: sentences for the user."""

    reference: float | None
    stated: float | None
    share: float = 0.0
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        channels: Collection[str],
        driveline: Driveline,
        measured: float | None,
        *,
        waits: bool = False,
        source: str | None = None,
    ) -> EngineTorque:
        """As columns have it, with the ``measured`` reference torque [N m], if any; ``waits``: it may come yet.

        Raises InputError where shares have none.
        """
        given = driveline.engine_torque_std
        if "engine_torque" in channels:
            return cls(None, given or 0.0)
        reference = driveline.reference_torque if measured is None else measured
        if reference is None and waits:
            reference = np.nan
        elif reference is None or not reference > 0:
            raise InputError(
                "is a share of the reference torque, which neither the log nor the vehicle file gives",
                file=source,
                place="column engine_torque_share",
                hint="add 'reference_torque: 800 N m' under 'driveline', from the engine's data sheet",
            )
        if "engine_friction_share" in channels:
            return cls(reference, given, SHARE_STD)
        note = f"The engine's own friction is not in the log: {_FRICTION[0]:.0%} ± {_FRICTION[1]:.0%} of the reference torque is assumed."
        return cls(reference, given, float(np.hypot(SHARE_STD, _FRICTION[1])), (note,))

    @property
    def std(self) -> float:
        """SD [N m] of its error as a constant."""
        return self.share * (self.reference or 0.0) if self.stated is None else self.stated

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it, without the sentences."""
        return {"reference": self.reference, "stated": self.stated, "share": self.share}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> EngineTorque:
        """The inverse of `to_dict`."""
        return cls(data["reference"], data["stated"], data["share"])

    def at(self, channels: Mapping[str, Floats], time: Floats) -> Floats:
        """The engine's torque (n,) [N m] at the flywheel, NaN where it was not measured."""
        if self.reference is None:
            return channels["engine_torque"]
        friction = channels.get("engine_friction_share")
        lost = _FRICTION[0] if friction is None else held(time, friction)
        return self.reference * (channels["engine_torque_share"] - lost)


@dataclass(frozen=True)
class DrivelineTorque:
    """``torque`` (n,) [N m]: the sum over the driven wheels, NaN where it was not measured or is set aside (``shift``); ``std``
    (n,) [N m] of the value in that row, NaN where there is none or a PTO takes an unknown part; ``shift`` (n,): rows of a gear shift."""

    torque: Floats
    std: Floats
    shift: Bools


def driveline_torque(
    driveline: Driveline,
    engine: EngineTorque,
    time: Floats,
    channels: Mapping[str, Floats],
    wheel_speed: Floats,
    radius: float,
) -> DrivelineTorque:
    """The torque of a driveline to the wheels (n,), of which ``wheel_speed`` (n,) [rad/s] is the mean and ``radius`` [m].

    A motor that turns backward, as a hydrostatic drive's in reverse, has a negative engine speed, and a torque that counts the same way.
    """
    turning, wheels = held(time, channels["engine_speed"]), held(time, wheel_speed)
    speed, way = np.abs(turning), np.where(turning < 0, -1.0, 1.0)
    known = np.abs(wheels) * radius > _SLOWEST * np.sqrt(GRAVITY * radius)
    known &= speed > 0
    ratio = np.divide(speed, wheels, out=np.full(len(time), np.nan), where=known)
    shift = np.zeros(len(time), dtype=bool)
    if driveline.ratio is not None:
        ratio = np.where(speed > 0, driveline.ratio * np.sign(np.where(known, wheels, 1.0)), np.nan)
    else:
        for lag in _LAGS:
            before = earlier(time, ratio, lag)
            shift |= np.isfinite(before) & ~(np.abs(ratio / before - 1) <= _SHIFT)
        shift &= known
    acceleration = (speed - earlier(time, speed, _CHANGE)) / (
        time - earlier(time, np.where(np.isfinite(speed), time, np.nan), _CHANGE)
    )
    power, power_std = _taken(driveline, pto_turns(time, channels))
    into = torque_into_gears(
        way * engine.at(channels, time),
        speed,
        np.nan_to_num(acceleration),
        other_power=power,
        engine_inertia=driveline.engine_inertia,
    )
    torque = np.where(shift, np.nan, wheel_torque(into, ratio, driveline.efficiency))
    std = torque_spread(speed, ratio, driveline.efficiency, engine.std, power_std)
    std_held = held(time, np.where(np.isfinite(torque), std, np.nan))
    return DrivelineTorque(torque, np.where(shift | ~np.isfinite(ratio + power_std), np.nan, std_held), shift)


def pto_turns(time: Floats, channels: Mapping[str, Floats]) -> Bools:
    """Rows (n,) in which a power take-off turns, rear or front; none where no channel says so."""
    turns = np.zeros(len(time), dtype=bool)
    for name in ("pto_speed", "pto_speed_front"):
        if name in channels:
            turns |= np.abs(held(time, channels[name])) > _TURNING
    return turns


def _taken(driveline: Driveline, turns: Bools) -> tuple[Floats, Floats]:
    """Power (n,) [W] that does not go into the gears, and its SD, NaN where it is not known: the accessories', and the PTO's where it
    ``turns``. An unknown one counts as none, for slip hardly depends on it."""

    def spread(power: float, std: float | None) -> float:
        return power / 2 if std is None else std

    pto, given = driveline.pto_power or 0.0, driveline.pto_power is not None
    power = driveline.accessory_power + np.where(turns, pto, 0.0)
    own = spread(driveline.accessory_power, driveline.accessory_power_std)
    of_pto = spread(pto, driveline.pto_power_std) if given else np.nan
    return power, np.hypot(own, np.where(turns, of_pto, 0.0))


def held(time: Floats, values: Floats) -> Floats:
    """The last value (n,) at each row, NaN where it is too old."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(time)), -1))
    fresh = (last >= 0) & (time - time[last] <= _HOLD)
    return np.where(fresh, values[last], np.nan)


def earlier(time: Floats, values: Floats, lag: float) -> Floats:
    """The last value (n,) at least ``lag`` [s] before each row, NaN where it is too old."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.full(len(time), np.nan)
    place = np.searchsorted(time[known], time - lag + 1e-9, side="right") - 1
    rows = known[np.maximum(place, 0)]
    return np.where((place >= 0) & (time - time[rows] <= _REACH), values[rows], np.nan)

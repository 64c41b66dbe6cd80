"""A machine that tells its engine's torque and not its wheels': what only the sum of the drive torques determines is estimated as a sum.

The driven wheels become one wheel, ``driven``, and the free ones another, ``undriven``; the estimator is the same. Column
``adhesion_driven`` is the mean of the driven wheels' adhesion, weighted by load; single wheels have no columns.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation.engine_torque import (
    TAIL,
    DrivelineTorque,
    EngineTorque,
    driveline_torque,
    tells_engine_torque,
)
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.rims import DRIVE, speeds_alone
from terragrip.estimation.settings import wheel_radii
from terragrip.estimation.slip_only import WHAT_IS_MISSING, slip_reference_in
from terragrip.physics.loads import GRAVITY
from terragrip.recording import LogBlocks, Recording
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

DRIVEN, UNDRIVEN = "driven", "undriven"
"""The wheels, and the axles, that stand for all driven and all free ones."""
_SUMS = ("adhesion_driven", "net_traction_driven", "efficiency_driven", "soil_resistance")
_LEAST = 0.02  # as the kernel: an adhesion below it divides nothing
_NOTE = (
    "The drive torque is the engine's through the driveline: adhesion_driven, net_traction_driven and efficiency_driven are of all driven "
    "wheels together; single wheels' adhesion cannot be had. Rows without a torque (standstill, gear shifts) hold none."
)
_TOWING = (
    "There is no drawbar_force: what a tool pulls is in soil_resistance, "
    "so net traction and efficiency are as if there were no tool."
)


def by_engine(log: Recording, vehicle: Vehicle) -> bool:
    """Whether the sum of drive torques is to be had from the engine's, and no wheel's torque is measured."""
    return (
        vehicle.driveline is not None
        and speeds_alone(log.channels, vehicle)
        and tells_engine_torque(log.channels)
    )


@dataclass
class ByEngine:
    """A log and a vehicle whose driven wheels are one; its estimates are made by the estimator as of any machine, then `completed`."""

    whole: Recording
    original: Vehicle
    _waiting: deque[DrivelineTorque] = field(default_factory=deque)

    @cached_property
    def _reference(self) -> Any:
        return slip_reference_in(self.whole, self.original)

    @cached_property
    def engine(self) -> EngineTorque:
        """How the log tells the engine's torque."""
        assert self.original.driveline is not None
        return EngineTorque.of(self.whole, self.original.driveline)

    @cached_property
    def _wheels(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        pairs = list(zip(self.original.wheels, self.original.driven, strict=True))
        return tuple(w for w, on in pairs if on), tuple(w for w, on in pairs if not on)

    @property
    def together(self) -> int:
        """How many wheels the driven one stands for."""
        return len(self._wheels[0])

    @cached_property
    def frees_measured(self) -> bool:
        """Whether all free wheels' speeds are in the log."""
        free = self._wheels[1]
        return bool(free) and all(f"wheel_speed_{w}" in self.whole.channels for w in free)

    @cached_property
    def vehicle(self) -> Vehicle:
        """The machine with its driven wheels as one, its free ones as another."""
        return Vehicle.from_dict(lumped(self.original, self._zero))

    @property
    def _zero(self) -> tuple[float, float] | None:
        """Radius [m] at zero slip of the drive train, and its relative SD, where its speed alone is measured."""
        rim = next((rim for rim in self._reference.rims if rim.wheel == DRIVE), None)
        return None if rim is None else (rim.radius, rim.spread)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        own = [_NOTE, *self.engine.notes, *(n for n in self._reference.notes if n != WHAT_IS_MISSING)]
        return (*own, *(() if "drawbar_force" in self.whole.channels else (_TOWING,)))

    def log(self, log: LogBlocks) -> LogBlocks:
        """The log as that of `vehicle`."""

        def blocks() -> Iterator[Recording]:
            self._waiting.clear()
            tail = None
            for block in log.blocks():
                whole = block if tail is None else _behind(tail, block)
                converted, drive = self._converted(whole, len(whole) - len(block))
                self._waiting.append(drive)
                yield converted
                tail = _tail(whole)

        return LogBlocks(log.rows, blocks, lambda: self._converted(self.whole, 0)[0], log.from_disk)

    def completed(self, parts: Iterator[Estimates]) -> Iterator[Estimates]:
        """Estimates of `vehicle` with the spread of what the driveline takes, and open where no torque stands."""
        for part in parts:
            yield self._completed(part, self._waiting.popleft())

    def _speed(self, channels: dict[str, Floats], wheels: tuple[str, ...], radius: float) -> Floats:
        """Mean speed (n,) [rad/s] of some wheels as one of a ``radius``."""
        radii = dict(zip(self.original.wheels, wheel_radii(self.original)[1], strict=True))
        known = [w for w in wheels if f"wheel_speed_{w}" in channels]
        mean: Floats = np.mean([radii[w] * channels[f"wheel_speed_{w}"] for w in known], axis=0) / radius
        return mean

    def _converted(self, log: Recording, before: int) -> tuple[Recording, DrivelineTorque]:
        """The rows of a log from ``before`` on as channels of `vehicle`, and the driveline's torque in them."""
        driveline = self.original.driveline
        assert driveline is not None
        driven, free = self._wheels
        given, radius = (
            log.channels,
            float(self.vehicle.wheel_radius[list(self.vehicle.wheels).index(DRIVEN)]),
        )
        if any(f"wheel_speed_{w}" in given for w in driven):
            speed = self._speed(given, driven, radius)
        else:
            rim = next(rim for rim in self._reference.rims if rim.wheel == DRIVE)
            speed = given["wheel_based_speed"] / rim.scale
            if self._reference.dead_band > 0:
                speed = np.where(speed == 0, np.nan, speed)
        result = driveline_torque(driveline, self.engine, log.time, given, speed, radius)
        drive = DrivelineTorque(result.torque[before:], result.std[before:], result.shift[before:])
        own = {f"wheel_speed_{DRIVEN}": speed, f"drive_torque_{DRIVEN}": result.torque}
        if free:
            place = float(self.vehicle.wheel_radius[list(self.vehicle.wheels).index(UNDRIVEN)])
            own[f"wheel_speed_{UNDRIVEN}"] = (
                self._speed(given, free, place) if self.frees_measured else given["ground_speed"] / place
            )
        kept = {n: v for n, v in given.items() if not n.startswith(_REPLACED)}
        return replace(log, channels={**own, **kept}).select(slice(before, None)), drive

    def _weight(self, columns: dict[str, Floats]) -> Floats | float:
        """What the wheels carry (n,) [N]: the machine's weight, unless the log says that it changes."""
        if not {"mass", "hitch_load"} & set(self.whole.channels):
            return self.vehicle.mass * GRAVITY
        loads = [columns[f"vertical_load_{axle}"] for axle in self.vehicle.axle_names]
        return np.asarray(np.sum(loads, axis=0))

    def _completed(self, part: Estimates, drive: DrivelineTorque) -> Estimates:
        columns = dict(part.columns)
        machine = self.vehicle
        radius = float(machine.wheel_radius[list(machine.wheels).index(DRIVEN)])
        force = drive.std / radius
        by_adhesion, by_resistance = force / columns[f"vertical_load_{DRIVEN}"], force / self._weight(columns)
        mu, rho = columns["adhesion_driven"], columns["soil_resistance"]
        widen = {
            "adhesion_driven": by_adhesion,
            "soil_resistance": by_resistance,
            "net_traction_driven": by_adhesion - by_resistance,
            "efficiency_driven": _by_efficiency(
                machine, mu, rho, columns["slip_driven"], by_adhesion, by_resistance
            ),
            "curve_a": columns["curve_a"] * by_adhesion / np.maximum(np.abs(mu), 0.1),
            "curve_a_driven": columns["curve_a_driven"] * by_adhesion / np.maximum(np.abs(mu), 0.1),
        }
        for name, spread in widen.items():
            spread = np.where(np.isfinite(spread), spread, 0.0) if name.startswith("curve") else spread
            columns[f"{name}_std"] = np.hypot(columns[f"{name}_std"], spread)
        columns["efficiency_driven_std"] = np.minimum(columns["efficiency_driven_std"], 1.0)
        none = ~np.isfinite(drive.std)
        for name in _SUMS:
            columns[name] = np.where(none, np.nan, columns[name])
            columns[f"{name}_std"] = np.where(none, np.nan, columns[f"{name}_std"])
        if not self.frees_measured:
            columns = {n: v for n, v in columns.items() if UNDRIVEN not in n or n.startswith("vertical_load")}
        about = {**part.about, "driveline": {"vehicle": self.original.to_dict()}}
        notes = tuple(n for n in part.notes if not n.startswith("There is no drawbar_force"))
        return replace(part, columns=columns, about=about, notes=tuple(dict.fromkeys((*notes, *self.notes))))


def machine_of(estimates: Estimates, vehicle: Vehicle) -> Vehicle:
    """The vehicle that the columns of the estimates speak of: ``vehicle`` (as its file has it) or, of a driveline, its wheels as one."""
    if "driveline" not in estimates.about or vehicle.driveline is None:
        return vehicle
    made = estimates.vehicle
    radius = float(made.wheel_radius[made.wheels.index(DRIVEN)])
    return Vehicle.from_dict(lumped(vehicle, (radius, made.uncertainty.wheel_radius or 0.0)))


_REPLACED = ("wheel_speed_", "wheel_based_speed", "vertical_load_", "engine_")


def lumped(vehicle: Vehicle, zero: tuple[float, float] | None) -> dict[str, Any]:
    """A vehicle file's data of the machine with its driven wheels as one and its free ones as another.

    Each has its wheels' mean radius and the sum of their equivalent masses; its axle carries their masses, where these have their mean.
    ``zero``: radius [m] of the driven one at zero slip and its relative SD, where the log tells them.
    """
    radii, data = wheel_radii(vehicle)[1], vehicle.to_dict()
    position, mass = vehicle.axle_to_rear, vehicle.axle_mass
    axle_driven = np.array([axle.driven for axle in vehicle.axles.values()])
    groups = []
    for name, chosen in ((DRIVEN, True), (UNDRIVEN, False)):
        axles, wheels = axle_driven == chosen, vehicle.driven == chosen
        if not axles.any():
            continue
        radius = float(radii[wheels].mean())
        if chosen and zero is not None:
            radius = zero[0]
        inertia = float(np.sum(vehicle.wheel_inertia[wheels] * (radius / radii[wheels]) ** 2))
        place = float(np.average(position[axles], weights=mass[axles]))
        wheel = {"radius": radius, "inertia": inertia}
        groups.append(
            (
                place,
                name,
                {"mass": float(mass[axles].sum()), "wheels": [name], "wheel": wheel, "driven": chosen},
            )
        )
    groups.sort(key=lambda group: -group[0])
    rear = groups[-1][0]
    calibration = data.get("calibration", {})
    data |= {
        "axles": {name: axle for _, name, axle in groups},
        "bearing_resistance": vehicle.bearing_resistance * int(vehicle.driven.sum()),
        "hitch_overhang": vehicle.hitch_overhang + rear,
        "hitch_height": vehicle.hitch_height,
        "center_of_gravity_height": vehicle.center_of_gravity_height,
        "calibration": {
            k: v
            for k, v in calibration.items()
            if k not in ("drive_torque_gain", "drive_torque_offset", "wheel_radius", "wheel_based_speed_gain")
        },
        "sensors": {
            k: v for k, v in data.get("sensors", {}).items() if k not in ("drive_torque", "vertical_load")
        },
        "uncertainty": _uncertainty(vehicle, zero),
    }
    for key, point in (("antenna", vehicle.antenna), ("payload", vehicle.payload)):
        if point is not None:
            data[key] = {**data[key], "x": point.x - rear}
    if len(groups) > 1:
        data["wheelbase"] = groups[0][0] - rear
        if data["wheelbase"] < 0.1 * float(
            np.ptp(position)
        ):  # the groups stand in one place: nothing shifts load between them
            data |= {"wheelbase": 1.0, "center_of_gravity_height": 0.0, "hitch_height": 0.0}
    for key in ("wheel", "track", "driveline", *(("wheelbase",) if len(groups) == 1 else ())):
        data.pop(key, None)
    return data


def _uncertainty(vehicle: Vehicle, zero: tuple[float, float] | None) -> dict[str, float]:
    given = {k: v for k, v in vehicle.uncertainty.model_dump().items() if v is not None}
    driveline = vehicle.driveline
    assert driveline is not None
    common = given.get("drive_torque_gain_common", 0.0)
    given["drive_torque_gain_common"] = float(
        np.hypot(common, driveline.efficiency_std / driveline.efficiency)
    )
    given.pop("drive_torque_gain", None)
    given.pop("drive_torque_offset", None)
    if zero is not None:
        given["wheel_radius"] = min(zero[1], 1.0)
    return given


def _by_efficiency(
    machine: Vehicle, mu: Floats, rho: Floats, slip: Floats, by_mu: Floats, by_rho: Floats
) -> Floats:
    """Change (n,) of the tractive efficiency (paper eq. 7) by changes of adhesion and resistance (n,)."""
    gross = np.maximum(mu + machine.tire_rolling_resistance, _LEAST)
    share = np.maximum(mu - rho, 0) / gross
    change: Floats = (1 - slip) / gross * ((1 - share) * by_mu - by_rho)
    return change


def _tail(block: Recording) -> Recording:
    """The last rows of a block, on which those behind it depend."""
    return block.select(np.arange(np.searchsorted(block.time, block.time[-1] - TAIL), len(block)))


def _behind(tail: Recording, block: Recording) -> Recording:
    """A block behind the tail of the one before."""
    return replace(
        block,
        time=np.concatenate([tail.time, block.time]),
        channels={n: np.concatenate([tail.channels[n], v]) for n, v in block.channels.items()},
        labels={n: np.concatenate([tail.labels[n], v]) for n, v in block.labels.items()},
    )

"""A machine that logs its engine's torque, not its wheels': what only the sum of the drive torques determines is estimated as a sum.

The driven wheels become one wheel, ``driven``, and the free ones another, ``undriven``; the estimator is the same. Column
``adhesion_driven`` is the mean of the driven wheels' adhesion, weighted by load; single wheels have no columns.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.estimation.engine_torque import (
    DrivelineTorque,
    EngineTorque,
    driveline_torque,
    pto_turns,
)
from terragrip.estimation.estimates import Estimates
from terragrip.estimation.rims import DRIVE, Rim, rims_of, speeds_alone
from terragrip.estimation.settings import wheel_radii
from terragrip.estimation.slip_only import SlipReference
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.recording.schema import has_engine_torque
from terragrip.vehicle import Vehicle

DRIVEN, UNDRIVEN = "driven", "undriven"
"""The wheels, and the axles, that represent all driven and all free ones."""
_SUMS = ("adhesion_driven", "net_traction_driven", "efficiency_driven", "soil_resistance")
_LEAST = 0.02  # as the kernel: an adhesion below it divides nothing
_NOTE = (
    "The drive torque is the engine's through the driveline: adhesion_driven, net_traction_driven and efficiency_driven are of all driven "
    "wheels together; the adhesion of single wheels is not determined. Rows without a torque (standstill, gear shifts) hold none."
)
_PTO = (
    "The PTO turns in {:.0%} of the log. What it takes of the engine's torque is not known, so these rows hold no adhesion and no soil "
    "resistance: give 'pto_power: 40 kW' (and pto_power_std) under 'driveline'."
)


def by_engine(channels: Collection[str], vehicle: Vehicle) -> bool:
    """Whether columns give the sum of drive torques by the engine's, and no wheel's torque."""
    return vehicle.driveline is not None and speeds_alone(channels, vehicle) and has_engine_torque(channels)


@dataclass(frozen=True)
class DrivenMachine:
    """How a machine becomes one of driven wheels: ``original``, the ``channels`` of its log, how these give the ``engine``'s torque.

    Where the drive train's speed alone is measured also that ``rim`` and the speed [m/s] below which it reads 0 (``dead_band``).
    ``unknown_pto``: a PTO turned in that log, and the vehicle file does not say what it takes."""

    original: Vehicle
    channels: tuple[str, ...]
    engine: EngineTorque
    rim: Rim | None
    dead_band: float = 0.0
    unknown_pto: bool = False

    @classmethod
    def of_log(cls, whole: Recording, vehicle: Vehicle, reference: SlipReference) -> DrivenMachine:
        """From a whole log; raises InputError where it lacks the reference torque of which the engine's torque is a share."""
        assert vehicle.driveline is not None
        measured = whole.channels.get("engine_reference_torque")
        engine = EngineTorque.of(
            whole.channels,
            vehicle.driveline,
            None if measured is None else float(np.nanmedian(measured)),
            source=whole.source,
        )
        turning = pto_turns(whole.time, whole.channels)
        unknown = vehicle.driveline.pto_power is None and bool(turning.any())
        if unknown:
            engine = replace(engine, notes=(*engine.notes, _PTO.format(turning.mean())))
        return cls(
            vehicle, tuple(whole.channels), engine, _drive(reference.rims), reference.dead_band, unknown
        )

    @classmethod
    def of_file(
        cls, vehicle: Vehicle, channels: Collection[str], known: Mapping[str, Any] | None = None
    ) -> DrivenMachine:
        """While samples of these ``channels`` come in: as the vehicle file has it, or an earlier log (``known``, by `to_dict`).

        What a bus may send or not (drawbar force, the engine's friction) is as if it did not, until it does; a PTO's speed, and a brake,
        count though the earlier log had none. Raises InputError as `of_log`.
        """
        assert vehicle.driveline is not None
        if known is not None:
            rim = None if known["rim"] is None else Rim(**known["rim"])
            there = tuple(name for name in known["channels"] if name in channels)
            there += tuple(
                name for name in channels if name.startswith(("pto_", "brake")) and name not in there
            )
            return cls(vehicle, there, EngineTorque.from_dict(known["engine"]), rim, known["dead_band"])
        there = tuple(n for n in channels if n not in ("drawbar_force", "engine_friction_share"))
        waits = "engine_reference_torque" in channels
        engine = EngineTorque.of(there, vehicle.driveline, None, waits=waits)
        return cls(vehicle, there, engine, _drive(rims_of(vehicle, channels)))

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it, the vehicle too."""
        return {
            "vehicle": self.original.to_dict(),
            "channels": list(self.channels),
            "engine": self.engine.to_dict(),
            "rim": None if self.rim is None else asdict(self.rim),
            "dead_band": self.dead_band,
        }

    @property
    def together(self) -> int:
        """How many wheels the driven one represents."""
        return len(self.original.driven_wheels)

    @cached_property
    def frees_measured(self) -> bool:
        """Whether all free wheels' speeds are in the log."""
        free = self.original.free_wheels
        return bool(free) and all(f"wheel_speed_{w}" in self.channels for w in free)

    @cached_property
    def vehicle(self) -> Vehicle:
        """The machine with its driven wheels as one, its free ones as another."""
        zero = None if self.rim is None else (self.rim.radius, self.rim.spread)
        return Vehicle.from_dict(lumped(self.original, zero))

    @cached_property
    def own_channels(self) -> tuple[str, ...]:
        """The channels of `vehicle` that the log's become."""
        own = [f"wheel_speed_{DRIVEN}", f"drive_torque_{DRIVEN}"]
        own += [f"wheel_speed_{UNDRIVEN}"] * bool(self.original.free_wheels)
        return (*own, *(n for n in self.channels if not n.startswith(_REPLACED)))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        return (_NOTE, *self.engine.notes)

    def _speed(self, channels: Mapping[str, Floats], wheels: tuple[str, ...], radius: float) -> Floats:
        """Mean speed (n,) [rad/s] of some wheels as one of a ``radius``."""
        radii = dict(zip(self.original.wheels, wheel_radii(self.original)[1], strict=True))
        known = [w for w in wheels if f"wheel_speed_{w}" in channels]
        mean: Floats = np.mean([radii[w] * channels[f"wheel_speed_{w}"] for w in known], axis=0) / radius
        return mean

    def radius(self, wheel: str) -> float:
        """Radius [m] of ``driven`` or ``undriven``."""
        return self.vehicle.radii[wheel]

    def converted(
        self, time: Floats, given: Mapping[str, Floats], before: int
    ) -> tuple[dict[str, Floats], DrivelineTorque]:
        """Channels of `vehicle`, and the driveline's torque, in the rows (n,) from ``before`` on of channels (before + n,) at ``time``."""
        driveline = self.original.driveline
        assert driveline is not None
        driven, free = self.original.driven_wheels, self.original.free_wheels
        if any(f"wheel_speed_{w}" in given for w in driven):
            speed = self._speed(given, driven, self.radius(DRIVEN))
        else:
            assert self.rim is not None
            speed = given["wheel_based_speed"] / self.rim.scale
            if self.dead_band > 0:
                speed = np.where(speed == 0, np.nan, speed)
        result = driveline_torque(driveline, self.engine, time, given, speed, self.radius(DRIVEN))
        drive = DrivelineTorque(result.torque[before:], result.std[before:], result.shift[before:])
        own = {f"wheel_speed_{DRIVEN}": speed, f"drive_torque_{DRIVEN}": result.torque}
        if free:
            place = self.radius(UNDRIVEN)
            own[f"wheel_speed_{UNDRIVEN}"] = (
                self._speed(given, free, place) if self.frees_measured else given["ground_speed"] / place
            )
        kept = {n: v for n, v in given.items() if not n.startswith(_REPLACED)}
        return {n: v[before:] for n, v in {**own, **kept}.items()}, drive

    def shows(self, name: str) -> bool:
        """Whether a column of estimates of `vehicle` rests on a measurement: of free wheels only the load, unless their speeds do."""
        return self.frees_measured or UNDRIVEN not in name or name.startswith("vertical_load")

    def _weight(self, columns: Mapping[str, Floats]) -> Floats | float:
        """The load on the wheels (n,) [N]: the machine's weight, unless the log has a mass that changes."""
        if not {"mass", "hitch_load"} & set(self.channels):
            return self.vehicle.mass * GRAVITY
        loads = [columns[f"vertical_load_{axle}"] for axle in self.vehicle.axle_names]
        return np.asarray(np.sum(loads, axis=0))

    def completed(self, columns: Mapping[str, Floats], std: Floats) -> dict[str, Floats]:
        """The columns (n,) that widen by the SD ``std`` (n,) [N m] of the driveline's losses; NaN where no torque is known."""
        machine = self.vehicle
        force = std / self.radius(DRIVEN)
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
        result = {}
        for name, spread in widen.items():
            spread = np.where(np.isfinite(spread), spread, 0.0) if name.startswith("curve") else spread
            result[f"{name}_std"] = np.hypot(columns[f"{name}_std"], spread)
        result["efficiency_driven_std"] = np.minimum(result["efficiency_driven_std"], 1.0)
        none = ~np.isfinite(std)
        for name in _SUMS:
            result[name] = np.where(none, np.nan, columns[name])
            result[f"{name}_std"] = np.where(none, np.nan, result[f"{name}_std"])
        return result


def _drive(rims: Collection[Rim]) -> Rim | None:
    """The drive train as one wheel, where its speed alone is measured."""
    return next((rim for rim in rims if rim.wheel == DRIVE), None)


def machine_of(estimates: Estimates, vehicle: Vehicle) -> Vehicle:
    """The vehicle that the columns of the estimates refer to: ``vehicle`` (as its file has it) or, of a driveline, its wheels as one."""
    if "driveline" not in estimates.about or vehicle.driveline is None:
        return vehicle
    made = estimates.vehicle
    return Vehicle.from_dict(lumped(vehicle, (made.radii[DRIVEN], made.uncertainty.wheel_radius or 0.0)))


_REPLACED = ("wheel_speed_", "wheel_based_speed", "vertical_load_", "engine_", "pto_")


def lumped(vehicle: Vehicle, zero: tuple[float, float] | None) -> dict[str, Any]:
    """A vehicle file's data of the machine with its driven wheels as one and its free ones as another.

    Each has its wheels' mean radius and the sum of their equivalent masses; its axle has their masses, at their mean position.
    ``zero``: radius [m] of the driven one at zero slip and its relative SD, where the log shows them.
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
        axle = {"mass": float(mass[axles].sum()), "wheels": [name], "wheel": wheel, "driven": chosen}
        axle["bearing_resistance"] = float(vehicle.wheel_bearing[wheels].sum())
        axle["drive_friction"] = float(vehicle.wheel_friction[wheels].sum())
        groups.append((place, name, axle))
    groups.sort(key=lambda group: -group[0])
    rear = groups[-1][0]
    calibration = data.get("calibration", {})
    data |= {
        "axles": {name: axle for _, name, axle in groups},
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
    if (
        vehicle.antenna is not None
    ):  # its wheels stand where the machine does not turn about: only what is beside them counts
        data["radar"] = {"y": vehicle.receiver[1]}
    if len(groups) > 1:
        data["wheelbase"] = groups[0][0] - rear
        if data["wheelbase"] < 0.1 * float(
            np.ptp(position)
        ):  # the groups are at one place: nothing shifts load between them
            data |= {"wheelbase": 1.0, "center_of_gravity_height": 0.0, "hitch_height": 0.0}
    for key in ("wheel", "track", "articulated", "driveline", *(("wheelbase",) if len(groups) == 1 else ())):
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

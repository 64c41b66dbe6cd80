"""The parts of the vehicle file: quantities with their limits, wheels, axles, sensors, spreads, calibration."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, field_validator, model_validator

from terragrip.arrays import Floats
from terragrip.document import Fault, Part
from terragrip.tire_size import tire_size
from terragrip.units import UnitError, factor_to, quantity

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_]*$")
"""Names of wheels and axles."""


_LENGTHS = ("mm", "cm", "in")


def _read(unit: str, low: float, high: float, likely: tuple[str, ...], above: bool) -> Callable[[Any], float]:
    """A validator: a number or a text with a unit, within the limits; a likely wrong unit is named."""

    def check(value: Any) -> float:
        number = quantity(value, unit)
        if (low < number if above else low <= number) and number <= high:
            return number
        suffix = "" if unit == "1" else f" {unit}"
        bound = "exceed" if above else "be at least"
        hint = f"it must {bound} {low:g}{suffix} and not exceed {high:g}{suffix}"
        units = likely if isinstance(value, int | float) else ()
        meant = [f"{number:g} {one}" for one in units if low < number * factor_to(one, unit) <= high]
        if meant:
            quoted = " or ".join(f"'{text}'" for text in meant)
            hint = f"{' or '.join(meant)}? write {quoted}"
        raise UnitError(f"{number:g}{suffix} is impossible", hint)

    return check


def quantity_of(
    unit: str, low: float, high: float, *, above: bool = False, likely: tuple[str, ...] = ()
) -> Any:
    """The field metadata of a physical quantity: SI inside, with its unit in a saved file."""
    return (
        BeforeValidator(_read(unit, low, high, likely, above)),
        PlainSerializer(lambda v: v if unit == "1" else f"{v!r} {unit}", when_used="json"),
    )


Mass = Annotated[float, *quantity_of("kg", 0, 2e5, above=True, likely=("g",))]
Length = Annotated[float, *quantity_of("m", 0.02, 30, likely=_LENGTHS)]
Height = Annotated[float, *quantity_of("m", 0, 5, likely=_LENGTHS)]
Overhang = Annotated[float, *quantity_of("m", -10, 10, likely=_LENGTHS)]
ToolLength = Annotated[float, *quantity_of("m", 0, 50, likely=_LENGTHS)]
_Offset = Annotated[float, *quantity_of("m", -30, 30, likely=_LENGTHS)]
Width = Annotated[float, *quantity_of("m", 0.05, 60, likely=_LENGTHS)]
Power = Annotated[float, *quantity_of("W", 1, 2e6, likely=("kW",))]
FuelPerEnergy = Annotated[float, *quantity_of("m^3/J", 1e-12, 1e-8, likely=("l/kWh",))]
_Radius = Annotated[float, *quantity_of("m", 0.01, 3, likely=_LENGTHS)]
_Inertia = Annotated[float, *quantity_of("kg m^2", 0, 1e4, above=True)]
_Pressure = Annotated[float, *quantity_of("Pa", 1e3, 2e6, likely=("kPa", "bar"))]
_Ratio = Annotated[float, *quantity_of("1", 0, 1, likely=("%",))]
Bearing = Annotated[float, *quantity_of("N s/rad", 0, 1e5)]
Friction = Annotated[float, *quantity_of("N m", 0, 1e6)]
_Angle = Annotated[float, *quantity_of("rad", 0, 1.5, likely=("deg",))]
_SignedAngle = Annotated[float, *quantity_of("rad", -1.5, 1.5, likely=("deg",))]
_SpeedSD = Annotated[float, *quantity_of("m/s", 0, 100, above=True)]
_WheelSpeedSD = Annotated[float, *quantity_of("rad/s", 0, 1e3, above=True)]
_TorqueSD = Annotated[float, *quantity_of("N m", 0, 1e6, above=True)]
_ForceSD = Annotated[float, *quantity_of("N", 0, 1e6, above=True)]
_AccelerationSD = Annotated[float, *quantity_of("m/s^2", 0, 100, above=True)]
_AngleSD = Annotated[float, *quantity_of("rad", 0, 1.5, above=True, likely=("deg",))]
_Torque = Annotated[float, *quantity_of("N m", 0, 1e6)]
_SignedTorque = Annotated[float, *quantity_of("N m", -1e6, 1e6)]
_Force = Annotated[float, *quantity_of("N", 0, 1e6)]
_SignedForce = Annotated[float, *quantity_of("N", -1e6, 1e6)]
_Delay = Annotated[float, *quantity_of("s", 0, 10, likely=("ms",))]
_Acceleration = Annotated[float, *quantity_of("m/s^2", 0, 10)]
_SignedAcceleration = Annotated[float, *quantity_of("m/s^2", -10, 10)]
_Gain = Annotated[float, *quantity_of("1", 0.01, 100)]


class FixedRadius(Part):
    """The wheel keeps the radius of the vehicle file under any load."""

    name: Literal["fixed"]


class HadekelRadius(Part):
    """Hadekel: h = F_z/(2π p √(r0 r_c)), r_c half the width (physics.md 4); the wheel's radius is r0."""

    name: Literal["hadekel"]
    pressure: _Pressure


class BidermanRadius(Part):
    """Biderman: h = A + √(A² + C1 F_z), A = C2 F_z/(2 (p + p0)) (physics.md 4); the wheel's radius is r0."""

    name: Literal["biderman"]
    C1: Annotated[float, *quantity_of("m^2/N", 0, 1)]
    C2: Annotated[float, *quantity_of("1/m", 0, 1e6)]
    p0: Annotated[float, *quantity_of("Pa", 0, 1e7)]
    pressure: _Pressure


RadiusModel = Annotated[FixedRadius | HadekelRadius | BidermanRadius, Field(discriminator="name")]


class Wheel(Part):
    """A wheel: ``radius`` [m] (unloaded, given a ``radius_model``), ``inertia`` [kg m²], ``width`` [m].

    ``mass`` [kg]: of the parts outside a force sensor in its axle, for a comparison with that sensor only.
    ``size`` of a tyre (``520/70R38``) gives width and radius where they are absent: with its inflation ``pressure`` [Pa] the unloaded
    radius and Hadekel's model, without it the rolling radius of a radial tyre.
    """

    radius: _Radius
    inertia: _Inertia
    width: Annotated[float, *quantity_of("m", 0.005, 3, likely=_LENGTHS)] | None = None
    mass: Mass | None = None
    radius_model: RadiusModel | None = None
    size: str | None = None
    pressure: _Pressure | None = None

    @model_validator(mode="before")
    @classmethod
    def _by_size(cls, data: Any) -> Any:
        if not isinstance(data, dict) or data.get("size") is None:
            return data
        size = tire_size(str(data["size"]))
        if size is None:
            if "radius" in data:
                return data
            raise Fault(
                f"{data['size']!r} does not say the tyre's height",
                "write a size such as 520/70R38, or add the radius",
                ("size",),
            )
        data = {"width": size.width, **data}
        if "radius" in data:
            return data
        if data.get("pressure") is None or "radius_model" in data:
            return {**data, "radius": size.radius if "radius_model" in data else size.rolling_radius}
        return {
            **data,
            "radius": size.radius,
            "radius_model": {"name": "hadekel", "pressure": data["pressure"]},
        }

    @model_validator(mode="after")
    def _hadekel_needs_a_width(self) -> Self:
        if isinstance(self.radius_model, HadekelRadius) and self.width is None:
            raise Fault(
                "is missing", "the radius model hadekel needs it: add e.g. 'width: 0.1 m'", ("width",)
            )
        return self


class Axle(Part):
    """An axle: the mass it carries at rest on level ground [kg], its wheels' names, whether it is driven, and whether it steers.

    ``pivots``: it swings on a pin in its middle, as a tractor's front axle does, so that its wheels carry alike on uneven ground.
    None: not said, see `pivoting_axles`.
    ``x`` [m]: how far ahead of the last axle its load acts; of a bogie's two axles where that is pivoted.
    ``bearing_resistance`` [N s/rad] and ``drive_friction`` [N m]: of each of its wheels, where they are others than the vehicle's.
    """

    mass: Mass
    wheels: tuple[str, ...]
    wheel: Wheel | None = None
    driven: bool = True
    steered: bool = False
    pivots: bool | None = None
    x: Annotated[float, *quantity_of("m", 0, 30, likely=_LENGTHS)] | None = None
    bearing_resistance: Bearing | None = None
    drive_friction: Friction | None = None

    @field_validator("wheels", mode="before")
    @classmethod
    def _read_names(cls, value: Any) -> tuple[str, ...]:
        if not isinstance(value, list | tuple) or not value:
            raise Fault("is not a list of wheels", "write e.g. '[fl, fr]'")
        return tuple(_wheel_name(name) for name in value)


def check_pivots(axles: dict[str, Axle]) -> None:
    """Raise a Fault where every axle with two wheels or more pivots."""
    pivots = [key for key, axle in axles.items() if axle.pivots]
    if pivots and all(axle.pivots or len(axle.wheels) == 1 for axle in axles.values()):
        hint = "leave out 'pivots' for an axle that the body rests on, left and right"
        raise Fault("no axle keeps the body from rolling over", hint, ("axles", pivots[0], "pivots"))


def pivoting_axles(axles: dict[str, Axle], articulated: bool) -> list[bool]:
    """Whether each axle swings on a pin. Where the file says it of none: as most machines do, one that steers beside a pair that does not,
    and the last of an ``articulated`` machine (docs/decisions/0176)."""
    stated = any(axle.pivots for axle in axles.values())
    upright = any(not axle.steered and len(axle.wheels) > 1 for axle in axles.values())
    last = list(axles)[-1] if articulated else None
    return [
        (axle.steered and upright) or key == last if axle.pivots is None and not stated else bool(axle.pivots)
        for key, axle in axles.items()
    ]


def check_places(axles: dict[str, Axle], place: Floats, length: float) -> None:
    """Raise a Fault unless the axles between the first and the last all have an ``x`` or none, and none is ahead of one before it.

    ``place`` (axles,) [m] ahead of the last axle; ``length`` [m]: the wheelbase.
    """
    placed = [name for name, axle in axles.items() if axle.x is not None]
    if not placed:
        return
    missing = next((name for name in list(axles)[1:-1] if name not in placed), None)
    if missing is not None:
        hint = (
            "give it for every axle between the first and the last, or for none: then they are evenly spaced"
        )
        raise Fault("is missing", hint, ("axles", missing, "x"))
    for k, name, right in ((0, next(iter(axles)), length), (-1, list(axles)[-1], 0.0)):
        if abs(place[k] - right) > 1e-6:
            hint = f"the first axle is the wheelbase, {length:g} m, ahead of the last, and that is at 0: leave x out there"
            raise Fault(f"is {place[k]:g} m", hint, ("axles", name, "x"))
    if np.any(np.diff(place) > 0):
        name = list(axles)[int(np.argmax(np.diff(place) > 0)) + 1]
        raise Fault("is ahead of the axle before it", "list axles front to rear", ("axles", name, "x"))


def _wheel_name(name: Any) -> str:
    if isinstance(name, bool):
        raise Fault("YAML reads a wheel name as yes or no", "put the wheel names in quotes")
    if not isinstance(name, int | str) or not NAME.match(str(name)) or str(name).endswith("std"):
        raise Fault(
            f"{name!r} is not a wheel name",
            "use letters, digits and underscores, not ending in 'std', e.g. fl",
        )
    return str(name)


class Antenna(Part):
    """Where position and speed are measured, from the rear axle's centre: ``x`` forward, ``y`` to the left, ``z`` above the ground [m]."""

    x: _Offset = 0.0
    y: _Offset = 0.0
    z: _Offset = 0.0


class Radar(Part):
    """A sensor of the ground speed that looks along the body, ``y`` [m] to the left of its middle."""

    y: _Offset = 0.0


class Payload(Part):
    """Centre of gravity of the load beside the file's ``mass``: from the rear axle ``x`` forward, ``z`` above the ground [m]."""

    x: _Offset
    z: Annotated[float, *quantity_of("m", 0, 6, likely=_LENGTHS)] | None = None


class Driveline(Part):
    """From the engine to the driven wheels, for machines that report the engine's torque and not the wheels' (docs/vehicle.md).

    Wheel torque = ``efficiency`` x ratio x (engine torque - ``accessory_power``/engine speed - ``engine_inertia`` x its
    acceleration), summed over the driven wheels. While a PTO turns ``pto_power`` is taken as well; None: such rows
    have no torque. The ratio is ``ratio`` where the gear is fixed, else engine speed over wheel
    speed. Each ``_std`` is the standard deviation of an unknown constant.
    """

    efficiency: Annotated[float, *quantity_of("1", 0.2, 1, likely=("%",))]
    efficiency_std: Annotated[float, *quantity_of("1", 0, 0.5, likely=("%",))] = 0.05
    accessory_power: Annotated[float, *quantity_of("W", 0, 1e6, likely=("kW",))]
    accessory_power_std: Annotated[float, *quantity_of("W", 0, 1e6, likely=("kW",))] | None = None
    pto_power: Annotated[float, *quantity_of("W", 0, 1e6, likely=("kW",))] | None = None
    pto_power_std: Annotated[float, *quantity_of("W", 0, 1e6, likely=("kW",))] | None = None
    engine_torque_std: Annotated[float, *quantity_of("N m", 0, 1e5)] | None = None
    reference_torque: Annotated[float, *quantity_of("N m", 0, 1e5, above=True)] | None = None
    engine_inertia: Annotated[float, *quantity_of("kg m^2", 0, 1e3)] = 0.0
    ratio: Annotated[float, *quantity_of("1", 0, 1e4, above=True)] | None = None


class Sensors(Part):
    """Standard deviations of the sensors' white noise, and of the ground speed's delay; absent: estimated from the log."""

    wheel_speed: _WheelSpeedSD | None = None
    ground_speed: _SpeedSD | None = None
    ground_speed_delay: _Delay | None = None
    drive_torque: _TorqueSD | None = None
    drawbar_force: _ForceSD | None = None
    acceleration: _AccelerationSD | None = None
    pitch: _AngleSD | None = None
    vertical_load: _ForceSD | None = None
    mass: Mass | None = None
    hitch_load: _ForceSD | None = None


_UNSTATED = {
    "drive_torque_gain": 0.1,  # of motor currents and of strain gauges on a shaft
    "drawbar_gain": 0.01,
    "slope": math.radians(0.5),
    "pitch_offset": math.radians(0.2),  # mounting included
    "wheel_radius": 0.02,  # docs/vehicle.md
    "vertical_load": 0.01,  # of the mean axle load, of an axle that was weighed
    "acceleration_bias": 0.3,  # mounting included
}


class Uncertainty(Part):
    """Prior standard deviations of constants that the data cannot determine: they widen the intervals (physics.md 6)."""

    drive_torque_gain: _Ratio | None = None  # of each wheel by itself
    drive_torque_gain_common: _Ratio | None = None  # of all wheels together
    drive_torque_offset: _Torque | None = None
    drawbar_gain: _Ratio | None = None
    drawbar_offset: _Force | None = None
    drawbar_force: _Force | None = None  # of a pull that no cell measures
    slope: _Angle | None = None  # that no pitch sensor measures
    pitch_offset: _Angle | None = None  # of a pitch sensor's zero
    wheel_radius: _Ratio | None = None
    tire_rolling_resistance: Annotated[float, *quantity_of("1", 0, 0.15)] | None = (
        None  # of the load, as its key
    )
    vertical_load: _Ratio | None = None
    mass: _Ratio | None = None
    hitch_load_gain: _Ratio | None = None
    hitch_load_offset: _Force | None = None
    acceleration_bias: _Acceleration | None = None

    def assumed(self, key: str) -> float:
        """SD of a constant [SI]: as the file states it (``key``), else what such a sensor or machine usually has (ours).

        Raises KeyError for a key whose usual SD nothing needs.
        """
        stated: float | None = getattr(self, key)
        return _UNSTATED[key] if stated is None else stated

    def of_slope(self, channels: Collection[str]) -> float:
        """SD [rad] of a lasting error of the slope: where ``channels`` have a pitch, of its sensor's zero alone, else of the slope."""
        given = self.slope or 0.0
        if "pitch" not in channels:
            return given
        usual = self.assumed("pitch_offset")
        return min(given, usual) if self.pitch_offset is None else usual

    def of_pull(self, channels: Collection[str]) -> float:
        """SD [N] of a lasting error of the pull: of the cell's zero where ``channels`` have a drawbar force, else of the pull itself."""
        return (self.drawbar_offset if "drawbar_force" in channels else self.drawbar_force) or 0.0


class Calibration(Part):
    """Gains and offsets found by ``terragrip calibrate``: corrected value = (raw value - offset) / gain.

    ``wheel_radius`` [m] replaces ``wheel.radius`` for the wheels it names; ``wheel_based_speed_gain`` is that of the drive
    train's speed on a machine whose file gives no wheels' radii.
    """

    drive_torque_gain: dict[str, _Gain] = Field(default_factory=dict)
    drive_torque_offset: dict[str, _SignedTorque] = Field(default_factory=dict)
    drawbar_offset: _SignedForce = 0.0
    acceleration_bias_x: _SignedAcceleration = 0.0
    pitch_offset: _SignedAngle = 0.0
    wheel_radius: dict[str, _Radius] = Field(default_factory=dict)
    wheel_based_speed_gain: _Gain | None = None

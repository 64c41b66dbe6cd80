"""What the machine is: masses, axles, wheels, hitch, sensors. A validated YAML file; every number is SI.

The frame is the body's: x forward, z up. Axles are listed front to rear, wheels in the order of the axles.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field, PlainSerializer, field_validator, model_validator

from terragrip.document import Fault, Part, read_yaml, validate
from terragrip.errors import InputError
from terragrip.units import UnitError, factor_to, quantity

Floats = npt.NDArray[np.float64]

MAX_WHEELS = 8
_MASS_TOLERANCE = 0.01  # share of the mass by which the axles may miss it
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_]*$")
_ADD_WHEELS = "add e.g. 'wheel: {radius: 0.2 m, inertia: 0.15 kg m^2}': only slip from wheel_based_speed alone needs none"


def _read(unit: str, low: float, high: float, likely: tuple[str, ...], above: bool) -> Callable[[Any], float]:
    """A validator: a number or a text with a unit, within the limits; a slip of the unit is named."""

    def check(value: Any) -> float:
        number = quantity(value, unit)
        if (low < number if above else low <= number) and number <= high:
            return number
        suffix = "" if unit == "1" else f" {unit}"
        bound = "exceed" if above else "be at least"
        hint = f"it must {bound} {low:g}{suffix} and not exceed {high:g}{suffix}"
        for other in likely if isinstance(value, int | float) else ():
            if low < number * factor_to(other, unit) <= high:
                hint = f"{number:g} {other}? write '{number:g} {other}'"
                break
        raise UnitError(f"{number:g}{suffix} is impossible", hint)

    return check


def _quantity(
    unit: str, low: float, high: float, *, above: bool = False, likely: tuple[str, ...] = ()
) -> Any:
    """The field metadata of a physical quantity: SI inside, with its unit in a saved file."""
    return (
        BeforeValidator(_read(unit, low, high, likely, above)),
        PlainSerializer(lambda v: v if unit == "1" else f"{v!r} {unit}", when_used="json"),
    )


_Mass = Annotated[float, *_quantity("kg", 0, 2e5, above=True, likely=("g",))]
_Length = Annotated[float, *_quantity("m", 0.02, 30, likely=("mm", "cm"))]
_Height = Annotated[float, *_quantity("m", 0, 5, likely=("mm", "cm"))]
_Overhang = Annotated[float, *_quantity("m", -10, 10, likely=("mm", "cm"))]
_ToolLength = Annotated[float, *_quantity("m", 0, 50, likely=("mm", "cm"))]
_Offset = Annotated[float, *_quantity("m", -30, 30, likely=("mm", "cm"))]
_Radius = Annotated[float, *_quantity("m", 0.01, 3, likely=("mm", "cm"))]
_Inertia = Annotated[float, *_quantity("kg m^2", 0, 1e4, above=True)]
_Pressure = Annotated[float, *_quantity("Pa", 1e3, 2e6, likely=("kPa", "bar"))]
_Ratio = Annotated[float, *_quantity("1", 0, 1, likely=("%",))]
_Bearing = Annotated[float, *_quantity("N s/rad", 0, 1e5)]
_Angle = Annotated[float, *_quantity("rad", 0, 1.5, likely=("deg",))]
_SignedAngle = Annotated[float, *_quantity("rad", -1.5, 1.5, likely=("deg",))]
_SpeedSD = Annotated[float, *_quantity("m/s", 0, 100, above=True)]
_WheelSpeedSD = Annotated[float, *_quantity("rad/s", 0, 1e3, above=True)]
_TorqueSD = Annotated[float, *_quantity("N m", 0, 1e6, above=True)]
_ForceSD = Annotated[float, *_quantity("N", 0, 1e6, above=True)]
_AccelerationSD = Annotated[float, *_quantity("m/s^2", 0, 100, above=True)]
_AngleSD = Annotated[float, *_quantity("rad", 0, 1.5, above=True, likely=("deg",))]
_Torque = Annotated[float, *_quantity("N m", 0, 1e6)]
_SignedTorque = Annotated[float, *_quantity("N m", -1e6, 1e6)]
_Force = Annotated[float, *_quantity("N", 0, 1e6)]
_SignedForce = Annotated[float, *_quantity("N", -1e6, 1e6)]
_Acceleration = Annotated[float, *_quantity("m/s^2", 0, 10)]
_SignedAcceleration = Annotated[float, *_quantity("m/s^2", -10, 10)]
_Gain = Annotated[float, *_quantity("1", 0.01, 100)]


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
    C1: Annotated[float, *_quantity("m^2/N", 0, 1)]
    C2: Annotated[float, *_quantity("1/m", 0, 1e6)]
    p0: Annotated[float, *_quantity("Pa", 0, 1e7)]
    pressure: _Pressure


RadiusModel = Annotated[FixedRadius | HadekelRadius | BidermanRadius, Field(discriminator="name")]


class Wheel(Part):
    """A wheel: ``radius`` [m] (unloaded, given a ``radius_model``), ``inertia`` [kg m²], ``width`` [m].

    ``mass`` [kg]: of what hangs outside a force sensor in its axle; only a comparison with that sensor asks for it.
    """

    radius: _Radius
    inertia: _Inertia
    width: Annotated[float, *_quantity("m", 0.005, 3, likely=("mm", "cm"))] | None = None
    mass: _Mass | None = None
    radius_model: RadiusModel | None = None

    @model_validator(mode="after")
    def _hadekel_needs_a_width(self) -> Self:
        if isinstance(self.radius_model, HadekelRadius) and self.width is None:
            raise Fault(
                "is missing", "the radius model hadekel needs it: add e.g. 'width: 0.1 m'", ("width",)
            )
        return self


class Axle(Part):
    """An axle: the mass it carries at rest on level ground [kg], its wheels' names, whether it is driven."""

    mass: _Mass
    wheels: tuple[str, ...]
    wheel: Wheel | None = None
    driven: bool = True

    @field_validator("wheels", mode="before")
    @classmethod
    def _read_names(cls, value: Any) -> tuple[str, ...]:
        if not isinstance(value, list | tuple) or not value:
            raise Fault("is not a list of wheels", "write e.g. '[fl, fr]'")
        return tuple(_wheel_name(name) for name in value)


def _wheel_name(name: Any) -> str:
    if isinstance(name, bool):
        raise Fault("YAML reads a wheel name as yes or no", "put the wheel names in quotes")
    if not isinstance(name, int | str) or not _NAME.match(str(name)) or str(name).endswith("std"):
        raise Fault(
            f"{name!r} is not a wheel name",
            "use letters, digits and underscores, not ending in 'std', e.g. fl",
        )
    return str(name)


class Antenna(Part):
    """Where the position is taken, from the rear axle's centre: ``x`` forward, ``y`` to the left, ``z`` above the ground [m]."""

    x: _Offset = 0.0
    y: _Offset = 0.0
    z: _Offset = 0.0


class Sensors(Part):
    """Standard deviations of the sensors' white noise; absent: estimated from the log."""

    wheel_speed: _WheelSpeedSD | None = None
    ground_speed: _SpeedSD | None = None
    drive_torque: _TorqueSD | None = None
    drawbar_force: _ForceSD | None = None
    acceleration: _AccelerationSD | None = None
    pitch: _AngleSD | None = None
    vertical_load: _ForceSD | None = None


class Uncertainty(Part):
    """Prior standard deviations of constants that data cannot tell: they widen the intervals (physics.md 6)."""

    drive_torque_gain: _Ratio | None = None  # of each wheel by itself
    drive_torque_gain_common: _Ratio | None = None  # of all wheels together
    drive_torque_offset: _Torque | None = None
    drawbar_gain: _Ratio | None = None
    drawbar_offset: _Force | None = None
    slope: _Angle | None = None
    wheel_radius: _Ratio | None = None
    tire_rolling_resistance: _Ratio | None = None
    vertical_load: _Ratio | None = None
    acceleration_bias: _Acceleration | None = None


class Calibration(Part):
    """Gains and offsets found by ``terragrip calibrate``: corrected value = (raw value - offset) / gain.

    ``wheel_radius`` [m] takes the place of ``wheel.radius`` for the wheels it names; ``wheel_based_speed_gain`` is that of the drive
    train's speed on a machine whose file gives no wheels' radii.
    """

    drive_torque_gain: dict[str, _Gain] = Field(default_factory=dict)
    drive_torque_offset: dict[str, _SignedTorque] = Field(default_factory=dict)
    drawbar_offset: _SignedForce = 0.0
    acceleration_bias_x: _SignedAcceleration = 0.0
    pitch_offset: _SignedAngle = 0.0
    wheel_radius: dict[str, _Radius] = Field(default_factory=dict)
    wheel_based_speed_gain: _Gain | None = None


class Vehicle(Part):
    """A machine of 1 to 8 wheels on one or more axles.

    Fields are those of the vehicle file (architecture.md, contracts) in SI; ``wheelbase`` [m] reaches from the first axle to
    the last. The properties hold numbers per wheel or axle as read-only arrays, in the order of ``wheels``. Without any ``wheel`` (see
    `knows_wheels`) the vehicle does for slip from ``wheel_based_speed`` alone.
    """

    PAGE: ClassVar[str | None] = "vehicle#all-keys"

    name: str = ""
    mass: _Mass
    wheelbase: _Length | None = None
    track: _Length | None = None
    center_of_gravity_height: _Height = 0.0
    hitch_height: _Height = 0.0
    hitch_overhang: _Overhang = 0.0
    tool_length: _ToolLength = 0.0
    axles: dict[str, Axle]
    wheel: Wheel | None = None
    tire_rolling_resistance: Annotated[float, *_quantity("1", 0, 0.5, likely=("%",))] = 0.0
    bearing_resistance: _Bearing = 0.0
    antenna: Antenna | None = None
    sensors: Sensors = Field(default_factory=Sensors)
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)
    calibration: Calibration = Field(default_factory=Calibration)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a vehicle file; raises InputError with the file, the key, its line and the fix."""
        return validate(cls, read_yaml(path))

    @classmethod
    def from_dict(cls, data: dict[str, Any], file: str | None = None) -> Self:
        """Build from a mapping as a vehicle file holds; raises InputError, which names ``file`` if given."""
        return validate(cls, data, file=file)

    def to_dict(self) -> dict[str, Any]:
        """The vehicle as plain data, every number in SI; ``from_dict`` gives it back."""
        return self.model_dump(exclude_unset=True)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a vehicle file that ``load`` reads back to an equal vehicle; raises InputError on failure."""
        from terragrip.files import replacing

        with replacing(path) as temporary:
            temporary.write_text(self.to_yaml(), encoding="utf-8")

    def to_yaml(self) -> str:
        """The text of a vehicle file."""
        import yaml

        data = self.model_dump(exclude_unset=True, mode="json")
        text: str = yaml.safe_dump(
            data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
        )
        return text

    @model_validator(mode="after")
    def _check(self) -> Self:
        names = [name for axle in self.axles.values() for name in axle.wheels]
        if not 1 <= len(names) <= MAX_WHEELS:
            raise Fault(f"there are {len(names)} wheels", f"a vehicle has 1 to {MAX_WHEELS}", ("axles",))
        for key, axle in self.axles.items():
            if not _NAME.match(key):
                raise Fault(
                    "is not an axle name", "use letters, digits and underscores, e.g. front", ("axles", key)
                )
            twice = next((name for name in axle.wheels if names.count(name) > 1), None)
            if twice is not None:
                raise Fault(
                    f"the wheel {twice} stands twice",
                    "give every wheel its own name",
                    ("axles", key, "wheels"),
                )
            if axle.wheel is None and not self.knows_wheels and any(a.wheel for a in self.axles.values()):
                raise Fault("has no wheel data, and another axle has", _ADD_WHEELS, ("axles", key))
        carried = sum(axle.mass for axle in self.axles.values())
        if abs(carried - self.mass) > _MASS_TOLERANCE * self.mass:
            raise Fault(
                f"the axles carry {carried:g} kg, the vehicle has {self.mass:g} kg",
                "make the axles' masses add up to the mass",
                ("axles",),
            )
        for key in ("wheelbase", "center_of_gravity_height") if len(self.axles) > 1 else ():
            if getattr(self, key) is None or key not in self.model_fields_set:
                raise Fault("is missing", f"two or more axles need it: add e.g. '{key}: 0.6 m'", (key,))
        for key in ("drive_torque_gain", "drive_torque_offset", "wheel_radius"):
            unknown = next((name for name in getattr(self.calibration, key) if name not in names), None)
            if unknown is not None:
                raise Fault(
                    "no such wheel", f"the wheels are {', '.join(names)}", ("calibration", key, unknown)
                )
        return self

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels, front to rear."""
        return tuple(name for axle in self.axles.values() for name in axle.wheels)

    @cached_property
    def axle_names(self) -> tuple[str, ...]:
        """Names of the axles, front to rear."""
        return tuple(self.axles)

    @cached_property
    def wheel_axle(self) -> npt.NDArray[np.intp]:
        """Index of each wheel's axle (n,)."""
        counts = [len(axle.wheels) for axle in self.axles.values()]
        return _frozen(np.repeat(np.arange(len(counts)), counts))

    @property
    def knows_wheels(self) -> bool:
        """Whether the file gives the wheels' radii and inertias; slip from ``wheel_based_speed`` alone does without."""
        return self.wheel is not None or all(axle.wheel is not None for axle in self.axles.values())

    @cached_property
    def wheel_data(self) -> tuple[Wheel, ...]:
        """Each wheel's radius, inertia, width and radius model: its axle's, else the vehicle's; raises InputError where there is none."""
        if not self.knows_wheels:
            of = f" of {self.name}" if self.name else ""
            raise InputError(f"the vehicle file{of} has no wheel data", place="wheel", hint=_ADD_WHEELS)
        return tuple(
            axle.wheel or self.wheel  # type: ignore[misc]  # one of them is there
            for axle in self.axles.values()
            for _ in axle.wheels
        )

    @cached_property
    def wheel_radius(self) -> Floats:
        """Radius of each wheel (n,) [m], calibrated where known; unloaded where it has a radius model."""
        result = self.calibration.wheel_radius
        return _frozen(
            np.array([result.get(n, w.radius) for n, w in zip(self.wheels, self.wheel_data, strict=True)])
        )

    @cached_property
    def wheel_inertia(self) -> Floats:
        """Moment of inertia of each wheel with its drive (n,) [kg m²]."""
        return _frozen(np.array([wheel.inertia for wheel in self.wheel_data]))

    @cached_property
    def driven(self) -> npt.NDArray[np.bool_]:
        """Whether each wheel is driven (n,)."""
        return _frozen(np.array([axle.driven for axle in self.axles.values() for _ in axle.wheels]))

    @cached_property
    def axle_mass(self) -> Floats:
        """Mass that each axle carries at rest on level ground (axles,) [kg]."""
        return _frozen(np.array([axle.mass for axle in self.axles.values()]))

    @cached_property
    def axle_to_rear(self) -> Floats:
        """Distance of each axle to the rear one (axles,) [m]; axles are taken as evenly spaced."""
        count = len(self.axles)
        return _frozen(np.linspace(self.wheelbase or 0.0, 0.0, count) if count > 1 else np.zeros(1))

    @cached_property
    def wheel_side(self) -> Floats:
        """Distance of each wheel from the vehicle's middle (n,) [m], left positive; 0 without a track."""
        half = (self.track or 0.0) / 2
        counts = [len(axle.wheels) for axle in self.axles.values()]
        return _frozen(
            np.concatenate([np.linspace(half, -half, n) if n > 1 else np.zeros(1) for n in counts])
        )

    @cached_property
    def center_of_gravity_to_rear(self) -> float:
        """Distance of the centre of gravity to the rear axle [m], from the axles' masses; 0 with one axle."""
        return float(self.axle_mass @ self.axle_to_rear / self.axle_mass.sum())

    @cached_property
    def drive_torque_gain(self) -> Floats:
        """Torque gain of each wheel (n,), 1 where not calibrated: torque = (raw - offset) / gain."""
        return _frozen(np.array([self.calibration.drive_torque_gain.get(name, 1.0) for name in self.wheels]))

    @cached_property
    def drive_torque_offset(self) -> Floats:
        """Calibrated torque offset of each wheel (n,) [N m], 0 where there is none."""
        return _frozen(
            np.array([self.calibration.drive_torque_offset.get(name, 0.0) for name in self.wheels])
        )


def _frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

"""The vehicle: masses, axles, wheels, hitch, sensors. A validated YAML file; every number is SI.

The frame is the body's: x forward, z up. Axles are listed front to rear, wheels in the order of the axles.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from terragrip.arrays import Bools, Floats, Ints
from terragrip.document import Fault, Part, read_yaml, validate
from terragrip.errors import InputError
from terragrip.physics.loads import axle_loads, point_load_shares, wheel_shares
from terragrip.vehicle_parts import (
    NAME,
    Antenna,
    Axle,
    Bearing,
    Calibration,
    Driveline,
    Friction,
    FuelPerEnergy,
    Height,
    Length,
    Mass,
    Overhang,
    Payload,
    Power,
    Radar,
    Sensors,
    ToolLength,
    Uncertainty,
    Wheel,
    Width,
    check_pivots,
    check_places,
    pivoting_axles,
    quantity_of,
)

MAX_WHEELS = 8
_MASS_TOLERANCE = 0.01  # allowed difference of the axles' sum, share of the mass
_ADD_WHEELS = "add e.g. 'wheel: {radius: 0.2 m, inertia: 0.15 kg m^2}': only slip from wheel_based_speed alone needs none"


class Vehicle(Part):
    """A machine of 1 to 8 wheels on one or more axles.

    Fields are those of the vehicle file (architecture.md, contracts) in SI; ``wheelbase`` [m] reaches from the first axle to
    the last. The properties give numbers per wheel or axle as read-only arrays, in the order of ``wheels``. Without any ``wheel``
    (see `knows_wheels`) the vehicle is enough for slip from ``wheel_based_speed`` alone.
    """

    PAGE: ClassVar[str | None] = "vehicle#all-keys"

    name: str = ""
    mass: Mass
    wheelbase: Length | None = None
    track: Length | None = None
    center_of_gravity_height: Height = 0.0
    hitch_height: Height = 0.0
    hitch_overhang: Overhang = 0.0
    tool_length: ToolLength = 0.0
    axles: dict[str, Axle]
    wheel: Wheel | None = None
    tire_rolling_resistance: Annotated[float, *quantity_of("1", 0, 0.5, likely=("%",))] = 0.0
    bearing_resistance: Bearing = 0.0
    drive_friction: Friction = 0.0
    articulated: bool = False
    antenna: Antenna | None = None
    radar: Radar | None = None
    payload: Payload | None = None
    power: Power | None = None
    working_width: Width | None = None
    fuel: FuelPerEnergy | None = None
    driveline: Driveline | None = None
    sensors: Sensors = Field(default_factory=Sensors)
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)
    calibration: Calibration = Field(default_factory=Calibration)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a vehicle file; raises InputError with the file, the key, its line and the fix."""
        return validate(cls, read_yaml(path))

    @classmethod
    def from_dict(cls, data: dict[str, Any], file: str | None = None) -> Self:
        """Build from a mapping with the content of a vehicle file; raises InputError, which names ``file`` if given."""
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
        self._check_axles()
        self._check_geometry()
        if self.driveline is not None and not self.knows_wheels:
            raise Fault("needs the wheels' radius and inertia", _ADD_WHEELS, ("driveline",))
        for key in ("drive_torque_gain", "drive_torque_offset", "wheel_radius"):
            unknown = next((name for name in getattr(self.calibration, key) if name not in self.wheels), None)
            if unknown is not None:
                hint = f"the wheels are {', '.join(self.wheels)}"
                raise Fault("no such wheel", hint, ("calibration", key, unknown))
        return self

    def _check_axles(self) -> None:
        """Names, numbers and data of axles and wheels, and what the axles carry."""
        names = [name for axle in self.axles.values() for name in axle.wheels]
        if not 1 <= len(names) <= MAX_WHEELS:
            raise Fault(f"there are {len(names)} wheels", f"a vehicle has 1 to {MAX_WHEELS}", ("axles",))
        some_know = any(axle.wheel for axle in self.axles.values())
        for key, axle in self.axles.items():
            if not NAME.match(key):
                hint = "use letters, digits and underscores, e.g. front"
                raise Fault("is not an axle name", hint, ("axles", key))
            twice = next((name for name in axle.wheels if names.count(name) > 1), None)
            if twice is not None:
                hint = "give every wheel its own name"
                raise Fault(f"the wheel {twice} occurs twice", hint, ("axles", key, "wheels"))
            if axle.wheel is None and some_know and not self.knows_wheels:
                raise Fault("has no wheel data, and another axle has", _ADD_WHEELS, ("axles", key))
        check_pivots(self.axles)
        carried = sum(axle.mass for axle in self.axles.values())
        if abs(carried - self.mass) > _MASS_TOLERANCE * self.mass:
            raise Fault(
                f"the axles carry {carried:g} kg, the vehicle has {self.mass:g} kg",
                "make the axles' masses add up to the mass",
                ("axles",),
            )

    def _check_geometry(self) -> None:
        """Lengths that two axles need, and what they make of payload and steering."""
        # A loader's bucket is up to two wheelbases from the rear axle.
        if self.payload is not None and not -1.0 <= self.payload.x / (self.wheelbase or np.inf) <= 2.5:
            raise Fault(
                f"{self.payload.x:g} m is far from between the axles, {self.wheelbase:g} m apart",
                "count from the rear axle forward",
                ("payload", "x"),
            )
        if self.articulated and (len(self.axles) < 2 or any(axle.steered for axle in self.axles.values())):
            hint = "leave out 'steered': a vehicle that bends steers by its joint"
            raise Fault("needs two axles, none of them steered", hint, ("articulated",))
        for key in ("wheelbase", "center_of_gravity_height") if len(self.axles) > 1 else ():
            if getattr(self, key) is None or key not in self.model_fields_set:
                raise Fault("is missing", f"two or more axles need it: add e.g. '{key}: 0.6 m'", (key,))
        check_places(self.axles, self.axle_to_rear, self.wheelbase or 0.0)

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels, front to rear."""
        return tuple(name for axle in self.axles.values() for name in axle.wheels)

    @cached_property
    def axle_names(self) -> tuple[str, ...]:
        """Names of the axles, front to rear."""
        return tuple(self.axles)

    @cached_property
    def wheel_axle(self) -> Ints:
        """Index of each wheel's axle (n,)."""
        counts = [len(axle.wheels) for axle in self.axles.values()]
        return _frozen(np.repeat(np.arange(len(counts)), counts))

    @property
    def knows_wheels(self) -> bool:
        """Whether the file gives the wheels' radii and inertias; slip from ``wheel_based_speed`` alone does not need them."""
        return self.wheel is not None or all(axle.wheel is not None for axle in self.axles.values())

    @cached_property
    def wheel_data(self) -> tuple[Wheel, ...]:
        """Each wheel's radius, inertia, width and radius model: its axle's, else the vehicle's; raises InputError if there is none."""
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
    def radii(self) -> dict[str, float]:
        """`wheel_radius` [m] by the wheel's name."""
        return dict(zip(self.wheels, self.wheel_radius.tolist(), strict=True))

    @cached_property
    def driven_radii(self) -> dict[str, float]:
        """Those of the driven wheels."""
        return {wheel: self.radii[wheel] for wheel in self.driven_wheels}

    @cached_property
    def wheel_inertia(self) -> Floats:
        """Moment of inertia of each wheel with its drive (n,) [kg m²]."""
        return _frozen(np.array([wheel.inertia for wheel in self.wheel_data]))

    @cached_property
    def wheel_bearing(self) -> Floats:
        """Bearing resistance of each wheel (n,) [N s/rad]: its axle's, else the vehicle's."""
        own = [axle.bearing_resistance for axle in self.axles.values() for _ in axle.wheels]
        return _frozen(np.array([self.bearing_resistance if one is None else one for one in own]))

    @cached_property
    def wheel_friction(self) -> Floats:
        """Friction of each wheel's drive (n,) [N m], of one size at any speed: its axle's, else the vehicle's; 0 of a free wheel."""
        own = [axle.drive_friction for axle in self.axles.values() for _ in axle.wheels]
        every = np.array([self.drive_friction if one is None else one for one in own])
        return _frozen(np.where(self.driven, every, 0.0))

    @cached_property
    def driven(self) -> Bools:
        """Whether each wheel is driven (n,)."""
        return _frozen(np.array([axle.driven for axle in self.axles.values() for _ in axle.wheels]))

    @cached_property
    def driven_wheels(self) -> tuple[str, ...]:
        """Names of the driven wheels, front to rear."""
        return tuple(name for axle in self.axles.values() if axle.driven for name in axle.wheels)

    @property
    def free_wheels(self) -> tuple[str, ...]:
        """The others: their slip says nothing of the drive."""
        return tuple(wheel for wheel in self.wheels if wheel not in self.driven_wheels)

    def rolling_wheels(self, channels: Collection[str]) -> tuple[str, ...]:
        """The free wheels without a speed among ``channels``: they go as the ground does under them, without slip."""
        return tuple(wheel for wheel in self.free_wheels if f"wheel_speed_{wheel}" not in channels)

    @cached_property
    def axle_mass(self) -> Floats:
        """Mass that each axle carries at rest on level ground (axles,) [kg]."""
        return _frozen(np.array([axle.mass for axle in self.axles.values()]))

    @cached_property
    def axle_to_rear(self) -> Floats:
        """Distance of each axle to the rear one (axles,) [m]: its ``x``; without any, axles are evenly spaced."""
        count = len(self.axles)
        even = np.linspace(self.wheelbase or 0.0, 0.0, count) if count > 1 else np.zeros(1)
        own = [axle.x for axle in self.axles.values()]
        return _frozen(np.array([e if x is None else x for e, x in zip(even, own, strict=True)]))

    @cached_property
    def wheel_side(self) -> Floats:
        """Distance of each wheel from the vehicle's middle (n,) [m], left positive; 0 without a track."""
        half = (self.track or 0.0) / 2
        counts = [len(axle.wheels) for axle in self.axles.values()]
        return _frozen(
            np.concatenate([np.linspace(half, -half, n) if n > 1 else np.zeros(1) for n in counts])
        )

    @cached_property
    def wheel_ahead(self) -> Floats:
        """How far ahead of what the vehicle turns about each steered wheel is (n,) [m]: of the axles that do not steer; 0 of the others."""
        steers = np.array([axle.steered for axle in self.axles.values()])
        return _frozen(np.where(steers, self.axle_to_rear - self.turns_about, 0.0)[self.wheel_axle])

    @cached_property
    def turns_about(self) -> float:
        """Distance to the rear axle [m] of what the vehicle turns about, for which its ground speed counts: the middle of the axles that do
        not steer, or of all if all do."""
        steers = np.array([axle.steered for axle in self.axles.values()])
        return float(np.mean(self.axle_to_rear[~steers if not steers.all() else steers]))

    @cached_property
    def receiver(self) -> tuple[float, float]:
        """How far ahead of that, and to the left of the middle, the ground speed is measured [m]: by the ``antenna``, or by a ``radar``,
        which reads the same ahead of it or behind. An ``articulated`` vehicle's axles go along their own middles: of the nearer."""
        if self.radar is not None or self.antenna is None:
            return 0.0, self.radar.y if self.radar else 0.0
        ahead = self.antenna.x - (self.axle_to_rear if self.articulated else np.array([self.turns_about]))
        return float(ahead[np.argmin(np.abs(ahead))]), self.antenna.y

    @cached_property
    def center_of_gravity_to_rear(self) -> float:
        """Distance of the centre of gravity to the rear axle [m], from the axles' masses; 0 with one axle."""
        return float(self.axle_mass @ self.axle_to_rear / self.axle_mass.sum())

    @cached_property
    def pivoting(self) -> Bools:
        """Whether each axle swings on a pin (axles,), see `terragrip.vehicle_parts.pivoting_axles`."""
        return _frozen(np.array(pivoting_axles(self.axles, self.articulated)))

    @cached_property
    def wheel_shares(self) -> tuple[Floats, Floats]:
        """Of every wheel (n,): its share of its axle's load, and what it loses of that per m/s² to the left [s²/m], by
        `terragrip.physics.loads.wheel_shares`. An axle that pivots does so at the height of its wheels' middle."""
        wheels = [axle.wheel or self.wheel for axle in self.axles.values()]
        pins = [wheel.radius if wheel else 0.0 for wheel in wheels]
        return wheel_shares(
            [len(axle.wheels) for axle in self.axles.values()],
            center_of_gravity_height=self.center_of_gravity_height,
            track=self.track,
            axle_mass=self.axle_mass,
            pins={k: pins[k] for k, axle in enumerate(self.axles.values()) if axle.pivots},
        )

    @cached_property
    def payload_share(self) -> Floats:
        """Share of the load beside the file's mass that each axle carries (axles,): by ``payload``, else as the mass itself."""
        if self.payload is None:
            return _frozen(self.axle_mass / self.axle_mass.sum())
        return _frozen(point_load_shares(self.axle_to_rear, self.payload.x))

    @property
    def payload_height(self) -> float:
        """Height of the payload's centre of gravity [m]: ``payload``'s, else the vehicle's own."""
        height = None if self.payload is None else self.payload.z
        return self.center_of_gravity_height if height is None else height

    @cached_property
    def hitch_share(self) -> Floats:
        """Share of a vertical load on the hitch that each axle carries (axles,); below 0 where the load lifts it."""
        return _frozen(point_load_shares(self.axle_to_rear, -self.hitch_overhang))

    def axle_loads(self, axle_mass: npt.ArrayLike | None = None, **motion: npt.ArrayLike) -> Floats:
        """Vertical load of each axle [N] by `terragrip.physics.loads.axle_loads`, (..., axles): of this machine with ``axle_mass``
        (axles,) [kg], None: its own; ``motion``: drawbar, hitch_load, acceleration, slope, spin_torque."""
        loads: Floats = axle_loads(
            self.axle_mass if axle_mass is None else axle_mass,
            self.axle_to_rear,
            center_of_gravity_height=self.center_of_gravity_height,
            hitch_height=self.hitch_height,
            hitch_overhang=self.hitch_overhang,
            **motion,  # type: ignore[arg-type]
        )
        return loads

    def loaded(self, mass: float) -> Self:
        """The vehicle at ``mass`` [kg], with the difference at `payload`; raises InputError where an axle would lift."""
        more = mass - self.mass
        axles = {
            name: axle.model_copy(update={"mass": axle.mass + more * float(share)})
            for (name, axle), share in zip(self.axles.items(), self.payload_share, strict=True)
        }
        height = (self.mass * self.center_of_gravity_height + more * self.payload_height) / mass
        data = self.to_dict() | {
            "mass": mass,
            "axles": {name: a.model_dump(exclude_unset=True) for name, a in axles.items()},
        }
        if "center_of_gravity_height" in data:
            data["center_of_gravity_height"] = height
        return self.from_dict(data)

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


def require_vehicle(vehicle: object) -> None:
    """Raise InputError unless ``vehicle`` is one."""
    if not isinstance(vehicle, Vehicle):
        hint = "give what Vehicle.load(path) returns, or Vehicle.from_dict(data)"
        raise InputError(f"{type(vehicle).__name__} is no vehicle", hint=hint)


def _frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

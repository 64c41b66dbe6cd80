"""The columns of a recording (architecture.md, contracts): their names and their units."""

from __future__ import annotations

from collections.abc import Collection, Iterable

TIME = "time"
WHEEL_CHANNELS = {"wheel_speed": "rad/s", "drive_torque": "N m", "wheel_force_x": "N", "wheel_force_z": "N"}
AXLE_CHANNELS = {"vertical_load": "N"}
CHANNELS = {
    "ground_speed": "m/s",
    "wheel_based_speed": "m/s",  # of all driven wheels as one, as the drive train reports it by the machine's own radius
    "engine_speed": "rad/s",
    "engine_torque": "N m",  # at the flywheel
    "engine_torque_share": "1",  # of the reference torque, friction included: J1939's actual engine percent torque
    "engine_friction_share": "1",  # of the reference torque: J1939's nominal friction percent torque
    "engine_reference_torque": "N m",
    "pto_speed": "rad/s",  # of a power take-off, which takes engine power while it turns; the rear one of two
    "pto_speed_front": "rad/s",
    "fuel_rate": "m^3/s",
    "drawbar_force": "N",
    "hitch_load": "N",  # vertical force of an implement on the hitch, down positive
    "brake": "1",  # of a friction brake on the wheels, whose torque no drive torque contains: 0 released to 1
    "mass": "kg",  # of the whole machine, without anything towed
    "acceleration_x": "m/s^2",
    "acceleration_y": "m/s^2",
    "acceleration_z": "m/s^2",
    "angular_velocity_x": "rad/s",
    "angular_velocity_y": "rad/s",
    "angular_velocity_z": "rad/s",
    "pitch": "rad",
    "roll": "rad",
    "latitude": "deg",
    "longitude": "deg",
    "altitude": "m",
}
LABELS = ("soil",)
REFERENCE = "true_"  # columns with this beginning pass through unchanged
REFERENCES = (REFERENCE, "wheel_force_")
"""Beginnings of the columns that no filter may use."""
CARRIED = ("latitude", "longitude", "altitude", "fuel_rate", "mass", "hitch_load")
"""Channels that are copied to the estimates as they were measured."""


def split_channel(name: str) -> tuple[str, str] | None:
    """``("wheel_speed", "fl")`` for ``wheel_speed_fl``, likewise for axles; None for any other name."""
    for quantity in (*WHEEL_CHANNELS, *AXLE_CHANNELS):
        if name.startswith(f"{quantity}_") and len(name) > len(quantity) + 1:
            return quantity, name[len(quantity) + 1 :]
    return None


def is_channel(name: str) -> bool:
    """Whether ``name`` is a measured channel or a reference of the schema (not time, not a label)."""
    return name in CHANNELS or name.startswith(REFERENCE) or split_channel(name) is not None


def is_own(name: str) -> bool:
    """Whether a column has one of the recording's own names: time, a label, a channel or a reference."""
    return name == TIME or name in LABELS or is_channel(name)


def has_torque(names: Iterable[str]) -> bool:
    """Whether any of the columns is a wheel's drive torque; without one, only slip can be determined."""
    return any(name.startswith("drive_torque_") for name in names)


def rim_names(names: Iterable[str]) -> list[str]:
    """The columns of wheels' speeds and of the drive train's."""
    return [name for name in names if name == "wheel_based_speed" or name.startswith("wheel_speed_")]


def speed_names(names: Iterable[str]) -> list[str]:
    """The columns of the ground speed, of wheels' speeds and of the drive train's."""
    names = tuple(names)
    rims = rim_names(names)
    return [name for name in names if name == "ground_speed" or name in rims]


def has_engine_torque(names: Collection[str]) -> bool:
    """Whether the engine's speed and torque are among the columns."""
    return "engine_speed" in names and not {"engine_torque", "engine_torque_share"}.isdisjoint(names)


def unit_of(name: str) -> str | None:
    """The unit of a column of the schema, None for a label, a reference or a foreign column."""
    if name == TIME:
        return "s"
    parts = split_channel(name)
    return CHANNELS.get(name) if parts is None else {**WHEEL_CHANNELS, **AXLE_CHANNELS}[parts[0]]


def wheel_names_in(columns: Iterable[str]) -> tuple[str, ...]:
    """The wheels named in the columns, in the order in which they first appear."""
    parts = (split_channel(name) for name in columns)
    return tuple(
        dict.fromkeys(wheel for quantity, wheel in filter(None, parts) if quantity in WHEEL_CHANNELS)
    )

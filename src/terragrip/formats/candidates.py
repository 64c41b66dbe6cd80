"""Which channels a column may be by its name and unit alone: candidates, to be judged by the data."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

from terragrip.formats.profile import Profile
from terragrip.formats.vocabulary import Name, Vocabulary
from terragrip.recording.schema import CHANNELS, is_channel, split_channel, unit_of
from terragrip.units import UnitError, factor_to, may_be_turns, parse_unit

_KINDS = {
    (0, 1, -1, 0): "speed", (0, 0, -1, 0): "rotation", (1, 2, -2, 0): "torque", (0, 0, 0, 1): "current", (1, 1, -2, 0): "force",
    (0, 1, -2, 0): "acceleration", (0, 1, 0, 0): "length", (0, 0, 0, 0): "angle", (0, 0, 1, 0): "time",
    (1, 0, 0, 0): "mass", (1, 1, 0, 0): "torque",  # lb ft, kg m
}  # fmt: skip
_MISSPELT = re.compile(r"ms(\^?-?2|²|\^?-1|⁻[¹²])")  # m/s^2 or m/s, which read as powers of milliseconds
ON_THE_BUS = "a signal of J1939, ISO 11783 or NMEA 2000"
_ROS = (
    (r"\.linear_acceleration\.[xyz]$", "m/s^2"),
    (r"\.(angular_velocity|angular)\.[xyz]$", "rad/s"),
    (r"\.wrench\.force\.[xyz]$", "N"),
    (r"\.twist\.linear\.[xyz]$", "m/s"),
    (r"\.velocity(\d|\.)|joint.*\.velocity$", "rad/s"),
    (r"\.effort(\d|\.)|joint.*\.effort$", "N m"),
)
"""Fields of ROS's own message types, by the end of their path, and their units (REP 103)."""


@dataclass(frozen=True)
class Column:
    """A column: its name as read, the unit that is stated or named (None: neither), what that unit measures, and how it is stated.

    ``one_of_several``: another column differs from it by a number alone.
    """

    column: str
    name: Name
    unit: str | None
    kind: str | None
    stated: str | None = None
    one_of_several: bool = False


class Candidate(NamedTuple):
    """A channel that a column may be: ``score`` (0 to 1) and ``why`` by the name."""

    channel: str
    score: float
    why: str


_WITHOUT_WHEELS = frozenset({"gps", "gnss", "rtk", "visual", "vio", "lidar", "icp"})
"""Odometry by these does not look at the wheels; the profile ros2-4wd takes it for ground speed, too."""
_SLOPES = frozenset({"slope", "incline", "inclination", "steigung", "pente", "pendiente", "pendenza"})
_FUSED = frozenset({"filtered", "filter", "fused", "ekf", "ukf"})
Hint = tuple[str, float, str]  # a Candidate's


def columns_of(
    numbers: Sequence[str], constants: Mapping[str, str], units: Mapping[str, str], vocabulary: Vocabulary
) -> dict[str, Column]:
    """Every numeric column's name as read; ``constants`` are the texts that never change, by column."""
    odometry = {_root(c) for c, text in constants.items() if "odometry" in vocabulary.read(text).concepts}
    alike, several = _numbered(numbers), _of_several(numbers)
    result = {}
    for column in numbers:
        name = vocabulary.read(column)
        index = re.search(r"(\d+)$", column)
        if index is not None:  # name0 = wheel_left_joint says of velocity0 which it is
            unit_word = next(
                (
                    t
                    for c, t in constants.items()
                    if c.endswith(f"name{index[1]}") and _root(c) == _root(column)
                ),
                None,
            )
            if unit_word is not None:
                other = vocabulary.read(unit_word)
                name = replace(name, concepts=name.concepts | other.concepts, wheel=other.wheel)
        if {"twist", "pose"} & set(name.words) and _root(column) in odometry:
            name = replace(name, concepts=name.concepts | {"odometry"})
        if is_channel(column) or {"drive", "joint"} <= set(name.words):  # behind the gear
            name = replace(name, concepts=name.concepts - {"motor"})
        if _WITHOUT_WHEELS & set(name.words) and not _FUSED & set(name.words):
            name = replace(name, concepts=name.concepts - {"odometry"})
        if (
            name.wheel.isdigit()
            and column not in alike
            and (name.has("current") or not name.has("wheel", "motor", "torque"))
        ):
            name = replace(name, wheel="")
        elif name.wheel[:1].isdigit() and not name.wheel.isdigit() and column not in alike:
            name = replace(name, wheel=name.wheel[1:])  # the number counts no axles
        stated = units.get(column)
        open_ = stated is not None and (_MISSPELT.fullmatch(stated) or may_be_turns(stated))
        readable = None if open_ else stated  # the sizes tell
        if readable and name.unit and kind_of(readable) != kind_of(name.unit):
            # As in ... Rad [km/h].
            name = replace(name, concepts=name.concepts | vocabulary.concepts_of(name.words[-1]))
        unit = readable or name.unit or _unit_of_ros(column)
        result[column] = Column(column, name, unit, kind_of(unit), stated, column in several)
    return result


def kind_of(unit: str | None) -> str | None:
    """What a unit measures: speed, rotation, torque, ...; None without a unit, "other" of one that no channel has."""
    if unit is None:
        return None
    if unit.strip() in ("g", "mg"):
        return "acceleration"
    if unit.strip() in ("%", "percent"):
        return "share"
    try:
        return _KINDS.get(parse_unit(unit).dimension, "other")
    except UnitError:
        return "other"


def candidates_of(column: Column) -> list[Candidate]:
    """The channels that a column may be, by its name and unit."""
    own = column.column
    # A wheel may have any name, but none that ends in a unit or says what is no measurement.
    any_name = split_channel(own) is not None and own not in CHANNELS
    if is_channel(own) and not (any_name and (column.name.unit or column.name.has("command", "statistic"))):
        return [Candidate(own, 1.0, "Terragrip's own name")]
    last = re.split(r"[./]", own)[-1]  # of a struct or a message
    if (
        last != own
        and "_" in last
        and is_channel(last)
        and not column.name.has("command", "statistic", "odometry")
    ):
        return [Candidate(last, 1.0, "Terragrip's own name")]
    standard = _on_the_bus().get(last)
    if standard is not None:
        return [Candidate(standard, 0.95, ON_THE_BUS)]
    if column.name.has("command", "statistic", "change", "other"):
        return []
    for ways in (_of_wheels, _of_motion, _of_place, _of_speed):
        result = ways(column)
        if result:
            return [Candidate(*hint) for hint in result if column.kind is None or _fits(column.kind, hint[0])]
    return []


def _of_wheels(column: Column) -> list[Hint]:
    name = column.name
    if (
        not name.wheel
        or name.axis
        or name.has("ground", "odometry", "gyro", "acceleration", "position", "rate")
    ):
        return []
    if name.has("torque") or column.kind == "torque":
        return [(f"drive_torque_{name.wheel}", 0.9 if name.has("wheel") else 0.8, "a torque and a wheel")]
    if name.has("current") or column.kind == "current":
        return [(f"drive_torque_{name.wheel}", 0.75, "a current and a wheel")]
    turning = (
        name.has("speed", "rotation")
        or (name.has("wheel", "motor") and column.kind in ("speed", "rotation"))
        or (name.wheel[-1] in "lr" and column.kind == "rotation" and _in_turns(column.unit))  # WS_FL [rpm]
    )
    if not turning or (name.has("body") and name.wheel.isdigit()):
        return []
    score = 0.9 if name.has("wheel") else 0.65 if name.has("motor") else 0.8
    what = "a motor" if name.has("motor") else "a wheel"
    return [(f"wheel_speed_{name.wheel}", score, f"a speed and {what}")]


def _of_motion(column: Column) -> list[Hint]:
    name = column.name
    axis = name.axis or next(
        (a for a, c in (("x", "longitudinal"), ("y", "lateral"), ("z", "vertical")) if name.has(c)), ""
    )
    about = next((a for a, c in (("x", "roll"), ("y", "pitch"), ("z", "yaw")) if name.has(c)), "")
    if name.has("acceleration"):
        if name.has("gyro", "rate", "rotation") or about or name.has("position", "east", "north"):
            return []
        if axis:
            return [(f"acceleration_{axis}", 0.8 if name.axis else 0.6, "an acceleration and an axis")]
        return [("acceleration_x", 0.4, "an acceleration, along an unknown axis")]
    if name.has("rate") and about and not axis:
        return [(f"angular_velocity_{about}", 0.85, "the rate of an angle")]
    of_wheels = name.has("odometry")
    angular = name.has("gyro") or (name.has("rate") and (name.has("speed") or "twist" in name.words))
    if angular and axis:
        if of_wheels:
            return [(f"angular_velocity_{axis}", 0.6, "odometry's rate of turn and an axis")]
        return [(f"angular_velocity_{axis}", 0.85, "a gyro and an axis")]
    if axis and name.has("rate") and not name.has("position"):
        return [(f"angular_velocity_{axis}", 0.7, "a rate and an axis")]
    if name.has("rate") and "turn" in name.words:
        return [("angular_velocity_z", 0.55, "a rate of turn")]
    if axis and column.kind == "rotation" and not name.has("wheel", "motor") and not name.wheel:
        return [(f"angular_velocity_{axis}", 0.6, "turns about an axis")]
    if axis and column.kind == "acceleration":
        return [(f"acceleration_{axis}", 0.6, "an acceleration by its unit, and an axis")]
    if (
        column.kind == "rotation"
        and not name.has("wheel", "motor")
        and not name.wheel
        and not _in_turns(column.unit)
        and not column.one_of_several  # more likely a wheel
    ):
        return [("angular_velocity_z", 0.3, "turns, of an unknown part")]
    if name.has("pitch", "roll") and not name.has("rate", "speed", "rotation", "yaw", "position", "lateral"):
        slope = bool(_SLOPES & set(name.words))
        if slope and name.axis:
            return []  # inclination_x: along it, or about it
        return [
            (
                "pitch" if name.has("pitch") else "roll",
                0.7 if slope else 0.85,
                "a slope" if slope else "its name",
            )
        ]
    return []


def _of_place(column: Column) -> list[Hint]:
    name = column.name
    if name.has("speed", "acceleration", "rate"):
        return []
    for channel in ("latitude", "longitude"):
        if name.has(channel):
            whole = channel in name.words or channel[:3] in name.words
            return [(channel, 0.85 if whole else 0.75, "its name")]
    if name.has("altitude") and not name.has("coupling"):
        return [("altitude", 0.85, "its name")]
    if name.has("coupling") and name.has("vertical") and (name.has("force") or column.kind == "force"):
        return [("hitch_load", 0.75, "a vertical force at the hitch")]
    if name.has("mass") and not (
        name.strange
        or _is_compound(name)
        or name.wheel
        or name.has("wheel", "front", "rear", "motor", "coupling")
    ):
        return [("mass", 0.85 if name.has("body") else 0.6, "a mass, of the whole machine")]
    words = set(name.words)
    # Effort de traction: a force.
    torque = name.has("torque") and not ("effort" in words and name.has("pull"))
    if torque or name.has("current", "lateral", "vertical") or name.axis in ("y", "z"):
        return []
    if name.has("pull") or (name.has("force") and (name.has("coupling") or "tow" in words)):
        return [("drawbar_force", 0.85, "a pull")]
    if ("f" in words or column.kind == "force") and (name.has("coupling") or words & {"tow", "draw"}):
        return [("drawbar_force", 0.65, "a force at the hitch, by its letter or unit")]
    return []


_OF_A_PART = re.compile(r"(?!gesamt|fahrzeug|maschine|traktor|schlepper).+(gewicht|masse)")


def _is_compound(name: Name) -> bool:
    """Whether a mass is of what the word begins with: Bunkergewicht."""
    return any(_OF_A_PART.fullmatch(word) for word in name.words)


def _of_speed(column: Column) -> list[Hint]:
    name = column.name
    along = "twist" in name.words and "linear" in name.words
    by_unit = name.has("ground") and column.kind == "speed"  # GPS [km/h]
    if not (name.has("speed") or along or by_unit) or name.wheel:
        return []
    if column.one_of_several and not name.has("ground", "odometry", "body"):
        return []
    if name.axis in ("y", "z") or name.has(
        "lateral", "vertical", "east", "north", "rate", "rotation", "gyro", "yaw", "heading"
    ):
        return []
    if name.has("pitch", "roll", "acceleration", "position", "motor"):
        return []
    if name.has("odometry"):
        if not _FUSED.isdisjoint(name.words):
            return []  # of more than the wheels
        return [("wheel_based_speed", 0.8, "odometry, which is computed from the wheels")]
    if name.has("ground"):
        return [("ground_speed", 0.85, "a speed over ground")]
    if name.has("wheel"):
        score = 0.5 if name.has("front", "rear") else 0.85
        return [("wheel_based_speed", score, "a speed of the wheels as one")]
    if along and not name.has("body"):
        return [("ground_speed", 0.4, "a velocity; wheel odometry is not over ground")]
    if name.axis == "x" or name.has("longitudinal"):
        return [("ground_speed", 0.65, "a speed along the vehicle")]
    return [
        ("ground_speed", 0.55, "a speed, of an unknown part"),
        ("wheel_based_speed", 0.35, "a speed, of an unknown part"),
    ]


def _fits(kind: str, channel: str) -> bool:
    target = kind_of(unit_of(channel))
    if channel.startswith("wheel_speed_"):
        return kind in ("rotation", "speed")
    if channel.startswith("drive_torque_"):
        return kind in ("torque", "current", "share")
    if channel == "pitch":
        return kind in ("angle", "share")  # a grade
    if target == "force":
        return kind in ("force", "mass")
    return kind == target


def unit_on_the_bus(channel: str) -> str | None:
    """The unit in which the standards give a channel's signal, where it is not the recording's own."""
    return _tractor().channels[channel].unit


@cache
def _tractor() -> Profile:
    return Profile.load("tractor-isobus")


@cache
def _on_the_bus() -> dict[str, str]:
    """Channels by the names of standard signals, as the shipped profile of tractors knows them."""
    return {name: channel for channel, source in _tractor().channels.items() for name in source.candidates}


def _root(column: str) -> str:
    """A column's name before its first point that is not a generic prefix: what a message's columns share."""
    parts = column.split(".")
    return parts[0] if len(parts) > 1 else ""


def _numbered(columns: Sequence[str]) -> frozenset[str]:
    """Columns that differ from another by a number alone, counted from 1: of those from 0 nobody knows which wheel is which."""
    stems: dict[str, list[str]] = {}
    for column in columns:
        stems.setdefault(re.sub(r"\d+(st|nd|rd|th)?", "#", column), []).append(column)
    counted = (
        group
        for group in stems.values()
        if len(group) > 1 and not any(re.search(r"(?<!\d)0(?!\d)", c) for c in group)
    )
    return frozenset(c for group in counted for c in group)


def _of_several(columns: Sequence[str]) -> frozenset[str]:
    """Columns that differ from another by one number alone, from 0 or 1: there are several of what they speak of."""
    stems: dict[str, list[str]] = {}
    for column in columns:
        for number in re.finditer(r"(?<!\d)(?<!can)(?<!bus)\d(?!\d|d\b)", column, re.IGNORECASE):
            stems.setdefault(f"{column[: number.start()]}#{column[number.end() :]}", []).append(column)
    return frozenset(c for group in stems.values() if len(group) > 1 for c in group)


def _in_turns(unit: str | None) -> bool:
    """Whether a unit counts turns a minute or a second: shafts are counted so, a vehicle's turning is not."""
    return unit is not None and abs(factor_to(unit, "rad/s") - 1.0) > 0.5 and factor_to(unit, "rad/s") > 0.05


def _unit_of_ros(column: str) -> str | None:
    """The unit of a field of ROS's own message types, by its path with points or strokes."""
    column = re.sub(r"\[(\d+)\]", r"\1", column.replace("/", "."))
    if "covariance" in column:
        return None
    return next((unit for field, unit in _ROS if re.search(field, column)), None)

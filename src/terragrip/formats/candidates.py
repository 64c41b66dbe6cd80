"""Which channels a column may be by its name and unit alone: candidates, to be judged by the data."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
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
)
"""Fields of ROS's own message types, by the end of their path, and their units (REP 103). No efforts: many drivers give currents."""


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
_GEARBOX = frozenset({"gearbox", "transmission", "getriebe"})
_FUSED = frozenset({"filtered", "filter", "fused", "ekf", "ukf"})
_COUNTED = re.compile(r"@(\d+|[\dA-F]{2}|bus\d+)$")
"""Signals of one name in several groups, of several senders or buses: no number of a wheel."""
_ALONG = {"longitudinal": "x", "lateral": "y", "vertical": "z"}
_ABOUT = {"roll": "x", "pitch": "y", "yaw": "z"}


def columns_of(
    numbers: Sequence[str],
    constants: Mapping[str, str],
    units: Mapping[str, str],
    vocabulary: Vocabulary,
    namespace: str = "",
) -> dict[str, Column]:
    """Every numeric column's name as read, a machine's ``namespace`` left out; ``constants`` are the texts that never change, by column."""
    odometry = {_root(c) for c, text in constants.items() if "odometry" in vocabulary.read(text).concepts}
    (alike, from_zero), several = _numbered(numbers), _of_several(numbers)
    result = {}
    for column in numbers:
        name, stated = vocabulary.read(_COUNTED.sub("", column.removeprefix(namespace))), units.get(column)
        joint = _joint_of(column, constants)
        concepts = {*name.concepts, *vocabulary.read(joint).concepts}
        wheel = vocabulary.read(joint).wheel if joint else name.wheel
        if {"twist", "pose"}.intersection(name.words) and _root(column) in odometry:
            concepts.add("odometry")
        if is_channel(_last(column)) or {"drive", "joint"} <= set(name.words):  # behind the gear
            concepts.discard("motor")
        if _WITHOUT_WHEELS.intersection(name.words) and not _FUSED.intersection(name.words):
            concepts.discard("odometry")
        of_one = "current" in concepts or not concepts & {"wheel", "motor", "torque"}
        if column not in alike and (of_one or not wheel.isdigit() or column in from_zero):
            wheel = wheel.lstrip("0123456789")  # the number counts no wheels and no axles
        readable = _read(stated)
        if readable and name.unit and kind_of(readable) != kind_of(name.unit):
            concepts |= vocabulary.concepts_of(name.words[-1])  # as in ... Rad [km/h]
        unit = readable or _read(name.unit) or _unit_of_ros(column)
        name = replace(name, concepts=frozenset(concepts), wheel=wheel)
        result[column] = Column(column, name, unit, kind_of(unit), stated, column in several)
    return result


def _joint_of(column: str, constants: Mapping[str, str]) -> str:
    """The joint whose value a numbered column is, empty if none: name0 = wheel_left_joint says of velocity0 which it is."""
    return constants.get(joint_column(column, constants) or "", "")


def joint_column(column: str, texts: Iterable[str]) -> str | None:
    """The text column that names the joint of a numbered one, ``name_0`` of ``velocity_0``; None if there is none."""
    number = re.search(r"[\[_]?\d+\]?$", column)
    names = (c for c in texts if number and c.endswith(f"name{number[0]}") and _root(c) == _root(column))
    return next(names, None)


def _read(unit: str | None) -> str | None:
    """A unit, None where it is misspelt or may be of turns or radians: then the sizes tell."""
    return None if unit is None or _MISSPELT.fullmatch(unit) or may_be_turns(unit) else unit


def kind_of(unit: str | None) -> str | None:
    """What a unit measures: speed, rotation, torque, ...; None without a unit, "other" of one that no channel has."""
    if unit is None:
        return None
    if unit.strip() in ("g", "G", "mg"):
        return "acceleration"
    if unit.strip() in ("%", "percent"):
        return "share"
    try:
        return _KINDS.get(parse_unit(unit).dimension, "other")
    except UnitError:
        return "other"


_BRAKE = re.compile(r"^(?!.*(park|hand)).*(brake|brems).*(switch|pedal|pressed|licht|light|schalter)")


def candidates_of(column: Column) -> list[Candidate]:
    """The channels that a column may be, by its name and unit."""
    return [one for one in _by_name(column) if column.kind is None or _fits(column.kind, one.channel)]


def _by_name(column: Column) -> list[Candidate]:
    own = column.column
    # A wheel may have any name, but none that ends in a unit or says what is no measurement.
    parts = None if own in CHANNELS else split_channel(own)
    strays = column.name.unit or column.name.has("command", "statistic")
    if is_channel(own) and not (parts and (strays or re.search(r"[^\w.-]", parts[1]))):
        return [Candidate(own, 1.0, "Terragrip's own name")]
    last = _last(own)
    if (
        last != own
        and "_" in last
        and is_channel(last)
        and not column.name.has("command", "statistic", "odometry")
    ):
        return [Candidate(last, 1.0, "Terragrip's own name")]
    standard = _on_the_bus().get(_written_out(last))
    if standard is not None:
        channel, place = standard
        return [
            Candidate(channel, 0.95 - 0.005 * place, ON_THE_BUS)
        ]  # in the order in which that profile uses them
    if _BRAKE.search("".join(column.name.words)) and not column.name.has("command"):
        return [Candidate("brake", 0.7, "a brake's switch or pedal")]
    of_gearbox = not _GEARBOX.isdisjoint(column.name.words) and not column.name.has("command", "statistic")
    if (
        of_gearbox
        and column.name.has("speed")
        and (column.kind == "speed" or column.name.has("ground", "body"))
    ):
        return [Candidate("wheel_based_speed", 0.6, "a speed of the vehicle, by its gearbox")]
    if column.name.has("command", "statistic", "change", "other"):
        return []
    ways = (_of_wheels, _of_motion, _of_place, _of_speed)
    return next(filter(None, (way(column) for way in ways)), [])


def _first(*rules: tuple[object, str, float, str]) -> list[Candidate]:
    """The candidate of the first rule that holds: whether it does, the channel, its score, and why."""
    return [Candidate(channel, score, why) for holds, channel, score, why in rules if holds][:1]


def _of_wheels(column: Column) -> list[Candidate]:
    name, wheel, of_wheel = column.name, column.name.wheel, column.name.has("wheel")
    if not wheel or name.axis or name.has("ground", "odometry", "gyro", "acceleration", "position", "angle"):
        return []
    if name.has("rate") and (name.has(*_ABOUT, "heading") or not (of_wheel or name.has("speed", "rotation"))):
        return []  # of the body; a wheel's angular velocity is its speed
    turning = (
        name.has("speed", "rotation")
        or (of_wheel and "rate" in name.words)  # its turns, though, are counted
        or (name.has("wheel", "motor") and column.kind in ("speed", "rotation"))
        or (wheel[-1] in "lr" and column.kind == "rotation" and _in_turns(column.unit))  # WS_FL [rpm]
    ) and not (name.has("body") and wheel.isdigit())
    torque, speed, score = f"drive_torque_{wheel}", f"wheel_speed_{wheel}", 0.9 if of_wheel else 0.8
    return _first(
        (name.has("torque") or column.kind == "torque", torque, score, "a torque and a wheel"),
        (name.has("current") or column.kind == "current", torque, 0.75, "a current and a wheel"),
        (turning and name.has("motor"), speed, 0.9 if of_wheel else 0.65, "a speed and a motor"),
        (turning, speed, score, "a speed and a wheel"),
    )


def _of_motion(column: Column) -> list[Candidate]:
    name = column.name
    axis = name.axis or next((a for c, a in _ALONG.items() if name.has(c)), "")
    about = next((a for c, a in _ABOUT.items() if name.has(c)), "")
    if name.has("acceleration"):
        if about or name.has("gyro", "rate", "rotation", "position", "east", "north"):
            return []
        return _first(
            (axis, f"acceleration_{axis}", 0.8 if name.axis else 0.6, "an acceleration and an axis"),
            (True, "acceleration_x", 0.4, "an acceleration, along an unknown axis"),
        )
    rate, gyro = name.has("rate"), f"angular_velocity_{axis}"
    body = not name.has("wheel", "motor") and not column.one_of_several
    angular = axis and (name.has("gyro") or (rate and (name.has("speed") or "twist" in name.words)))
    turns = column.kind == "rotation" and not name.wheel and not name.has("wheel", "motor")
    by_unit = column.kind == "acceleration"
    shaft = column.kind == "rotation" and _in_turns(column.unit)
    alone = turns and not column.one_of_several and not shaft
    slope = not _SLOPES.isdisjoint(name.words)
    angle = not name.has("rate", "speed", "rotation", "yaw", "position", "lateral")
    angle &= not (slope and name.axis)  # inclination_x: along it, or about it
    by_angle = (0.7, "a slope") if slope else (0.85, "its name")
    return _first(
        (
            about and not axis and (rate or (name.has("speed") and not (slope or shaft))),
            f"angular_velocity_{about}",
            0.85,
            "the rate of an angle",
        ),
        (
            angular and (name.has("odometry") or "twist" in name.words),
            gyro,
            0.6,
            "a rate of turn, of odometry or a twist, and an axis",
        ),
        (angular, gyro, 0.85, "a gyro and an axis"),
        (axis and rate and not name.has("position"), gyro, 0.7, "a rate and an axis"),
        (
            rate and body and not shaft and (name.has("speed") or "turn" in name.words),
            "angular_velocity_z",
            0.3 if name.strange else 0.55,  # of a belt, say
            "a rate of turn",
        ),
        (axis and turns, gyro, 0.6, "turns about an axis"),
        (axis and by_unit, f"acceleration_{axis}", 0.6, "an acceleration by its unit, and an axis"),
        (alone, "angular_velocity_z", 0.3, "turns, of an unknown part"),
        (angle and name.has("pitch"), "pitch", *by_angle),
        (angle and name.has("roll"), "roll", *by_angle),
    )


def _of_place(column: Column) -> list[Candidate]:
    name, words, is_force = column.name, set(column.name.words), column.kind == "force"
    if name.has("speed", "acceleration", "rate"):
        return []
    of_a_part = name.strange or _is_compound(name) or name.wheel
    mass = name.has("mass") and not (of_a_part or name.has("wheel", "front", "rear", "motor", "coupling"))
    force, hitch = name.has("force"), name.has("coupling")
    effort = "effort" in words and name.has("pull")  # effort de traction: a force
    torque = name.has("torque") and not effort
    along = not (torque or name.has("current", "lateral", "vertical") or name.axis in ("y", "z"))
    pull = name.has("pull") or (force and (hitch or "tow" in words))
    letter = ("f" in words or is_force) and (hitch or words & {"tow", "draw"})
    load = hitch and name.has("vertical") and (force or is_force)
    return _first(
        (name.has("latitude"), "latitude", 0.85 if words & {"latitude", "lat"} else 0.75, "its name"),
        (name.has("longitude"), "longitude", 0.85 if words & {"longitude", "lon"} else 0.75, "its name"),
        (name.has("altitude") and not hitch, "altitude", 0.85, "its name"),
        (load, "hitch_load", 0.75, "a vertical force at the hitch"),
        (mass, "mass", 0.85 if name.has("body") else 0.6, "a mass, of the whole machine"),
        (along and pull, "drawbar_force", 0.85, "a pull"),
        (along and letter, "drawbar_force", 0.65, "a force at the hitch, by its letter or unit"),
    )


_OF_A_PART = re.compile(r"(?!gesamt|fahrzeug|maschine|traktor|schlepper).+(gewicht|masse)")


def _is_compound(name: Name) -> bool:
    """Whether a mass is of what the word begins with: Bunkergewicht."""
    return any(_OF_A_PART.fullmatch(word) for word in name.words)


def _of_speed(column: Column) -> list[Candidate]:
    name = column.name
    along = "twist" in name.words and "linear" in name.words
    by_unit = name.has("ground") and column.kind == "speed"  # GPS [km/h]
    if not (name.has("speed") or along or by_unit) or name.wheel or name.axis in ("y", "z"):
        return []
    if column.one_of_several and not name.has("ground", "odometry", "body"):
        return []
    if name.has("lateral", "vertical", "east", "north", "rate", "rotation", "gyro", "yaw", "heading"):
        return []
    if name.has("pitch", "roll", "acceleration", "position", "motor"):
        return []
    if name.has("odometry") and not _FUSED.isdisjoint(name.words):
        return []  # of more than the wheels
    along = along and not name.has("body")
    of_wheels = 0.5 if name.has("front", "rear") else 0.85
    return _first(
        (name.has("odometry"), "wheel_based_speed", 0.8, "odometry, which is computed from the wheels"),
        (name.has("ground"), "ground_speed", 0.85, "a speed over ground"),
        (name.has("wheel"), "wheel_based_speed", of_wheels, "a speed of the wheels as one"),
        (along, "ground_speed", 0.4, "a velocity; wheel odometry is not over ground"),
        (name.axis == "x" or name.has("longitudinal"), "ground_speed", 0.65, "a speed along the vehicle"),
    ) or [
        Candidate("ground_speed", 0.55, "a speed, of an unknown part"),
        Candidate("wheel_based_speed", 0.35, "a speed, of an unknown part"),
    ]


def _fits(kind: str, channel: str) -> bool:
    target = kind_of(unit_of(channel))
    if channel.startswith("wheel_speed_"):
        return kind in ("rotation", "speed")
    if channel.startswith("drive_torque_"):
        return kind in ("torque", "current", "share")
    if channel == "pitch" or unit_of(channel) == "1":
        return kind in ("angle", "share")  # a grade, a plain number
    if target == "force":
        return kind in ("force", "mass")
    return kind == target or (channel == "mass" and kind == "acceleration")  # in g


def unit_on_the_bus(channel: str) -> str | None:
    """The unit in which the standards give a channel's signal, where it is not the recording's own."""
    return _tractor().channels[channel].unit


@cache
def _tractor() -> Profile:
    return Profile.load("tractor-isobus")


@cache
def _on_the_bus() -> dict[str, tuple[str, int]]:
    """Channels, and the place among their signals, by the names of standard signals, as the shipped profile of tractors knows them."""
    channels = _tractor().channels.items()
    return {
        _written_out(name): (channel, place)
        for channel, source in channels
        for place, name in enumerate(source.candidates)
    }


def _written_out(name: str) -> str:
    """A signal's name as one word in lower case, without its unit: Actual Engine - Percent Torque (%)."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[\[(].*", "", name).lower())


def _last(column: str) -> str:
    """A column's name inside its struct or message."""
    return re.split(r"[./]|::", column)[-1]


def _root(column: str) -> str:
    """A column's name before its first point that is not a generic prefix: what a message's columns share."""
    parts = column.split(".")
    return parts[0] if len(parts) > 1 else ""


def _numbered(columns: Sequence[str]) -> tuple[frozenset[str], frozenset[str]]:
    """Columns that differ from another by a number alone: those counted from 1, and those from 0, of which nobody knows which wheel is
    which."""
    stems: dict[str, list[str]] = {}
    for column in columns:
        stems.setdefault(re.sub(r"\d+(st|nd|rd|th)?", "#", column), []).append(column)
    counted: tuple[set[str], set[str]] = set(), set()
    for group in stems.values():
        if len(group) > 1:
            counted[any(re.search(r"(?<!\d)0(?!\d)", c) for c in group)].update(group)
    return frozenset(counted[0]), frozenset(counted[1])


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

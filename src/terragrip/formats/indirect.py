"""What a log may hold only indirectly: a ground speed of two velocities or positions, a pitch of a quaternion, wheel speeds of encoders'
counts, proposed where no column is it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.candidates import Column
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.evidence import RADII, Evidence
from terragrip.formats.judgement import varies
from terragrip.formats.rim_units import lightest_share, radius_of
from terragrip.formats.vocabulary import GENERAL
from terragrip.recording.schema import rim_names
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

_COUNT = frozenset(
    ["tick", "ticks", "count", "counts", "cnt", "counter", "pulse", "pulses", "encoder", "encoders", "enc"]
)
_TWIST = re.compile(r"[./]twist[./]linear[./]x$")
_ONE_WAY = 0.7
"""Least share of a count's steps in one direction, where no ground speed shows that it counts on."""
_NO_COUNT = ("command", "other", "statistic", "rate", "speed", "ground", "acceleration")


def add_indirect(
    proposals: dict[str, Proposal],
    numbers: Mapping[str, Floats],
    columns: Mapping[str, Column],
    plane: tuple[str, str] | tuple[()],
    evidence: Evidence,
    vehicle: Vehicle | None,
) -> None:
    """Ground speed from two velocities or positions, pitch from a quaternion, wheel speeds from counts, where no column is it."""
    pose = _quaternion(tuple(numbers))
    speed = _derived_speed(proposals, numbers, columns, plane, pose)
    if "ground_speed" not in proposals and speed is not None:
        proposals["ground_speed"] = speed
    made_of_wheels = any("odometry" in columns[c].name.concepts for c in pose)
    if "pitch" not in proposals and pose and not made_of_wheels and all(varies(numbers[c]) for c in pose[:2]):
        proposals["pitch"] = Proposal(
            {"pitch_of": pose}, "axes forward, left, up?", "", 0.5, ("a quaternion",)
        )
    if not rim_names(proposals):
        proposals |= _of_counts(proposals, columns, evidence, vehicle)


def _of_counts(
    proposals: Mapping[str, Proposal],
    columns: Mapping[str, Column],
    evidence: Evidence,
    vehicle: Vehicle | None,
) -> dict[str, Proposal]:
    """Wheel speeds of what counts their turning or is their angle, by name, and goes with the ground speed where there is one."""
    result: dict[str, Proposal] = {}
    ground = proposals.get("ground_speed")
    for name, column in columns.items():
        read = column.name
        counts = bool(_COUNT.intersection(read.words))
        others = frozenset().union(*(GENERAL.concepts_of(w) for w in read.words if w not in _COUNT))
        angle = read.has("position") and read.has("wheel") and column.kind in (None, "angle")
        turning = evidence.derivative(name, counts=counts)
        if not read.wheel or not (counts or angle) or not others.isdisjoint(_NO_COUNT) or turning is None:
            continue
        time, rate = turning[0], np.abs(turning[1])
        if counts and not evidence.is_whole(name) and column.unit is None:
            continue
        metres = None  # on the ground for each count
        if ground is not None and "from" in ground.entry:
            speed = np.abs(evidence.at(ground.columns[0], time)) * factor_to(ground.unit or "m/s", "m/s")
            known = np.isfinite(speed)
            metres = lightest_share(speed[known], rate[known])
            if metres is None:
                continue
        elif abs(turning[1].sum()) < _ONE_WAY * rate.sum():  # counted in each row, not on
            continue
        result.setdefault(f"wheel_speed_{read.wheel}", _of_count(name, column, counts, metres, vehicle))
    return result


def _of_count(
    name: str, column: Column, counts: bool, metres: float | None, vehicle: Vehicle | None
) -> Proposal:
    """The speed of a wheel from its count or angle, of which one is ``metres`` on the ground (None: unknown)."""
    radius = radius_of(vehicle, column.name.wheel)
    seen = () if metres is None else (f"{metres:.3g} m on the ground for each",)
    if not counts or column.kind == "angle":
        unit = column.unit or "rad"
        size = None if metres is None else metres / factor_to(unit, "rad")
        doubt = (
            "" if size is not None and RADII[0] < size < RADII[1] else "the angle by which the wheel turned?"
        )
        entry: dict[str, object] = {"derivative_of": name, "unit": unit}
        return Proposal(entry, doubt, "", 0.6, ("the angle of a wheel", *seen), (), unit)
    turn = ""
    if metres is not None and radius is not None:
        some = float(f"{2 * np.pi * radius / metres:.3g}")
        turn = f" (some {some:.0f} by the radius of {radius:.3g} m, less as it slips)"
    give = f"the scale is 2 pi over the counts in a turn of the wheel{turn}"
    entry = {"derivative_of": name, "scale": 1.0, "unit": "rad"}
    doubt = "" if seen else "a count of the wheel's turning?"
    return Proposal(entry, doubt, give, 0.6, ("a count of a wheel's turning", *seen))


def _derived_speed(
    proposals: Mapping[str, Proposal],
    numbers: Mapping[str, Floats],
    columns: Mapping[str, Column],
    plane: tuple[str, str] | tuple[()],
    pose: list[str],
) -> Proposal | None:
    if parts := _east_and_north(columns) or plane:
        unit = columns[parts[0]].unit
        entry: dict[str, object] = {"norm_of": list(parts)}
        entry |= {"unit": unit} if unit and unit != "m/s" else {}
        doubt = "" if unit else "no unit is stated: m/s?"
        doubt = doubt if columns[parts[0]].name.has("ground", "east", "north") else "over ground?"
        return Proposal(entry, doubt, "", 0.8, ("two velocities in the plane",), (), unit)
    if pair := _position_pair(numbers, columns):
        forward = {"quaternion": pose} if pose else _yaw(numbers, columns)
        unit = columns[pair[0]].unit if columns[pair[0]].kind == "length" else None
        entry = {"derivative_of": list(pair), "unit": unit or "m", "window": "0.5 s"}
        entry |= {"forward": forward} if forward else {}
        sign = "x forward at yaw 0?" if forward else "a heading under 'forward:' would give its sign"
        doubt = ("" if unit else "positions in m? ") + sign
        return Proposal(entry, doubt, "", 0.5, ("two positions",), (), unit or "m")
    place = [proposals[c] for c in ("latitude", "longitude") if c in proposals]
    if len(place) < 2 or place[0].unit != place[1].unit:
        return None
    if any(one.doubt or one.entry.get("unit", "deg") != "deg" for one in place):
        return None
    entry = {"derivative_of": [one.columns[0] for one in place], "unit": "deg", "window": "2 s"}
    entry |= {key: value for key, value in place[0].entry.items() if key == "scale"}
    return Proposal(entry, "no speed: from positions?", "", 0.5, ("latitude and longitude",), (), "deg")


def _east_and_north(columns: Mapping[str, Column]) -> tuple[str, str] | None:
    """Two velocity columns, east and north, of one unit."""
    parts: dict[str, str] = {}
    for name, column in columns.items():
        read = column.name
        beside = read.has("statistic", "command", "vertical", "other")
        if read.has("speed") and not beside and column.kind in (None, "speed"):
            for side in ("east", "north"):
                if read.has(side):
                    parts.setdefault(side, name)
    if len(parts) == 2 and columns[parts["east"]].unit == columns[parts["north"]].unit:
        return parts["east"], parts["north"]
    return None


def velocity_in_the_plane(columns: Mapping[str, Column], evidence: Evidence) -> tuple[str, str] | tuple[()]:
    """The velocities x and y of a receiver, or of one ROS message, of which neither is along the vehicle: both are great."""
    for name, column in columns.items():
        read = column.name
        of_message = _TWIST.search(name) is not None and not read.has("odometry", "wheel")
        if read.axis != "x" or not ((read.has("ground") and read.has("speed")) or of_message):
            continue
        if read.has("command", "position", "rate", "gyro") or (read.has("statistic") and not of_message):
            continue
        for other, beside in columns.items():
            if beside.name.axis == "y" and beside.name.words == (*read.words[:-1], "y"):
                small, great = sorted((evidence.size(name), evidence.size(other)))
                if small > 0.3 * great and column.kind in (None, "speed") and column.unit == beside.unit:
                    return name, other
    return ()


def _quaternion(names: tuple[str, ...]) -> list[str]:
    """Four columns that look like a quaternion x, y, z, w; empty if there are none."""
    for name in names:
        match = re.fullmatch(r"(.*(?:quat|orientation|quaternion)[_.]?|(?:.*_)?q)x", name, re.IGNORECASE)
        if match and all(f"{match[1]}{axis}" in names for axis in "yzw"):
            return [f"{match[1]}{axis}" for axis in "xyzw"]
    return []


def _yaw(numbers: Mapping[str, Floats], columns: Mapping[str, Column]) -> dict[str, str]:
    """A yaw column and its unit, as a profile's ``forward:``; empty if there is none."""
    for name, values in numbers.items():
        read = columns[name].name
        if read.has("yaw") and not read.has("rate", "speed", "gyro", "acceleration") and varies(values):
            unit = columns[name].unit or ("deg" if np.nanmax(np.abs(values)) > 7 else "rad")
            if unit in ("deg", "rad"):
                return {"yaw": name, "unit": unit}
    return {}


def _position_pair(numbers: Mapping[str, Floats], columns: Mapping[str, Column]) -> tuple[str, str] | None:
    """Two columns that look like a position in a plane: bare x, y, or names of positions that differ by x, y.

    Odometry is no such position: it is made of the wheel speeds, so that slip would be hidden.
    """
    names = [n for n, values in numbers.items() if varies(values) and not columns[n].name.has("odometry")]
    for first, second in (("x", "y"), ("e", "n"), ("easting", "northing")):
        for name in names:
            match = re.fullmatch(rf"(.*?)({first})", name, re.IGNORECASE)
            if not match or (match[1] and not match[1].endswith(("_", "."))):
                continue
            other = match[1] + (second.upper() if match[2].isupper() else second)
            read = columns[name]
            about = first != "x" or not match[1] or read.name.has("position")
            if read.kind not in (None, "length") or read.name.has(
                "acceleration", "gyro", "speed", "force", "rate"
            ):
                continue
            if other in names and about:
                return name, other
    return None

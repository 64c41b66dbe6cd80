"""What a log may hold only indirectly: a ground speed of two velocities or positions, a pitch of a quaternion, proposed where no column
is it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from terragrip.arrays import Floats
from terragrip.formats.candidates import Column
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.evidence import Evidence
from terragrip.formats.judgement import varies


def add_indirect(
    proposals: dict[str, Proposal],
    numbers: Mapping[str, Floats],
    columns: Mapping[str, Column],
    plane: tuple[str, str] | tuple[()],
) -> None:
    """Ground speed from two velocities or positions, pitch from a quaternion, where no column is it."""
    pose = _quaternion(tuple(numbers))
    speed = _derived_speed(proposals, numbers, columns, plane, pose)
    if "ground_speed" not in proposals and speed is not None:
        proposals["ground_speed"] = speed
    made_of_wheels = any("odometry" in columns[c].name.concepts for c in pose)
    if "pitch" not in proposals and pose and not made_of_wheels and all(varies(numbers[c]) for c in pose[:2]):
        proposals["pitch"] = Proposal(
            {"pitch_of": pose}, "axes forward, left, up?", "", 0.5, ("a quaternion",)
        )


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
    """A receiver's velocities x and y, of which neither is along the vehicle: both are great."""
    for name, column in columns.items():
        read = column.name
        if read.axis != "x" or not (read.has("ground") and read.has("speed")):
            continue
        if read.has("statistic", "command", "position", "rate", "gyro"):
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

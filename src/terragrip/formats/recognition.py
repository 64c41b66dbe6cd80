"""Guess which column of a foreign log is which channel, by names, units and sizes: a proposal, never a decision."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.recording.schema import LABELS, TIME, is_channel, unit_of
from terragrip.units import UnitError, factor_to

Floats = npt.NDArray[np.float64]

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_CORNERS = {
    **dict.fromkeys(("fl", "lf", "vl"), "fl"), **dict.fromkeys(("fr", "rf", "vr"), "fr"),
    **dict.fromkeys(("rl", "lr", "bl", "hl"), "rl"), **dict.fromkeys(("rr", "br", "hr"), "rr"),
}  # fmt: skip
_SIDES = {"left": "l", "l": "l", "right": "r", "r": "r"}
_ENDS = {"front": "f", "rear": "r", "back": "r"}
_AXES = {"x": "x", "y": "y", "z": "z"}
_NOT_MEASURED = {
    *("cmd", "command", "commanded", "set", "setpoint", "target", "desired", "ref", "demand", "std", "var", "cov"),
    *("temp", "temperature", "voltage", "volt", "status", "state", "id", "count", "index", "idx", "raw", "engine"),
}  # fmt: skip
_TURNING = {"omega", "w", "rpm", "vel", "velocity", "speed", "rps", "wheelspeed", "rotation"}
_TORQUE = {"torque", "effort", "m", "moment", "tq", "trq", "tau"}
_CURRENT = {"current", "curr", "amp", "amps", "i"}
_SPEED = {"speed", "velocity", "vel", "v", "vx", "groundspeed", "sog"}
_OVER_GROUND = {
    "ground": 3,
    "groundspeed": 3,
    "gps": 2,
    "gnss": 2,
    "radar": 2,
    "true": 2,
    "sog": 2,
    "vehicle": 1,
    "body": 1,
}
_NOT_OVER_GROUND = {
    "pto",
    "shaft",
    "wheel",
    "omega",
    "angular",
    "yaw",
    "engine",
    "motor",
    "fan",
    "wind",
    "y",
    "z",
    "wz",
    "vy",
    "vz",
    "odom",
}
_PULL = {"drawbar", "pull", "towing", "tow", "hitch", "fdx"}
_ACCELERATION = {"acc", "accel", "acceleration"}
_GYRO = {"gyro", "gyr", "rate"}
_UNITS = {
    "rpm": "rpm", "kmh": "km/h", "kph": "km/h", "mph": "mph", "mps": "m/s", "degs": "deg/s", "dps": "deg/s",
    "deg": "deg", "rad": "rad", "nm": "N m", "kn": "kN", "rps": "rev/s", "radps": "rad/s",
}  # fmt: skip
_ON_THE_BUS = {  # signals of J1939 and ISO 11783 by the names that can/j1939.yaml and most DBC files give them
    "WheelBasedMachineSpeed": "wheel_based_speed", "WheelBasedVehicleSpeed": "wheel_based_speed",
    "GroundBasedMachineSpeed": "ground_speed", "RearHitchDraft": "drawbar_force",
}  # fmt: skip
_TIME_UNITS = {"ns": "ns", "us": "us", "ms": "ms", "s": "s", "sec": "s", "secs": "s", "seconds": "s"}
_TIMES = {"time", "t", "timestamp", "stamp", "unix", "epoch", "zeit"}


@dataclass(frozen=True)
class Proposal:
    """What a channel may be made of: the keys of its entry in a profile, and what to look at."""

    entry: dict[str, object]
    doubt: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """The log's columns that it would read."""
        found = next((self.entry[k] for k in ("from", "derivative_of", "pitch_of") if k in self.entry), None)
        return (found,) if isinstance(found, str) else tuple(found) if isinstance(found, list) else ()


def find_time(
    numbers: Mapping[str, Floats], dates: tuple[str, ...], units: Mapping[str, str]
) -> tuple[str, str] | None:
    """The time column and its unit, or None: by name, then by running forward; a unit of ``units``, the log's own, counts first."""
    best: tuple[int, str] | None = None
    for name, values in numbers.items():
        words = _words(name)
        score = 4 * (name == TIME) + 2 * bool(words & _TIMES) + bool(words & set(_TIME_UNITS))
        known = values[np.isfinite(values)]
        forward = len(known) > 1 and np.mean(np.diff(known) > 0) > 0.9
        score = score + 2 * bool(forward) if score >= 2 and not words & _NOT_MEASURED else 0
        if score and (best is None or score > best[0]):
            best = score, name
    if best is None:
        return (dates[0], "s") if dates else None
    stated = units.get(best[1])
    if stated is not None and _fits(stated, "s"):
        return best[1], stated
    return best[1], _time_unit(best[1], numbers[best[1]])


def propose(
    numbers: Mapping[str, Floats], texts: tuple[str, ...], units: Mapping[str, str]
) -> dict[str, Proposal]:
    """A `Proposal` for each channel that some column may be, by channel; ``units`` are those that the log states."""
    found: dict[str, tuple[int, Proposal]] = {}
    angles = [v for n, v in numbers.items() if _words(n) in ({"roll"}, {"pitch"}, {"yaw"}) and _varies(v)]
    in_degrees = any(np.nanmax(np.abs(values)) > 7 for values in angles)
    for name, values in numbers.items():
        guess = _channel_of(name)
        if guess is None or not (name == guess[0] or _varies(values)):
            continue
        channel, score, doubt = guess
        entry: dict[str, object] = {"from": name}
        if doubt:
            entry["scale"] = 1.0
        else:
            unit, doubt = _unit_for(channel, name, values, units.get(name), in_degrees)
            entry |= {"unit": unit} if unit and unit != unit_of(channel) else {}
        if channel not in found or score > found[channel][0]:
            found[channel] = score, Proposal(entry, doubt)
    proposals = {channel: proposal for channel, (_, proposal) in found.items()}
    pose = _quaternion(tuple(numbers))
    pair = _position_pair(numbers)
    if "ground_speed" not in proposals and pair is not None:
        forward = {"quaternion": pose} if pose else _yaw(numbers)
        entry = {"derivative_of": list(pair), "unit": "m", "window": "0.5 s"}
        entry |= {"forward": forward} if forward else {}
        sign = "x forward at yaw 0?" if forward else "a heading under 'forward:' would give its sign"
        proposals["ground_speed"] = Proposal(entry, f"positions in m? {sign}")
    if "pitch" not in proposals and pose:
        proposals["pitch"] = Proposal({"pitch_of": pose}, "axes forward, left, up?")
    for name in texts:
        if name in LABELS or _words(name) & {"soil", "terrain", "surface"}:
            proposals.setdefault("soil", Proposal({"from": name}))
    return proposals


def silent(numbers: Mapping[str, Floats], proposals: Mapping[str, Proposal]) -> list[str]:
    """Sentences on columns that go by the name of a speed or torque which was not found, but hold nothing or never change."""
    said = []
    for name, values in numbers.items():
        guess = _channel_of(name)
        if guess is None or guess[0] in proposals or _varies(values):
            continue
        if guess[0].startswith(("ground_speed", "wheel_based_speed", "wheel_speed_", "drive_torque_")):
            known = values[np.isfinite(values)]
            held = f"is {known[0]:.4g} throughout" if len(known) else "holds no value"
            said.append(f"{name} goes by the name of {guess[0]}, but {held}.")
    return said[:6]


def _channel_of(name: str) -> tuple[str, int, str] | None:
    """Channel, score and doubt of a number column; the schema's own names win."""
    if is_channel(name):
        return name, 100, ""
    if name in _ON_THE_BUS:
        return _ON_THE_BUS[name], 8, ""
    words = _words(name)
    if words & _NOT_MEASURED:
        return None
    wheel, axis = _wheel(words), _axis(name, words)
    if words & {"pitch", "roll"} and not words & {"rate"}:
        return ("pitch" if "pitch" in words else "roll"), 5, ""
    for channel, names in (("latitude", {"lat", "latitude"}), ("longitude", {"lon", "lng", "longitude"})):
        if words & names:
            return channel, 5, ""
    if words & {"altitude", "alt"}:
        return "altitude", 5, ""
    if words & _PULL and not wheel:
        return "drawbar_force", 5, ""
    if wheel and words & _TORQUE:
        return f"drive_torque_{wheel}", 6, ""
    if wheel and words & _TURNING and not axis:
        return f"wheel_speed_{wheel}", 5 + ("wheel" in words), ""
    if wheel and words & _CURRENT:
        return f"drive_torque_{wheel}", 4, "a current: the scale in N m per A is yours to give"
    if axis and words & _ACCELERATION:
        return f"acceleration_{axis}", 5, ""
    if axis and (words & _GYRO or {"angular", "velocity"} <= words):
        return f"angular_velocity_{axis}", 5, ""
    if words & _SPEED and not wheel and not words & _NOT_OVER_GROUND:
        return "ground_speed", 1 + max((_OVER_GROUND.get(word, 0) for word in words), default=0), ""
    return None


def _words(name: str) -> set[str]:
    return {word.lower() for word in (*_WORD.findall(name), *re.split(r"[^A-Za-z0-9]+", name)) if word}


def _wheel(words: set[str]) -> str:
    """The wheel a name speaks of: a corner, a side or a number; empty if none."""
    for word in words:
        if word in _CORNERS:
            return _CORNERS[word]
    side = next((_SIDES[word] for word in sorted(words) if word in _SIDES), "")
    end = next((_ENDS[word] for word in sorted(words) if word in _ENDS), "")
    number = next((word for word in words if word.isdigit() and 1 <= int(word) <= 8), "")
    return end + side if side else number


def _axis(name: str, words: set[str]) -> str:
    axis = next((_AXES[word] for word in sorted(words) if word in _AXES), "")
    short = re.fullmatch(r"(?:.*_)?([agw])([xyz])", name.lower())
    if short:
        words |= {"a": _ACCELERATION, "g": _GYRO, "w": _GYRO}[short[1]]
        return short[2]
    return axis


def _varies(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 0 and bool(known.max() > known.min())


def _quaternion(names: tuple[str, ...]) -> list[str]:
    """Four columns that look like a quaternion x, y, z, w; empty if there are none."""
    for name in names:
        match = re.fullmatch(r"(.*(?:quat|orientation|quaternion)_?|(?:.*_)?q)x", name, re.IGNORECASE)
        if match and all(f"{match[1]}{axis}" in names for axis in "yzw"):
            return [f"{match[1]}{axis}" for axis in "xyzw"]
    return []


def _yaw(numbers: Mapping[str, Floats]) -> dict[str, str]:
    """A yaw column and its unit, as a profile's ``forward:``; empty if there is none."""
    for name, values in numbers.items():
        if _words(name) == {"yaw"} and _varies(values):
            return {"yaw": name, "unit": "deg" if np.nanmax(np.abs(values)) > 7 else "rad"}
    return {}


def _position_pair(numbers: Mapping[str, Floats]) -> tuple[str, str] | None:
    """Two columns that look like a position in a plane: bare x, y, or names of positions that differ by x, y.

    Odometry is no such position: it is made of the wheel speeds, so that slip would be hidden.
    """
    names = [name for name, values in numbers.items() if _varies(values) and "odom" not in name.lower()]
    for first, second in (("x", "y"), ("e", "n"), ("easting", "northing")):
        for name in names:
            match = re.fullmatch(rf"(.*?)({first})", name, re.IGNORECASE)
            if not match or (match[1] and not match[1].endswith("_")):
                continue
            other = match[1] + (second.upper() if match[2].isupper() else second)
            about_position = (
                first != "x" or not match[1] or _words(match[1]) & {"pos", "position", "pose", "utm"}
            )
            if other in names and about_position:
                return name, other
    return None


def _unit_for(
    channel: str, name: str, values: Floats, stated: str | None, in_degrees: bool
) -> tuple[str, str]:
    """Unit of a column and a doubt about it: as stated, as named, else by the size of its values."""
    target = unit_of(channel)
    if target is None:
        return "", ""
    for unit in (stated, *(_UNITS[word] for word in sorted(_words(name)) if word in _UNITS)):
        if unit and _fits(unit, target):
            return unit, ""
    known = np.abs(values[np.isfinite(values)])
    if not len(known):
        return target, ""
    size = float(np.quantile(known, 0.95))
    if target == "rad" and (in_degrees or size > 1.6):
        return "deg", "the sizes tell degrees"
    if channel in ("latitude", "longitude") and size < 1.6:
        return "rad", "its size tells radians"
    if target == "m/s^2" and channel.endswith("_z") and 0.8 < size < 1.5:
        return "g", "its size tells g"
    if target == "rad/s" and channel.startswith("wheel_speed") and size > 40:
        return target, f"reaches {size:.3g}: rpm or deg/s?"
    return target, ""


def _fits(unit: str, target: str) -> bool:
    try:
        factor_to(unit, target)
    except UnitError:
        return False
    return True


def _time_unit(name: str, values: Floats) -> str:
    """Unit of a time column: from its name, else from its size (seconds, ms, µs or ns since 1970)."""
    last = name.lower().replace("]", "").replace(")", "").split("_")[-1]
    if last in _TIME_UNITS:
        return _TIME_UNITS[last]
    size = float(np.nanmax(np.abs(values), initial=0.0))
    return next((unit for limit, unit in ((1e17, "ns"), (1e14, "us"), (1e11, "ms")) if size > limit), "s")

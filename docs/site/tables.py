"""Pages of tables from the code: the profile's keys, the recording's channels, the columns of estimates."""

from __future__ import annotations

import types
import typing
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from terragrip.formats.payload import Payload
from terragrip.formats.profile import SHIPPED, Profile
from terragrip.formats.profile_parts import Forward, Rows, Source, TimeSource
from terragrip.recording.schema import AXLE_CHANNELS, CHANNELS, WHEEL_CHANNELS

KEYS: dict[type[BaseModel], dict[str, str]] = {
    Profile: {
        "name": "what reports call it",
        "description": "for its readers",
        "time": "where the stamps are",
        "rows": "keep only these rows",
        "payload": "how a live source packs its numbers; JSON without it",
        "dbc": "DBC files of a CAN log, from the profile's folder",
        "namespace": "of several machines in a log the one that is meant, e.g. `/r2`: its columns lie inside",
        "channels": "by the recording's [channel](channels.md): a name, a list of names, or the keys of a channel below",
    },
    TimeSource: {
        "from": "the column of the stamps",
        "unit": "of the stamps: s, ms, us, ns",
        "zero": "`first`: time begins with 0 at the first row",
        "nanoseconds": "the column of the nanoseconds, where the stamps are whole seconds beside them, as ROS writes them",
        "dates": "`dd/mm/yyyy` or `mm/dd/yyyy`: the order in dates as 3/4/2024, where no day above 12 shows it",
    },
    Rows: {"column": "the column that decides", "equals": "the value that it must have"},
    Source: {
        "from": "the log's column; a list of names: the first that the log has, with a value; `*` stands for any text",
        "optional": "left out, with a note, where the log lacks it",
        "over": "a column by which it is divided (a torque is power over speed)",
        "over_minimum": "no value where the divisor is smaller in size than this",
        "derivative_of": "one to three columns whose derivative is the channel; latitude and longitude with `unit: deg`",
        "norm_of": "two or three columns of a vector, whose size is the channel",
        "sum_of": "columns that are added, as two pins of a hitch; or each with a factor, `{a: 14.3, b: -14.3}`",
        "pitch_of": "the columns x, y, z, w of a quaternion",
        "roll_of": "the columns x, y, z, w of a quaternion",
        "constant": "one value for the whole log",
        "unit": "of the log's value; without it the header's, else the recording's own",
        "scale": "value = sign (scale raw + offset), in `unit`",
        "offset": "as above",
        "sign": "1, or -1 where the log counts the other way",
        "delay": "by how much the log's value is late [s]",
        "invalid": "raw values, and ranges [from, to], that mean: not measured",
        "window": "of the derivative [s]",
        "forward": "what tells forward from backward, for a speed from positions",
        "else": "another source, with the same keys, where the log lacks this one",
    },
    Forward: {
        "yaw": "a heading's column",
        "unit": "of the heading",
        "quaternion": "the columns x, y, z, w",
    },
    Payload: {
        "format": "`json`, `doubles`, or `struct` with a `layout`",
        "fields": "the names of packed numbers, in their order",
        "layout": "as Python's `struct` writes it: `d4f` is a double and four floats",
        "byte_order": "`little` or `big`",
    },
}
"""What each key of a profile means; a key of the code that is missing here ends the build."""

_TITLES = {
    Profile: "The file",
    TimeSource: "`time:`",
    Rows: "`rows:`",
    Source: "A channel",
    Forward: "`forward:`",
    Payload: "`payload:`",
}

SIGNS = {
    "ground_speed": "speed over ground, forward positive",
    "wheel_based_speed": "what the drive train says of all driven wheels as one, by the machine's own radius, forward positive",
    "fuel_rate": "burnt by the engine; it is passed on and gives l/h and l/ha in the advice",
    "engine_speed": "of the crankshaft, running positive; for a `driveline` of the vehicle file, as all of the engine",
    "engine_torque": "at the flywheel, driving positive",
    "engine_torque_share": "of the reference torque, friction included (J1939: actual engine percent torque), driving positive",
    "engine_friction_share": "of the reference torque (J1939: nominal friction percent torque), positive",
    "engine_reference_torque": "what the shares are of (J1939: engine reference torque)",
    "pto_speed": "of a power take-off; while it turns it takes the `pto_power` of the vehicle file's `driveline`",
    "pto_speed_front": "the same, of a power take-off in front",
    "drawbar_force": "horizontal force of the tool on the machine, backward positive; absent: nothing is towed",
    "hitch_load": "vertical force of the tool on the machine's hitch, down positive; absent: nothing hangs there",
    "brake": "of a friction brake, 0 released to 1 pressed: a switch, or a share of its way or pressure; absent: none acts",
    "mass": "of the whole machine, without what is towed; absent: the vehicle file's throughout",
    "acceleration_x": "specific force along the body, forward positive",
    "acceleration_y": "specific force across the body, to the left positive",
    "acceleration_z": "specific force, up positive: +9.81 at rest",
    "angular_velocity_x": "about the axis that points forward: the left side rises, positive",
    "angular_velocity_y": "about the axis that points left: the nose goes down, positive",
    "angular_velocity_z": "about the axis that points up: turning left, positive",
    "pitch": "nose up positive",
    "roll": "left side up positive",
    "latitude": "WGS 84, north positive",
    "longitude": "WGS 84, east positive",
    "altitude": "up positive",
    "wheel_speed": "rolling forward positive",
    "drive_torque": "at the wheel, behind all gears; driving forward positive. A wheel of an axle that is not driven has 0",
    "wheel_force_x": "reference: what the ground pushes the wheel forward with, positive",
    "wheel_force_z": "reference: what the ground carries of the wheel, positive",
    "vertical_load": "what the ground carries of the axle, positive",
}
"""Meaning and sign of each channel of the schema."""


def profile_keys() -> str:
    """Markdown of every key of a profile, with its kind and its default."""
    parts = [
        "# Profile keys",
        f"How a foreign log becomes a recording: [formats](formats.md#in-a-profile) explains, this page lists."
        f" {', '.join(f'`{name}`' for name in SHIPPED)}"
        " come with Terragrip and go by name. Unknown keys are refused with the nearest known one.",
    ]
    for model, meanings in KEYS.items():
        lines = [f"## {_TITLES[model]}", "", "| key | what | kind | if absent |", "|---|---|---|---|"]
        for name, field in model.model_fields.items():
            key = field.alias or name
            lines.append(f"| `{key}` | {meanings[key]} | {_kind(field.annotation)} | {_default(field)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _kind(annotation: Any) -> str:
    """A type in a reader's words."""
    words = {str: "text", float: "number", int: "number", bool: "true or false", type(None): ""}
    if annotation in words:
        return words[annotation]
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return _kind(inner[0])
    if origin is typing.Literal:
        return " or ".join(f"`{value}`" for value in inner)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(filter(None, map(_kind, inner))))
    return {tuple: "list", dict: "mapping"}.get(origin, "mapping")


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=False)
    if value in (None, "", (), PydanticUndefined):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else f'{value:g}' if isinstance(value, float) else value}`"


CHANNELS_PAGE = """# Channels and signs

The columns of a recording, in SI units; empty (NaN) where nothing was measured at that instant. Wheels and axles have the names of the
[vehicle file](vehicle.md). A log with other names, units or signs needs a [profile](formats.md#in-a-profile).

![Axes and positive directions, seen from the right side: x forward, y left, z up; drawbar force backward; torque and wheel speed driving
forward; pitch nose up; slip from -1 (locked) over 0 to 1 (spinning on the spot)](images/axes.svg)

"""

ESTIMATES_PAGE = """# Columns of estimates

What `terragrip estimate` writes, one row a row of the recording; SI units, "1" is a ratio or a count. Each column marked ± has a twin
`_std`, one standard deviation of noise and of what the data cannot tell. Of columns a wheel the list shows the first wheel's. The list is
that of method `aukf-fs` of a robot with torques and a drawbar cell; other methods and machines leave out what they do not have. The words
in `event` are explained in [events](events.md).

"""


def channels() -> str:
    """Markdown of the recording's channels: name, unit, sign; and the drawing."""
    lines = [
        "| column | unit | what, and which way is positive |",
        "|---|---|---|",
        "| `time` | s | runs forward |",
    ]
    lines += [f"| `{name}_<wheel>` | {unit} | {SIGNS[name]} |" for name, unit in WHEEL_CHANNELS.items()]
    lines += [f"| `{name}_<axle>` | {unit} | {SIGNS[name]} |" for name, unit in AXLE_CHANNELS.items()]
    lines += [f"| `{name}` | {unit} | {SIGNS[name]} |" for name, unit in CHANNELS.items()]
    lines += ["| `soil` | text | label of the ground, empty where unknown |"]
    lines += ["| `true_...` | | a reference: passed through untouched |"]
    return CHANNELS_PAGE + "\n".join(lines) + "\n"


def estimates_columns() -> str:
    """Markdown of the columns of estimates, by a short simulated drive: what a file holds is what the page lists."""
    import terragrip as tg
    from terragrip.estimation.columns import column_named

    drive = tg.simulate("fine-10", seed=1)
    names = list(tg.estimate(drive.recording, drive.vehicle, method="aukf-fs").to_pandas().columns)
    others = tuple(f"_{wheel}" for wheel in drive.vehicle.wheels[1:])
    lines = ["| column | unit | what |", "|---|---|---|"]
    for name in names:
        if name.endswith(("_std", *others)):
            continue
        column, mark = column_named(name), " ±" if f"{name}_std" in names else ""
        lines.append(f"| `{name}`{mark} | {column.unit} | {column.description} |")
    return ESTIMATES_PAGE + "\n".join(lines) + "\n"

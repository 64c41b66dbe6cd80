"""What makes a table unusable, said with column, row and mend."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError, nearest
from terragrip.recording.schema import TIME

Floats = npt.NDArray[np.float64]

_ESSENTIAL = ("wheel_speed_", "drive_torque_", "ground_speed", "drawbar_force")


def place(column: str, row: int, time: Floats | None = None) -> str:
    """Where a cell stands: data rows count from 1, as below a header."""
    if time is None or not np.isfinite(time[row]):
        return f"column {column}, row {row + 1}"
    return f"column {column}, row {row + 1} (time {time[row]:.10g} s)"


def require_columns(columns: Collection[str], source: str | None) -> None:
    """Raise InputError unless time, ground_speed and a wheel speed are among the columns."""
    if not columns:
        raise InputError("there are no columns", file=source, mend="give a table with a header")
    wheels = any(c.startswith("wheel_speed_") and len(c) > len("wheel_speed_") for c in columns)
    missing = [n for n in (TIME, "ground_speed") if n not in columns] + ["wheel_speed_<wheel>"] * (not wheels)
    if not missing:
        return
    near = {name: nearest(name.replace("_<wheel>", ""), columns) for name in missing}
    # The name with a likely cousin in the table is the one to mend first.
    name = next((n for n in missing if near[n]), missing[0])
    mend = f"the nearest column is {near[name]!r}: rename it, or map it in a profile"
    if near[name] is None:
        mend = "map the log's columns in a profile ('terragrip inspect' proposes one)"
    raise InputError("is missing", file=source, place=f"column {name}", mend=mend)


def check_time(time: Floats, source: str | None) -> None:
    """Raise InputError unless there is a row and time is finite and runs forward."""
    if len(time) == 0:
        raise InputError("the table is empty", file=source, mend="give a log with at least one row")
    with np.errstate(invalid="ignore"):
        forward = np.diff(time) > 0
    if forward.all() and np.isfinite(time[0]) and np.isfinite(time[-1]):
        return
    unknown = np.flatnonzero(~np.isfinite(time))
    if len(unknown):
        problem = "time is not a finite number"
        raise InputError(problem, file=source, place=place(TIME, unknown[0]), mend="drop the row, or mend it")
    row = int(np.argmin(forward)) + 1
    if time[row] == time[row - 1]:
        problem, mend = "time repeats", "keep one row an instant"
    else:
        problem, mend = f"time runs back from {time[row - 1]:.10g} s", "sort the rows, or split the log there"
    raise InputError(problem, file=source, place=place(TIME, row, time), mend=mend)


def check_channel(name: str, values: Floats, time: Floats, source: str | None) -> bool:
    """Whether a channel holds a value; raises InputError on infinities, or if an essential one holds none."""
    if np.isfinite(values).all():
        return True
    infinite = np.flatnonzero(np.isinf(values))
    if len(infinite):
        raise InputError(
            "is infinite",
            file=source,
            place=place(name, infinite[0], time),
            mend="leave the cell empty instead",
        )
    if not np.isnan(values).all():
        return True
    if name.startswith(_ESSENTIAL):
        raise InputError(
            "holds no value", file=source, place=f"column {name}", mend="fill it, or leave the column out"
        )
    return False

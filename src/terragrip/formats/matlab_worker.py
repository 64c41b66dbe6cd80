"""Tables and timetables of MATLAB files: ``python -m terragrip.formats.matlab_worker FILE``.

mat-io reads MATLAB's objects with C code that came from SciPy, which a damaged file can crash: so it gets a process that may
end (`terragrip.formats.worker`). It hears the names of variables and says the numeric columns of each, and its clock.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.boundary import needed
from terragrip.formats.worker import Outlet, serve


def work(path: str, out: Outlet) -> None:
    """Serve one file."""
    matio = needed("matio", "a MATLAB table")
    names = out.hear()
    for name, frame in matio.load_from_mat(path, variable_names=names).items():
        if name not in names or not hasattr(frame, "columns"):
            continue
        columns = {str(c): frame[c].to_numpy() for c in frame.columns if frame[c].dtype.kind in "fiub"}
        clock = _seconds(frame.index)
        out.say({"name": name, "columns": list(columns), "clock": clock is not None})
        for values in columns.values():
            out.send(values.astype(np.float64))
        if clock is not None:
            out.send(clock)


def _seconds(index: Any) -> npt.NDArray[np.float64] | None:
    """Row times in seconds, dates since 1970; None of a table without row times."""
    if index.dtype.kind == "m":
        return np.asarray(index.to_numpy() / np.timedelta64(1, "s"), dtype=np.float64)
    if index.dtype.kind == "M":
        if getattr(index, "tz", None) is not None:
            index = index.tz_convert("UTC").tz_localize(None)
        since = index.to_numpy() - np.datetime64(0, "s")
        return np.asarray(since / np.timedelta64(1, "s"), dtype=np.float64)
    return None


if __name__ == "__main__":
    sys.exit(serve("matio", work))

"""What mat-io reads of MATLAB files: ``python -m terragrip.formats.matlab_worker``.

A damaged file can crash mat-io, so it gets a process that may end (`terragrip.formats.worker`). It is sent the names of variables
(null: all), answers with what is in them, and sends the arrays that it is asked for.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.boundary import needed
from terragrip.formats.matlab_objects import TICKS, plain
from terragrip.formats.matlab_records import records_of, resolved
from terragrip.formats.matlab_values import Array, Opaque
from terragrip.formats.worker import Outlet, serve


def work(path: str, out: Outlet) -> None:
    """Serve one file."""
    matio = needed("matio", "an object of MATLAB")
    names = out.receive()
    loaded = matio.load_from_mat(path, variable_names=names)
    arrays: list[Array] = []
    with records_of(path) as records:
        chosen = names or [name for name in loaded if not name.startswith("__")]
        tree = {name: resolved(plain(loaded.pop(name)), records, TICKS) for name in chosen if name in loaded}
        out.send({"tree": {name: _skeleton(value, arrays) for name, value in tree.items()}})
        while (number := out.receive()) is not None:
            out.send_array(np.asarray(arrays[number].read(), dtype=np.float64))


def _skeleton(value: Any, arrays: list[Array]) -> Any:
    """A plain value for JSON: what it is, an array by its place in ``arrays``."""
    if isinstance(value, dict):
        return {"struct": {key: _skeleton(part, arrays) for key, part in value.items()}}
    if isinstance(value, list):
        return {"list": [_skeleton(part, arrays) for part in value]}
    if isinstance(value, np.ndarray):
        held: npt.NDArray[Any] = value
        value = Array(held.shape, lambda: held) if held.size else None
    if isinstance(value, Array):
        arrays.append(value)
        return {"array": len(arrays) - 1, "shape": list(value.shape)}
    if isinstance(value, Opaque):
        return {"object": value.kind}
    return {"text": value} if isinstance(value, str) else None


if __name__ == "__main__":
    sys.exit(serve("matio", work))

"""Variables of MATLAB files of version 7.3, and of other HDF5 files, by h5py: numbers stay in the file until they are asked for."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.matlab_values import Array, Opaque
from terragrip.recording.frames import stated_unit

_DEEPEST = 12
_USER_BLOCK, _HDF5 = 512, b"\x89HDF\r\n\x1a\n"
_PACKING = {"scale_factor": 1.0, "add_offset": 0.0}
_MISSING = ("_FillValue", "missing_value")


def is_hdf5(path: str) -> bool:
    """Whether a file is of version 7.3, or another HDF5 file."""
    with open(path, "rb") as stream:
        head = stream.read(_USER_BLOCK + len(_HDF5))
    return head.startswith((_HDF5, b"MATLAB 7.3")) or head[_USER_BLOCK:] == _HDF5


def tree_of(file: Any, h5py: Any) -> dict[str, Any]:
    """The variables of an open file by name: mapping (struct), list (cell), text, `Array` or `Opaque`."""
    tree = {name: _of_hdf5(file, item, 0, h5py) for name, item in file.items() if not name.startswith("#")}
    return _with_units(file, tree)


def _with_units(group: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """A group's parts and, as a struct of units beside them, what the attributes ``units`` (or ``unit``) of its datasets state, alone or as
    an array of one text, as netCDF writes them."""
    stated = {name: stated_unit(group[name].attrs) for name in parts}
    stated = {n: u.item() if isinstance(u, np.ndarray) and u.size == 1 else u for n, u in stated.items()}
    texts = {n: u.decode("utf-8", "replace") if isinstance(u, bytes) else u for n, u in stated.items()}
    # degrees_north; a netCDF's time is in "seconds since ..."
    units = {n: re.sub("_(north|east)$| since .*", "", u) for n, u in texts.items() if isinstance(u, str)}
    return {"units": units, **parts} if units else parts


def _of_hdf5(file: Any, item: Any, depth: int, h5py: Any) -> Any:
    """A group or dataset as mapping, list, text, `Array` or `Opaque`."""
    if depth > _DEEPEST:
        return None
    if "MATLAB_object_decode" in item.attrs:
        kind = item.attrs.get("MATLAB_class", b"")
        return Opaque(kind.decode("ascii", "replace") if isinstance(kind, bytes) else "")
    if isinstance(item, h5py.Group):
        parts = {name: _of_hdf5(file, part, depth + 1, h5py) for name, part in item.items()}
        if _is_struct_array(item, parts, h5py):
            return [dict(zip(parts, one, strict=True)) for one in zip(*parts.values(), strict=True)]
        return _with_units(item, parts)
    if not isinstance(item, h5py.Dataset) or "MATLAB_empty" in item.attrs:
        return None
    kind = item.attrs.get("MATLAB_class", b"")
    if h5py.check_ref_dtype(item.dtype) is not None:
        references = item[()].ravel()[: 1 << 20]
        return [_of_hdf5(file, file[reference], depth + 1, h5py) for reference in references if reference]
    if kind == b"char":
        rows = item[()].T
        if rows.ndim == 2 and min(rows.shape) > 1:  # a text in each row, padded with blanks
            return ["".join(map(chr, row)) for row in rows.tolist()]
        return "".join(map(chr, rows.ravel().tolist()))
    if item.dtype.names:
        return {name: np.asarray(item[name]) for name in item.dtype.names}
    if h5py.check_string_dtype(item.dtype) is not None and item.ndim:
        return item.asstr(errors="replace")[()].ravel().tolist()
    if item.dtype.kind in "fiub":
        return _array_of_hdf5(item, turned=bool(kind))
    return None


def _is_struct_array(group: Any, parts: dict[str, Any], h5py: Any) -> bool:
    """Whether a group is an array of structs: each field a reference an element, which in a cell would say that it is one."""
    fields = list(group.values())
    lengths = {len(part) if isinstance(part, list) else 0 for part in parts.values()}
    return (
        len(lengths) == 1
        and lengths != {0}
        and all(isinstance(field, h5py.Dataset) and "MATLAB_class" not in field.attrs for field in fields)
    )


def _array_of_hdf5(item: Any, *, turned: bool) -> Array:
    """A dataset of numbers; ``turned``: by MATLAB, whose first axis is the last one in the file."""
    shape = tuple(reversed(item.shape)) if turned else item.shape
    whole = _packing_of(item)

    def part(rows: Any, column: Any) -> npt.NDArray[Any]:
        place: tuple[Any, ...] = (rows,) if len(shape) == 1 else (rows, column)
        if len(shape) == 2 and shape[0] == 1:
            place = (0, rows)  # a row vector
        return whole(np.asarray(item[tuple(reversed(place)) if turned else place]))

    def read() -> npt.NDArray[Any]:
        return whole(np.asarray(item[()]).T if turned else np.asarray(item[()]))

    return Array(shape, read, part if len(shape) <= 2 else None)


def _packing_of(item: Any) -> Callable[[npt.NDArray[Any]], npt.NDArray[Any]]:
    """How a dataset's stored numbers become values: the packing and the missing values of netCDF (CF conventions 8.1 and 2.5.1)."""
    stated = {k: np.ravel(item.attrs[k]) for k in (*_PACKING, *_MISSING) if k in item.attrs}
    numbers = {k: v for k, v in stated.items() if v.size and v.dtype.kind in "fiu"}
    scale, offset = (float(numbers[k][0]) if k in numbers else usual for k, usual in _PACKING.items())
    codes = np.concatenate([np.empty(0, item.dtype), *(numbers[k] for k in _MISSING if k in numbers)])
    if item.dtype.kind == "f":
        codes = codes.astype(item.dtype)  # a script writes -999.9 beside single numbers as a double

    def whole(stored: npt.NDArray[Any]) -> npt.NDArray[Any]:
        missing = np.isin(stored, codes)
        if not missing.any() and (scale, offset) == (1.0, 0.0):
            return stored  # whole numbers keep their digits
        return np.where(missing, np.nan, stored * scale + offset)

    return whole if len(codes) or (scale, offset) != (1.0, 0.0) else lambda stored: stored

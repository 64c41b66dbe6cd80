"""A log as it came: columns by their own names, before they mean anything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError

Wanted = Callable[[str], bool]


@dataclass(frozen=True, eq=False)
class LogTable:
    """Columns of a log file: ``names`` are all there are, ``columns`` those that were read.

    Numbers are float64 or integers (n,), missing = NaN; texts are objects, missing = None; dates are datetime64.
    ``units`` holds what the file itself says of a column's unit.
    """

    names: tuple[str, ...]
    columns: dict[str, npt.NDArray[Any]]
    units: dict[str, str] = field(default_factory=dict)
    source: str | None = None
    sha256: str | None = None
    notes: tuple[str, ...] = ()


def from_arrow(name: str, column: Any, source: str | None) -> npt.NDArray[Any]:
    """An Arrow column as NumPy; raises InputError on a type that holds neither numbers, texts nor dates."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (
        pa.types.is_floating(kind)
        or pa.types.is_integer(kind)
        or pa.types.is_string(kind)
        or pa.types.is_large_string(kind)
        or pa.types.is_string_view(kind)
        or pa.types.is_timestamp(kind)
        or pa.types.is_duration(kind)
    ):
        raise InputError(
            f"holds {kind}, not numbers", file=source, place=f"column {name}", mend="give one number a row"
        )
    return column.to_numpy(zero_copy_only=False)

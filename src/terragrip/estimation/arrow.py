"""NumPy columns as Arrow arrays and back, by their own memory. ``pa.array`` and ``to_numpy`` import pandas where it is: 0.6 s and 50 MB;
a cast all of Arrow's functions: a fifteenth of a short `estimate`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pyarrow as pa


def floats(values: npt.NDArray[np.float64]) -> pa.Array:
    """A float64 column (n,), not copied where it is contiguous."""
    import pyarrow as pa

    flat = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(flat), [None, pa.py_buffer(flat)])


def texts(values: Sequence[str | None] | npt.NDArray[np.object_]) -> pa.Array:
    """A column of texts (n,); None, and what is no text, is missing."""
    import pyarrow as pa

    encoded = [value.encode() if isinstance(value, str) else None for value in values]
    ends = np.cumsum([0, *(len(text or b"") for text in encoded)])
    kind, width = (pa.string(), np.int32) if ends[-1] < 1 << 31 else (pa.large_string(), np.int64)
    buffers = [
        None,
        pa.py_buffer(ends.astype(width)),
        pa.py_buffer(b"".join(text or b"" for text in encoded)),
    ]
    missing = [text is None for text in encoded]
    if any(missing):
        buffers[0] = pa.py_buffer(np.packbits(~np.array(missing), bitorder="little"))
    return pa.Array.from_buffers(kind, len(encoded), buffers)


def choices(codes: npt.NDArray[np.uint8], names: Sequence[str]) -> pa.Array:
    """A column of texts (n,) that are the ``names`` of its codes."""
    import pyarrow as pa

    words = [name.encode() for name in names]
    sizes = np.array([len(word) for word in words])
    length, begin = sizes[codes], (np.cumsum(sizes) - sizes)[codes]
    ends = np.r_[0, np.cumsum(length)]
    letters = np.frombuffer(b"".join(words), np.uint8)[
        np.arange(ends[-1]) + np.repeat(begin - ends[:-1], length)
    ]
    buffers = [None, pa.py_buffer(ends.astype(np.int32)), pa.py_buffer(letters)]
    return pa.Array.from_buffers(pa.string(), len(codes), buffers)


def values_of(column: pa.ChunkedArray) -> npt.NDArray[Any]:
    """A column (n,) as ``column.to_numpy()`` has it, not copied where it is one piece of numbers."""
    import pyarrow as pa

    if pa.types.is_string(column.type):
        names, codes = codes_of(column)
        return np.array(names, dtype=object)[codes]
    is_number = pa.types.is_floating(column.type) or pa.types.is_integer(column.type)
    if is_number and not column.null_count and len(column):
        parts = [np.from_dlpack(part) for part in column.chunks]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)
    return column.to_numpy()


def codes_of(column: pa.ChunkedArray) -> tuple[list[str | None], npt.NDArray[np.intp]]:
    """The different texts of a column (n,), None where one is missing, and which of them each row has (n,)."""
    import pyarrow as pa

    coded = column.cast(pa.string()).combine_chunks().dictionary_encode("encode")
    return coded.dictionary.to_pylist(), np.from_dlpack(coded.indices).astype(np.intp)

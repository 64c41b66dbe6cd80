"""How many rows other file formats hold."""

from __future__ import annotations

from collections.abc import Collection

SHEET_ROWS = 1_048_576
"""Of an Excel sheet, its header included (Excel specifications and limits, Microsoft)."""
_STRUCT_BYTES = (1 << 31) - (1 << 20)
"""Of a variable of a MATLAB file of version 5 and 7: 2 GB (MAT-File Versions, MathWorks), less the size of the fields' tags."""


def struct_rows(names: Collection[str]) -> int:
    """Rows of a table with those columns that one struct holds."""
    return _STRUCT_BYTES // (8 * len(names))

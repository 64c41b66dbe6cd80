"""How many rows the files of others take."""

from __future__ import annotations

from collections.abc import Collection

from terragrip.estimation.columns import column_named

SHEET_ROWS = 1_048_576
"""Of an Excel sheet, its header included (Excel specifications and limits, Microsoft)."""
_STRUCT_BYTES = (1 << 31) - (1 << 20)
"""Of a variable of a MATLAB file of version 5 and 7: 2 GB (MAT-File Versions, MathWorks), less what the fields' tags take."""
_TEXT = 64  # bytes of a text's cell that are reckoned with: 32 characters


def struct_rows(names: Collection[str]) -> int:
    """Rows of a table with those columns that one struct takes."""
    return _STRUCT_BYTES // sum(8 if column_named(name).unit else _TEXT for name in names)

"""Numbers written with a sign between thousands, where ``1,234`` must not become 1.234, or with their unit (``3.2 km/h``)."""

from __future__ import annotations

import re
from collections.abc import Sequence

SIGNS = ",.' \u2019\u00a0\u202f"
"""What stands between thousands, somewhere."""
_GROUPED = re.compile(rf"[+-]?[1-9]\d{{0,2}}(?P<sign>[{SIGNS}])\d{{3}}(?:(?P=sign)\d{{3}})*(?:[.,]\d+)?")

_WITH_UNIT = re.compile(
    r"[+-]?\d+(?:[.,]\d+)?\s*(?P<unit>[kcm]?m/s(?:²|\^?2)?|km/h|kph|mph|kn|rpm|[1U]/min|rad(?:/s)?|deg(?:/s)?|°(?:/s)?|%|da?N|[kM]N|"
    r"(?:k|da)?N[ ·]?m|kgf?|lbf?|bar|kW|m?A|m?s|sec|min|hr)",
    re.IGNORECASE,
)


def unit_in(cell: str) -> str | None:
    """The unit of a number that is written with it (``3.2 km/h``); None of any other text."""
    found = _WITH_UNIT.fullmatch(cell)
    return found["unit"] if found else None


def is_grouped(cell: str, sign: str) -> bool:
    """Whether a number may be written with ``sign`` between thousands: ``1,234``, ``12'345.6``."""
    match = _GROUPED.fullmatch(cell)
    return match is not None and match["sign"] == sign


def has_thousands(cells: Sequence[str], sign: str) -> bool:
    """Whether the numbers of a column may be written with ``sign`` between thousands: each that has it does, and there are whole
    numbers without it, or with two of it."""
    signed = [cell for cell in cells if sign in cell]
    if not signed or not all(is_grouped(cell, sign) for cell in signed):
        return False
    whole = any(re.fullmatch(r"[+-]?\d+", cell) for cell in cells if sign not in cell)
    return whole or any(cell.count(sign) > 1 for cell in signed)


def complaint(cell: str) -> tuple[str, str] | None:
    """What is wrong with a cell that has its unit, or may have a sign between thousands, and what to write; None where it has neither."""
    if unit := unit_in(cell):
        return f"{cell!r} has its unit in the cell", f"write numbers alone, and [{unit}] behind the name"
    sign = next((sign for sign in SIGNS if is_grouped(cell, sign)), None)
    if sign is None:
        return None
    problem = f"{cell!r} is not a number"
    if sign in ",." and len(re.findall("[.,]", cell)) == 1:
        problem = f"{cell!r} may be {cell.replace(sign, '')} or {cell.replace(sign, '.')}"
    return problem, "write numbers without a thousands separator"

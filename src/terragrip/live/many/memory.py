"""What the process holds."""

from __future__ import annotations

import os
from pathlib import Path

from terragrip.errors import InputError

_UNITS = {"MB": 1e6, "GB": 1e9}


def held_now() -> float:
    """Bytes of memory that the process holds; where the system does not tell (it is not Linux), the most that it has held."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
        return float(pages) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        pass
    try:
        import resource
    except ModuleNotFoundError:  # Windows: nothing is known, so nothing is limited
        return 0.0
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def amount(text: str) -> float:
    """``2GB`` or ``500MB`` in bytes; raises InputError where it is neither."""
    number, unit = text.strip()[:-2], text.strip()[-2:].upper()
    try:
        value = float(number) * _UNITS[unit]
    except (ValueError, KeyError):
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise InputError(f"{text!r} is not an amount of memory", place="--memory", hint="write 2GB or 500MB")
    return value


def in_words(size: float) -> str:
    """``1.2 GB``, ``340 MB``."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"

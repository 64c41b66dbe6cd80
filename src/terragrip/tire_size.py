"""Radius and width of a tyre as its size says (ISO 4251-1: section width, its height in per cent of it, rim diameter in inches)."""

from __future__ import annotations

import re
from dataclasses import dataclass

INCH = 0.0254
ROLLING = 3.05 / 3.141592653589793
"""Rolling radius over the unloaded one of a radial tyre: circumference 3.05 times the diameter (UN Regulation 30)."""
_SIZE = re.compile(
    r"\s*(?:[A-Z]{1,3}\s*)?(?P<width>\d{2,4})\s*/\s*(?P<ratio>\d{2,3})\s*(?:R|-|B|D)\s*(?P<rim>\d{1,2}(?:\.\d)?)\b",
    re.IGNORECASE,
)


_INCHES = re.compile(r"\s*\d{1,2}(?:[.,]\d{1,2})?(?:/\d{2,3})?\s*[R-]\s*\d{2}(?:[.,]\d)?\s*", re.IGNORECASE)
"""18.4R38, 11.2-28: sizes in inches, whose height is not in them."""


@dataclass(frozen=True)
class TireSize:
    """``radius`` unloaded and ``width`` of the section [m]."""

    radius: float
    width: float

    @property
    def rolling_radius(self) -> float:
        """On the road under its usual load [m]: `ROLLING` of the unloaded one."""
        return ROLLING * self.radius


def tire_size(text: str) -> TireSize | None:
    """A metric size such as ``520/70R38`` or ``VF 650/65 R42``; None for any other text (18.4R38 does not say its height)."""
    found = _SIZE.match(text)
    if found is None:
        return None
    width, ratio, rim = (float(found[key]) for key in ("width", "ratio", "rim"))
    width *= 1e-3
    return TireSize(0.5 * rim * INCH + width * ratio / 100, width)


def is_tire_size(text: str) -> bool:
    """Whether ``text`` is a tyre's size, metric or in inches."""
    return tire_size(text) is not None or _INCHES.fullmatch(text) is not None

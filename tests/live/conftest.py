"""Makes machine.py, which tests import from, and its fixtures known."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from machine import port, sender, short, vehicle

__all__ = ["port", "sender", "short", "vehicle"]

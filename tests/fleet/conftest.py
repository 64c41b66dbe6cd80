"""Makes small_fleet.py, which tests import from, and its fixtures known."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from small_fleet import place, scheduler, started

__all__ = ["place", "scheduler", "started"]

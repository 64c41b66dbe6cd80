"""The second plant lives with the benchmarks: a development dependency (MuJoCo), no part of the package."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

"""Lets the tests of this folder share their synthetic campaign."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

"""Lets the tests of this folder share their drives of known ground."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

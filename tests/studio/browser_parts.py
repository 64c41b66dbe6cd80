"""Where the browser and what it needs are."""

from __future__ import annotations

import shutil
from pathlib import Path

from terragrip.studio.app import STATIC

AXE = str(Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js")


def chromium() -> str | None:
    """Debian's chromium, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


def problems() -> str | None:
    """Why the pages cannot be tested, or None."""
    if not (STATIC / "index.html").is_file() or not Path(AXE).is_file():
        return "the pages are not built: `make studio` needs Node.js 20 or newer"
    return None

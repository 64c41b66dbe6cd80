"""The command line: ``terragrip COMMAND``. Each command has a module; what they need loads when they run."""

from __future__ import annotations

from terragrip.cli.entry import main as main

__all__ = ["main"]

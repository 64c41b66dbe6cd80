"""The installed command keeps the contracts of architecture.md, contracts, tried by the project's own outside check."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path


def test_installed_command_keeps_the_contracts(shared: Callable[[str], Path]) -> None:
    check = shared("checks/contract.py")
    command = Path(sys.executable).with_name("terragrip")
    assert command.exists(), f"{command} is not installed: run make test, or pip install --editable ."
    done = subprocess.run(
        [sys.executable, str(check), str(command)], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the contracts hold" in done.stdout

"""The command line keeps the contracts of architecture.md, contracts, tried by the project's own outside check."""

from __future__ import annotations

import contextlib
import io
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from terragrip.cli import main

COMMAND = Path(sys.executable).with_name("terragrip")


def in_this_process(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
    """What `subprocess.run` would return of a call of the command; twenty starts of a process take longer than the calls' work."""
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        code = main(words[1:])
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())


def test_the_command_line_keeps_the_contracts(
    shared: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    check = shared("checks/contract.py")
    calls: list[str] = []

    def run(words: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        calls.append(words[1])
        return in_this_process(words, **options)

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(sys, "argv", [str(check), str(COMMAND)])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(check), run_name="__main__")
    said = capsys.readouterr().out
    assert ended.value.code == 0, said
    assert "the contracts hold" in said
    assert {"estimate", "soils", "ground"} <= set(calls)


def test_the_installed_command_is_this_program(tmp_path: Path) -> None:
    """It runs `terragrip.cli.main`, of which the test above says the rest; refuses with 2 and one line."""
    assert COMMAND.exists(), f"{COMMAND} is not installed: run make test, or pip install --editable ."
    words = [str(COMMAND), "estimate", str(tmp_path / "no.csv"), "--vehicle", str(tmp_path / "no.yaml")]
    done = subprocess.run(
        [*words, "-o", str(tmp_path / "out.parquet")], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "no.yaml" in done.stderr or "no.csv" in done.stderr


@pytest.mark.long  # above, within this process
def test_installed_command_keeps_the_contracts(shared: Callable[[str], Path]) -> None:
    check = shared("checks/contract.py")
    done = subprocess.run(
        [sys.executable, str(check), str(COMMAND)], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the contracts hold" in done.stdout

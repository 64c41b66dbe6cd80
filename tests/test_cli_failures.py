"""Whatever goes wrong: the exit code, one line, and where the traceback is."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from terragrip import __version__
from terragrip.cli import main
from terragrip.cli.failure import describe
from terragrip.errors import InputError

LAUNCH = [sys.executable, "-c", "import sys; from terragrip.cli import main; sys.exit(main())"]

Say = Callable[..., tuple[int, str]]


@pytest.fixture
def say(capsys: pytest.CaptureFixture[str]) -> Say:
    """Return a function that runs the command line in this process: exit code and standard error's one line."""

    def run(*words: Any) -> tuple[int, str]:
        code = main([str(word) for word in words])
        lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
        assert len(lines) == (code != 0), lines
        return code, lines[0] if lines else ""

    return run


def failing(failure: BaseException) -> Callable[..., None]:
    def raise_it(*_: Any, **__: Any) -> None:
        raise failure

    return raise_it


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["nope"], "No such command 'nope'"),
        (["--nope"], "No such option"),
        (["estimate"], "--vehicle"),
        (["estimate", "a.csv"], "--vehicle"),
        (["estimate", "a.csv", "--vehicle"], "requires an argument"),
        (["estimate", "a.csv", "--vehicle", "v", "-o", "o", "--metod", "x"], "--metod"),
        (["simulate", "x", "-o", "y", "--seed", "many"], "--seed"),
        (["simulate", "x", "-o", "y", "--seed", "-1"], "--seed"),
        (["inspect"], "LOG"),
    ],
)
def test_a_wrong_call_is_one_line_that_points_to_the_help(say: Say, words: list[str], expected: str) -> None:
    code, line = say(*words)
    assert code == 2
    assert expected in line
    assert line.endswith("--help")


def test_help_and_version_are_no_failures(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"terragrip {__version__}\n"
    for words in ([], ["--help"], ["estimate", "--help"]):
        assert main(words) == 0
        streams = capsys.readouterr()
        assert "Usage" in streams.out
        assert streams.err == ""


def test_a_defect_keeps_its_traceback_in_a_file(
    say: Say, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("terragrip.formats.inspect", failing(ZeroDivisionError("a\nb")))
    code, line = say("inspect", "x.csv")
    assert code == 1
    assert "defect" in line
    (kept,) = tmp_path.glob("terragrip-*.txt")
    assert str(kept) in line
    text = kept.read_text()
    assert "Traceback" in text
    assert "ZeroDivisionError" in text
    assert "inspect x.csv" in text


def test_debug_shows_the_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("terragrip.formats.inspect", failing(ZeroDivisionError("zero")))
    assert main(["--debug", "inspect", "x.csv"]) == 1
    shown = capsys.readouterr().err
    assert "Traceback" in shown
    assert ".txt" not in shown.splitlines()[-1]


@pytest.mark.parametrize(
    ("failure", "code", "expected"),
    [
        (InputError("is text", file="a.csv", place="row 3", hint="write numbers"), 2, "a.csv: row 3: is text; write numbers"),
        (OSError(errno.ENOSPC, "No space left on device", "a.parquet"), 2, "a.parquet: the disk is full"),
        (PermissionError(errno.EACCES, "Permission denied", "a.csv"), 2, "a.csv: permission denied"),
        (OSError("Error writing bytes. Detail: [errno 28] No space left"), 2, "the disk is full"),
        (RuntimeError("parquet: No space left on device (os error 28)"), 2, "the disk is full"),
        (MemoryError(), 2, "not enough memory"),
        (ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib"), 2, "pip install 'terragrip[all]'"),
        (ModuleNotFoundError("x", name="terragrip._kernel_portable"), 1, "defect"),
        (OSError(errno.EBADF, "Bad file descriptor"), 1, "defect"),
        (ValueError("what"), 1, "defect"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)  # fmt: skip
def test_what_each_failure_becomes(failure: BaseException, code: int, expected: str) -> None:
    got, line = describe(failure)
    assert got == code
    assert expected in line


def test_interruption_inside_a_command(say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terragrip.formats.inspect", failing(KeyboardInterrupt()))
    assert say("inspect", "x.csv")[0] == 130


def test_library_warnings_do_not_reach_standard_error(monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "import sys, warnings; import terragrip.formats as f; from terragrip.cli import main\n"
        "def warn(*_, **__): warnings.warn('hm'); raise f.read('missing.csv')\n"
        "f.inspect = warn; sys.exit(main(['inspect', 'missing.csv']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "missing.csv" in done.stderr


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from terragrip.cli import main; main(['--help'])\n"
        "heavy = {'numpy', 'pandas', 'pyarrow', 'polars', 'scipy', 'pydantic', 'pint', 'yaml', 'structlog', 'rich'}\n"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""


@pytest.mark.skipif(os.name != "posix", reason="pipes of a POSIX system")
def test_a_reader_that_goes_away_is_no_traceback() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([*LAUNCH, "--help"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert done.returncode == 141
    assert done.stderr == ""


def test_verbose_logs_to_standard_error_by_structlog() -> None:
    code = (
        "import logging, sys; import terragrip.formats as f; from terragrip.cli import main\n"
        "def inspect(*_, **__): logging.getLogger('terragrip.formats').info('looking', extra={'rows': 3}); raise f.read('m.csv')\n"
        "f.inspect = inspect; sys.exit(main(['--verbose', 'inspect', 'm.csv']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "looking" in done.stderr
    assert "rows=3" in done.stderr
    assert done.stdout == ""

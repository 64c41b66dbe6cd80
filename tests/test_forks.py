"""`make pytest` forks its workers (conftest.py): no failure in one is lost, nor a worker that dies."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

GOOD = "def test_good(): pass\n"
BAD = "def test_bad(): assert 0\n"
EXITS = "import os\ndef test_exits(): os._exit(0)\n"
AT_ITS_END = """
import os, threading
def test_last():
    end = threading.Thread(target=lambda: (threading.main_thread().join(), os._exit(3)))
    end.start()
"""


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        (BAD, [], "1 failed, 1 passed"),
        (EXITS, [], "a worker died in test_other.py::test_exits"),
        (AT_ITS_END, [], "a worker died in its end"),
        (
            GOOD,
            ["-p", "no:capture"],
            "a worker died in its start",
        ),  # as one does that finds no room on the disk
    ],
    ids=["fails", "exits", "at its end", "at its start"],
)
def test_no_failure_is_lost(tmp_path: Path, text: str, options: list[str], line: str) -> None:
    shutil.copy(Path(__file__).with_name("conftest.py"), tmp_path)
    (tmp_path / "pytest.ini").write_text("[pytest]\nasyncio_default_fixture_loop_scope = function\n")
    (tmp_path / "test_good.py").write_text(GOOD)
    (tmp_path / "test_other.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "--forks", "2", "--import-mode=importlib", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1, done.stdout
    assert line in done.stdout

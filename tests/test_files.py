"""Files: nothing is ever half-written, and what cannot be opened or written is refused with a hint."""

from __future__ import annotations

import errno
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from terragrip.errors import InputError
from terragrip.files import UNFINISHED, has_ended, lock, refuse_missing, replacing, sha256, this_process


def test_the_old_file_stands_until_the_new_one_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "estimates.parquet"
    target.write_text("old")
    with replacing(target) as temporary:
        temporary.write_text("new")
        assert target.read_text() == "old"
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".parquet")
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["estimates.parquet"]


@pytest.mark.parametrize("failure", [KeyboardInterrupt, ValueError, InputError])
def test_an_interruption_leaves_the_old_file_alone(tmp_path: Path, failure: type[BaseException]) -> None:
    target = tmp_path / "out.csv"
    target.write_text("old")

    def work() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise failure("stop")

    with pytest.raises(failure, match="stop"):
        work()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.csv"]


def test_a_full_disk_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match=r"out\.csv: cannot be written .*No space left.*; free space"),
        replacing(tmp_path / "out.csv"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert os.listdir(tmp_path) == []


def test_a_new_file_has_the_usual_rights(tmp_path: Path) -> None:
    with replacing(tmp_path / "out.csv") as temporary:
        temporary.write_text("x")
    (tmp_path / "plain").write_text("x")
    assert (tmp_path / "out.csv").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    for target in (tmp_path / "none" / "out.csv", Path("/proc/out.csv"), Path("/")):
        with pytest.raises(InputError, match="cannot be written"), replacing(target):
            pytest.fail("the work must not begin")
    (tmp_path / "folder").mkdir()
    with (
        pytest.raises(InputError, match="folder: cannot be written"),
        replacing(tmp_path / "folder") as temporary,
    ):
        temporary.write_text("x")
    assert os.listdir(tmp_path) == ["folder"]


def test_sha256_and_missing_files(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(b"abc")
    assert sha256(tmp_path / "log.csv") == hashlib.sha256(b"abc").hexdigest()
    with pytest.raises(InputError, match=r"lgo\.csv: no such file; did you mean log\.csv\?"):
        sha256(tmp_path / "lgo.csv")
    for odd in ("\x00", "x" * 5000, "/dev/null"):
        with pytest.raises(InputError):
            refuse_missing(odd)


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_writes_is_not(tmp_path: Path) -> None:
    script = """
import os, sys
from terragrip.files import replacing
with replacing(sys.argv[1]) as temporary:
    temporary.write_text("half")
    print("begun", flush=True)
    sys.stdin.read()
"""
    words = [sys.executable, "-c", script, str(tmp_path / "a.csv")]
    living, killed = (
        subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in "ab"
    )
    for process in (living, killed):
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
    killed.kill()
    killed.wait()
    assert len([name for name in os.listdir(tmp_path) if name.startswith(UNFINISHED)]) == 2
    with replacing(tmp_path / "b.csv") as temporary:
        temporary.write_text("whole")
    (left,) = (name for name in os.listdir(tmp_path) if name.startswith(UNFINISHED))
    assert f"-{living.pid}-" in left
    living.communicate("", timeout=120)
    killed.communicate(timeout=120)
    assert sorted(os.listdir(tmp_path)) == ["a.csv", "b.csv"]


def test_a_process_elsewhere_is_not_taken_for_ended() -> None:
    assert not has_ended(this_process())
    assert not has_ended("00000000-1")
    assert not has_ended("nonsense")


def test_a_lock_goes_with_its_process(tmp_path: Path) -> None:
    script = """
import sys
from pathlib import Path
from terragrip.files import lock
lock(Path(sys.argv[1]))
print(1, flush=True)
sys.stdin.read()
"""
    words = [sys.executable, "-c", script, str(tmp_path / "lock")]
    holder = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"1\n"
    assert lock(tmp_path / "lock") is None
    holder.kill()
    holder.communicate()
    held = lock(tmp_path / "lock")
    assert held is not None
    os.close(held)

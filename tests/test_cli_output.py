"""Where results may go: found out before the work, and never half-written."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from terragrip.cli import main
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.errors import InputError

LAUNCH = [sys.executable, "-c", "import sys; from terragrip.cli import main; sys.exit(main())"]
POSIX = pytest.mark.skipif(os.name != "posix", reason="needs a POSIX system")


def test_a_good_file_and_a_good_folder_leave_nothing_behind(tmp_path: Path) -> None:
    assert check_file(tmp_path / "a.parquet", suffixes=(".parquet",)) == tmp_path / "a.parquet"
    assert check_folder(tmp_path / "new") == tmp_path / "new"
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_what_is_no_place_for_a_file(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("x")
    (tmp_path / "link.parquet").symlink_to(log)
    for path, inputs, reason in (
        (tmp_path, [], "is a folder"),
        (tmp_path / "no" / "a.parquet", [], "does not exist"),
        (log, [log], "is an input too"),
        (tmp_path / "link.parquet", [log], "is an input too"),
        (Path(os.devnull), [], "is a device"),
    ):
        with pytest.raises(InputError, match=reason) as caught:
            check_file(path, inputs)
        assert caught.value.hint
    with pytest.raises(InputError, match=r"is not named \.parquet.*a\.parquet"):
        check_file(tmp_path / "a.csv", suffixes=(".parquet",))
    assert log.read_text() == "x"


def test_what_is_no_place_for_a_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="is a file"):
        check_folder(tmp_path / "file")
    with pytest.raises(InputError, match="does not exist"):
        check_folder(tmp_path / "a" / "b")


@POSIX
def test_a_folder_that_refuses_writing(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        if os.access(tmp_path, os.W_OK):
            pytest.skip("NOT TESTED: this user may write anywhere")
        with pytest.raises(InputError, match="cannot be written"):
            check_file(tmp_path / "a.parquet")
    finally:
        tmp_path.chmod(0o700)


def test_a_system_that_refuses_writing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    with pytest.raises(InputError, match="Read-only file system"):
        check_file(tmp_path / "a.parquet")


def test_two_logs_of_one_name_do_not_overwrite_each_other(tmp_path: Path) -> None:
    logs = [tmp_path / "a" / "run.csv.gz", tmp_path / "b" / "run.csv"]
    with pytest.raises(InputError, match="same name"):
        files_in(tmp_path, logs, ".parquet")
    assert files_in(tmp_path, logs[:1], ".parquet") == [tmp_path / "run.parquet"]


@POSIX
def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    import resource

    def limit() -> None:  # the nearest to a full disk that a test can have
        resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))

    done = subprocess.run(
        [*LAUNCH, "simulate", "constant", "-o", str(tmp_path / "out")],
        preexec_fn=limit,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # which would be cut short, and stay so
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "File too large" in done.stderr
    assert list((tmp_path / "out").iterdir()) == []


@POSIX
def test_ctrl_c_leaves_whole_files(tmp_path: Path) -> None:
    import pandas as pd

    # Whoever starts the tests in the background may have them ignore Ctrl-C, which a process hands on to those it starts.
    hearing = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); " + LAUNCH[2]
    run = subprocess.Popen(
        [*LAUNCH[:2], hearing, "simulate", "campaign", "-o", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # what a background job inherits ignores Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    patience = time.monotonic() + 300
    while (
        not list(tmp_path.glob("out/*/vehicle.yaml")) and run.poll() is None and time.monotonic() < patience
    ):
        time.sleep(0.02)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to the workers too
    _, output = run.communicate(timeout=300)
    assert run.returncode == 130
    assert len(output.strip().splitlines()) == 1
    written = list(tmp_path.glob("out/*/*"))
    assert written
    assert not [path for path in written if path.name.startswith(".")]
    for path in written:
        if path.suffix == ".parquet":
            assert len(pd.read_parquet(path)) > 0


@POSIX
def test_ctrl_c_in_a_destructor_is_not_lost() -> None:
    """Python ignores what is raised there: once a campaign of runs went on to its end and gave 0."""
    destroyed = """
import signal, sys, time
import terragrip.simulation
from terragrip.cli import main

class Kept:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

def names():
    Kept()
    time.sleep(60)
    return ["never"]

signal.signal(signal.SIGINT, signal.default_int_handler)
terragrip.simulation.set_names = names
sys.exit(main())
"""
    command = [sys.executable, "-c", destroyed, "simulate", "--list"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (run.returncode, run.stdout) == (130, "")
    assert len(run.stderr.strip().splitlines()) == 1


def test_a_folder_without_room_is_named_with_its_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """'--output' was named of every option, and another folder asked for where room would do."""

    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryFile", full)
    with pytest.raises(
        InputError, match=r"--write-profile: cannot be written .*; free space or choose another folder"
    ):
        check_file(tmp_path / "p.yaml", option="--write-profile")


def test_a_log_in_place_of_estimates_is_to_be_estimated_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`report log.csv` asked to write log.csv again."""
    (tmp_path / "log.csv").write_text("time,ground_speed\n0,1\n")
    assert main(["report", str(tmp_path / "log.csv"), "-o", str(tmp_path / "r.html")]) == 2
    assert "a log is estimated first" in capsys.readouterr().err

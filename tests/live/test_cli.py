"""``terragrip live`` as a user starts it: stopped by Ctrl-C, killed, started again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from machine import rows_of
from terragrip.cli import main
from terragrip.estimation import TractionEstimator
from terragrip.live import read_record

COMMAND = [sys.executable, "-c", "import sys; from terragrip.cli import main; sys.exit(main())", "live"]


@pytest.fixture
def files(tmp_path, vehicle, short):
    """A vehicle file and a log."""
    vehicle.save(tmp_path / "vehicle.yaml")
    short.recording.to_pandas().to_parquet(tmp_path / "drive.parquet")
    return tmp_path


def start(files: Path, *options: str) -> subprocess.Popen:
    command = [*COMMAND, "--vehicle", str(files / "vehicle.yaml"), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_rows(folder: Path, rows: int) -> None:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        wal = folder / "wal-000001.log"
        if wal.exists() and wal.stat().st_size > 350 * rows:
            return
        time.sleep(0.01)
    raise AssertionError("nothing is recorded")


def test_ctrl_c_closes_the_record_and_says_what_was_done(files):
    process = start(files, "--source", f"replay:{files / 'drive.parquet'}", "--record", str(files / "r"))
    wait_for_rows(files / "r", 50)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "rows estimated" in out
    assert f"Recorded in {files / 'r'}" in out
    assert (files / "r" / "estimates-000001.parquet").exists()


def test_killed_and_started_again_it_ends_as_if_never_interrupted(files, vehicle, short):
    log, record = f"replay:{files / 'drive.parquet'}", ("--record", str(files / "r"))
    process = start(files, "--source", f"{log}?speed=3", *record)
    wait_for_rows(files / "r", 200)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    out, err = start(files, "--source", f"{log}?speed=max", *record).communicate(timeout=120)
    assert "600 rows estimated" in out, err
    assert "resumed after" in err
    kept, estimates = read_record(files / "r")
    through = TractionEstimator(vehicle, channels=tuple(short.recording.channels)).update_block(
        short.recording
    )
    assert np.array_equal(kept.time, short.recording.time)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


def run(capsys, files, *options: str) -> tuple[int, str, str]:
    code = main(["live", "--vehicle", str(files / "vehicle.yaml"), *options])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--source", "nothing"], "is not a source"),
        (["--source", "udp://127.0.0.1:9", "--sink", "udp://127.0.0.1"], "has no host or no port"),
        (["--source", "udp://127.0.0.1:9", "--quiet"], "would go nowhere"),
        (["--source", "udp://127.0.0.1.evil.example:9"], "anyone could send samples here"),
        (["--source", "udp://0.0.0.0:9?allow=10.0.0.0/8"], "is no IP address"),
        (["--source", "udp://127.0.0.1:9", "--held", "speed=1"], "is not a channel and a period"),
        (["--source", "udp://127.0.0.1:9", "--method", "aukf-sf"], "did you mean"),
        (["--source", "udp://127.0.0.1:9", "--library", "no.json"], "no such file"),
        (
            ["--source", "can:x?interface=virtual", "--profile", "tractor-isobus", "--ground"],
            "need drive torques",
        ),
    ],
)
def test_what_cannot_be_is_one_line_and_exit_2(capsys, files, options, expected):
    code, out, err = run(capsys, files, *options)
    assert code == 2
    assert out == ""
    assert len(err.splitlines()) == 1
    assert expected in err


def test_a_missing_package_names_the_extra(capsys, files, monkeypatch):
    monkeypatch.setitem(sys.modules, "paho", None)
    code, _, err = run(capsys, files, "--source", "mqtt://127.0.0.1/machine")
    assert code == 2
    assert "pip install 'terragrip[live]'" in err


def test_events_are_lines_on_standard_error(capsys, files, vehicle, short):
    lines = [json.dumps({"time": t, **values}) for t, values in rows_of(short.recording)]
    assert lines
    code, out, err = run(capsys, files, "--source", "udp://127.0.0.1:9", "--duration", "3.6")
    assert code == 0
    assert "0 rows estimated" in out
    assert "source_lost: udp://127.0.0.1:9: nothing came for" in err

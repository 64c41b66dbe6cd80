"""Nothing is lost: killed again and again, a run goes on as if it had never stopped, to the last bit."""

from __future__ import annotations

import json
import os
import random
import signal
import time
import warnings

import numpy as np
import pytest

from drives import drive, robot
from machine import rows_of
from terragrip import read
from terragrip.errors import InputError
from terragrip.estimation import Estimates, TractionEstimator
from terragrip.live import read_record
from terragrip.live.core import Core, Settings
from terragrip.live.pipeline import Pipeline
from terragrip.live.record_folder import last_snapshot, write_snapshot
from terragrip.live.wal import Reading


def settings_for(recording) -> Settings:
    return Settings(("replay:test",), channels=tuple(recording.channels))


def play(pipeline: Pipeline, rows, pause: float = 0.0) -> None:
    """Feed the rows behind the newest that the record holds, ten at a time."""
    after = pipeline.core.clocks[0].newest
    for k, (stamp, values) in enumerate(row for row in rows if row[0] > after):
        pipeline.process(stamp, 0, stamp, values)
        if k % 10 == 9:
            pipeline.write()
            pipeline.sync()
            time.sleep(pause)
    pipeline.flush()
    pipeline.close()


def assert_as_never_interrupted(folder, recording, vehicle) -> None:
    kept, estimates = read_record(folder)
    assert np.array_equal(kept.time, recording.time)
    for name, values in recording.channels.items():
        assert np.array_equal(kept.channels[name], values, equal_nan=True), name
    through = TractionEstimator(vehicle, channels=tuple(recording.channels)).update_block(recording)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


def killed_child(act, seconds: float | None = None) -> bool:
    """Fork a child that does ``act`` and kill it after ``seconds``, if given; whether it had come to its end before."""
    with warnings.catch_warnings():
        # A child that hangs for a lock of another thread is killed like any other.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        code = 1
        try:
            act()
            code = 0
        finally:
            os._exit(code)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.WIFEXITED(status) and os.WEXITSTATUS(status) == 0


@pytest.mark.parametrize("least", [10, pytest.param(100, marks=pytest.mark.long)])
def test_killed_many_times_it_ends_as_if_never_interrupted(tmp_path, vehicle, least):
    import pyarrow.parquet  # noqa: F401  # here, so that a child need not

    recording = drive(25.0, imu=True).recording
    rows, settings = list(rows_of(recording)), settings_for(recording)
    random.seed(5)
    kills, drives = 0, 1

    # Segments of 150 rows: kills hit every step of closing one. On a quick machine a drive ends before the kills do: then another begins.
    def act():
        play(Pipeline(Core(vehicle, settings), tmp_path / f"r{drives}", rows=150), rows, pause=0.004)

    while kills < least:
        if killed_child(act, random.uniform(0.0, 0.15)):
            assert_as_never_interrupted(tmp_path / f"r{drives}", recording, vehicle)
            drives += 1
        else:
            kills += 1
    play(Pipeline(Core(vehicle, settings), tmp_path / f"r{drives}", rows=150), rows)
    assert_as_never_interrupted(tmp_path / f"r{drives}", recording, vehicle)


def test_at_most_the_frames_behind_the_last_write_are_lost(tmp_path, vehicle, short):
    rows, settings = list(rows_of(short.recording)), settings_for(short.recording)

    def act():
        pipeline = Pipeline(Core(vehicle, settings), tmp_path)
        for stamp, values in rows[:437]:
            pipeline.process(stamp, 0, stamp, values)
            pipeline.write()
        for stamp, values in rows[437:450]:
            pipeline.process(stamp, 0, stamp, values)
        os.kill(os.getpid(), signal.SIGKILL)

    killed_child(act)
    kept, _ = read_record(tmp_path)
    assert np.array_equal(kept.time, short.recording.time[:437])


@pytest.mark.parametrize("cut", [1, 7, 30, 100])
def test_a_torn_end_is_cut_off_and_said(tmp_path, vehicle, short, cut):
    rows, settings = list(rows_of(short.recording)), settings_for(short.recording)
    pipeline = Pipeline(Core(vehicle, settings), tmp_path)
    for stamp, values in rows[:100]:
        pipeline.process(stamp, 0, stamp, values)
    pipeline.write()
    pipeline.recorder.abandon()
    wal = tmp_path / "wal-000001.log"
    wal.write_bytes(wal.read_bytes()[:-cut])
    again = Pipeline(Core(vehicle, settings), tmp_path)
    assert again.core.rows in (98, 99)
    assert "incomplete" in again.recorder.segment.events[-1].text
    play(again, rows)
    assert_as_never_interrupted(tmp_path, short.recording, vehicle)


def test_a_flipped_byte_ends_the_reading_there(tmp_path, vehicle, short):
    pipeline = Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)
    for stamp, values in list(rows_of(short.recording))[:50]:
        pipeline.process(stamp, 0, stamp, values)
    pipeline.close()
    pipeline = Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)
    for stamp, values in list(rows_of(short.recording))[50:100]:
        pipeline.process(stamp, 0, stamp, values)
    pipeline.write()
    path = tmp_path / "wal-000002.log"
    whole = len(list(Reading(path)))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    reading = Reading(path)
    assert 0 < len(list(reading)) < whole
    assert reading.good < reading.size
    pipeline.recorder.abandon()


def test_segments_are_files_that_every_command_reads(tmp_path, vehicle, short):
    play(Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path, rows=250), rows_of(short.recording))
    names = sorted(path.name for path in tmp_path.glob("*.parquet"))
    assert names == [f"{kind}-00000{k}.parquet" for kind in ("estimates", "recording") for k in (1, 2, 3)]
    second = read(tmp_path / "recording-000002.parquet")
    assert len(second) == 250
    assert second.notes == ()
    part = Estimates.read(tmp_path / "estimates-000002.parquet")
    assert part.vehicle.to_dict() == vehicle.to_dict()
    assert not list(tmp_path.glob(".*.part"))


def test_what_was_refused_is_kept_too(tmp_path, vehicle, short):
    pipeline = Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)
    rows = list(rows_of(short.recording))
    for stamp, values in [*rows[:100], rows[20]]:
        pipeline.process(stamp, 0, stamp, values)
    pipeline.close()
    (line,) = (tmp_path / "refused-000001.jsonl").read_text().splitlines()
    assert json.loads(line)["time"] == rows[20][0]
    assert json.loads(line)["values"] == rows[20][1]


def test_another_vehicle_or_a_second_writer_is_refused(tmp_path, vehicle, short):
    settings = settings_for(short.recording)
    pipeline = Pipeline(Core(vehicle, settings), tmp_path)
    with pytest.raises(InputError, match="in use"):
        Pipeline(Core(vehicle, settings), tmp_path)
    pipeline.close()
    other = robot(
        mass=150.0,
        axles={
            "front": {"mass": 60.0, "wheels": ["fl", "fr"]},
            "rear": {"mass": 90.0, "wheels": ["rl", "rr"]},
        },
    )
    with pytest.raises(InputError, match="another vehicle"):
        Pipeline(Core(other, settings), tmp_path)
    with pytest.raises(InputError, match="made with window"):
        Pipeline(Core(vehicle, Settings(settings.sources, window=1.0, channels=settings.channels)), tmp_path)
    (tmp_path / "snapshot-000000.json").unlink(missing_ok=True)
    for path in tmp_path.glob("snapshot-*"):
        path.write_text(path.read_text().replace('"rows"', '"rowz"'))
        with pytest.raises(InputError, match="is damaged"):
            Pipeline(Core(vehicle, settings), tmp_path)


def test_a_snapshot_of_another_version_is_refused_in_one_line(tmp_path, vehicle, short):
    core = Core(vehicle, settings_for(short.recording))
    Pipeline(core, tmp_path).close()
    newer, without, other = (core.state() for _ in range(3))
    newer["format"] += 1
    del without["format"]  # as it was once
    del other["reorder"]["released"]  # whole by its check sum, but with other entries
    for state in (newer, without, other):
        write_snapshot(tmp_path, last_snapshot(tmp_path), state)
        with pytest.raises(InputError, match="another version"):
            Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)


def test_no_record_is_said(tmp_path):
    with pytest.raises(InputError, match="holds no record"):
        read_record(tmp_path)


@pytest.mark.parametrize("content", [("S", [0.0, 7, 0.0, {}]), ("S", 3), ("N", {"event": {"why": "x"}})])
def test_a_write_ahead_file_of_something_else_is_refused_in_one_line(tmp_path, vehicle, short, content):
    pipeline = Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)
    pipeline.recorder._ahead.add(*content)
    pipeline.write()
    pipeline.recorder.abandon()
    with pytest.raises(InputError, match="holds an input that is none, before byte"):
        Pipeline(Core(vehicle, settings_for(short.recording)), tmp_path)

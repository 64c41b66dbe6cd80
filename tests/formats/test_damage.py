"""Damaged files of every kind: bytes cut, flipped, swapped and overwritten are read or refused, in bounded memory."""

from __future__ import annotations

import random
import re
import resource
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
import pandas as pd
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin

from can_frames import drive, write_log
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.formats.boundary import needed
from terragrip.formats.reading import read_table
from test_logs import write_mcap, write_mdf, write_ros1, write_ros2
from test_matlab_exports import matlab_content, write_hdf5
from test_nmea_logs import write_nmea


def matlab_5(path: Path, packed: bool) -> Path:
    scipy.io.savemat(path, matlab_content(), do_compression=packed)
    return path


def parquet(path: Path) -> Path:
    time = np.arange(50.0)
    pd.DataFrame({"time": time, "ground_speed": time, "wheel_speed_a": time, "soil": "x"}).to_parquet(path)
    return path


SAMPLES: dict[str, Callable[[Path], Path]] = {
    **{s: lambda d, s=s: write_log(d / f"log.{s}", drive(1000, 5.0).frames) for s in ("blf", "asc", "trc", "log", "csv")},
    "parquet": lambda d: parquet(d / "log.parquet"),
    "nmea": lambda d: write_nmea(d / "log.nmea"),
    "ros1": lambda d: write_ros1(d / "log.bag"),
    "sqlite": lambda d: next(write_ros2(d / "bag", StoragePlugin.SQLITE3, ("/joint_states",)).glob("*.db3")),
    "ros mcap": lambda d: next(write_ros2(d / "bag", StoragePlugin.MCAP, ("/joint_states",)).glob("*.mcap")),
    "mcap": lambda d: write_mcap(d / "log.mcap", 50),
    "matlab 5": lambda d: matlab_5(d / "log.mat", packed=False),
    "matlab 5 packed": lambda d: matlab_5(d / "log.mat", packed=True),
    "matlab 7.3": lambda d: write_hdf5(d / "log.mat", matlab_content()),
    "mdf": lambda d: write_mdf(d / "log.mf4"),
}  # fmt: skip
ROUNDS = {"mdf": 4}  # each starts a process; fuzz/parsers.py searches at length


def damaged(whole: bytes, seed: int) -> bytes:
    """The bytes cut off, with bits flipped, with two parts swapped, or with bytes near the head overwritten."""
    draws, data = random.Random(seed), bytearray(whole)
    if seed % 4 == 0:
        return bytes(data[: draws.randrange(len(data))])
    if seed % 4 == 1:
        for _ in range(draws.choice((1, 3, 20))):
            data[draws.randrange(len(data))] ^= 1 << draws.randrange(8)
    elif seed % 4 == 2:
        first, second = sorted(draws.randrange(len(data)) for _ in range(2))
        size = min(draws.randrange(1, 400), len(data) - second)
        data[first : first + size], data[second : second + size] = (
            data[second : second + size],
            data[first : first + size],
        )
    else:
        for _ in range(4):
            data[min(int(draws.expovariate(1 / 300)), len(data) - 1)] = draws.choice((0, 127, 255))
    return bytes(data)


@pytest.mark.parametrize("kind", list(SAMPLES))
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path: Path, kind: str) -> None:
    sample = SAMPLES[kind](tmp_path)
    whole, target = sample.read_bytes(), tmp_path / f"damaged{sample.suffix}"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refusals: list[InputError] = []
    for seed in range(ROUNDS.get(kind, 20)):
        target.write_bytes(damaged(whole, seed))
        try:
            read_table(target)
        except InputError as error:
            refusals.append(error)
    assert all("\n" not in str(error) and error.file is not None and error.hint for error in refusals)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB
    assert refusals or kind in ("asc", "log", "nmea")  # of a text, single lines are left out


@pytest.mark.parametrize("kind", ["blf", "ros1", "mcap", "matlab 7.3", "mdf"])
def test_the_command_line_says_it_in_one_line(
    tmp_path: Path, kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    sample = SAMPLES[kind](tmp_path)
    target = tmp_path / f"damaged{sample.suffix}"
    target.write_bytes(sample.read_bytes()[:100].ljust(2000, b"\xff"))
    assert main(["inspect", str(target)]) == 2
    sentence = capfd.readouterr().err.strip().splitlines()
    assert len(sentence) == 1
    assert str(target) in sentence[0]
    assert "Traceback" not in sentence[0]


@pytest.mark.parametrize("suffix", [".mf4", ".blf", ".bag", ".db3", ".mcap", ".mat"])
def test_nothing_but_zeros_is_refused_by_the_reader_that_its_name_calls(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"log{suffix}"
    path.write_bytes(bytes(5000))
    with pytest.raises(InputError, match=r"is a damaged|has no numeric column"):  # zeros are an empty MAT 4
        read_table(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="is empty"):
        read_table(path)


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"'not_there' is needed; pip install 'terragrip\[formats\]'"):
        needed("not_there.at_all", "a log")
    path = SAMPLES["asc"](tmp_path)
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(InputError, match=r"pip install 'terragrip\[formats\]'"):
        read_table(path)


@pytest.mark.parametrize("version", [1, 9])
def test_an_object_without_a_size_ends_a_blf_log(tmp_path: Path, version: int) -> None:
    """python-can read it for ever (found by fuzz/parsers.py)."""
    path = tmp_path / "log.blf"
    with can.BLFWriter(path, compression_level=0) as log:
        for k in range(50):
            log.on_message_received(can.Message(timestamp=0.1 * k, arbitration_id=0x0CFE49F0, data=bytes(8)))
    content = bytearray(path.read_bytes())
    heads = [one.start() for one in re.finditer(b"LOBJ", content)]
    # behind the container's head and 30 frames
    content[heads[31] + 6 : heads[31] + 12] = struct.pack("<HI", version, 0)
    path.write_bytes(content)
    assert "30 messages before were read" in " ".join(read_table(path).notes)

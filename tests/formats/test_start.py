"""When a log was recorded, by its dates or its stamps, and by which profile it was read: the file of estimates says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.formats.log_blocks import log_in_blocks
from terragrip.formats.profile import SHIPPED, Profile

FIRST = pd.Timestamp("2024-05-17 06:30:00.5")
ROWS = 400


def frame(stamps: Any) -> pd.DataFrame:
    rng = np.random.default_rng(3)
    speed = 1 + 0.02 * rng.standard_normal(ROWS)
    return pd.DataFrame({"t": stamps, "v": speed, "w": 2.1 * speed})


def profile(**time: Any) -> Profile:
    return Profile.from_dict(
        {
            "name": "mine",
            "time": {"from": "t", **time},
            "channels": {"ground_speed": "v", "wheel_speed_drive": "w"},
        }
    )


DATES = pd.date_range(FIRST, periods=ROWS, freq="100ms")
SINCE_1970 = DATES.as_unit("ns").astype("int64")
STAMPS = {
    "dates": (DATES, {}),
    "dates with a zone": (DATES.tz_localize("UTC").tz_convert("Europe/Berlin"), {}),
    "nanoseconds since 1970": (SINCE_1970, {"unit": "ns"}),
    "nanoseconds since 1970, from the first": (SINCE_1970, {"unit": "ns", "zero": "first"}),
    "milliseconds since 1970": (SINCE_1970 // 1_000_000, {"unit": "ms"}),
}  # fmt: skip


@pytest.mark.parametrize("kind", STAMPS)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("in_blocks", [False, True], ids=["whole", "in blocks"])
def test_the_clock_of_the_first_row(
    kind: str, suffix: str, in_blocks: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stamps, time = STAMPS[kind]
    table, path = frame(stamps), tmp_path / f"log{suffix}"
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path, index=False)
    if in_blocks:
        for module in ("csv", "parquet"):
            monkeypatch.setattr(f"terragrip.formats.{module}._LONG", 0)
        monkeypatch.setattr("terragrip.formats.parquet.ROWS", 150)
        log = log_in_blocks(path, profile(**time))
        first, *others = list(log.blocks())
        assert (log.from_disk, bool(others)) == (True, suffix == ".parquet")
    else:
        first = tg.read(path, profile(**time))
    assert abs(first.to_pandas().index[0] - FIRST.tz_localize("UTC")) < pd.Timedelta("2us")
    assert first.profiles == (profile(**time).to_dict(),)


def test_a_log_without_a_clock_has_none(tmp_path: Path) -> None:
    frame(np.arange(ROWS) / 10).to_csv(tmp_path / "log.csv", index=False)
    recording = tg.read(tmp_path / "log.csv", profile())
    assert recording.start is None
    assert isinstance(recording.to_pandas().index, pd.RangeIndex)


def test_stamps_in_a_wrong_unit_are_no_clock(tmp_path: Path) -> None:
    frame(SINCE_1970 // 1_000_000).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(tg.InputError, match="since 1970 in ms"):
        tg.read(tmp_path / "log.csv", profile(unit="s"))
    frame(SINCE_1970 // 1_000_000_00).to_csv(tmp_path / "log.csv", index=False)  # in tenths of a second
    recording = tg.read(tmp_path / "log.csv", profile(unit="s"))
    assert recording.clock_zero is None
    assert isinstance(recording.to_pandas().index, pd.RangeIndex)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_profile_comes_back_from_what_the_file_keeps(name: str) -> None:
    known = Profile.load(name)
    assert Profile.from_dict(known.to_dict()).to_dict() == known.to_dict()
    assert Profile.from_dict(known.to_dict()).channels == known.channels


def test_a_profiles_content_is_what_its_file_says(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("channels:\n  ground_speed: {from: v}\n")
    assert Profile.load(tmp_path / "p.yaml").to_dict() == {"channels": {"ground_speed": {"from": "v"}}}
    (tmp_path / "q.yaml").write_text("dbc: bus.dbc\nchannels:\n  ground_speed: {from: v}\n")
    assert Profile.load(tmp_path / "q.yaml").to_dict()["dbc"] == [str(tmp_path / "bus.dbc")]


def test_the_file_of_estimates_says_when_and_by_which_profile(tmp_path: Path) -> None:
    import json

    import pyarrow.parquet as pq

    frame(DATES).to_parquet(tmp_path / "log.parquet", index=False)
    vehicle = tg.Vehicle.from_dict(
        {"mass": 5000, "axles": {"rear": {"mass": 5000, "wheels": ["drive"]}}, "wheel": {"radius": 0.48, "inertia": 10}}
    )  # fmt: skip
    tg.estimate_file(tmp_path / "log.parquet", vehicle, tmp_path / "e.parquet", profile=profile())
    about = json.loads(pq.read_schema(tmp_path / "e.parquet").metadata[b"terragrip"])["recording"]
    assert about["start"] == "2024-05-17T06:30:00.500000+00:00"
    assert Profile.from_dict(about["profile"]) == profile()

"""Whatever comes in: never a traceback, and what cannot be read is counted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.formats import Profile
from terragrip.formats.nmea_sentences import sentences
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed
from terragrip.live.frame_decoder import FrameDecoder
from terragrip.live.inbox import Inbox
from terragrip.live.payload import unpacker
from terragrip.live.wal import MAGIC, Reading, WriteAhead

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
NAMES = ("time", "ground_speed", "wheel_speed_fl", "pitch", "unknown")
PROFILE = Profile.from_dict(
    {
        "time": {"from": "t", "unit": "ms", "zero": "first"},
        "channels": {
            "ground_speed": {
                "from": ["fast", "*slow*"],
                "unit": "km/h",
                "invalid": [[900, 1000]],
                "delay": "50 ms",
            },
            "wheel_speed_fl": {"norm_of": ["time", "unknown"]},
            "pitch": {"pitch_of": ["time", "pitch", "unknown", "ground_speed"]},
            "drive_torque_fl": {"from": "pitch", "over": "ground_speed", "over_minimum": 0.1, "unit": "W s"},
        },
    }
)


def feed(profile: Profile | None) -> Feed:
    payload = None if profile is None else profile.payload
    return Feed(0, "test", Decoder(profile), unpacker(payload), Inbox(), after=0.0)


@given(st.binary(max_size=60) | anything.map(lambda value: json.dumps(value).encode()), st.booleans())
def test_any_message(data, with_profile):
    result = feed(PROFILE if with_profile else None)
    result.message(data)
    result.message(data, topic="a/b")
    json.dumps(result.inbox.notes())
    assert all(isinstance(value, float) for sample in result.inbox.samples for value in sample[3].values())


@given(st.lists(st.dictionaries(st.sampled_from((*NAMES, "t", "fast", "a slow one")), anything), max_size=5))
def test_any_fields(messages):
    for profile in (None, PROFILE):
        result = feed(profile)
        for fields in messages:
            result.fields(fields)
        for _, _, stamp, values in result.inbox.samples:
            assert all(abs(number) < float("inf") for number in (stamp, *values.values()))


@given(st.integers(0, (1 << 29) - 1), st.booleans(), st.binary(max_size=64))
def test_any_frame(identifier, extended, data):
    fields = FrameDecoder([], lambda name: True).fields(identifier, extended, data)
    assert all(isinstance(value, float) for value in fields.values())


@given(st.binary(max_size=100) | st.text(alphabet="$GPRMCVTA,.0123456789*NWE-", max_size=80).map(str.encode))
def test_any_sentence(line):
    good, damaged = sentences(line.decode("ascii", "replace"))
    assert damaged >= 0
    assert all(abs(value) < float("inf") for sentence in good for value in sentence.fields.values())


@given(data=st.data())
def test_any_damage_to_a_write_ahead_file(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("wal") / "wal.log"
    wal = WriteAhead(path)
    for k in range(20):
        wal.add("S", (float(k), 0, float(k), {"ground_speed": 1.0, f"wheel_speed_{k % 3}": 2.0}))
        wal.add("T", float(k))
        wal.add("N", {"k": k})
    wal.close()
    whole = list(Reading(path))
    assert len(whole) == 60
    content = bytearray(path.read_bytes())
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=3)):
        content[place] ^= data.draw(st.integers(1, 255))
    cut = data.draw(st.integers(0, len(content)))
    path.write_bytes(content[:cut])
    reading = Reading(path)
    result = list(reading)
    assert result == whole[: len(result)]
    assert reading.good <= max(cut, len(MAGIC))


def test_numbers_of_numpy_come_back(tmp_path: Path) -> None:
    wal = WriteAhead(tmp_path / "wal.log")
    wal.add("S", (1.0, 0, 1.0, {"ground_speed": np.float32(0.5), "engine_speed": np.int64(3)}))
    wal.close()
    assert list(Reading(tmp_path / "wal.log")) == [
        ("S", [1.0, 0, 1.0, {"ground_speed": 0.5, "engine_speed": 3.0}])
    ]


def test_a_write_ahead_file_of_another_version_is_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "wal.log"
    path.write_bytes(b"TGWAL2\r\n" + bytes(40))
    with pytest.raises(InputError, match="another version"):
        Reading(path)
    assert path.stat().st_size == 48

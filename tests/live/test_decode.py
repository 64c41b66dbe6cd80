"""A message gives what the same profile makes of the same row of a log."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile
from terragrip.live.decode import Decoder, check_channels
from terragrip.live.payload import Unreadable, from_json, unpacker

PROFILE = {
    "time": {"from": "t", "unit": "ms"},
    "channels": {
        "ground_speed": {"from": "v", "unit": "km/h", "invalid": [[60, 100]], "sign": -1},
        "wheel_speed_fl": {"from": "rpm_left", "unit": "rpm", "scale": 0.1, "offset": 2.0},
        "wheel_speed_fr": {"from": ["absent", "*_right"], "unit": "rpm"},
        "drive_torque_fl": {
            "from": "power",
            "over": "rpm_left",
            "over_minimum": 5.0,
            "scale": 9.5,
            "unit": "N m",
        },
        "pitch": {"pitch_of": ["qx", "qy", "qz", "qw"]},
        "roll": {"roll_of": ["qx", "qy", "qz", "qw"]},
        "drawbar_force": {"from": "nowhere", "else": {"norm_of": ["px", "py"], "unit": "kN"}},
        "hitch_load": {"sum_of": {"px": 2.0, "py": -0.5}, "unit": "kN", "invalid": [[60, 100]]},
        "altitude": {"from": "gone", "optional": True},
        "acceleration_z": {"constant": 9.81, "sign": -1},
    },
}


@pytest.fixture(scope="module")
def log():
    draws = np.random.default_rng(3)
    names = ["v", "rpm_left", "rpm_right", "power", "px", "py", "qx", "qy", "qz", "qw"]
    table = pd.DataFrame(draws.uniform(-40, 90, (50, len(names))), columns=names)
    table[["qx", "qy", "qz", "qw"]] = draws.uniform(0.1, 1.0, (50, 4))
    quaternion = table[["qx", "qy", "qz", "qw"]].to_numpy()
    table[["qx", "qy", "qz", "qw"]] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    table.insert(0, "t", 10.0 * np.arange(50))
    return table


def test_as_a_profile_makes_of_a_log(log):
    recording = Profile.from_dict(PROFILE).apply(log)
    decoder = Decoder(Profile.from_dict(PROFILE))
    for k, fields in enumerate(log.to_dict("records")):
        ((stamp, values),) = decoder.samples(fields)
        expected = {
            name: float(column[k]) for name, column in recording.channels.items() if np.isfinite(column[k])
        }
        assert stamp == pytest.approx(recording.time[k])
        assert values == expected  # to the last digit
    assert not decoder.unreadable


def test_a_delay_makes_a_sample_of_its_own():
    profile = {"channels": {"ground_speed": {"from": "v", "delay": "50 ms"}, "wheel_speed_fl": {"from": "w"}}}
    result = Decoder(Profile.from_dict(profile)).samples({"time": 1.0, "v": 2.0, "w": 3.0})
    assert dict(result) == {0.95: {"ground_speed": 2.0}, 1.0: {"wheel_speed_fl": 3.0}}
    # So too where the message has no stamp, as a receiver on a serial line.
    result = Decoder(Profile.from_dict(profile)).samples({"v": 2.0, "w": 3.0}, arrival=1.0)
    assert dict(result) == {0.95: {"ground_speed": 2.0}, 1.0: {"wheel_speed_fl": 3.0}}


def test_a_delay_longer_than_rows_wait_is_refused(vehicle):
    delayed = {"ground_speed": {"from": "v", "delay": "200 ms"}}
    profile = Profile.from_dict({"channels": {**delayed, **{f"wheel_speed_{w}": w for w in vehicle.wheels}}})
    with pytest.raises(InputError, match=r"channels\.ground_speed: has a delay of 200 ms.*--window 220"):
        check_channels(profile, vehicle, 0.02)
    check_channels(profile, vehicle, 0.22)


def test_the_better_source_wins_once_it_speaks():
    decoder = Decoder(Profile.from_dict({"channels": {"ground_speed": {"from": ["radar", "gnss"]}}}))
    assert decoder.samples({"gnss": 1.0}) == [(None, {"ground_speed": 1.0})]
    assert decoder.samples({"radar": 2.0}) == [(None, {"ground_speed": 2.0})]
    assert decoder.samples({"gnss": 1.0}) == []


def test_a_divisor_may_come_in_a_message_of_its_own():
    over = {"from": "power", "over": "speed", "over_minimum": 0.5, "unit": "N m"}
    decoder = Decoder(Profile.from_dict({"channels": {"drive_torque_fl": over}}))
    assert decoder.samples({"power": 10.0}) == []
    assert decoder.samples({"speed": 4.0}) == []
    assert decoder.samples({"power": 10.0}) == [(None, {"drive_torque_fl": 2.5})]


def test_the_sources_own_units_count_where_the_profile_is_silent():
    decoder = Decoder(Profile.from_dict({"channels": {"ground_speed": "v"}}))
    decoder.units = {"v": "km/h"}
    assert decoder.samples({"v": 36.0}) == [(None, {"ground_speed": pytest.approx(10.0)})]


def test_nanoseconds_since_1970_keep_their_digits():
    decoder = Decoder(
        Profile.from_dict(
            {"time": {"from": "ns", "unit": "ns", "zero": "first"}, "channels": {"ground_speed": "v"}}
        )
    )
    first = 1_700_000_000_123_456_789
    for wrong in (math.nan, 10**400, True):  # the first stamp is the first number
        assert decoder.samples({"ns": wrong, "v": 1.0}) == [(None, {"ground_speed": 1.0})]
    stamps = [decoder.samples({"ns": first + 1000 * k, "v": 1.0})[0][0] for k in range(3)]
    assert stamps == pytest.approx([0.0, 1e-6, 2e-6], abs=1e-12)


def test_what_looks_ahead_is_refused():
    profile = Profile.from_dict({"channels": {"ground_speed": {"derivative_of": ["x", "y"], "unit": "m"}}})
    with pytest.raises(InputError, match="needs future samples"):
        Decoder(profile)


ROW = '{"time": 1.5, "ground_speed": NaN, "soil": "Löss {"}'


@pytest.mark.parametrize(
    "data",
    [
        ROW.encode(),
        f" \r\n{ROW}\n\n".encode(),
        ROW.encode("utf-16"),
        ROW.encode("utf-8-sig"),
        f"[{ROW}]".encode(),
        json.dumps(json.loads(ROW)).encode(),
    ],
)
def test_json_is_read_however_it_is_written(data):
    (fields,) = from_json(data)
    assert (fields["time"], fields["soil"]) == (1.5, "Löss {")
    assert np.isnan(fields["ground_speed"])


@pytest.mark.parametrize("data", [b"", b"{", b'{"a": 1} x', b'{"a": 1}, {"b": 2}', b"\xff\xfe{", b"7"])
def test_what_is_no_json_object_is_said(data):
    with pytest.raises(Unreadable, match="JSON"):
        from_json(data)


def test_json_lines_are_samples():
    assert from_json(b'{"a": 1}\n{"a": 2}\n') == [{"a": 1}, {"a": 2}]


def test_a_message_of_the_time_alone_is_no_sample_however_often_it_comes():
    decoder = Decoder(None)
    assert [decoder.samples({"time": float(k)}) for k in range(3)] == [[], [], []]


def test_numbers_of_the_other_byte_order_are_named() -> None:
    payload = Profile.from_dict(
        {
            "payload": {"format": "doubles", "fields": ["t", "fl", "fr", "v"]},
            "time": {"from": "t"},
            "channels": {"ground_speed": "v", "wheel_speed_fl": "fl", "wheel_speed_fr": "fr"},
        }
    ).payload
    unpack = unpacker(payload)
    right = [
        (0.02, 2.61, 2.58, 0.5),
        (1e9, math.nan, 1e-200, 0.0),
        (3.0, 1e300, 2.0, 1.0),
        (1e-30, 1e-40, 2.0, 1e-25),
        (1e25, 3.0, 1e25, 1.0),
        (0.0, 0.0, 1e300, 1.0),
        (math.inf, math.inf, -math.inf, 1.0),
    ]
    for sample in right:
        assert unpack(struct.pack("<4d", *sample))[0]["t"] == sample[0]
    with pytest.raises(Unreadable, match="byte_order"):
        unpack(struct.pack(">4d", 0.02, 2.61, 2.58, 0.5))


def test_bytes_in_a_payload_do_not_stop_its_numbers() -> None:
    payload = Profile.from_dict(
        {
            "payload": {"format": "struct", "layout": "cQ2d", "fields": ["kind", "t", "fl", "v"]},
            "time": {"from": "t", "unit": "ns"},
            "channels": {"ground_speed": "v", "wheel_speed_fl": "fl"},
        }
    ).payload
    unpack = unpacker(payload)
    assert unpack(struct.pack("<cQ2d", b"a", 1, 2.5, 0.5))[0]["v"] == 0.5
    with pytest.raises(Unreadable, match="byte_order"):
        unpack(struct.pack(">cQ2d", b"a", 1, 2.61, 0.51))

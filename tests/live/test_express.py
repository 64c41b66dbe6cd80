"""The express way changes nothing but the work: everything that comes out is what the ordinary way gives, to the last bit."""

from __future__ import annotations

import json
import random
import shutil
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drives import drive
from machine import running
from terragrip._kernel import ffi, lib
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.live import Recorder, read_record
from terragrip.live.message import ESTIMATE, EVENT
from terragrip.live.record_folder import last_snapshot, wal_path
from terragrip.live.service import Service

NUMBERS = r"-?(0|[1-9][0-9]{0,20})(\.[0-9]{1,25})?([eE][+-]?[0-9]{1,3})?"


def number_at_the_start_of(text: str) -> tuple[float, int] | None:
    value, data = ffi.new("double *"), ffi.new("char[]", text.encode())
    end = lib.tg_read_number(data, value)
    return None if end == ffi.NULL else (value[0], end - data)


def same(a: float, b: float) -> bool:
    return struct.pack("d", a) == struct.pack("d", b)


@given(
    st.one_of(
        st.from_regex(NUMBERS, fullmatch=True), st.floats(allow_nan=False, allow_infinity=False).map(repr)
    )
)
def test_a_number_that_is_read_is_the_nearest_double_as_pythons_json_reads_it(text):
    found = number_at_the_start_of(text + ", ")
    assert found is None or (same(found[0], float(json.loads(text))) and found[1] == len(text))


@given(st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-25))
def test_what_sensors_say_is_read(number):
    found = number_at_the_start_of(repr(number))
    assert found is not None
    assert same(found[0], number)


@pytest.mark.parametrize(
    "text", ["", "-", ".5", "1.", "1.e5", "1e", "1e+", "01", "-01", "+1", "NaN", "Infinity", "-0", "0x1"]
)
def test_what_is_no_json_number_is_left_to_who_can_tell(text):
    found = number_at_the_start_of(text)
    assert found is None or text[found[1] :] == "x1"


@pytest.mark.parametrize("digits", [15, 16, 17, 18])
def test_numbers_near_the_middle_of_two_doubles_are_rounded_right_or_left_out(digits):
    generator = random.Random(digits)
    for _ in range(3000):
        low = generator.uniform(0.1, 100.0)
        middle = (np.longdouble(low) + np.longdouble(np.nextafter(low, 1e9))) / 2
        text = np.format_float_positional(middle, precision=digits, unique=False, fractional=False)
        found = number_at_the_start_of(text)
        assert found is None or same(found[0], float(text)), text


def rows_in(recording) -> list[list[float]]:
    return np.column_stack([recording.time, *recording.channels.values()]).tolist()


def text_of(recording, row: list[float]) -> bytes:
    return json.dumps(dict(zip(["time", *recording.channels], row, strict=True))).encode()


def texts(recording) -> list[tuple[float, bytes]]:
    """Arrival and message of each row."""
    return [(row[0], text_of(recording, row)) for row in rows_in(recording)]


def stuck_at_6_s(vehicle, seconds: float):
    """A recording of a vehicle that comes to stand with spinning wheels."""
    recording = drive(seconds, imu=True).recording
    recording.channels["ground_speed"][605:] = 0.0
    for wheel in vehicle.wheels:
        recording.channels[f"wheel_speed_{wheel}"][605:] = 4.0
    return recording


def jittered(recording, seed: int) -> list[tuple[float, bytes]]:
    """Arrival and text of each message of a drive; with all that senders and networks do to some of them."""
    generator = random.Random(seed)
    names, found = ["time", *recording.channels], []
    for k, row in enumerate(rows_in(recording)):
        message = dict(zip(names, row, strict=True))
        chance = generator.random() if k > 40 else 1.0
        if chance < 0.01:
            continue
        if chance < 0.02:
            message["ground_speed"] = None
        elif chance < 0.03:
            message = dict(reversed(message.items()))
        elif chance < 0.04:
            del message["drawbar_force"]
        elif chance < 0.05:
            message["slope"] = {"x": 1.0}
        elif chance < 0.06:
            message["ground_speed"] = "fast"
        elif chance < 0.065:
            message["time"] += 86400.0
        elif chance < 0.07:
            message["wheel_speed_fl"] = 1e300
        elif chance < 0.08:
            message["drawbar_force"] = round(message["drawbar_force"])
        data = json.dumps(message, separators=(",", ":") if chance > 0.98 else None).encode()
        if 0.11 < chance < 0.14:
            place = generator.randrange(len(data))
            data = data[:place] + bytes([generator.randrange(256)]) + data[place + 1 :]
        found.append((row[0] + 0.002 * generator.random(), data))
        if 0.08 < chance < 0.09:
            found.append((row[0] + 0.003, data))
        elif 0.09 < chance < 0.1:
            found[-2:] = (
                [(found[-1][0], found[-2][1]), (found[-2][0], found[-1][1])] if len(found) > 1 else found
            )
        elif 0.1 < chance < 0.105:
            found.append((row[0] + 0.004, data[:-5]))
        elif 0.105 < chance < 0.11:
            found.append((row[0] + 0.3, data.replace(b'"time": ', b'"time": 9')))
    return found


async def fed(service, sent, last=lambda: None) -> None:
    """Run a service on these messages by a clock of their own, then do ``last``, and end it."""
    now = [1.7e9]
    service.inbox.clock = lambda: now[0]
    async with running(service):
        for arrival, data in sent:
            now[0] = 1.7e9 + arrival
            service.feeds[0].burst([data])
            if service._done.done():  # it failed: a loop would end it now
                break
        last()


async def lived(vehicle, port, folder, sent, express: bool):
    """All that a service published of these messages, its state, its record, and how many went the express way."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=folder)
    passed = [0]
    if not express:
        service.feeds[0].express = lambda messages: False
    else:
        shorter = service.feeds[0].express

        def counted(messages) -> bool:
            done = shorter(messages)
            passed[0] += done
            return done

        service.feeds[0].express = counted
    now = [1.7e9]
    service.inbox.clock = lambda: now[0]
    async with running(service):
        for arrival, data in sent:
            now[0] = max(now[0], 1.7e9 + arrival)
            service._tick()  # the loop's timer, which has no part in a run without a pause
            service.feeds[0].burst([data])
        counts, state = service.core.counts.state(), service.core.state()
        messages = service.feeds[0].messages
    told = [(m.kind, m.json()) for m in service.seen if m.kind in (ESTIMATE, EVENT)]
    return told, counts, state, messages, read_record(folder), passed[0]


@pytest.mark.asyncio
@pytest.mark.parametrize("seed", range(12))
async def test_it_gives_what_the_ordinary_way_gives_whatever_comes(tmp_path, vehicle, port, seed):
    sent = jittered(drive(8.0, imu=True, seed=seed).recording, seed)
    runs = [
        await lived(vehicle, port, tmp_path / name, sent, express)
        for name, express in (("express", True), ("ordinary", False))
    ]
    (
        (told, counts, state, messages, (kept, estimates), passed),
        (told_2, counts_2, state_2, messages_2, record_2, none),
    ) = runs
    assert passed > len(sent) / 10
    assert none == 0
    assert told == told_2
    assert counts == counts_2
    assert messages == messages_2
    assert state == state_2
    kept_2, estimates_2 = record_2
    assert np.array_equal(kept.time, kept_2.time)
    for mine, other in ((kept.channels, kept_2.channels), (estimates.columns, estimates_2.columns)):
        assert mine.keys() == other.keys()
        for name in mine:
            assert np.array_equal(mine[name], other[name], equal_nan=True), name


@pytest.mark.asyncio
async def test_in_good_order_nearly_all_go_that_way_and_warnings_come_at_once(tmp_path, vehicle, port):
    sent = texts(stuck_at_6_s(vehicle, 12.0))
    told, *_, passed = await lived(vehicle, port, tmp_path / "express", sent, express=True)
    told_2, *_ = await lived(vehicle, port, tmp_path / "ordinary", sent, express=False)
    assert passed > 0.9 * len(sent)
    assert any(kind == EVENT and b"stuck" in text for kind, text in told)
    assert told == told_2


@pytest.mark.asyncio
@pytest.mark.parametrize("seed", range(20))
async def test_killed_at_any_byte_it_goes_on_as_one_run(tmp_path, vehicle, port, short, seed):
    """The write-ahead file, cut anywhere, is resumed; what is behind the cut is sent again."""
    recording, folder = short.recording, tmp_path / "record"
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=folder)

    def killed():
        service.engine.write()
        shutil.copytree(folder, tmp_path / "killed")

    await fed(service, texts(recording), killed)
    torn = wal_path(tmp_path / "killed", last_snapshot(tmp_path / "killed") + 1)
    data = torn.read_bytes()
    torn.write_bytes(data[: random.Random(seed).randrange(len(data) // 3, len(data))])
    again = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "killed")
    newest = again.core.time
    await fed(again, [(2.0 + at, data) for at, data in texts(recording) if at > newest])
    assert newest < recording.time[-1]
    kept, estimates = read_record(tmp_path / "killed")
    through = TractionEstimator(vehicle, channels=tuple(kept.channels)).update_block(kept)
    assert np.array_equal(kept.time, recording.time)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


@pytest.mark.asyncio
@pytest.mark.parametrize("swapped", range(202, 234))
async def test_a_source_that_doubles_its_pace_is_not_taken_for_late(tmp_path, vehicle, port, swapped):
    """The period by which rows are waited for changes while they go the express way: a late sample finds its place as ever."""
    recording = drive(3.0, imu=True, rate=200.0).recording
    rows = rows_in(recording)
    rows = [*rows[0:400:2], *rows[400:]]
    rows[swapped], rows[swapped + 1] = rows[swapped + 1], rows[swapped]
    sent = [(k / 200, text_of(recording, row)) for k, row in enumerate(rows)]
    runs = [await lived(vehicle, port, tmp_path / str(express), sent, express) for express in (True, False)]
    assert runs[0][0] == runs[1][0]
    assert runs[0][2] == runs[1][2]


@pytest.mark.asyncio
@pytest.mark.parametrize(
    "name",
    [r"wheel_speed_\ud800", r"wheel_speed_a\"b", r"wheel_speed_a\b", r"wheel_speed_\u0000", "wheel_speed_ö"],
)
async def test_fields_of_strange_names_are_no_channels_and_harm_nobody(tmp_path, vehicle, port, short, name):
    sent = [(at, data[:-1] + f', "{name}": 1.0}}'.encode()) for at, data in texts(short.recording)[:120]]
    told, counts, _, messages, (kept, _), _ = await lived(
        vehicle, port, tmp_path / "record", sent, express=True
    )
    assert messages == 120
    assert np.array_equal(kept.time, short.recording.time[:120])
    assert set(counts) == set(short.recording.channels)
    assert sum(kind == ESTIMATE for kind, _ in told) == 120


@pytest.mark.asyncio
async def test_a_listener_that_asks_for_the_core_changes_no_order(vehicle, port):
    service, seen = Service(vehicle, [f"udp://127.0.0.1:{port}"]), []
    service.listeners += [lambda message: service.core.rows, seen.append]
    await fed(service, texts(stuck_at_6_s(vehicle, 9.0)))
    stuck = next(k for k, m in enumerate(seen) if m.kind == EVENT and m.data["kind"] == "stuck")
    assert seen[stuck - 1].kind == ESTIMATE
    assert seen[stuck - 1].time == seen[stuck].time


@pytest.mark.asyncio
async def test_the_record_is_closed_whole_though_a_listener_raises(tmp_path, vehicle, port):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")

    def broken(message):
        if b"stuck" in message.json():
            raise RuntimeError("a listener's own")

    service.listeners.append(broken)
    with pytest.raises(RuntimeError, match="a listener's own"):
        await fed(service, texts(stuck_at_6_s(vehicle, 9.0)))
    kept, estimates = read_record(tmp_path / "record")
    assert kept.time[-1] > 6.0
    assert estimates["event"][-1] == "stuck"
    assert list((tmp_path / "record").glob("recording-*.parquet"))


@pytest.mark.asyncio
async def test_a_disk_that_is_full_as_the_last_rows_are_written_is_said(
    tmp_path, vehicle, port, short, monkeypatch
):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")

    said = []

    def full(self, block):
        raise OSError(28, "No space left on device")

    def closed():
        assert service.engine._express._estimates  # rows that wait
        monkeypatch.setattr(Recorder, "passed", full)
        service.engine.close()
        said.append(service.engine.failure)

    with pytest.raises(InputError, match="No space left"):
        await fed(service, texts(short.recording)[:217], closed)
    assert "No space left" in said[0]

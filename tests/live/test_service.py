"""The whole service: what a user sends comes back as estimates, and faults are named, counted and survived."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import json
import socket
import struct
import time
from collections import deque

import numpy as np
import pytest

from drives import drive, robot
from machine import Sender, events, is_settled, messages, rows_of, running, until
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.formats import Profile
from terragrip.live import read_record
from terragrip.live.options import Options
from terragrip.live.service import Service
from terragrip.live.supervision import cancelled

pytestmark = pytest.mark.asyncio


async def test_a_replay_gives_what_the_estimator_gives(tmp_path, vehicle, short):
    log = tmp_path / "drive.parquet"
    short.recording.to_pandas().to_parquet(log)
    service = Service(vehicle, [f"replay:{log}?speed=max"], record=tmp_path / "record")
    await service.run()
    _, estimates = read_record(tmp_path / "record")
    through = TractionEstimator(vehicle, channels=tuple(short.recording.channels)).update_block(
        short.recording
    )
    assert np.array_equal(estimates.time, through.time)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


async def test_a_replay_does_not_wait_for_a_winter(tmp_path, vehicle, short, monkeypatch):
    """Five months at ten times the pace are two weeks, without a word."""
    monkeypatch.setattr("terragrip.live.links.replay._PAUSE", 0.01)
    table = short.recording.to_pandas()
    table["time"] += 150 * 86400.0 * (table["time"] > 3)
    table.to_parquet(tmp_path / "drive.parquet")
    service = Service(vehicle, [f"replay:{tmp_path / 'drive.parquet'}?speed=10"])
    async with asyncio.timeout(60):
        await service.run()
    assert service.core.rows == len(table)


async def test_no_object_holds_its_caller(tmp_path, vehicle, short, port, sender):
    """References lead one way, from source to sink: no walk along the live service's objects comes back to where it was."""
    sinks = ["udp://127.0.0.1:9", f"studio://127.0.0.1:{port}"]
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], sinks, record=tmp_path)
    async with running(service):
        sender.send(*messages(short.recording, 20))
        await until(lambda: service.core.rows == 20)
        assert len(walked(service, [], set())) > 15


async def test_a_task_that_loses_its_cancellation_is_cancelled_again():
    """As `wait_for` of Python 3.11 may lose it, by which libraries wait: the service did not end."""

    async def loses_one():
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.Event().wait()
        await asyncio.Event().wait()

    task = asyncio.create_task(loses_one())
    await asyncio.sleep(0)
    await asyncio.wait_for(cancelled([task]), 60)
    assert task.cancelled()


def walked(thing, path: list, done: set) -> set:
    """The ids of all objects of `terragrip.live` that can be reached from one; fails where one of them is on the path to it."""
    if isinstance(thing, dict):
        parts = list(thing.values())
    elif isinstance(thing, list | tuple | set | deque):
        parts = list(thing)
    elif inspect.ismethod(thing):
        parts = [thing.__self__]
    elif inspect.isfunction(thing):
        parts = [cell.cell_contents for cell in thing.__closure__ or ()]
    elif type(thing).__module__.startswith("terragrip.live"):
        assert not any(thing is above for above in path), [type(one).__name__ for one in [*path, thing]]
        if id(thing) in done:
            return done
        done.add(id(thing))
        path = [*path, thing]
        names = [*getattr(thing, "__dict__", ()), *getattr(type(thing), "__slots__", ())]
        parts = [getattr(thing, name) for name in names]
    else:
        return done
    for part in parts:
        walked(part, path, done)
    return done


async def test_datagrams_in_estimates_out(vehicle, short, port, sender):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        receiver.setblocking(False)
        sink = f"udp://127.0.0.1:{receiver.getsockname()[1]}?columns=slip_*,soil_resistance*"
        service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [sink])
        loop, got = asyncio.get_running_loop(), []
        loop.add_reader(receiver, lambda: got.append(json.loads(receiver.recv(65536))))
        async with running(service):
            sender.send(*messages(short.recording, 300))
            await until(lambda: len([m for m in got if "slip_fl" in m and not m["predicted"]]) == 300)
        loop.remove_reader(receiver)
    result = [m for m in got if "slip_fl" in m and not m["predicted"]]
    assert [m["time"] for m in result] == short.recording.time[:300].tolist()
    assert {m["kind"] for m in result} == {"estimate"}
    assert result[-1].keys() == {
        "kind",
        "time",
        "arrival",
        "event",
        "predicted",
        "soil_resistance",
        "soil_resistance_std",
    } | {f"slip_{w}{std}" for w in vehicle.wheels for std in ("", "_std")}
    assert result[-1]["slip_fl"] == pytest.approx(short.truth["slip_fl"][299], abs=0.05)


async def test_each_message_by_udp_says_its_kind_and_what_was_learned(tmp_path, monkeypatch):
    monkeypatch.setattr("terragrip.estimation.learning.ROWS", 200)
    log = tmp_path / "drive.parquet"
    drive(6.0, noise=3.0).recording.to_pandas().to_parquet(log)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        receiver.setblocking(False)
        sink = f"udp://127.0.0.1:{receiver.getsockname()[1]}?columns=slip_fl"
        vehicle = robot(sensors={"drawbar_force": 4.0})
        service = Service(vehicle, [f"replay:{log}?speed=max"], [sink])
        got: list = []
        asyncio.get_running_loop().add_reader(receiver, lambda: got.append(json.loads(receiver.recv(65536))))
        await service.run()
        await until(lambda: got[-1]["kind"] == "status")
        asyncio.get_running_loop().remove_reader(receiver)
    kinds = {message["kind"] for message in got}
    assert {"estimate", "learned", "status"} <= kinds
    noise, held = service.core.learner.used(service.core.estimator)
    assert noise
    assert got[-1]["learned"] == {"noise": noise, "held": held}


async def test_simulinks_doubles_in_and_out(vehicle, short, port, sender):
    names = list(short.recording.channels)
    profile = Profile.from_dict(
        {
            "payload": {"format": "doubles", "fields": ["t", *names], "byte_order": "big"},
            "time": {"from": "t"},
            "channels": {name: name for name in names},
        }
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        sink = f"udp://127.0.0.1:{receiver.getsockname()[1]}?format=doubles&columns=ground_speed*"
        service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [sink], profile=profile)
        async with running(service):
            for time, values in list(rows_of(short.recording))[:50]:
                sender.send(struct.pack(f">{1 + len(names)}d", time, *(values[n] for n in names)))
            sender.send(b"seven b")
            await until(lambda: service.core.rows == 50)
            await until(lambda: events(service, "unreadable"))
        time, speed, std = struct.unpack("<3d", receiver.recv(100))
    assert time == short.recording.time[0]
    assert speed == pytest.approx(short.truth["ground_speed"][0], abs=5 * std)
    assert "7 bytes" in events(service, "unreadable")[0]


async def test_a_payload_that_is_no_json_or_no_number_is_named_counted_survived(vehicle, short, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    good = messages(short.recording, 100)
    async with running(service):
        sender.send(*good[:50], b"\xff\xfe", b"{", b"[1, 2]", b"12", {**good[50], "ground_speed": "fast"})
        sender.send({**good[51], "ground_speed": 1e999}, *good[52:])
        await until(lambda: service.core.rows == 100)
    counts = service.core.counts.by_channel
    assert counts["ground_speed"]["unreadable"] == 2
    assert counts["ground_speed"]["received"] == 98
    assert service.feeds[0].unreadable == 4
    assert any("not JSON" in text for text in events(service, "unreadable"))
    assert any("'fast'" in text for text in events(service, "unreadable"))


async def test_late_doubled_and_missing_are_counted_by_channel(vehicle, short, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], options=Options(window=0.05))
    good = messages(short.recording, 200)
    swapped = [*good[:60], good[61], good[60], *good[62:100], good[99], *good[105:150]]
    async with running(service):
        sender.send(*swapped)
        await until(lambda: service.core.rows == 145)
        sender.send(good[102], *good[150:])
        await until(lambda: service.core.rows == 195)
    mine = service.core.counts.by_channel["ground_speed"]
    assert (mine["late"], mine["doubled"], mine["missing"], mine["received"]) == (1, 1, 5, 197)
    times = [m.time for m in service.seen if m.kind == "estimate" and not m.row.predicted]
    assert times == sorted(times)


async def test_a_silent_source_is_said_and_estimates_go_on_with_growing_intervals(
    vehicle, short, port, sender
):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    good = messages(short.recording, 200)
    async with running(service):
        sender.send(*good[:100])
        await until(lambda: events(service, "source_lost"))
        predicted = [m.row for m in service.seen if m.kind == "estimate" and m.row.predicted]
        sender.send(*good[100:])
        await until(lambda: service.core.rows == 200)
        await until(lambda: events(service, "source_back"))
    assert len(predicted) >= 3
    spreads = [row.estimate.ground_speed_std for row in predicted]
    assert spreads == sorted(spreads)
    assert spreads[0] < spreads[-1]
    # What was only delayed finds the filter as if nothing had happened.
    through = TractionEstimator(vehicle, channels=service.core.estimator.channels)
    for row in rows_of(short.recording):
        if row[0] <= good[-1]["time"]:
            last = through.update({"time": row[0], **row[1]})
    kept = [m.row.estimate for m in service.seen if m.kind == "estimate" and not m.row.predicted]
    assert kept[-1].to_dict() == last.to_dict()


async def test_a_clock_that_jumps_by_a_day_is_named_and_time_goes_on(vehicle, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    speeds = dict.fromkeys([f"wheel_speed_{w}" for w in vehicle.wheels], 3.0) | {"ground_speed": 0.55}
    async with running(service):
        for k in range(160):
            sender.send({"time": k * 0.01 + (86400.0 if k >= 40 else 0.0), **speeds})
            await asyncio.sleep(0.01)
        await until(lambda: events(service, "clock_jump"))
        await until(lambda: service.core.rows == 160)
    assert "+86400" in events(service, "clock_jump")[0]
    assert 1.0 < service.core.time < 20.0


async def test_another_set_of_fields_is_named_and_survived(vehicle, short, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    good = messages(short.recording, 300)
    async with running(service):
        sender.send(*good[:150])
        await until(lambda: service.core.rows == 150)
        for message in good[150:]:
            del message["drive_torque_fl"]
            message["torque_front_left"] = 3.0
            sender.send(message)
            await asyncio.sleep(0.001)
        await until(lambda: service.core.rows == 300)
    assert events(service, "schema") == [
        "messages changed: without drive_torque_fl and with torque_front_left"
    ]
    assert events(service, "channel_lost") == ["drive_torque_fl comes no longer"]


async def test_where_estimates_cannot_keep_up_drops_are_counted(vehicle, short):
    service = Service(vehicle, ["udp://127.0.0.1:1"], capacity=10)
    async with running(service):
        for k in range(25):
            service.inbox.put(0, k * 0.01, {"ground_speed": 1.0})
        await until(lambda: events(service, "behind"))
    assert service.core.counts.by_channel["ground_speed"]["dropped"] == 15
    assert "15 values dropped" in events(service, "behind")[0]


async def test_a_full_disk_stops_the_record_not_the_estimates(
    tmp_path, vehicle, short, port, sender, monkeypatch
):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path)
    monkeypatch.setattr("terragrip.live.wal.os.write", _disk_full)
    task = asyncio.create_task(service.run())
    await until(lambda: is_settled(service))
    sender.send(*messages(short.recording, 100))
    await until(lambda: service.core.rows == 100 and events(service, "record_failed"))
    service.stop()
    with pytest.raises(InputError, match=r"the record stopped at .*No space left"):
        await task
    assert events(service, "record_failed")


def _disk_full(file: int, data: bytes) -> int:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        ("upd://127.0.0.1:9", "is not a source"),
        ("udp://127.0.0.1:9?speed=3", "has no option 'speed'"),
        ("udp://0.0.0.0:9", "name the senders"),
        ("udp://127.0.0.1", "names no port"),
        ("mqtt://user:secret@127.0.0.1/x", "credentials do not belong"),
        ("replay:nowhere.csv", "no such file"),
        ("replay:", "names no log"),
    ],
)
async def test_a_source_that_cannot_be_used_is_refused_in_one_line(source, problem):
    with pytest.raises(InputError) as refused:
        Service(robot(), [source])
    assert problem in str(refused.value)
    assert "secret" not in str(refused.value)


async def test_sources_with_clocks_of_their_own_share_one_time_base(vehicle, short, port, sender):
    """Wheels stamped since the robot's start, the receiver since 1970 by another clock 30 s off: rows in true order."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        other_port = probe.getsockname()[1]
    other = Sender(other_port)
    service = Service(
        vehicle, [f"udp://127.0.0.1:{port}", f"udp://127.0.0.1:{other_port}"], options=Options(window=0.1)
    )
    began = asyncio.get_running_loop().time()
    async with running(service):
        for message in messages(short.recording, 100):
            now = asyncio.get_running_loop().time() - began
            speed = message.pop("ground_speed")
            sender.send({**message, "time": 4.0 + now})
            other.send({"ground_speed": speed, "time": 1.7e9 + 30.0 + now})
            await asyncio.sleep(0.01)
        await until(lambda: service.core.counts.total("received") == 100 * len(short.recording.channels))
    other.close()
    rows = [
        message.row for message in service.seen if message.kind == "estimate" and not message.row.predicted
    ]
    times = np.array([row.estimate.time for row in rows])
    speeds = np.array([row.estimate.time for row in rows if "ground_speed" in row.values])
    wheels = np.array([row.estimate.time for row in rows if "wheel_speed_fl" in row.values])
    assert (np.diff(times) > 0).all()
    assert len(speeds) + service.core.counts.by_channel["ground_speed"]["late"] == 100
    # Sent together, they stand within a few ms of each other, and on the machine's clock.
    assert np.median(np.abs(speeds[:, None] - wheels).min(axis=1)) < 0.02
    assert abs(times[-1] - rows[-1].arrival) < 5.0


async def test_a_warning_of_the_estimator_is_an_event_once(vehicle, short, monkeypatch):
    """Whatever the kernel says when; here it is made to say it."""
    service = Service(vehicle, ["udp://127.0.0.1:1"])
    update = TractionEstimator.update_at

    def sinking(self, time, sample):
        estimate = update(self, time, sample)
        estimate.event = "immobilization" if 1.0 < estimate.time < 2.0 else ""
        return estimate

    monkeypatch.setattr(TractionEstimator, "update_at", sinking)
    async with running(service):
        for time, values in list(rows_of(short.recording))[:300]:
            service.feeds[0].sample(time, values)
        await until(lambda: service.core.rows == 300)
    (text,) = events(service, "immobilization")
    assert text.startswith("about to dig in: ground speed 0.6")
    assert "slip up to" in text


async def test_a_time_in_milliseconds_is_named(vehicle, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    speeds = dict.fromkeys([f"wheel_speed_{w}" for w in vehicle.wheels], 3.0) | {"ground_speed": 0.55}
    async with running(service):
        while not events(service, "units"):
            sender.send({"time": time.time() * 1000, **speeds})
            await asyncio.sleep(0.02)
    (said,) = events(service, "units")
    assert "unit: ms" in said
    assert "rows estimated" in service.summary()  # no date has a year that large


async def test_wheels_by_other_names_are_named_and_no_slip_is_claimed(vehicle, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    async with running(service):
        for k in range(30):
            sender.send({"time": 0.01 * k, "w_fl": 3.0, "drawbar_force": 100.0})
        await until(lambda: service.core.rows == 30)
    assert "what comes is drawbar_force" in events(service, "schema")[0]
    assert "no wheel's speed came" in service.summary()

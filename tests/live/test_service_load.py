"""Floods, full queues, late samples and threads that are too fast: what is lost is counted, and nothing waits in silence."""

from __future__ import annotations

import asyncio
import json
import threading

import pytest

from drives import drive
from machine import events, messages, running, until
from terragrip.live.message import STATUS, Message
from terragrip.live.service import Service
from terragrip.live.thread_bridge import ThreadBridge

pytestmark = pytest.mark.asyncio


async def test_a_replay_waits_for_its_sinks(tmp_path, vehicle, short):
    """6000 rows as fast as they go into a sink that takes them one by one: none is dropped."""
    many = drive(60.0).recording
    log = tmp_path / "drive.parquet"
    many.to_pandas().to_parquet(log)
    service = Service(vehicle, [f"replay:{log}?speed=max"], ["udp://127.0.0.1:9?rate=1000"])
    (outbox,) = service.outboxes
    got = []

    class Slow:
        async def run(self, box):
            await asyncio.sleep(0.2)
            box.connected()
            while True:
                got.append(await box.get())
                await asyncio.sleep(0)

    service.sinks[0] = (service.sinks[0][0], Slow())
    await service.run()
    assert outbox.dropped == 0
    assert sum(message.kind == "estimate" for message in got) == len(many)


async def test_a_flood_is_all_accounted_for(vehicle, short, port, sender):
    """Messages of 150 samples, and room for 100: what is not estimated is counted as dropped, and missing."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], capacity=100)
    kept = ("time", "ground_speed", "wheel_speed_fl", "drive_torque_fl")
    every = [json.dumps({name: row[name] for name in kept}) for row in messages(short.recording, 600)]
    async with running(service):
        for k in range(4):
            sender.send("\n".join(every[150 * k : 150 * (k + 1)]).encode())
            await until(lambda: service.core.rows == 100 * (k + 1))  # noqa: B023
        await until(lambda: events(service, "behind"))
        await until(lambda: service.core.counts.by_channel["ground_speed"]["dropped"] == 200)
    mine = service.core.counts.by_channel["ground_speed"]
    assert (mine["received"], mine["missing"]) == (400, 150)


async def test_a_message_too_long_for_a_datagram_is_counted_and_its_sink_stays(vehicle, port):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], ["udp://127.0.0.1:9"])
    (outbox,) = service.outboxes
    async with running(service):
        outbox.put(Message(STATUS, 0.0, data={"text": "x" * 70_000}))
        await until(lambda: outbox.dropped == 1)
    assert events(service, "sink_lost") == []


async def test_datagrams_that_are_too_many_are_dropped_by_the_service_which_counts(
    vehicle, short, port, sender
):
    """They come faster than they are estimated: none is lost unseen in the system's buffer."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], capacity=20)
    async with running(service):
        sender.send(*messages(short.recording, 200))  # the loop stands still meanwhile
        await until(lambda: events(service, "behind"))

        def dropped() -> int:
            return service.core.counts.by_channel["ground_speed"]["dropped"]

        await until(lambda: service.core.rows + dropped() == 200)
        assert dropped() > 0


async def test_what_the_system_drops_is_counted_and_its_hole_is_no_jump_of_the_clock(
    vehicle, short, port, sender, monkeypatch
):
    """Ten seconds' datagrams and forty more while the loop stands still, then on at their own pace."""
    monkeypatch.setattr("terragrip.live.links.udp._BUFFER", 1 << 16)
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    speeds = dict.fromkeys([f"wheel_speed_{w}" for w in vehicle.wheels], 3.0) | {"ground_speed": 0.55}
    async with running(service):
        sender.send({"time": 0.0, **speeds})
        await until(lambda: service.feeds[0].messages == 1)
        sender.send(*({"time": k * 0.01, **speeds} for k in range(1, 5000)))
        for k in range(5000, 5130):
            sender.send({"time": k * 0.01, **speeds})
            await asyncio.sleep(0.01)
        await until(lambda: service.core.time == 5129 * 0.01)
    counts = service.core.counts.by_channel
    unread = counts[f"(udp://127.0.0.1:{port})"]["dropped"]
    assert unread > 1000
    assert counts["ground_speed"]["received"] + unread == 5130
    assert counts["ground_speed"]["clock"] == 0
    assert events(service, "clock_jump") == []
    assert "messages dropped unread" in events(service, "behind")[0]


async def test_a_sample_that_comes_late_in_a_silence_ends_nothing(vehicle, short, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    good = messages(short.recording, 200)

    def predicted() -> int:
        return sum(m.kind == "estimate" and m.row.predicted for m in service.seen)

    async with running(service):
        sender.send(*good[:100])
        await until(lambda: predicted() > 3)
        sender.send(good[50])
        before = predicted()
        await until(lambda: predicted() > before + 3 or service.task.done())
        sender.send(*good[100:])
        await until(lambda: service.core.rows == 200 or service.task.done())
    assert service.core.rows == 200
    assert service.core.counts.by_channel["ground_speed"]["doubled"] == 1


async def test_a_thread_that_is_too_fast_is_held_back_and_counted(vehicle, port):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    async with running(service):
        bridge, taken = ThreadBridge(service.feeds[0], most=10), []

        def flood():
            for k in range(500):
                bridge.call(taken.append, k)

        thread = threading.Thread(target=flood)
        thread.start()
        thread.join()  # the loop stands still meanwhile
        await until(lambda: len(taken) == 10)
        bridge.call(taken.append, 500)
        await until(lambda: events(service, "behind"))
    assert taken == [*range(10), 500]
    assert service.core.counts.by_channel[f"(udp://127.0.0.1:{port})"]["dropped"] == 490


async def test_wheels_of_other_names_are_said(vehicle, short, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    async with running(service):
        for message in messages(short.recording, 30):
            sender.send({name.replace("_fl", "_left"): value for name, value in message.items()})
        await until(lambda: service.core.rows == 30)
    assert events(service, "schema") == ["no speed of the wheel fl yet; the vehicle has no wheel left"]

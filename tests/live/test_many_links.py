"""What a service of many vehicles shows and sends: health and metrics by vehicle, a stream a vehicle, its turn before a sink; and Zenoh."""

from __future__ import annotations

import asyncio
import json

import pytest

from machine import messages, running, until
from terragrip.errors import InputError
from terragrip.live.many.roster import Roster
from terragrip.live.many.service import ManyService
from terragrip.live.message import EVENT, Message
from terragrip.live.outbox import Outbox
from terragrip.live.topics import VehicleTopics, is_name
from terragrip.live.uri import Uri
from test_links import subscribed
from test_many import NOWHERE, everyone, listed, put, rows_of
from test_monitor import get, parsed
from test_service import walked

__all__ = ["everyone", "listed"]


@pytest.mark.asyncio
async def test_health_tells_which_vehicle_gets_no_data(listed, short, port):
    service = ManyService(listed, [NOWHERE], [f"studio://127.0.0.1:{port}"])

    async def idle(feed):
        feed.connected()
        await asyncio.Event().wait()

    service.sources[0].run = idle
    good = messages(short.recording, 100)
    silence, began, clock = 0.0, service.vehicles.clock(), service.vehicles.clock
    # A hundredth as fast as time: no busy machine makes a vehicle silent, only `silence` does.
    service.vehicles.clock = lambda: began + silence + 0.01 * (clock() - began)
    async with running(service):
        assert await get(port, "/health/live") == (200, "alive\n")
        status, text = await get(port, "/health/ready")
        assert status == 503
        assert (
            "0 of 3 vehicles get data\na: nothing has come yet\nb: nothing has come yet\nlost: not estimated: "
            in text
        )
        for name in "ab":
            put(service, name, *good)
            await rows_of(service, name, len(good))
        assert service.monitor.unready().keys() == {"lost"}
        silence = 0.8  # 0.5 s, and predictions go on meanwhile
        await until(lambda: "b" in service.monitor.unready())
        put(service, "a", messages(short.recording, 101)[-1])
        await until(lambda: "a" not in service.monitor.unready())
        status, text = await get(port, "/health/ready")
        assert (status, text.splitlines()[0]) == (200, "1 of 3 vehicles get data")
        assert text.splitlines()[1].startswith("b: nothing came from mqtt://127.0.0.1:1/field/b/sample for ")
        assert (await get(port, "/health/ready/b"))[0] == 503
        assert (await get(port, "/health/ready/lost"))[0] == 503
        assert (await get(port, "/health/ready/nobody"))[0] == 404
        service.routers[0].lost("the broker: gone")
        status, text = await get(port, "/health/ready")
        assert (status, text.splitlines()[0]) == (
            503,
            "mqtt://127.0.0.1:1/field/{vehicle}/sample: the broker: gone",
        )


@pytest.mark.asyncio
async def test_no_object_holds_its_caller(tmp_path, everyone, short, port):
    """As of the service of one vehicle; and what is the service's own goes to no topic."""
    sinks = ["mqtt://127.0.0.1:1/field/{vehicle}", f"studio://127.0.0.1:{port}"]
    service = ManyService(everyone, [NOWHERE], sinks, record=tmp_path / "many")
    async with running(service):
        for name in "ab":
            put(service, name, *messages(short.recording, 20))
            await rows_of(service, name, 20)
        await until(lambda: any(m.vehicle == "" for m in service.seen))  # the broker is not there
        assert len(walked(service, [], set())) > 25
        assert set(service.outboxes[0]._lanes) == {"a", "b"}


@pytest.mark.asyncio
async def test_metrics_bear_the_vehicle(listed, short, port):
    """Against what the test sent: 100 messages of one, 40 of the other with one of nonsense."""
    service = ManyService(listed, [NOWHERE], [f"studio://127.0.0.1:{port}"])
    good = messages(short.recording, 100)
    async with running(service):
        put(service, "a", *good)
        put(service, "b", *good[:40], b"nonsense")
        put(service, "..", good[0])
        await rows_of(service, "a", 100)
        await rows_of(service, "b", 40)
        await until(lambda: service.vehicles.runs["b"].core.counts.total("unreadable") == 1)
        page = parsed((await get(port, "/metrics"))[1])
    name = "terragrip_live_{}".format
    assert page[name('rows_total{vehicle="a"}')] == 100
    assert page[name('rows_total{vehicle="b"}')] == 40
    assert page[name('values_total{vehicle="a",fate="received"}')] == sum(len(one) - 1 for one in good)
    assert page[name('values_total{vehicle="b",fate="unreadable"}')] == 1
    assert page[name('events_total{vehicle="b",event="unreadable"}')] == 1
    assert page[name('ready{vehicle="lost"}')] == 0
    assert page[name("vehicles")] == 2
    assert page[name("vehicles_refused")] == 1
    assert page[name("unnamed_messages_total")] == 1


@pytest.mark.asyncio
async def test_a_client_of_the_stream_gets_the_vehicle_that_it_asked_for(everyone, short, port):
    from websockets.asyncio.client import connect

    service = ManyService(everyone, [NOWHERE], [f"studio://127.0.0.1:{port}"])
    good = messages(short.recording, 60)
    async with running(service):
        put(service, "a", *good)
        put(service, "tractor 7", *good)
        await rows_of(service, "a", 60)
        await rows_of(service, "tractor 7", 60)
        async with (
            connect(f"ws://127.0.0.1:{port}/?vehicle=tractor%207&columns=slip_*") as of_one,
            connect(f"ws://127.0.0.1:{port}/") as of_first,
        ):
            hello, first = json.loads(await of_one.recv()), json.loads(await of_first.recv())
            assert (hello["name"], first["name"]) == ("tractor 7", "a")
            assert hello["vehicles"] == first["vehicles"] == ["a", "tractor 7"]
            assert all(name.startswith("slip_") for name in hello["columns"])
            put(service, "a", {**good[-1], "time": 0.8})
            put(service, "tractor 7", {**good[-1], "time": 0.9})
            times = []
            for link in (of_one, of_first):
                message = json.loads(await link.recv())
                while message["kind"] != "estimate" or message["predicted"]:
                    message = json.loads(await link.recv())
                times.append(message["time"])
            assert times == [0.9, 0.8]
        async with connect(f"ws://127.0.0.1:{port}/?vehicle=tractor") as nobody:
            await nobody.wait_closed()
            assert nobody.close_code == 1008
            assert "did you mean tractor 7?" in nobody.close_reason


@pytest.mark.asyncio
async def test_through_zenoh(everyone, short, port):
    zenoh = pytest.importorskip("zenoh")
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
    got: dict[str, list[float]] = {}

    def hear(sample):
        estimate = json.loads(bytes(sample.payload))
        if not estimate["predicted"]:
            got.setdefault(str(sample.key_expr).split("/")[1], []).append(estimate["time"])

    good = messages(short.recording, 50)
    with zenoh.open(config) as other:
        other.declare_subscriber("field/*/estimate", hear)
        at = f"connect=tcp/127.0.0.1:{port}"
        service = ManyService(
            everyone, [f"zenoh:field/{{vehicle}}/sample?{at}"], [f"zenoh:field/{{vehicle}}?{at}"]
        )
        async with running(service):
            for name in "ab":
                await subscribed(other, f"field/{name}/sample")

            async def send(name: str, k: int) -> None:
                data = json.dumps(good[k])  # without blocking a busy machine's session drops messages
                other.put(f"field/{name}/sample", data, congestion_control=zenoh.CongestionControl.BLOCK)
                await rows_of(service, name, k + 1)

            sent = 0
            while len(got) < 2:  # estimates go nowhere until the sink's session knows who asks for them
                for name in "ab":
                    await send(name, sent)
                sent += 1
                await asyncio.sleep(0.1)
            for k in range(sent, len(good)):
                for name in "ab":
                    await send(name, k)
            await until(lambda: all(times[-1] == good[-1]["time"] for times in got.values()))
        assert {run.core.rows for run in service.vehicles.runs.values()} == {len(good)}


def test_a_vehicle_that_sends_too_much_pushes_out_its_own_messages_alone():
    """Each has its turn, in its own order."""
    outbox = Outbox(Uri.parse("udp://127.0.0.1:9", {"udp": ()}, "sink"), capacity=3)
    for k in range(100):
        outbox.put(Message(EVENT, float(k), data={}, vehicle="loud"))
    for k in range(3):
        outbox.put(Message(EVENT, float(k), data={}, vehicle="calm"))

    async def drained():
        return [await outbox.get() for _ in range(len(outbox))]

    got = [(message.vehicle, message.time) for message in asyncio.run(drained())]
    assert outbox.dropped == 97
    assert got == [("loud", 97), ("calm", 0), ("loud", 98), ("calm", 1), ("loud", 99), ("calm", 2)]


@pytest.mark.parametrize(
    ("name", "is_one"),
    [("tractor-7", True), ("Schlepper grün.2", True), ("7", True), ("a" * 64, True), ("a" * 65, False), ("", False),
     ("..", False), (".hidden", False), ("a/b", False), ("a\x00", False), ("a\n", False), (" a", False), ("-", False)],
)  # fmt: skip
def test_names(name, is_one):
    assert is_name(name) is is_one


def test_topics():
    topics = VehicleTopics("mqtt://h:1/field/{vehicle}/hubs/#?qos=1")
    assert topics.subscription == "mqtt://h:1/field/+/hubs/#?qos=1"
    assert topics.split("field/t7/hubs/fl") == ("t7", "field/{vehicle}/hubs/fl")
    assert topics.split("field")[0] == ""
    assert topics.named("t7") == "mqtt://h:1/field/t7/hubs/#"
    assert VehicleTopics("zenoh:a/{vehicle}/**").subscription == "zenoh:a/*/**"


def test_a_number_a_topic(tmp_path, vehicle, short):
    """The profile asks for a topic with {vehicle} in the vehicle's place."""
    hubs = "\n".join(f"  wheel_speed_{w}: field/{{vehicle}}/{w}" for w in vehicle.wheels)
    (tmp_path / "profile.yaml").write_text(f"channels:\n  ground_speed: 'field/{{vehicle}}/speed'\n{hubs}\n")
    vehicle.save(tmp_path / "robot.yaml")
    roster = Roster(tmp_path / "robot.yaml", tmp_path / "profile.yaml")

    async def run():
        service = ManyService(roster, ["mqtt://127.0.0.1:1/field/{vehicle}/#"])
        async with running(service):
            for _ in range(20):
                for name in "ab":
                    service.routers[0].message(b"3.6" if name == "a" else b"7.2", topic=f"field/{name}/speed")
                    for wheel in vehicle.wheels:
                        service.routers[0].message(b"5.0", topic=f"field/{name}/{wheel}")
                await asyncio.sleep(0.03)
            await until(lambda: len(service.vehicles.runs) == 2)
            await until(lambda: all(run.core.rows > 5 for run in service.vehicles.runs.values()))
            return [
                {value for m in service.seen if m.kind == "estimate" and m.vehicle == name and m.row
                 for channel, value in m.row.values.items() if channel == "ground_speed"} for name in "ab"
            ]  # fmt: skip

    assert asyncio.run(run()) == [{3.6}, {7.2}]


@pytest.mark.parametrize(
    ("source", "sink", "why"),
    [
        ("mqtt://h/field/+/sample", [], "{vehicle} is not one whole level"),
        ("mqtt://h/field/x{vehicle}/sample", [], "{vehicle} is not one whole level"),
        ("mqtt://{vehicle}/field", [], "{vehicle} is not one whole level"),
        ("mqtt://h/{vehicle}/{vehicle}", [], "{vehicle} is not one whole level"),
        ("udp://127.0.0.1:9870", [], "cannot tell vehicles apart"),
        (NOWHERE, ["udp://127.0.0.1:9870"], "cannot tell vehicles apart"),
        (NOWHERE, ["mqtt://127.0.0.1:1/out"], "{vehicle} is not one whole level"),
        ("mqtt://h/f/{vehicle}/#", ["mqtt://h/f/{vehicle}"], "would come back by mqtt://h/f/{vehicle}/#"),
        ("mqtt://h/f/{vehicle}/+", ["mqtt://h/f/{vehicle}?rate=1"], "would come back"),
        ("mqtt://h/{vehicle}/#", ["mqtt://h/f/{vehicle}"], "would come back"),
        ("zenoh:f/{vehicle}/**", ["zenoh:f/{vehicle}"], "would come back"),
    ],
)
def test_links_that_cannot_tell_vehicles_apart_are_refused(everyone, source, sink, why):
    with pytest.raises(InputError, match=why.replace("{", r"\{").replace("}", r"\}")):
        ManyService(everyone, [source], sink)


@pytest.mark.parametrize(
    "sink", ["mqtt://other/f/{vehicle}", "mqtt://h/out/{vehicle}", "mqtt://h/f/{vehicle}/deep"]
)
def test_what_does_not_come_back_is_allowed(everyone, sink):
    assert ManyService(everyone, ["mqtt://h/f/{vehicle}/sample"], [sink]).sinks

"""Zenoh, Foxglove, MCAP, the studio's WebSocket and a serial line, each with a real other side."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import itertools
import json
import os
import socket
import struct
import threading

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from websockets.asyncio.client import connect

from drives import drive
from machine import events, messages, rows_of, running, until
from terragrip.errors import InputError
from terragrip.formats import Profile
from terragrip.live.links.foxglove import NAMES
from terragrip.live.links.studio import Broadcast
from terragrip.live.options import Options
from terragrip.live.service import Service
from terragrip.live.thread_bridge import repeated_in_thread

pytestmark = pytest.mark.asyncio


async def test_a_pair_of_zenoh_sessions(vehicle, short, port):
    import zenoh

    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    got = []
    with zenoh.open(config) as other:
        other.declare_subscriber("terragrip/estimate", lambda s: got.append(json.loads(bytes(s.payload))))
        at = f"connect=tcp/127.0.0.1:{port}"
        service = Service(vehicle, [f"zenoh:machine/*?{at}"], [f"zenoh:terragrip?{at}&columns=slip_fl"])
        block = zenoh.CongestionControl.BLOCK  # else a busy machine's session drops messages
        async with running(service):
            await subscribed(other, "machine/all")
            sent, left = 0, list(messages(short.recording, 200))
            while not got:  # estimates go nowhere until the sink's session knows who asks for them
                other.put("machine/all", json.dumps(left[sent]), congestion_control=block)
                sent += 1
                await until(lambda: service.core.rows == sent)  # noqa: B023
                await asyncio.sleep(0.1)
            for message in left[sent:]:
                other.put("machine/all", json.dumps(message), congestion_control=block)
            await until(lambda: service.core.rows == 200)
            last = short.recording.time[199]
            await until(lambda: any(m["time"] == last and not m["predicted"] for m in got))
    measured = [m for m in got if not m["predicted"]]
    assert [m["time"] for m in measured] == list(short.recording.time[200 - len(measured) : 200])
    assert measured[-1]["slip_fl"] == pytest.approx(short.truth["slip_fl"][199], abs=0.05)


async def subscribed(session, key: str) -> None:
    """Wait until the session knows of a subscriber to a key: what it puts before that goes nowhere."""
    publisher = session.declare_publisher(key)
    await until(lambda: publisher.matching_status.matching)
    publisher.undeclare()


async def test_ros_2_by_zenoh(vehicle, short, port):
    """JointState and TwistStamped under the keys of rmw_zenoh; estimates come back as std_msgs/String in CDR."""
    import zenoh
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    joints = [f"{w}_hub" for w in vehicle.wheels]
    profile = Profile.from_dict(
        {
            "channels": {f"wheel_speed_{w}": f"/joints.velocity.{w}_hub" for w in vehicle.wheels}
            | {f"drive_torque_{w}": f"/joints.effort.{w}_hub" for w in vehicle.wheels}
            | {"ground_speed": {"norm_of": ["/gnss/vel.twist.linear.x", "/gnss/vel.twist.linear.y"]}}
        }
    )
    got = []

    def hear(sample):
        estimate = json.loads(store.deserialize_cdr(bytes(sample.payload), "std_msgs/msg/String").data)
        if not estimate["predicted"]:  # on a busy machine the sender falls silent for long enough
            got.append(estimate["time"])

    with zenoh.open(config) as other:
        other.declare_subscriber("7/terragrip/estimate/*/*", hear)
        at = f"connect=tcp/127.0.0.1:{port}&domain=7"
        service = Service(
            vehicle,
            [f"ros2:/joints,/gnss/vel?{at}"],
            [f"ros2:/terragrip?{at}"],
            profile=profile,
            options=Options(window=0.5),
        )
        async with running(service):
            for topic in ("joints", "gnss/vel"):
                await subscribed(other, f"7/{topic}/type/hash")

            def send(time, values):
                for topic, name, message in ros_messages(store, 5.0 + time, values, vehicle.wheels, joints):
                    key = f"7/{topic}/{name.replace('/msg/', '::msg::dds_::')}_/RIHS01_0"
                    data = bytes(store.serialize_cdr(message, name))
                    other.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK)

            sent, left = 0, list(rows_of(short.recording))[:100]
            while not got:  # estimates go nowhere until the sink's session knows who asks for them
                send(*left[sent])
                sent += 1
                await until(lambda: service.core.rows == sent)  # noqa: B023
                await asyncio.sleep(0.1)
            while sent < len(
                left
            ):  # one by one: of a burst Zenoh drops what a busy machine cannot send at once
                send(*left[sent])
                sent += 1
                await until(lambda: service.core.rows == sent)  # noqa: B023
            other.put("7/joints/sensor_msgs::msg::dds_::JointState_/RIHS01_0", b"garbage")
            await until(
                lambda: (
                    service.core.rows == 100
                    and got[-1] == pytest.approx(5.0 + short.recording.time[99])
                    and service.feeds[0].unreadable == 1
                )
            )
    assert got == pytest.approx((5.0 + short.recording.time[100 - len(got) : 100]).tolist())
    measured = [m.row for m in service.seen if m.kind == "estimate" and not m.row.predicted]
    sent = short.recording.channels["drive_torque_rr"][:100]
    assert [row.values["drive_torque_rr"] for row in measured] == sent.tolist()
    assert measured[5].values["ground_speed"] == pytest.approx(
        abs(short.recording.channels["ground_speed"][5])
    )


def ros_messages(store, time, values, wheels, joints):
    """A JointState and a TwistStamped of one instant."""
    import numpy as np

    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=int(time), nanosec=round(1e9 * (time % 1)))
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
    speeds, torques = (
        np.array([values[f"{n}_{w}"] for w in wheels]) for n in ("wheel_speed", "drive_torque")
    )
    vector = types["geometry_msgs/msg/Vector3"]
    yield (
        "joints",
        "sensor_msgs/msg/JointState",
        types["sensor_msgs/msg/JointState"](
            header=header, name=joints, position=np.zeros(4), velocity=speeds, effort=torques
        ),
    )
    speed = values["ground_speed"]
    twist = types["geometry_msgs/msg/Twist"](
        linear=vector(0.6 * speed, 0.8 * speed, 0.0), angular=vector(0.0, 0.0, 0.0)
    )
    yield (
        "gnss/vel",
        "geometry_msgs/msg/TwistStamped",
        types["geometry_msgs/msg/TwistStamped"](header=header, twist=twist),
    )


async def test_zenoh_whose_other_side_is_absent_is_named(vehicle, port):
    service = Service(vehicle, [f"zenoh:machine/*?connect=tcp/127.0.0.1:{port}"])
    async with running(service):
        await until(lambda: events(service, "source_lost"))
    with pytest.raises(InputError, match="anyone could connect"):
        Service(vehicle, ["zenoh:machine?listen=tcp/127.0.0.1:7447,tcp/0.0.0.0:7448"])
    with pytest.raises(InputError, match="not a key expression"):
        Service(vehicle, ["zenoh:a//b"])


async def test_foxglove_subscribes_and_an_mcap_holds_the_same(tmp_path, vehicle, short, port, sender):
    sink = f"foxglove://127.0.0.1:{port}?mcap={tmp_path / 'mcap'}"
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [sink], options=Options(setpoint=(0.11, 1.0)))
    sent = messages(short.recording, len(short.recording))
    async with (
        running(service),
        # no bound on what waits to be read: behind it, closing would wait for ten seconds
        connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_queue=None) as client,
    ):
        channels = {}
        while len(channels) < len(NAMES):
            result = json.loads(await client.recv())
            channels |= {c["topic"]: c for c in result.get("channels", [])}
        estimate = channels["/terragrip/estimate"]
        await client.send(
            json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": estimate["id"]}]})
        )
        data = b""
        for k in range(0, len(sent), 100):
            sender.send(*sent[k : k + 100])
            await until(lambda: service.core.rows == k + 100)  # noqa: B023
        while not isinstance(data, bytes) or data[:1] != b"\x01":
            data = await client.recv()
    opcode, subscription, _ = struct.unpack_from("<BIQ", data)
    assert (opcode, subscription) == (1, 7)
    assert json.loads(data[13:])["slip_fl"] is not None
    schema = json.loads(estimate["schema"])
    assert (schema["title"], "adhesion_rr_std" in schema["properties"]) == (
        "terragrip.TractionEstimate",
        True,
    )

    (path,) = (tmp_path / "mcap").iterdir()
    with path.open("rb") as stream:
        logged = [(c.topic, m.log_time) for _, c, m in make_reader(stream).iter_messages()]
    assert {topic.rpartition("/")[2] for topic, _ in logged} >= {"estimate", "setpoint", "status"}
    times = [time for _, time in logged]
    assert max(times) - min(times) < 600e9  # on one time base, whatever that of the stamps is
    with path.open("rb") as stream:
        recorded = [
            (s.name, json.loads(m.data))
            for s, c, m in make_reader(stream).iter_messages(topics="/terragrip/estimate")
        ]
    assert [d["time"] for _, d in recorded if not d["predicted"]] == short.recording.time.tolist()
    assert {name for name, _ in recorded} == {"terragrip.TractionEstimate"}
    # Cut off in the middle, as by a kill, it still reads up to there.
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert 0 < readable_messages(cut) < readable_messages(path)


async def test_an_mcap_that_cannot_be_written_any_more_ends_neither_the_estimates_nor_foxgloves_stream(
    tmp_path, vehicle, short, port, sender, monkeypatch
):
    class Full:
        def flush(self):
            raise RuntimeError("No space left on device")

        close = flush

    monkeypatch.setattr("terragrip.live.links.foxglove._FLUSH", -1.0)
    monkeypatch.setattr("terragrip.live.links.foxglove._AGAIN", 0.1)
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [f"foxglove://127.0.0.1:{port}?mcap={tmp_path}"])
    sent = messages(short.recording, 40)
    async with running(service):
        sender.send(*sent[:20])
        await until(lambda: len(list(tmp_path.iterdir())) == 1)
        service.sinks[0][1]._writer = Full()
        sender.send(*sent[20:])
        await until(lambda: events(service, "sink_back"))
        assert not service.task.done()
        monkeypatch.setattr("terragrip.live.links.foxglove._FLUSH", 1e9)
        service.sinks[0][1]._writer = Full()
    while_it_ran, at_its_end = events(service, "sink_lost")
    assert "is the disk full? (No space left on device); all else goes on" in while_it_ran
    assert at_its_end.startswith("the end of the MCAP could not be written")
    assert len(list(tmp_path.iterdir())) == 2
    assert service.core.rows == 40


def readable_messages(path) -> int:
    result = 0
    with path.open("rb") as stream, contextlib.suppress(EndOfFile):
        for result, _ in enumerate(NonSeekingReader(stream).iter_messages(log_time_order=False), 1):  # noqa: B007
            pass
    return result


async def test_foxglove_stays_on_this_machine(vehicle):
    with pytest.raises(InputError, match="SSH tunnel"):
        Service(vehicle, ["udp://127.0.0.1:9870"], ["foxglove://0.0.0.0:8765"])


async def test_a_client_of_the_studios_websocket_gets_the_driven_wheels():
    """Where a driven wheel's speed was lost the cab showed the free wheel's slip: 0 %."""
    frames = Broadcast(lambda: {"": ("tractor", ["slip_fl", "slip_rl"], ("fl",))}).subscribe()
    hello = json.loads(await anext(frames))
    await frames.aclose()
    assert (hello["wheels"], hello["driven"]) == (["fl", "rl"], ["rl"])


async def test_the_studios_websocket_in_json_and_in_doubles(tmp_path, vehicle, port):
    log = tmp_path / "drive.parquet"
    drive(60.0).recording.to_pandas().to_parquet(log)  # goes on until the last client has had its turn
    service = Service(vehicle, [f"replay:{log}"], [f"studio://127.0.0.1:{port}"])
    async with running(service):
        async with connect(f"ws://127.0.0.1:{port}/?columns=slip_fl") as text:
            hello, first = json.loads(await text.recv()), json.loads(await text.recv())
            service.inbox.event("late", "a source", "a sentence")
            while json.loads(one := await text.recv())["kind"] in ("estimate", "status"):
                pass
            assert one.count('"kind"') == 1
            assert json.loads(one) | {"time": 0} == {
                "kind": "late", "time": 0, "source": "a source", "text": "a sentence",
            }  # fmt: skip
        async with connect(f"ws://127.0.0.1:{port}/?format=binary&columns=slip_fl*&rate=20") as packed:
            columns = json.loads(await packed.recv())["columns"]
            result = [await packed.recv() for _ in range(10)]
        async with connect(f"ws://127.0.0.1:{port}/?colums=slip_fl") as wrong:
            await wrong.wait_closed()
            assert "did you mean columns" in wrong.close_reason
        service.stop()
    assert (hello["kind"], hello["columns"], hello["wheels"]) == ("hello", ["slip_fl"], list(vehicle.wheels))
    assert first.keys() == {"kind", "time", "arrival", "event", "predicted", "slip_fl"}
    numbers = [struct.unpack("<5d", one) for one in result if isinstance(one, bytes)]
    assert columns == ["slip_fl", "slip_fl_std"]
    steps = [b[0] - a[0] for a, b in itertools.pairwise(numbers)]
    assert steps == pytest.approx([0.05] * len(steps))


async def test_clients_that_leave_or_speak_no_websocket_leave_no_traceback(vehicle, port, caplog):
    service = Service(vehicle, ["udp://127.0.0.1:0"], [f"studio://127.0.0.1:{port}"])
    async with running(service):
        async with connect(f"ws://127.0.0.1:{port}/") as client:
            await client.recv()
        async with connect(f"ws://127.0.0.1:{port}/") as client:
            await client.recv()
            client.transport.abort()
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"hello\r\n\r\n")
        await writer.drain()
        writer.close()
        broadcast = service.sinks[0][1].broadcast
        await until(lambda: not len(broadcast))
        async with connect(f"ws://127.0.0.1:{port}/") as client:  # the next one is served
            assert json.loads(await client.recv())["kind"] == "hello"
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


async def test_the_studios_websocket_beyond_this_machine_wants_the_token(vehicle, port, monkeypatch):
    with pytest.raises(InputError, match="TERRAGRIP_TOKEN"):
        Service(vehicle, ["udp://127.0.0.1:9870"], [f"studio://0.0.0.0:{port}"])
    monkeypatch.setenv("TERRAGRIP_TOKEN", "a-long-one")
    service = Service(vehicle, ["udp://127.0.0.1:0"], [f"studio://0.0.0.0:{port}"])
    from websockets.exceptions import InvalidStatus

    async with running(service):
        for wrong in ("", "?token=a-short-one"):
            with pytest.raises(InvalidStatus, match="401"):
                await connect(f"ws://127.0.0.1:{port}/{wrong}").__aenter__()
        with pytest.raises(InvalidStatus, match="403"):
            await connect(
                f"ws://127.0.0.1:{port}/?token=a-long-one", origin="https://elsewhere.example"
            ).__aenter__()
        async with connect(f"ws://127.0.0.1:{port}/?token=a-long-one") as client:
            assert json.loads(await client.recv())["kind"] == "hello"


def sentence(body: str) -> bytes:
    check = 0
    for character in body:
        check ^= ord(character)
    return f"${body}*{check:02X}\r\n".encode()


async def test_a_receiver_on_a_serial_line(vehicle, port):
    machine, device = os.openpty()
    name = os.ttyname(device)
    service = Service(vehicle, [f"serial:{name}?baud=9600", f"udp://127.0.0.1:{port}"])
    async with running(service):
        for k in range(5):
            os.write(
                machine, sentence(f"GPRMC,1235{k:02d},A,4807.038,N,01131.000,E,002.0,084.4,230394,003.1,W")
            )
            os.write(machine, sentence("GPVTG,084.4,T,,M,002.0,N,003.7,K"))
            os.write(machine, b"$GPRMC,garbled*00\r\n")
        await until(lambda: service.core.rows >= 5)
        counts = service.core.counts.by_channel
        assert (counts["ground_speed"]["received"], counts["latitude"]["received"]) == (5, 5)
        assert service.feeds[0].unreadable == 5
        os.close(device)
        os.close(machine)
        await until(lambda: any("the device" in text for text in events(service, "source_lost")))
    rows = [message.row for message in service.seen if message.kind == "estimate"]
    assert rows[0].values["ground_speed"] == pytest.approx(2.0 * 1852 / 3600)
    assert rows[0].values["latitude"] == pytest.approx(48 + 7.038 / 60)


async def test_a_receiver_sends_its_speed_more_often_than_its_place(vehicle, sender, port):
    """Of VTG at 10 Hz beside RMC at 1 Hz, all but RMC's was left out as its repetition."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    async with running(service):
        rmc = sentence("GPRMC,123500,A,4807.038,N,01131.000,E,002.0,084.4,230394,003.1,W")
        vtg = sentence("GPVTG,084.4,T,,M,002.0,N,003.7,K")
        for burst in (rmc + vtg, vtg, vtg, rmc + vtg):
            sender.send(burst, {"wheel_speed_fl": 3.0})
        await until(lambda: service.core.counts.by_channel.get("ground_speed", {}).get("received") == 4)


async def test_a_receiver_that_sends_datagrams_beside_one_that_sends_json(vehicle, sender, port):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"])
    async with running(service):
        place = sentence("GPGGA,123500,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,")
        speed = sentence("GPRMC,123500,A,4807.038,N,01131.000,E,002.0,084.4,230394,003.1,W")
        sender.send(
            place + speed,
            b"$GPRMC,garbled*00",
            {"wheel_speed_fl": 3.0},
            sentence("GPRMC,123501,V,,,,,,,230394,,,N"),
        )
        await until(lambda: service.feeds[0].messages == 3 and service.feeds[0].unreadable == 1)
        await until(lambda: "ground_speed" in service.core.counts.by_channel)
        counts = service.core.counts.by_channel
        assert (counts["ground_speed"]["received"], counts["altitude"]["received"]) == (1, 1)
        await until(lambda: events(service, "source_lost"))
    assert "no fix" in events(service, "source_lost")[0]
    assert "not a whole NMEA sentence" in events(service, "unreadable")[0]


async def test_a_receiver_that_serves_by_tcp_is_lost_and_comes_back(vehicle):
    line = sentence("GPRMC,123500,A,4807.038,N,01131.000,E,002.0,084.4,230394,003.1,W")
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        loop = asyncio.get_running_loop()
        service = Service(vehicle, [f"serial:socket://127.0.0.1:{server.getsockname()[1]}"])
        async with running(service):
            for count in (1, 2):
                with (await loop.sock_accept(server))[0] as link:
                    link.sendall(line)
                    await until(lambda count=count: service.feeds[0].messages == count)
                await until(lambda count=count: len(events(service, "source_lost")) == count)
    assert len(events(service, "source_back")) == 1


async def test_a_receiver_without_a_fix_and_one_at_another_baud_rate_are_named(vehicle):
    machine, device = os.openpty()
    service = Service(vehicle, [f"serial:{os.ttyname(device)}"])
    async with running(service):
        while not events(service, "source_lost"):
            os.write(machine, sentence("GPRMC,123500,V,,,,,,,230394,,,N"))
            await asyncio.sleep(0.1)
        os.write(machine, b"\xff\x81" * 300)
        await until(lambda: events(service, "unreadable"))
        os.write(
            machine, b"\n" + sentence("GPRMC,123501,A,4807.038,N,01131.000,E,002.0,084.4,230394,003.1,W")
        )
        await until(lambda: len(events(service, "source_lost")) == 2)
        assert service.feeds[0].unreadable == 1  # what was read of no line is said once
    os.close(device)
    os.close(machine)
    first, second = events(service, "source_lost")
    assert "no fix" in first
    assert "nothing came" in second
    assert "baud" in events(service, "unreadable")[0]


async def test_a_device_that_goes_while_the_service_ends_prints_no_traceback():
    begun, gone, said = threading.Event(), threading.Event(), []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: said.append(context))

    def read():
        begun.set()
        gone.wait()
        raise OSError("unplugged")

    task = asyncio.create_task(repeated_in_thread(read))
    await asyncio.to_thread(begun.wait)
    task.cancel()
    await asyncio.sleep(0)
    gone.set()
    with contextlib.suppress(asyncio.CancelledError):
        await task
    del task
    for _ in range(3):  # the loop lets go of what it has called
        await asyncio.sleep(0)
    gc.collect()
    assert said == []

"""Samples and estimates through a real broker, mosquitto, with a password and with TLS."""

from __future__ import annotations

import asyncio
import json
import signal
import ssl

import pytest

from machine import events, messages, rows_of, running, until
from mosquitto import broker, listening, pretended
from terragrip.errors import InputError
from terragrip.formats import Profile
from terragrip.live.service import Service

pytestmark = pytest.mark.asyncio


async def test_by_password_in_and_out(tmp_path, vehicle, short, port, monkeypatch):
    secret = tmp_path / "credentials"
    secret.write_text("username: robot\npassword: kept-well\n")
    secret.chmod(0o600)
    monkeypatch.setenv("TERRAGRIP_CREDENTIALS", str(secret))
    with broker(tmp_path, port, password="kept-well"):
        at = f"mqtt://127.0.0.1:{port}"
        service = Service(vehicle, [f"{at}/machine/#"], [f"{at}/terragrip?rate=10"])
        known = {"username": "robot", "password": "kept-well"}
        async with listening(port, "terragrip/#", **known) as (client, got), running(service):
            for message in messages(short.recording, 300):
                client.publish("machine/all", json.dumps(message))
            client.publish("machine/all", b"no json")
            await until(lambda: service.core.rows == 300)
            await until(lambda: any(topic == "terragrip/event" for topic, _ in got))
            await until(
                lambda: any(data["time"] == 2.9 for topic, data in got if topic.endswith("/estimate"))
            )
            estimates = [
                data for topic, data in got if topic == "terragrip/estimate" and not data["predicted"]
            ]
    assert len(estimates) == 30
    assert estimates[-1]["slip_fl"] == pytest.approx(short.truth["slip_fl"][290], abs=0.05)
    assert any(
        data["text"] == "a message was not JSON: 'no json' on machine/all"
        for _, data in got
        if "text" in data
    )


async def test_by_tls_and_a_number_a_topic(tmp_path, vehicle, short, port):
    with broker(tmp_path, port, tls=True):
        hubs = {
            f"wheel_speed_{wheel}": {"from": f"m/hubs/{wheel}", "unit": "rad/s"} for wheel in vehicle.wheels
        }
        profile = Profile.from_dict(
            {"channels": {"ground_speed": {"from": "m/speed", "unit": "km/h"}, **hubs}}
        )
        service = Service(vehicle, [f"mqtts://127.0.0.1:{port}/m/#?ca={tmp_path}/cert.pem"], profile=profile)
        trusted = ssl.create_default_context(cafile=tmp_path / "cert.pem")
        async with running(service), listening(port, tls=trusted) as (client, _):
            for _ in range(20):
                client.publish("m/speed", "3.6")
                client.publish("m/hubs", json.dumps(dict.fromkeys(vehicle.wheels, 5.0)))
            await until(lambda: service.core.counts.total("received") == 100)
            await until(lambda: service.core.rows > 0)
        rows = [message.row for message in service.seen if message.kind == "estimate"]
    assert {name: value for row in rows for name, value in row.values.items()} == {
        "ground_speed": pytest.approx(1.0),
        **dict.fromkeys(hubs, 5.0),
    }


async def test_what_a_broker_retained_is_no_sample(tmp_path, vehicle, short, port):
    """Of an hour ago it was the first row, and the clock of the whole record an hour behind."""
    old, *fresh = messages(short.recording, 51)
    with broker(tmp_path, port):
        service = Service(vehicle, [f"mqtt://127.0.0.1:{port}/m"])
        async with listening(port) as (client, _):
            client.publish("m", json.dumps(old | {"time": fresh[0]["time"] - 3600.0}), retain=True)
            async with listening(port, "m") as (_, got):
                await until(lambda: got)  # the broker has it
            async with running(service):
                for message in fresh:
                    client.publish("m", json.dumps(message))
                await until(lambda: service.core.rows >= 50)
    rows = [
        message.time for message in service.seen if message.kind == "estimate" and not message.row.predicted
    ]
    assert rows == [message["time"] for message in fresh]
    assert not events(service, "clock_jump")


@pytest.mark.parametrize(
    ("source", "sink"),
    [
        ("mqtt://127.0.0.1/machine/#", "mqtt://127.0.0.1/machine/out"),
        ("mqtt://localhost:1883/machine/+", "mqtt://127.0.0.1/machine?rate=5"),
        ("zenoh:**/estimate", "zenoh:terragrip"),
        ("udp://127.0.0.1:9870", "udp://127.0.0.1:9870"),
    ],
)
async def test_a_sink_whose_estimates_a_source_would_receive_is_refused(vehicle, source, sink):
    """They were measurements: rows were lost beside them, predictions were new ones, and the silence of the machine went unsaid."""
    with pytest.raises(InputError) as caught:
        Service(vehicle, [source], [sink])
    assert str(caught.value).startswith(f"--sink {sink}: its messages would come back by {source}")


async def test_a_source_beside_a_sink_of_the_same_broker_is_not_refused(vehicle):
    at = "mqtt://127.0.0.1"
    Service(
        vehicle,
        [f"{at}/machine/+", f"{at}/gnss", "zenoh:**/all"],
        [f"{at}/machine/out", f"{at}/gnss", "zenoh:all"],
    )


async def test_a_broker_that_refuses_is_named_and_tried_again(tmp_path, vehicle, short, port, monkeypatch):
    service = Service(vehicle, [f"mqtt://127.0.0.1:{port}/m"], [f"mqtt://127.0.0.1:{port}/out"])
    async with running(service):
        await until(lambda: events(service, "source_lost") and events(service, "sink_lost"))
        with broker(tmp_path, port, password="kept-well"):
            await until(lambda: any("Not authorized" in text for text in events(service, "source_lost")))
            monkeypatch.setenv("TERRAGRIP_USERNAME", "robot")
            monkeypatch.setenv("TERRAGRIP_PASSWORD", "kept-well")
            await until(lambda: events(service, "source_back") and events(service, "sink_back"))
            async with listening(port, username="robot", password="kept-well") as (client, _):
                client.publish("m", json.dumps(messages(short.recording, 1)[0]))
            await until(lambda: service.core.rows == 1)
        before = len(events(service, "source_lost"))
        await until(
            lambda: len(events(service, "source_lost")) > before and len(events(service, "sink_lost")) > 1
        )
    assert not any("kept-well" in event.text for event in service.statistics.events)


async def test_credentials_that_others_may_read_are_refused(tmp_path, vehicle, monkeypatch):
    secret = tmp_path / "credentials"
    secret.write_text("password: x\n")
    secret.chmod(0o644)
    monkeypatch.setenv("TERRAGRIP_CREDENTIALS", str(secret))
    with pytest.raises(InputError, match="others can read it"):
        Service(vehicle, ["mqtt://127.0.0.1/m"])
    secret.chmod(0o600)
    with pytest.raises(InputError, match="would be sent unencrypted"):
        Service(vehicle, ["mqtt://broker.example/m"])
    secret.write_text("pasword: x\n")
    with pytest.raises(InputError, match="line 1"):
        Service(vehicle, ["mqtts://broker.example/m"])


@pytest.mark.parametrize(("qos", "tls"), [(0, True), (1, False), (2, True)])
async def test_a_burst_comes_and_goes_whole(tmp_path, vehicle, short, port, qos, tls):
    """All at once, by each quality of service: each sample is a row, each row's estimate is heard."""
    sent = messages(short.recording, 600)
    with broker(tmp_path, port, tls=tls):
        at, ca = f"{'mqtts' if tls else 'mqtt'}://127.0.0.1:{port}", f"&ca={tmp_path}/cert.pem" if tls else ""
        trusted = ssl.create_default_context(cafile=tmp_path / "cert.pem") if tls else None
        service = Service(vehicle, [f"{at}/m?qos={qos}{ca}"], [f"{at}/out?qos={qos}{ca}"])
        async with listening(port, "out/estimate", tls=trusted) as (client, got), running(service):
            for message in sent:
                client.publish("m", json.dumps(message), qos)
            await until(lambda: sum(not data["predicted"] for _, data in got) == 600)
    assert service.core.rows == 600
    assert [data["time"] for _, data in got if not data["predicted"]] == [message["time"] for message in sent]


async def test_a_broker_that_stands_still_holds_nothing_up(tmp_path, vehicle, short, port):
    """Estimates go on, the sink's oldest are dropped and counted; once the broker runs again the newest come. It ends beside one, too."""
    with broker(tmp_path, port) as process:
        at = f"mqtt://127.0.0.1:{port}/out?qos=1"
        service = Service(vehicle, ["udp://127.0.0.1:0"], [at])
        async with listening(port, "out/estimate") as (_, got), running(service):
            rows = [(time, values) for time, values in rows_of(short.recording)]
            process.send_signal(signal.SIGSTOP)
            for k in range(1500):
                time, values = rows[k % 500]
                service.feeds[0].sample(time + 5.0 * (k // 500), values)
                if k % 50 == 0:
                    await asyncio.sleep(0)
            await until(lambda: service.core.rows == 1500)
            (outbox,) = service.outboxes
            assert outbox.dropped >= 1500 - outbox.capacity - 20
            assert not outbox.is_lost
            process.send_signal(signal.SIGCONT)
            await until(lambda: got and got[-1][1]["time"] >= service.core.time)
            process.send_signal(signal.SIGSTOP)
            service.feeds[0].sample(15.0, rows[0][1])
            await until(lambda: service.core.rows == 1501)


async def test_what_no_broker_acknowledged_is_sent_again(vehicle, short, port):
    service = Service(vehicle, ["udp://127.0.0.1:0"], [f"mqtt://127.0.0.1:{port}/out?qos=1"])
    rows = list(rows_of(short.recording))[:40]
    async with pretended(port, acknowledges=False) as first:
        task = asyncio.create_task(service.run())
        for time, values in rows:
            service.feeds[0].sample(time, values)
        await until(lambda: len(first) == 20)  # no more wait for a broker
    async with pretended(port) as second:
        await until(lambda: sum("slip_fl" in one for one in second) >= 40)
        service.stop()
        await task
    assert first == second[:20]
    assert [one["time"] for one in second if not one.get("predicted", True)] == [time for time, _ in rows]


async def test_a_broker_that_refuses_the_topic_is_named(vehicle, port):
    async with pretended(port, takes_topics=False):
        service = Service(vehicle, [f"mqtt://127.0.0.1:{port}/m"])
        async with running(service):
            await until(lambda: events(service, "source_lost"))
    assert events(service, "source_lost") == ["the broker refuses the topic: Unspecified error"]


@pytest.mark.parametrize(
    ("source", "sink"), [("a/#/b", "out"), ("a+/b", "out"), ("a", "out/#"), ("a", "out/+")]
)
async def test_wild_cards_out_of_place_are_refused(vehicle, source, sink):
    with pytest.raises(InputError, match="wild card in the wrong place"):
        Service(vehicle, [f"mqtt://127.0.0.1/{source}"], [f"mqtt://127.0.0.1/{sink}"])

"""Samples and estimates through a real broker, mosquitto, with a password and with TLS."""

from __future__ import annotations

import json
import ssl

import aiomqtt
import pytest

from machine import events, messages, running, until
from mosquitto import broker, listening
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
                await client.publish("machine/all", json.dumps(message))
            await client.publish("machine/all", b"no json")
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
        data["text"] == "a message was no JSON: 'no json' on machine/all" for _, data in got if "text" in data
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
        async with running(service), aiomqtt.Client("127.0.0.1", port, tls_context=trusted) as client:
            for _ in range(20):
                await client.publish("m/speed", "3.6")
                await client.publish("m/hubs", json.dumps(dict.fromkeys(vehicle.wheels, 5.0)))
            await until(lambda: service.core.counts.total("received") == 100)
            await until(lambda: service.core.rows > 0)
        rows = [message.row for message in service.seen if message.kind == "estimate"]
    assert {name: value for row in rows for name, value in row.values.items()} == {
        "ground_speed": pytest.approx(1.0),
        **dict.fromkeys(hubs, 5.0),
    }


async def test_a_broker_that_refuses_is_named_and_tried_again(tmp_path, vehicle, short, port, monkeypatch):
    service = Service(vehicle, [f"mqtt://127.0.0.1:{port}/m"], [f"mqtt://127.0.0.1:{port}/out"])
    async with running(service):
        await until(lambda: events(service, "source_lost") and events(service, "sink_lost"))
        with broker(tmp_path, port, password="kept-well"):
            await until(lambda: any("Not authorized" in text for text in events(service, "source_lost")))
            monkeypatch.setenv("TERRAGRIP_USERNAME", "robot")
            monkeypatch.setenv("TERRAGRIP_PASSWORD", "kept-well")
            await until(lambda: events(service, "source_back") and events(service, "sink_back"))
            async with aiomqtt.Client("127.0.0.1", port, username="robot", password="kept-well") as client:
                await client.publish("m", json.dumps(messages(short.recording, 1)[0]))
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
    with pytest.raises(InputError, match="others may read it"):
        Service(vehicle, ["mqtt://127.0.0.1/m"])
    secret.chmod(0o600)
    with pytest.raises(InputError, match="would travel openly"):
        Service(vehicle, ["mqtt://broker.example/m"])
    secret.write_text("pasword: x\n")
    with pytest.raises(InputError, match="line 1"):
        Service(vehicle, ["mqtts://broker.example/m"])

"""Samples and estimates through a real broker, mosquitto, with a password and with TLS."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import ssl
import subprocess
import time

import aiomqtt
import pytest

from machine import events, messages, running, until
from terragrip.errors import InputError
from terragrip.formats import Profile
from terragrip.live.service import Service

pytestmark = pytest.mark.asyncio

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


def openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True)


@contextlib.contextmanager
def broker(folder, port, *, password=None, tls=False):
    """mosquitto on loopback while the block runs."""
    if MOSQUITTO is None:
        pytest.skip("NOT TESTED: there is no mosquitto; apt-get install mosquitto")
    lines = [
        f"listener {port} 127.0.0.1",
        "persistence false",
        f"allow_anonymous {str(password is None).lower()}",
    ]
    if os.geteuid() == 0:
        lines.append("user root")  # or it gives up its rights to read the test's folder
    if password is not None:
        secret = folder / "passwords"
        subprocess.run(
            ["mosquitto_passwd", "-b", "-c", secret, "robot", password], check=True, capture_output=True
        )
        lines.append(f"password_file {secret}")
    if tls:
        if shutil.which("openssl") is None:
            pytest.skip("NOT TESTED: there is no openssl; apt-get install openssl")
        openssl(
            "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1",
            "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", f"{folder}/key.pem", "-out", f"{folder}/cert.pem",
        )  # fmt: skip
        lines += [f"certfile {folder}/cert.pem", f"keyfile {folder}/key.pem"]
    (folder / "mosquitto.conf").write_text("\n".join(lines) + "\n")
    process = subprocess.Popen([MOSQUITTO, "-c", folder / "mosquitto.conf"], stderr=subprocess.DEVNULL)
    try:
        wait_for(port)
        yield
    finally:
        process.terminate()
        process.wait(60)


def wait_for(port: int) -> None:
    import socket

    end = time.monotonic() + 60
    while time.monotonic() < end:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
            return
        time.sleep(0.02)
    raise AssertionError("mosquitto does not listen")


@contextlib.asynccontextmanager
async def listening(port: int, topic: str, **options):
    """A client that has what came on a topic in a list."""
    got = []
    async with aiomqtt.Client("127.0.0.1", port, **options) as client:
        await client.subscribe(topic)

        async def collect():
            async for message in client.messages:
                got.append((message.topic.value, json.loads(message.payload)))  # noqa: PERF401

        task = asyncio.create_task(collect())
        try:
            yield client, got
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


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

"""A real broker for tests, and clients that listen to it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import subprocess
import time

import aiomqtt
import pytest

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

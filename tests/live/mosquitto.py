"""A real broker for tests, and clients that listen to it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import signal
import subprocess
import threading
import time

import paho.mqtt.client as paho
import pytest

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


def openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True)


@contextlib.contextmanager
def broker(folder, port, *, password=None, tls=False):
    """mosquitto on loopback while the block runs; gives its process."""
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
        yield process
    finally:
        process.send_signal(signal.SIGCONT)  # a test may have stopped it
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
async def listening(port: int, topic: str | None = None, *, username=None, password=None, tls=None):
    """Another client, paho in a thread, and what came on a topic in a list."""
    got, heard = [], threading.Event()
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.username_pw_set(username, password)
    if tls is not None:
        client.tls_set_context(tls)
    client.on_message = lambda _, __, message: got.append((message.topic, json.loads(message.payload)))
    client.on_subscribe = lambda *_: heard.set()
    await asyncio.to_thread(client.connect, "127.0.0.1", port)
    client.loop_start()
    try:
        if topic is not None:
            client.subscribe(topic)
            assert await asyncio.to_thread(heard.wait, 60)
        yield client, got
    finally:
        client.disconnect()
        await asyncio.to_thread(client.loop_stop)


@contextlib.asynccontextmanager
async def pretended(port: int, *, takes_topics: bool = True, acknowledges: bool = True):
    """A broker that may refuse topics or not acknowledge, which mosquitto does not; gives what was published to it, as JSON."""
    got, links = [], []

    async def serve(reader, writer):
        links.append(writer)
        with contextlib.suppress(asyncio.IncompleteReadError):
            while True:
                kind, byte = await reader.readexactly(2)
                length, shift = byte & 0x7F, 7
                while byte >= 0x80:
                    (byte,) = await reader.readexactly(1)
                    length, shift = length | (byte & 0x7F) << shift, shift + 7
                body = await reader.readexactly(length)
                if kind == 0x10:
                    writer.write(b"\x20\x02\x00\x00")
                elif kind == 0x82:
                    writer.write(b"\x90\x03" + body[:2] + (b"\x00" if takes_topics else b"\x80"))
                elif kind & 0xF6 == 0x32:  # of quality 1, perhaps once more
                    end = 2 + int.from_bytes(body[:2], "big")
                    got.append(json.loads(body[end + 2 :]))
                    if acknowledges:
                        writer.write(b"\x40\x02" + body[end : end + 2])

    async with await asyncio.start_server(serve, "127.0.0.1", port):
        try:
            yield got
        finally:
            for link in links:
                link.close()

"""Just enough of MQTT 3.1.1 to send and receive thousands of messages a second from Python without being what is measured."""

from __future__ import annotations

import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def broker(folder: Path) -> Iterator[tuple[int, int]]:
    """mosquitto on loopback; gives its port and process."""
    path = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
    if path is None:
        raise SystemExit("there is no mosquitto: apt-get install mosquitto")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    conf = folder / "mosquitto.conf"
    conf.write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nset_tcp_nodelay true\nuser root\n"
    )
    process = subprocess.Popen([path, "-c", conf], stderr=subprocess.DEVNULL)
    try:
        for _ in range(500):
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
                break
            except OSError:
                time.sleep(0.02)
        yield port, process.pid
    finally:
        process.terminate()
        process.wait(10)


def packet(topic: str, payload: bytes) -> bytes:
    """A PUBLISH of quality 0."""
    name = topic.encode()
    body = len(name).to_bytes(2, "big") + name + payload
    return b"\x30" + _length(len(body)) + body


def _length(number: int) -> bytes:
    result = bytearray()
    while True:
        number, low = divmod(number, 128)
        result.append(low | (0x80 if number else 0))
        if not number:
            return bytes(result)


class Wire:
    """A connection to a broker."""

    def __init__(self, port: int, name: str) -> None:
        self.link = socket.create_connection(("127.0.0.1", port))
        self.link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        client = name.encode()
        body = b"\x00\x04MQTT\x04\x02\x00\x00" + len(client).to_bytes(2, "big") + client
        self.link.sendall(b"\x10" + _length(len(body)) + body)
        assert self.link.recv(4)[:1] == b"\x20"
        self._rest = b""

    def subscribe(self, topic: str) -> None:
        """Have what is published on a topic."""
        name = topic.encode()
        body = b"\x00\x01" + len(name).to_bytes(2, "big") + name + b"\x00"
        self.link.sendall(b"\x82" + _length(len(body)) + body)
        assert self.link.recv(5)[:1] == b"\x90"

    def messages(self) -> Iterator[tuple[bytes, bytes]]:
        """Topic and payload of each message that one read brings; raises TimeoutError as the link is set."""
        data = self._rest + self.link.recv(1 << 18)
        place = 0
        while len(data) - place >= 5:
            length = shift = 0
            head = place + 1
            while True:
                byte = data[head]
                head += 1
                length |= (byte & 0x7F) << shift
                shift += 7
                if byte < 0x80:
                    break
            if len(data) - head < length:
                break
            if data[place] & 0xF0 == 0x30:
                size = int.from_bytes(data[head : head + 2], "big")
                yield data[head + 2 : head + 2 + size], data[head + 2 + size : head + length]
            place = head + length
        self._rest = data[place:]

"""A robot, a drive that obeys the equations, and the way to run a live service in a test."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from contextlib import asynccontextmanager
from pathlib import Path
from weakref import WeakSet

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "estimation"))  # for drives.py

from drives import Drive, drive, robot
from terragrip.live.feed import Feed
from terragrip.live.many.links import Router
from terragrip.live.many.service import ManyService
from terragrip.live.outbox import Outbox
from terragrip.live.service import Service


@pytest.fixture(scope="session")
def vehicle():
    return robot()


@pytest.fixture(scope="session")
def short() -> Drive:
    return drive(6.0, imu=True)


@pytest.fixture
def port() -> int:
    """A UDP and TCP port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def rows_of(recording):
    """The rows as mappings, without what was not measured."""
    names = list(recording.channels)
    for time, *values in zip(recording.time, *(recording.channels[n] for n in names), strict=True):
        yield float(time), {n: float(v) for n, v in zip(names, values, strict=True) if v == v}


async def until(condition, seconds: float = 60.0) -> None:
    """Wait for something to become true; fails where it does not, even on a busy machine."""
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


@asynccontextmanager
async def running(service: Service | ManyService):
    """The service at work; what it published is in `service.seen`.

    The block begins when each source and each sink has its other side, or has said that it has not.
    """
    service.seen = []
    service.listeners.append(service.seen.append)
    service.task = task = asyncio.create_task(service.run())
    await until(lambda: is_settled(service) or task.done())
    try:
        yield service
    finally:
        service.stop()
        await asyncio.wait_for(task, 60)


_settled: WeakSet[Feed | Router | Outbox] = WeakSet()
"""Those that have said whether their other side is there."""


def is_settled(service: Service | ManyService) -> bool:
    """Whether each source and each sink has its other side, or has said that it has not."""
    ends = service.routers if isinstance(service, ManyService) else service.feeds
    return _settled.issuperset([*ends, *service.outboxes])


def _noted(say):
    def noted(self, *arguments):
        say(self, *arguments)
        _settled.add(self)

    return noted


for _kind in (Feed, Router, Outbox):
    for _name in ("connected", "lost"):
        setattr(_kind, _name, _noted(getattr(_kind, _name)))


async def estimated(service: Service) -> None:
    """Wait until the service has estimated what came in, or has ended."""
    while (service.inbox.samples or service.inbox._counts) and not service.task.done():
        await asyncio.sleep(0)


def events(service: Service, kind: str) -> list[str]:
    return [event.text for event in service.statistics.events if event.kind == kind]


def messages(recording, count: int):
    return [{"time": time, **values} for time, values in list(rows_of(recording))[:count]]


class Sender:
    """Sends datagrams to a service."""

    def __init__(self, port: int) -> None:
        self._link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._link.connect(("127.0.0.1", port))

    def send(self, *messages) -> None:
        for message in messages:
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            self._link.send(data)

    def close(self) -> None:
        self._link.close()


@pytest.fixture
def sender(port):
    result = Sender(port)
    yield result
    result.close()

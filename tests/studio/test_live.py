"""The live page's stream: a run played again, and a live service passed on."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

from terragrip.estimation import Estimates
from terragrip.studio.app import create_app
from terragrip.studio.replay import relayed

STREAM = "ws://127.0.0.1:8750/api/live"


def test_a_replay_sends_every_row_as_the_table_holds_it(client: TestClient, folder: Path) -> None:
    table = Estimates.read(folder / "estimates.parquet")
    blocks, hello, messages = [], {}, []
    with client.websocket_connect(f"{STREAM}?replay=estimates.parquet&speed=1000") as socket:
        while True:
            message = socket.receive()
            if message.get("bytes"):
                blocks.append(np.frombuffer(message["bytes"]).reshape(-1, 3 + len(hello["columns"])))
                continue
            text = json.loads(message["text"])
            if text["kind"] == "end":
                break
            hello = text if text["kind"] == "hello" else hello
            messages.append(text)
    rows = np.concatenate(blocks)
    np.testing.assert_array_equal(rows[:, 0], table.time)
    np.testing.assert_array_equal(rows[:, 2], table.event_codes)
    for name in ("slip_rr", "adhesion_fl", "curve_a"):
        np.testing.assert_array_equal(rows[:, 3 + hello["columns"].index(name)], table[name])
    assert [m["soil"] for m in messages if m["kind"] == "soil"] == ["grass"]
    expected = [m["kind"] for m in messages if m.get("source") == "estimator"]
    assert expected[0] == table["event"][np.flatnonzero(table.event_codes)[0]]


@pytest.mark.parametrize(
    ("query", "why"),
    [
        ("", "no live service"),
        ("replay=nothing.parquet", "no such file"),
        ("replay=vehicle.yaml", "Parquet"),
        ("replay=../x", "not a path"),
    ],
)
def test_what_cannot_be_played_is_said(client: TestClient, query: str, why: str) -> None:
    with client.websocket_connect(f"{STREAM}?{query}") as socket:
        messages = socket.receive_json()
    assert messages["kind"] == "problem"
    assert why in messages["text"]
    assert "\n" not in messages["text"]


@pytest.fixture
def service() -> Iterator[str]:
    """A stand-in for a live service: hello, 200 rows, an event, then it goes."""
    from websockets.asyncio.server import ServerConnection, serve

    ready, stop, address = threading.Event(), threading.Event(), []

    async def answer(socket: ServerConnection) -> None:
        await socket.send(
            json.dumps(
                {
                    "kind": "hello",
                    "vehicle": "v",
                    "columns": ["slip_a"],
                    "wheels": ["a"],
                    "driven": ["a"],
                    "events": [""],
                }
            )
        )
        for i in range(200):
            await socket.send(np.array([i, 0.0, 0.0, i / 1000]).tobytes())
        await socket.send(json.dumps({"kind": "status", "time": 1.0}))
        await socket.send(np.array([200, 0.0, 0.0, 0.2]).tobytes())
        await asyncio.sleep(0.2)

    async def run() -> None:
        async with serve(answer, "127.0.0.1", 0) as server:
            address.append(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}")
            ready.set()
            while not stop.is_set():
                await asyncio.sleep(0.02)

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    assert ready.wait(60)
    yield address[0]
    stop.set()
    thread.join(10)


def test_a_live_service_is_passed_on_whole_and_in_order(folder: Path, service: str) -> None:
    with (
        TestClient(create_app(folder, live=service), base_url="http://127.0.0.1:8750") as client,
        client.websocket_connect(STREAM) as socket,
    ):
        hello = socket.receive_json()
        assert hello["columns"] == ["slip_a"]
        times: list[float] = []
        statuses = []
        while True:
            message = socket.receive()
            if message.get("bytes"):
                times += np.frombuffer(message["bytes"]).reshape(-1, 4)[:, 0].tolist()
                continue
            text = json.loads(message["text"])
            if text["kind"] == "end":
                break
            statuses.append((len(times), text["kind"]))
    assert times == [float(i) for i in range(201)]
    assert statuses == [(200, "status")]


def test_a_service_that_is_not_there_is_said(folder: Path) -> None:
    with (
        TestClient(create_app(folder, live="ws://127.0.0.1:9"), base_url="http://127.0.0.1:8750") as client,
        client.websocket_connect(STREAM) as socket,
    ):
        said = socket.receive_json()["text"]
    assert "does not answer" in said
    assert "studio://127.0.0.1:9" in said  # the address that was named, not another


def test_a_page_that_leaves_rows_unread_is_left_at_once(service: str) -> None:
    """A studio took ten seconds more to end, or twenty."""

    async def leave() -> float:
        messages = relayed(service, None)
        await anext(messages)
        await asyncio.sleep(0.3)  # meanwhile more rows come than are kept
        begun = time.monotonic()
        await messages.aclose()
        return time.monotonic() - begun

    assert asyncio.run(leave()) < 5

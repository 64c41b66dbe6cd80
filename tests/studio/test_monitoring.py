"""What a monitoring system is told of the studio, and of the live service behind it."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from terragrip.studio.app import create_app

TOKEN = "a-token-of-many-characters"


def test_a_studio_whose_folder_is_gone_is_alive_and_not_ready(client: TestClient, folder: Path) -> None:
    assert (client.get("/health/ready").status_code, client.get("/health/ready").text) == (200, "ready\n")
    shutil.rmtree(folder)
    answer = client.get("/health/ready")
    assert (answer.status_code, answer.text.count("\n")) == (503, 1)
    assert "folder is gone" in answer.text
    assert str(folder) not in answer.text
    assert client.get("/health/live").text == "alive\n"
    client.app.state.studio.prepare_maps()  # type: ignore[attr-defined]  # its thread may look after the folder has gone


def test_where_there_is_a_token_it_is_needed_here_too(folder: Path) -> None:
    with TestClient(create_app(folder, token=TOKEN), base_url="http://192.0.2.7:8750") as client:
        for path in ("/health/live", "/health/ready", "/metrics"):
            assert client.get(path).status_code == 401
            assert client.get(path, headers={"authorization": f"Bearer {TOKEN}"}).status_code == 200


def test_metrics_count_jobs_and_pages(client: TestClient) -> None:
    answer = client.get("/metrics")
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    assert "# TYPE terragrip_studio_pages gauge\nterragrip_studio_pages 0\n" in answer.text
    assert 'terragrip_studio_jobs{state="failed"} 0\n' in answer.text
    with client.websocket_connect("ws://127.0.0.1:8750/api/notices"):
        assert "terragrip_studio_pages 1\n" in client.get("/metrics").text


@pytest.fixture
def live(folder: Path) -> Iterator[str]:
    """``terragrip live`` whose source sends nothing; its WebSocket's address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    words = ["--vehicle", "vehicle.yaml", "--source", f"udp://127.0.0.1:{port}"]
    command = [sys.executable, "-m", "terragrip", "live", *words, "--sink", f"studio://127.0.0.1:{port}"]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield f"ws://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.wait(60)


def test_a_studio_before_a_live_service_is_ready_when_that_is(folder: Path, live: str) -> None:
    with TestClient(create_app(folder, live=live), base_url="http://127.0.0.1:8750") as client:
        deadline = time.monotonic() + 120
        while "does not answer" in (why := client.get("/health/ready").text) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert why == f"the live service: nothing has come from udp://{live.removeprefix('ws://')} yet\n"
        assert client.get("/health/live").status_code == 200


def test_a_live_service_that_is_not_there_is_the_reason(folder: Path) -> None:
    app = create_app(folder, live="ws://127.0.0.1:9")
    with TestClient(app, base_url="http://127.0.0.1:8750") as client:
        answer = client.get("/health/ready")
    assert (answer.status_code, answer.text) == (
        503,
        "the live service at 127.0.0.1:9 does not answer (Connection refused)\n",
    )

"""Advice of a run: what the interface gives is what the command writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from terragrip.cli import main

if TYPE_CHECKING:
    from fastapi.testclient import TestClient


def advised(folder: Path) -> dict[str, Any]:
    """What the command writes for the folder's run."""
    out = folder / "advice.json"
    files = [str(folder / "estimates.parquet"), "--vehicle", str(folder / "vehicle.yaml")]
    assert main(["advise", *files, "-o", str(out), "--quiet"]) == 0
    return json.loads(out.read_text())


def test_the_interface_gives_what_the_command_writes(client: TestClient, folder: Path) -> None:
    said = client.get("/api/advice", params={"path": "estimates.parquet"}).json()
    (soil,) = said["soils"]
    written = advised(folder)
    assert written["best_efficiency"] is not None
    for key in ("best_efficiency", "best_productivity", "actions", "missing", "grip_reserve"):
        assert soil[key] == written[key]
    assert said["weight"] == pytest.approx(139 * 9.80665, rel=0.05)  # the campaign's robot


def test_a_replaced_run_and_a_run_that_is_not_there_are_one_line(client: TestClient) -> None:
    for query in ({"path": "estimates.parquet", "version": "older"}, {"path": "nothing.parquet"}):
        answer = client.get("/api/advice", params=query)
        assert 400 <= answer.status_code < 500
        assert "\n" not in answer.json()["detail"]

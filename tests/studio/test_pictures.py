"""A picture's calibration is kept beside it, checked, and sent to every page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

NOTICES = "ws://127.0.0.1:8750/api/notices"

PNG = b"\x89PNG\r\n\x1a\n" + b"\0" * 40


def axis(first: float = 0.0, second: float = 0.5, log: bool = False) -> dict[str, Any]:
    return {"marks": [{"pixel": [10, 90], "value": first}, {"pixel": [90, 80], "value": second}], "log": log}


@pytest.fixture
def picture(folder: Path) -> str:
    (folder / "scan.png").write_bytes(PNG)
    return "scan.png"


def test_a_calibration_is_kept_beside_the_picture(client: TestClient, folder: Path, picture: str) -> None:
    assert client.get("/api/picture", params={"path": picture}).json()["slip"] is None
    whole = {
        "slip": axis(),
        "adhesion": axis(0.1, 10.0, log=True),
        "opacity": 0.3,
        "lines": [{"name": "dry", "points": [[0.1, 0.4]]}],
    }
    with client.websocket_connect(NOTICES) as other:
        assert client.put("/api/picture", params={"path": picture, "by": "me"}, json=whole).status_code == 200
        assert other.receive_json() == {"kind": "picture", "path": picture, "by": "me"}
    assert json.loads((folder / "scan.png.picture.json").read_text())["opacity"] == 0.3
    back = client.get("/api/picture", params={"path": picture}).json()
    assert {name: back[name] for name in whole} == whole


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"slip": axis(0.2, 0.2)}, "must differ"),
        ({"slip": axis(0.0, 1.0, log=True)}, "logarithmic"),
        ({"slip": {"marks": [], "log": False}}, "slip"),
        ({"opacity": 2}, "opacity"),
    ],
)
def test_an_impossible_calibration_is_refused(
    client: TestClient, folder: Path, picture: str, changes: Any, why: str
) -> None:
    answer = client.put("/api/picture", params={"path": picture}, json=changes)
    assert answer.status_code == 422
    assert why in answer.json()["detail"]
    assert not (folder / "scan.png.picture.json").exists()


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"version": 9}', '{"opacity": "much"}', '{"slip": {"marks": 3}}']
)
def test_a_damaged_calibration_is_named(client: TestClient, folder: Path, picture: str, text: str) -> None:
    (folder / "scan.png.picture.json").write_text(text)
    answer = client.get("/api/picture", params={"path": picture})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("scan.png.picture.json")

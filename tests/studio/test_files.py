"""Uploads are whole, sized, checked by content; a log is looked into."""

from __future__ import annotations

import errno
import gzip
import os
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

NOTICES = "ws://127.0.0.1:8750/api/notices"

PNG = b"\x89PNG\r\n\x1a\n" + b"\0" * 40


def put(client: TestClient, path: str, content: bytes, **query: object) -> tuple[int, str]:
    answer = client.put("/api/file", params={"path": path, **query}, content=content)
    return answer.status_code, answer.json().get("detail", "")


def test_a_good_log_is_taken_and_told(client: TestClient, folder: Path) -> None:
    text = b"time,wheel_speed_fl,ground_speed\n" + b"".join(b"%d,5.0,1.0\n" % i for i in range(50))
    assert put(client, "new.csv", text)[0] == 201
    assert (folder / "new.csv").read_bytes() == text
    result = client.get("/api/inspect", params={"path": "new.csv"}).json()
    assert result["rows"] == 50
    assert str(folder) not in result["text"]


@pytest.mark.parametrize(
    ("path", "content", "why"),
    [
        ("broken.parquet", b"PAR1 and then nothing of the sort", ""),
        ("empty.csv", b"", "is empty"),
        ("virus.exe", b"MZ", "not a file that the studio accepts"),
        ("day.xlsx", b"PK\x03\x04", "save the sheet as CSV"),
        ("page.html", b"<script>alert(1)</script>", "not a file that the studio accepts"),
        ("picture.png", b"<svg onload='alert(1)'>", "is no PNG picture"),
        ("picture.svg", b"<svg xmlns='http://www.w3.org/2000/svg'/>", "not a picture that the studio accepts"),
        ("bad.yaml", b"axles: {front: {mass: -1 kg}}", ""),
        ("soils.json", b"{}", "exists already"),
        ("bomb.csv.gz", None, "unpacks to more than 34 MB"),
        ("lib.json", b'{"soils": {"x": {"model": "none"}}}', "not known"),
        ("no/such/folder.csv", b"a,b\n1,2\n", "cannot be written there"),
    ],
)  # fmt: skip
def test_what_is_not_what_its_name_says_is_refused_and_leaves_nothing(
    client: TestClient, folder: Path, path: str, content: bytes | None, why: str
) -> None:
    if content is None:  # not while every worker imports this file
        content = gzip.compress(b"time,ground_speed\n" + b"1,1\n" * 15_000_000)
    before = {p: p.read_bytes() for p in folder.iterdir()}
    status, detail = put(client, path, content)
    assert status == 422
    assert why in detail
    assert "\n" not in detail
    assert str(folder) not in detail
    assert {p: p.read_bytes() for p in folder.iterdir()} == before


def test_an_upload_over_the_limit_is_refused(client: TestClient, folder: Path) -> None:
    before = sorted(folder.iterdir())
    status, detail = put(client, "large.csv", b"x" * 2_000_001)
    assert status == 422
    assert "larger than 2 MB" in detail
    assert sorted(folder.iterdir()) == before


def test_a_picture_is_shown_and_everything_else_is_a_download(client: TestClient) -> None:
    assert put(client, "scan.png", PNG)[0] == 201
    assert client.get("/api/file", params={"path": "scan.png"}).headers["content-type"] == "image/png"
    answer = client.get("/api/file", params={"path": "vehicle.yaml"})
    assert answer.headers["content-disposition"].startswith("attachment")


def test_replacing_must_be_asked_for(client: TestClient, folder: Path) -> None:
    assert put(client, "scan.png", PNG)[0] == 201
    assert put(client, "scan.png", PNG + b"1")[0] == 422
    assert put(client, "scan.png", PNG + b"1", replace=True)[0] == 201
    assert (folder / "scan.png").read_bytes().endswith(b"1")


def test_pages_hear_of_a_new_file(client: TestClient, folder: Path) -> None:
    with client.websocket_connect(NOTICES) as one, client.websocket_connect(NOTICES) as two:
        (folder / "another.yaml").write_text("axles: {}")
        assert one.receive_json() == {"kind": "folder"}
        assert two.receive_json() == {"kind": "folder"}


def test_a_file_that_cannot_be_removed_is_named_with_the_reason(
    client: TestClient, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A read-only disk gave an 'Internal Server Error'."""

    def refuse(path: Path) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "unlink", refuse)
    answer = client.delete("/api/file", params={"path": "soils.json"})
    monkeypatch.undo()
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("soils.json: cannot be removed (Read-only file system)")

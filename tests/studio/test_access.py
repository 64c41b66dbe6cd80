"""Other sites, other hosts and strangers get nothing; the studio's own page gets everything."""

from __future__ import annotations

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from terragrip.studio.access import COOKIE
from terragrip.studio.app import create_app

NOTICES = "ws://127.0.0.1:8750/api/notices"

TOKEN = "a-token-of-many-characters"


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},  # DNS rebinding
        {"host": "127.0.0.1.evil.example:8750"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},  # another program on this machine
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"},
    ],
)
def test_requests_of_other_sites_are_refused(client: TestClient, headers: dict[str, str]) -> None:
    assert client.get("/api/folder", headers=headers).status_code == 403
    assert client.put("/api/file?path=x.csv", content=b"a", headers=headers).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(NOTICES, headers=headers):
        pass


@pytest.mark.parametrize("host", ["127.0.0.1:8750", "localhost:8750", "[::1]:8750", "LOCALHOST"])
def test_the_studios_own_page_is_served(client: TestClient, host: str) -> None:
    headers = {"host": host, "origin": f"http://{host}", "sec-fetch-site": "same-origin"}
    assert client.get("/api/folder", headers=headers).status_code == 200
    with client.websocket_connect(NOTICES, headers=headers):
        pass


def test_a_program_without_an_origin_is_served(client: TestClient) -> None:
    assert client.get("/api/folder").status_code == 200


def test_every_answer_carries_a_strict_policy(client: TestClient) -> None:
    for answer in (client.get("/api/folder"), client.get("/api/folder", headers={"host": "evil.example"})):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_with_a_token_nothing_is_had_without_it(folder: Path) -> None:
    with TestClient(create_app(folder, token=TOKEN), base_url="http://192.0.2.7:8750") as client:
        for path in ("/", "/api/folder", "/openapi.json", "/api/file?path=vehicle.yaml"):
            assert client.get(path).status_code == 401
        assert client.get("/api/folder", headers={"authorization": "Bearer wrong"}).status_code == 401
        assert client.get("/api/folder", headers={"cookie": f"{COOKIE}=wrong"}).status_code == 401
        with pytest.raises(WebSocketDisconnect), client.websocket_connect("ws://192.0.2.7:8750/api/notices"):
            pass
        assert client.get("/?token=wrong", follow_redirects=False).status_code == 401
        assert client.get("/api/folder", headers={"authorization": f"Bearer {TOKEN}"}).status_code == 200


def test_the_printed_address_logs_in_by_a_cookie_that_scripts_cannot_read(folder: Path) -> None:
    with TestClient(create_app(folder, token=TOKEN), base_url="http://192.0.2.7:8750") as client:
        answer = client.get(f"/?token={TOKEN}", follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        cookie = answer.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert client.get("/api/folder").status_code == 200


def test_with_a_token_a_rebound_name_is_still_refused(folder: Path) -> None:
    with TestClient(create_app(folder, token=TOKEN), base_url="http://evil.example") as client:
        assert client.get("/api/folder", headers={"authorization": f"Bearer {TOKEN}"}).status_code == 403


PUBLIC = "https://field.example.org/studio"


@pytest.mark.parametrize("host", ["127.0.0.1:8750", "field.example.org"])
def test_a_reverse_proxy_passes_whether_it_keeps_the_host_or_not(folder: Path, host: str) -> None:
    """nginx sends its upstream's name by default, others the browser's; the browser's origin is the public address in both."""
    app = create_app(folder, token=TOKEN, public=PUBLIC)
    headers = {"host": host, "origin": "https://field.example.org", "sec-fetch-site": "same-origin"}
    with TestClient(app, base_url=f"http://{host}") as client:
        answer = client.get(f"/?token={TOKEN}", headers={"host": host}, follow_redirects=False)
        assert answer.headers["location"] == "/studio/"
        assert "Path=/studio/; Secure" in answer.headers["set-cookie"]
        headers["cookie"] = f"{COOKIE}={TOKEN}"
        assert client.get("/api/folder", headers=headers).status_code == 200
        with client.websocket_connect(f"ws://{host}/api/notices", headers=headers):
            pass
        for wrong in ({"origin": "https://evil.example"}, {"host": "evil.example"}):
            assert client.get("/api/folder", headers=headers | wrong).status_code == 403
        del headers["cookie"]
        assert client.get("/api/folder", headers=headers).status_code == 401


def test_a_machine_is_named_by_its_local_name_where_there_is_a_token(
    folder: Path, client: TestClient
) -> None:
    with TestClient(create_app(folder, token=TOKEN), base_url="http://tractor.local:8750") as named:
        assert named.get("/api/folder").status_code == 401
        headers = {"authorization": f"Bearer {TOKEN}", "origin": "http://tractor.local:8750"}
        assert named.get("/api/folder", headers=headers).status_code == 200
    assert client.get("/api/folder", headers={"host": "tractor.local:8750"}).status_code == 403

"""``terragrip studio`` as a process: what it prints is what gets a browser in, also behind a reverse proxy."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from terragrip.cli import main

PUBLIC = "https://field.example.org/studio"


@contextmanager
def studio(folder: Path, *words: str, lines: int) -> Iterator[list[str]]:
    """The command on the folder; its first lines."""
    given = {name: value for name, value in os.environ.items() if name != "TERRAGRIP_TOKEN"}
    command = [sys.executable, "-m", "terragrip", "studio", str(folder), "--port", "0", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=given) as process:
        try:
            printed = [process.stdout.readline().rstrip() for _ in range(lines)]
            yield [line for line in printed if not line.startswith("The pages are not built")]
        finally:
            process.terminate()
            process.wait(60)


def test_behind_a_proxy_the_printed_address_is_the_public_one_and_its_token_is_needed(
    tmp_path: Path,
) -> None:
    with studio(tmp_path, "--public-url", PUBLIC, lines=2) as printed:
        shown = re.fullmatch(rf"Terragrip studio: {PUBLIC}/\?token=(\S+)", printed[0])
        own = re.fullmatch(r"The proxy must forward to http://127\.0\.0\.1:(\d+)/\.", printed[1])
        assert shown, printed
        assert own, printed

        def get(path: str, **headers: str) -> http.client.HTTPResponse:
            connection = http.client.HTTPConnection("127.0.0.1", int(own[1]), timeout=60)
            proxied = {"Host": "field.example.org", "Origin": "https://field.example.org"}
            connection.request("GET", path, headers={**proxied, **headers})
            answer = connection.getresponse()
            answer.read()
            connection.close()
            return answer

        assert get("/api/folder").status == 401
        answer = get(f"/?token={shown[1]}")
        assert (answer.status, answer.getheader("location")) == (303, "/studio/")
        cookie = answer.getheader("set-cookie")
        assert "Path=/studio/; Secure" in cookie
        mine = cookie.partition(";")[0]
        assert get("/api/folder", Cookie=mine).status == 200
        assert get("/api/folder", Cookie=mine, Host="evil.example").status == 403


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    """A certificate of 127.0.0.1 and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("NOT TESTED: there is no openssl; apt-get install openssl")
    chain, key = tmp_path / "studio.pem", tmp_path / "studio.key"
    words = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=studio -addext subjectAltName=IP:127.0.0.1"
    files = ["-out", str(chain), "-keyout", str(key)]
    subprocess.run(["openssl", *words.split(), *files], check=True, capture_output=True)
    return chain, key


def test_https_by_a_certificate_and_a_line_for_each_write(
    certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    chain, key = certificate
    folder, log = tmp_path / "folder", tmp_path / "log"
    folder.mkdir()
    words = ["--tls-certificate", str(chain), "--tls-key", str(key), "--log-format", "json"]
    command = [sys.executable, "-m", "terragrip", "studio", str(folder), "--port", "0", *words]
    with open(log, "w") as sink, subprocess.Popen(command, stderr=sink) as process:
        try:
            place = ""
            while not place and process.poll() is None:
                time.sleep(0.02)
                first, end, _ = log.read_text().partition("\n")
                place = json.loads(first)["address"] if end else ""
            assert place.startswith("https://127.0.0.1:")
            trusted = ssl.create_default_context(cafile=str(chain))
            with urllib.request.urlopen(f"{place}api/folder", context=trusted, timeout=60) as answer:
                assert answer.status == 200
            with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
                urllib.request.urlopen(f"{place}api/folder", timeout=60)
            wrong = urllib.request.Request(f"{place}api/nothing", method="POST", data=b"")
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(wrong, context=trusted, timeout=60)
            refused.value.close()
        finally:
            process.terminate()
            process.wait(60)
    events = [json.loads(line) for line in log.read_text().splitlines()]
    writes = [event for event in events if event["event"] == "studio_write"]
    assert [(one["client"], one["method"], one["path"], one["status"]) for one in writes] == [
        ("127.0.0.1", "POST", "/api/nothing", refused.value.code)
    ]


def test_a_certificate_that_cannot_be_used_is_refused_in_one_line(
    certificate: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chain, key = map(str, certificate)
    for words, said in (
        ([chain], "--tls-key: a certificate needs its key, and a key its certificate"),
        ([chain, "--tls-key", str(tmp_path / "none.key")], "none.key: --tls-certificate: is not there"),
        ([key, "--tls-key", key], "cannot be used with"),
    ):
        assert main(["studio", str(tmp_path), "--tls-certificate", *words]) == 2
        line = capsys.readouterr().err
        assert said in line
        assert line.count("\n") == 1


@pytest.mark.parametrize(
    "url", ["field.example.org/studio", "ftp://field.example.org", "https://", "https://h/?a=1"]
)
def test_what_is_no_web_address_is_refused_in_one_line(
    url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["studio", str(tmp_path), "--public-url", url]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--public-url" in error
    assert "https://HOST" in error


def test_json_alone_is_logged_and_no_token_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TERRAGRIP_TOKEN", raising=False)
    command = [sys.executable, "-m", "terragrip", "studio", str(tmp_path), "--port", "0"]
    with subprocess.Popen(
        [*command, "--log-format", "json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        first = json.loads(process.stderr.readline())
        process.terminate()
        said, rest = process.communicate(timeout=60)
    assert first["event"] == "studio_started"
    assert first["address"].startswith("http://127.0.0.1:")
    assert said == ""
    assert all(json.loads(line) for line in rest.splitlines())
    open_to_all = [*command, "--address", "0.0.0.0", "--log-format", "json"]
    done = subprocess.run(open_to_all, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "set TERRAGRIP_TOKEN" in done.stderr

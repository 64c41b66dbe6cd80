"""A fleet whose logs and data set are on S3: moto's server on this machine, asked by s3fs, in workers of their own."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from small_fleet import call, free_port, serve, whole
from terragrip.cli import main

pytestmark = [
    pytest.mark.skipif(find_spec(name) is None, reason=f"NOT TESTED: {name} is not installed")
    for name in ("s3fs", "moto")
]  # imported where they are used: each worker of a run reads this file, and one runs it

BUCKET = "fields"


class Moody:
    """A store that refuses the first write of each object, but not the trial at the start."""

    def __init__(self) -> None:
        self.refused: set[str] = set()
        from moto.server import DomainDispatcherApplication, create_backend_app

        self._store = DomainDispatcherApplication(create_backend_app)

    def __call__(self, request: dict[str, Any], begin: Callable[..., Any]) -> Any:
        name = request["PATH_INFO"]
        written = request["REQUEST_METHOD"] == "PUT" and "/out/" in name and "/.tmp/" not in name
        if written and name not in self.refused:
            self.refused.add(name)
            request["wsgi.input"].read(int(request.get("CONTENT_LENGTH") or 0))
            begin("500 Internal Server Error", [("Content-Type", "text/plain"), ("Connection", "close")])
            return [b""]
        return self._store(request, begin)


@pytest.fixture
def moody() -> Iterator[tuple[Moody, dict[str, str]]]:
    """The store, and what says to s3fs where it is; botocore itself does not try again."""
    from werkzeug.serving import make_server

    store, port = Moody(), free_port()
    server = make_server("127.0.0.1", port, store, threaded=True)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield (
        store,
        {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
            "AWS_ACCESS_KEY_ID": "none",
            "AWS_SECRET_ACCESS_KEY": "none",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_MAX_ATTEMPTS": "1",
            "NO_PROXY": "127.0.0.1",
        },
    )
    server.shutdown()


@pytest.mark.long  # test_cluster.py: a store that refuses each first write
def test_logs_and_data_set_on_s3(
    place: Path,
    moody: tuple[Moody, dict[str, str]],
    started: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    import boto3

    store, said = moody
    port = free_port()
    started += serve(place, port, **said)
    for name, value in said.items():
        monkeypatch.setenv(name, value)
    s3 = boto3.client("s3")
    s3.create_bucket(Bucket=BUCKET)
    for path in (place / "logs/b").glob("*.csv"):
        s3.upload_file(str(path), BUCKET, f"logs/{path.name}")
    words = (f"s3://{BUCKET}/logs/*.csv", "--vehicle", place / "Heros.yaml", "-o", f"s3://{BUCKET}/out")
    for estimated in (3, 0):
        assert main(call(place, *words, "--scheduler", f"tcp://127.0.0.1:{port}")) == 0
        printed = capsys.readouterr()
        assert printed.err == ""
        assert f"{estimated} estimated, {3 - estimated} unchanged, 0 failed" in printed.out
    # what the store holds, as any other folder
    for one in s3.list_objects_v2(Bucket=BUCKET, Prefix="out/")["Contents"]:
        local = place / one["Key"]
        local.parent.mkdir(parents=True, exist_ok=True)
        s3.download_file(BUCKET, one["Key"], str(local))
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (3, {})
    files = set(pd.read_parquet(place / "out/summary.parquet")["file"])
    assert {f"/{BUCKET}/out/{file}" for file in files} <= store.refused
    alone = tg.estimate(tg.read(place / "logs/b/drive4.csv"), tg.Vehicle.load(place / "Heros.yaml"))
    table = pd.read_parquet(
        place / "out/estimates/vehicle=Heros/day=2026-05-03/drive4.csv.parquet", partitioning=None
    )
    np.testing.assert_array_equal(table["slip_l"], alone["slip_l"])


def test_a_store_that_does_not_answer(
    place: Path,
    moody: tuple[Moody, dict[str, str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name, value in (moody[1] | {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{free_port()}"}).items():
        monkeypatch.setenv(name, value)
    assert main(call(place, "-o", f"s3://{BUCKET}/out")) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert "cannot be written" in errors

"""``--log-format json``: lines of JSON alone, of a closed list of events, without a secret."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from terragrip.log_events import EVENTS, emit
from terragrip.simulation import Scenario

TOKEN, PASSWORD = "a-token-of-many-characters", 'a "quoted" password'
SECRETS = {"TERRAGRIP_TOKEN": TOKEN, "TERRAGRIP_PASSWORD": PASSWORD, "TERRAGRIP_USERNAME": "me"}


def lines(text: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in text.splitlines()]


def test_an_event_that_is_not_listed_is_refused() -> None:
    assert len(set(EVENTS)) == len(EVENTS)
    with pytest.raises(ValueError, match="no event"):
        emit(logging.getLogger("terragrip"), "something")


def test_live_logs_its_life_in_json_and_no_secret(tmp_path: Path) -> None:
    pytest.importorskip("paho.mqtt")
    vehicle = tmp_path / "vehicle.yaml"
    Scenario.load("grass-05").nominal_vehicle().save(vehicle)
    words = ["--source", "udp://127.0.0.1:0", "--source", "mqtt://127.0.0.1:1/machine", "--duration", "1.6"]
    command = [sys.executable, "-m", "terragrip", "live", "--vehicle", str(vehicle), *words]
    done = subprocess.run(
        [*command, "--log-format", "json"], env={**os.environ, **SECRETS}, capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    events = lines(done.stderr)
    names = [one["event"] for one in events]
    assert (names[0], names[-1]) == ("live_started", "live_stopped")
    assert "source_lost" in names
    assert set(names) <= set(EVENTS)
    assert events[-1]["rows"] == 0
    assert all({"timestamp", "level", "logger"} <= one.keys() for one in events)
    assert TOKEN not in done.stderr
    assert "quoted" not in done.stderr


def test_a_secret_is_blanked_out_of_any_line_also_of_other_libraries() -> None:
    code = (
        "import logging; from terragrip.cli.log import LogForm, log_to_stderr; log_to_stderr(LogForm.json)\n"
        "logging.getLogger('other').warning('GET /?token=abcdef&x=1 %s', '" + TOKEN + "')\n"
        "logging.getLogger('terragrip.live').info('schema', extra={'text': " + repr(PASSWORD) + "})\n"
    )
    environment = {**os.environ, **SECRETS}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    first, second = lines(done.stderr)
    assert first["event"] == "GET /?token=***&x=1 ***"
    assert second["text"] == "***"

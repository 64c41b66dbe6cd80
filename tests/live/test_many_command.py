"""``terragrip live`` of many vehicles as a user starts it: killed and started again, refused in one line."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess

import numpy as np
import pytest

from drives import drive
from machine import messages
from mosquitto import broker, listening
from terragrip.cli import main
from terragrip.estimation import TractionEstimator
from terragrip.live import read_record
from test_cli import COMMAND

PATIENCE = 300.0
"""How long [s] a busy machine may need; no test passes or fails by what it waits less."""


@pytest.mark.long  # of one vehicle: test_cli.py; of several in one process: test_many.py
@pytest.mark.asyncio
async def test_killed_and_started_again_each_goes_on(tmp_path, vehicle, port):
    """Two kills among the samples of three vehicles: every estimate heard a second before a kill is kept, and all are those of one run."""
    vehicle.save(tmp_path / "robot.yaml")
    (tmp_path / "index.csv").write_text("name;vehicle\na;robot.yaml\nb;robot.yaml\nc;robot.yaml\n")
    sent = {n: messages(drive(9.0, rate=50.0, seed=k).recording, 450) for k, n in enumerate("abc")}
    record = tmp_path / "many"
    at = f"mqtt://127.0.0.1:{port}/field/{{vehicle}}"
    command = [
        *COMMAND, "--index", str(tmp_path / "index.csv"), "--source", f"{at}/sample", "--sink", at,
        "--record", str(record),
    ]  # fmt: skip
    with broker(tmp_path, port):
        async with listening(port, "field/+/estimate") as (client, got):

            async def publish(k: int) -> None:
                for name, one in sent.items():
                    client.publish(f"field/{name}/sample", json.dumps(one[k]))

            def reached(k: int) -> bool:
                """Whether the estimate of each vehicle's row ``k`` has come."""
                there = {
                    topic
                    for topic, data in got
                    if data["time"] == sent["a"][k]["time"] and not data["predicted"]
                }
                return len(there) == len(sent)

            for part in range(3):
                process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                async with asyncio.timeout(PATIENCE):
                    while not reached(150 * part):  # a sample that it has already is doubled, and dropped
                        await publish(150 * part)
                        await asyncio.sleep(0.1)
                    for k in range(150 * part + 1, 150 * part + 150):
                        await publish(k)
                        await asyncio.sleep(0.002)
                    while not reached(150 * part + 149):
                        await asyncio.sleep(0.02)
                await asyncio.sleep(1.0)
                process.send_signal(signal.SIGKILL if part < 2 else signal.SIGINT)
                out, err = await asyncio.to_thread(process.communicate)
    assert process.returncode == 0, err
    assert "3 vehicles, 1350 rows estimated" in out
    assert f"Recorded in {record}" in out
    for name, one in sent.items():
        assert f"{name}: resumed: record: resumed after 300 rows" in err
        kept, estimates = read_record(record / name)
        assert kept.time.tolist() == [message["time"] for message in one]
        through_all = TractionEstimator(vehicle, channels=tuple(kept.channels)).update_block(kept)
        for column, values in through_all.columns.items():
            assert np.array_equal(estimates.columns[column], values, equal_nan=True), column


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (["--source", "mqtt://h/{vehicle}/s"], "no vehicle is named"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "absent.csv"], "absent.csv"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "odd.csv"], "odd.csv: line 1: has an unknown column"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "twice.csv"], "twice.csv: row 3: a occurs here twice"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "name.csv"], "name.csv: row 2: '../x' is not a vehicle's name"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "empty.csv"], "empty.csv: names no vehicle"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "lost.csv"], "nowhere.yaml"),
        (["--source", "mqtt://h/{vehicle}/s", "--index", "none.csv"], "no vehicle file for t1; write one in its row"),
        (["--source", "mqtt://h/{vehicle}/s", "--vehicle", "robot.yaml", "--record", "robot.yaml"], "robot.yaml"),
        (["--source", "mqtt://h/s", "--sink", "mqtt://h/{vehicle}", "--vehicle", "robot.yaml"], "not one whole level"),
        (["--source", "mqtt://h/{vehicle}/s", "--vehicle", "robot.yaml", "--method", "magic"], "magic"),
        (["--source", "mqtt://h/s"], "no vehicle is named"),
    ],
)  # fmt: skip
def test_refused_in_one_line(tmp_path, vehicle, monkeypatch, capsys, options, why):
    monkeypatch.chdir(tmp_path)
    vehicle.save(tmp_path / "robot.yaml")
    for name, text in {
        "odd": "name,log\na,b\n", "twice": "name\na\na\n", "name": "name,vehicle\n../x,robot.yaml\n",
        "empty": "name,vehicle\n", "none": "name,vehicle\nt1,\n", "lost": "name,vehicle\na,nowhere.yaml\nb,nowhere.yaml\n",
    }.items():  # fmt: skip
        (tmp_path / f"{name}.csv").write_text(text)
    before = sorted(tmp_path.iterdir())
    assert main(["live", *options]) == 2
    error = capsys.readouterr().err
    assert why in error
    assert len(error.strip().splitlines()) == 1, error
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.asyncio
async def test_log_lines_bear_the_vehicle(tmp_path, vehicle, port):
    """--log-format json, through a broker, with a reader of JSON."""
    vehicle.save(tmp_path / "robot.yaml")
    at = f"mqtt://127.0.0.1:{port}/{{vehicle}}/s"
    command = [*COMMAND, "--vehicle", str(tmp_path / "robot.yaml"), "--source", at, "--log-format", "json"]
    with broker(tmp_path, port):
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=dict(os.environ)
        )
        lines: list[dict] = []

        async def read() -> None:
            while line := await asyncio.to_thread(process.stderr.readline):
                lines.append(json.loads(line))

        reading = asyncio.create_task(read())
        async with listening(port) as (client, _), asyncio.timeout(PATIENCE):
            while not any(line["event"] == "unreadable" for line in lines):
                client.publish("t7/s", b"no json")
                await asyncio.sleep(0.05)
        process.send_signal(signal.SIGINT)
        await asyncio.wait_for(reading, PATIENCE)
        process.wait(PATIENCE)
        process.stdout.close()
        process.stderr.close()
    by_event = {line["event"]: line for line in lines}
    assert by_event["vehicle_started"]["vehicle"] == by_event["unreadable"]["vehicle"] == "t7"
    assert by_event["live_started"]["sources"] == [at]
    assert by_event["live_stopped"]["vehicles"] == 1

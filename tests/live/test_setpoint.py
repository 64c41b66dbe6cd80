"""The set-point of slip of a live service: advice beside the estimates, safe where they are not trusted, never a command."""

from __future__ import annotations

import asyncio
import json
import math

import numpy as np
import pytest

from drives import drive
from machine import rows_of
from terragrip.advice.setpoint import SlipSetpoint
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.live.message import ESTIMATE, SETPOINT, Message
from terragrip.live.options import Options
from terragrip.live.outbox import Outbox
from terragrip.live.outputs import Row
from terragrip.live.service import Service
from terragrip.live.setpoint import FREED, LiveSetpoint
from terragrip.live.uri import Uri


@pytest.fixture(scope="module")
def recording():
    return drive(12.0).recording


@pytest.fixture
def log(tmp_path, recording):
    path = tmp_path / "drive.parquet"
    recording.to_pandas().to_parquet(path)
    return path


class Stated:
    """A row of estimates by hand: columns by name and as attributes."""

    def __init__(self, time: float, event: str = "", speed: float = 0.8, **columns: float) -> None:
        self.time, self.event, self.ground_speed = time, event, speed
        self._columns = {
            "time": time,
            "event": event,
            "ground_speed": speed,
            "nis": 4.0,
            "channels": 4.0,
            **columns,
        }

    def __getitem__(self, name: str):
        if name in self._columns:
            return self._columns[name]
        return 0.01 if name.endswith("_std") else 0.05  # slips

    def row(self, predicted: bool = False) -> Row:
        return Row(self.time, {}, self, predicted)


@pytest.mark.asyncio
async def test_each_row_has_the_set_point_that_the_block_gives_by_hand(log, vehicle, recording):
    service = Service(vehicle, [f"replay:{log}?speed=max"], options=Options(setpoint=(0.1, 0.8), learn=False))
    seen = []
    service.listeners.append(seen.append)
    await service.run()
    advised = [json.loads(message.json()) for message in seen if message.kind == SETPOINT]
    estimator = TractionEstimator(vehicle, channels=tuple(recording.channels))
    by_hand = SlipSetpoint(vehicle, 0.1, 0.8)
    for (time, values), one in zip(rows_of(recording), advised, strict=True):
        speeds = by_hand.update(estimator.update({"time": time, **values}))
        assert one["time"] == time
        assert one["wheel_speed"] == pytest.approx(speeds)
        assert (one["state"], one["why"]) == (by_hand.state, by_hand.why)
    assert advised[-1]["state"] == "follow"


@pytest.mark.asyncio
async def test_the_estimates_and_the_record_are_the_same_with_and_without(tmp_path, log, vehicle):
    rows = {}
    for name, setpoint in (("with", (0.1, 0.8)), ("without", None)):
        service = Service(
            vehicle, [f"replay:{log}?speed=max"], record=tmp_path / name, options=Options(setpoint=setpoint)
        )
        await service.run()
        rows[name] = (tmp_path / name / "estimates-000001.parquet").read_bytes()
        assert not list((tmp_path / name).glob("*setpoint*"))
    assert rows["with"] == rows["without"]


def test_predictions_of_a_silence_lead_nothing(vehicle):
    live = LiveSetpoint(vehicle, 0.1, 0.8)
    for k in range(200):
        live.message(Stated(k / 50).row())
    assert live.setpoint.state == "follow"
    for k in range(40):
        advised = live.message(Stated(4.0 + k / 10).row(predicted=True))
    assert advised["state"] == "slow"
    assert advised["why"] == "predicted"
    assert (
        max(advised["wheel_speed"].values()) * 0.2 <= 0.4 * 0.8 + 1e-9
    )  # the crawl; the robot's radius is .2 m


def test_stuck_stops_and_only_driving_ends_the_stop(vehicle):
    live = LiveSetpoint(vehicle, 0.1, 0.8)
    live.message(Stated(0.0).row())
    live.message(Stated(0.02, "stuck", speed=0.0).row())
    time = 0.02
    for _ in range(100):  # wheels at rest, where it stuck: no reason to turn them again
        time += 0.02
        advised = live.message(Stated(time, "standstill", speed=0.0).row())
    assert advised["state"] == "stop"
    assert set(advised["wheel_speed"].values()) == {0.0}
    while advised["state"] == "stop":
        time += 0.02
        advised = live.message(Stated(time, speed=0.5).row())
        assert time < 10
    assert time == pytest.approx(2.02 + FREED, abs=0.1)


def drained(outbox):
    async def every():
        return [await outbox.get() for _ in range(len(outbox))]

    return asyncio.run(every())


def test_rate_thins_set_points_with_their_estimates():
    outbox = Outbox(Uri.parse("udp://127.0.0.1:9?rate=10", {"udp": ("rate",)}, "sink"))
    for k in range(100):
        row = Stated(k / 100).row()
        outbox.put(Message(ESTIMATE, row.estimate.time, row))
        outbox.put(Message(SETPOINT, row.estimate.time, data={}))
    kinds = [message.kind for message in drained(outbox)]
    assert kinds == [ESTIMATE, SETPOINT] * 10


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--setpoint", "0.11"], "--speed"),
        (["--speed", "1.5"], "--setpoint"),
        (["--setpoint", "fast", "--speed", "1"], "neither a slip"),
        (["--setpoint", "0.9", "--speed", "1"], "not a set-point"),
        (["--setpoint", "nothing.json", "--speed", "1"], "cannot be read"),
        (["--setpoint", "11%", "--speed", "-1"], "not forward"),
    ],
)
def test_a_set_point_that_cannot_be_is_one_line(tmp_path, vehicle, capsys, options, said):
    vehicle.save(tmp_path / "v.yaml")
    call = ["live", "--source", "udp://127.0.0.1:9870", "--vehicle", str(tmp_path / "v.yaml"), *options]
    assert main(call) == 2
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    assert said in line


def test_the_slip_of_a_file_of_advice_is_taken_and_one_without_is_refused(tmp_path, vehicle, log, capsys):
    vehicle.save(tmp_path / "v.yaml")
    advice = tmp_path / "advice.json"
    call = ["live", "--source", f"replay:{log}?speed=max", "--vehicle", str(tmp_path / "v.yaml"),
            "--setpoint", str(advice), "--speed", "0.8", "--quiet", "--record", str(tmp_path / "r")]  # fmt: skip
    advice.write_text(json.dumps({"best_efficiency": {"slip": 0.12}}))
    assert main(call) == 0
    advice.write_text(json.dumps({"best_efficiency": None}))
    assert main([*call[:-1], str(tmp_path / "s")]) == 2
    assert "advises no slip" in capsys.readouterr().err


def test_slip_alone_has_no_set_point(vehicle, tmp_path):
    from terragrip.formats import Profile

    path = tmp_path / "p.yaml"
    path.write_text("time: {from: t}\nchannels: {wheel_based_speed: w, ground_speed: g}\n")
    with pytest.raises(InputError, match="slip of each driven wheel"):
        Service(
            vehicle,
            ["udp://127.0.0.1:9871"],
            profile=Profile.load(path),
            options=Options(setpoint=(0.1, 0.8)),
        )


def test_no_number_of_a_set_point_is_ever_missing(vehicle):
    live = LiveSetpoint(vehicle, 0.1, 0.8)
    rng = np.random.default_rng(0)
    for k in range(400):
        event = str(rng.choice(["", "", "gap", "outlier", "standstill", "push", "immobilization"]))
        speed = float(rng.choice([math.nan, 0.0, 0.7, -3.0]))
        advised = live.message(Stated(k / 50, event, speed).row(bool(rng.integers(2))))
        assert all(math.isfinite(v) and v >= 0 for v in advised["wheel_speed"].values())

"""Many vehicles in one service: the digits of one, and what goes wrong with one stays with it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import time

import numpy as np
import pytest

from drives import drive
from machine import messages, running, until
from mosquitto import broker, listening
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.live import read_record
from terragrip.live.many import vehicles as many_vehicles
from terragrip.live.many.roster import Roster
from terragrip.live.many.service import ManyService
from terragrip.live.options import Options
from terragrip.live.service import Service

pytestmark = pytest.mark.asyncio
NOWHERE = "mqtt://127.0.0.1:1/field/{vehicle}/sample"  # the tests put messages in by hand


@pytest.fixture
def listed(tmp_path, vehicle):
    """A service's roster from an index table of three vehicles, of which the last has no file."""
    vehicle.save(tmp_path / "robot.yaml")
    (tmp_path / "index.csv").write_text("name,vehicle\na,robot.yaml\nb,robot.yaml\nlost,nowhere.yaml\n")
    return Roster(None, index=tmp_path / "index.csv")


@pytest.fixture
def everyone(tmp_path, vehicle):
    """A roster by which all vehicles are alike."""
    vehicle.save(tmp_path / "robot.yaml")
    return Roster(tmp_path / "robot.yaml")


def put(service: ManyService, name: str, *sent) -> None:
    """Messages as a broker brings them."""
    for message in sent:
        data = message if isinstance(message, bytes) else json.dumps(message).encode()
        service.routers[0].message(data, topic=f"field/{name}/sample")


async def rows_of(service: ManyService, name: str, count: int) -> None:
    await until(lambda: name in service.vehicles.runs and service.vehicles.runs[name].core.rows >= count)


def assert_as_one(folder, alone) -> None:
    """Two records hold the same rows and, in every column, the same digits."""
    (kept, estimates), (expected, alone_estimates) = read_record(folder), read_record(alone)
    assert np.array_equal(kept.time, expected.time)
    assert list(estimates.columns) == list(alone_estimates.columns)
    for name, values in alone_estimates.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name
    assert np.array_equal(estimates.event_codes, alone_estimates.event_codes)


async def test_each_has_the_digits_of_a_service_of_its_own(tmp_path, vehicle, everyone, port):
    """Three vehicles through one broker, with rows out of order and holes; beside them a service of its own for each."""
    logs = {name: drive(12.0, rate=50.0, seed=k, imu=True).recording for k, name in enumerate("abc")}
    sent = {name: messages(log, 600) for name, log in logs.items()}
    for one in sent.values():
        one[100], one[101] = one[101], one[100]
        del one[300:320]
    with broker(tmp_path, port):
        at = f"mqtt://127.0.0.1:{port}/field"
        patient = Options(window=2.0)  # what is late must not depend on how fast the machine is
        many = ManyService(
            everyone,
            [f"{at}/{{vehicle}}/sample"],
            [f"{at}/{{vehicle}}"],
            record=tmp_path / "many",
            options=patient,
        )
        alone = {
            n: Service(vehicle, [f"{at}/{n}/sample"], record=tmp_path / f"alone-{n}", options=patient)
            for n in logs
        }
        async with contextlib.AsyncExitStack() as stack:
            client, got = await stack.enter_async_context(listening(port, "field/+/estimate"))
            for service in (many, *alone.values()):
                await stack.enter_async_context(running(service))
            while not all(one.feeds[0].unreadable for one in alone.values()) or len(many.vehicles.runs) < 3:
                for name in logs:
                    client.publish(f"field/{name}/sample", b"no json")
                await asyncio.sleep(0.05)
            for k in range(580):
                for name, one in sent.items():
                    client.publish(f"field/{name}/sample", json.dumps(one[k]))
                await asyncio.sleep(0.003)
            for name, service in alone.items():
                await until(lambda s=service: s.core.rows >= 579)
                await rows_of(many, name, 579)
            last = {name: one[-1]["time"] for name, one in sent.items()}
            await until(
                lambda: {t.split("/")[1] for t, d in got if d["time"] == last[t.split("/")[1]]} == set(logs)
            )
    for name in logs:
        assert_as_one(tmp_path / "many" / name, tmp_path / f"alone-{name}")
    a, b = (read_record(tmp_path / "many" / name)[1] for name in "ab")
    assert not np.array_equal(a.columns["slip_fl"][:500], b.columns["slip_fl"][:500])


def spoiled(good: list[dict]) -> list:
    """What a broken sender may send for each good message."""
    junk = [
        b"", b"\xff\xfe\x00", b"no json", b"[]", b"[1, 2]", b"null", b"{" * 5000, b"[" * 100_000, b"x" * 200_000,
        {"time": "now"}, {"time": 1e300, "ground_speed": 1e300}, {"time": None, "ground_speed": [1, {"a": 2}]},
        b'{"time": NaN, "ground_speed": NaN}', b'{"time": 1, "ground_speed": Infinity, "wheel_speed_fl": -1e999}',
        {"time": 2, "wheel_speed_nobody": 3.0, "wheel_speed_\u0000": 1, "drive_torque_x": "\ud800"},
        [{"time": k * 1e-4, "ground_speed": 0.0} for k in range(400)], {f"wheel_speed_w{k}": 1.0 for k in range(900)},
    ]  # fmt: skip
    result = []
    for k, message in enumerate(good):
        result.append(junk[k % len(junk)])
        step = 3600.0 if k % 5 == 0 else -86400.0 if k % 7 == 0 else 0.0
        result.append(
            {**message, "time": message["time"] + step, "ground_speed": float("nan") if k % 3 else 1e200}
        )
    return result


async def test_a_bad_vehicle_harms_no_other(tmp_path, vehicle, listed, monkeypatch, caplog):
    """Beside two good ones: garbage, NaN, clock steps, unknown wheels, floods, a missing vehicle file, and an estimator that fails."""
    caplog.set_level(logging.INFO, "terragrip.live")
    vehicle.save(tmp_path / "broken.yaml")
    with (tmp_path / "index.csv").open("a") as table:
        table.write("bad,robot.yaml\nbroken,robot.yaml\nold,robot.yaml\n")
    listed.refresh()
    monkeypatch.setattr(many_vehicles, "RETRY", 0.0)
    (tmp_path / "many" / "old").mkdir(parents=True)
    (tmp_path / "many" / "old" / "snapshot-000003.json").write_text("torn")
    good = messages(drive(6.0, imu=True).recording, 400)
    service = ManyService(listed, [NOWHERE], record=tmp_path / "many")
    alone = Service(vehicle, ["udp://127.0.0.1:0"], record=tmp_path / "alone")
    update, calls = TractionEstimator.update_at, [0]

    def failing(self, time, values):
        calls[0] += 1
        if values.get("ground_speed") == 7.0:
            raise RuntimeError("a defect\nin two lines")
        return update(self, time, values)

    monkeypatch.setattr(TractionEstimator, "update_at", failing)
    async with running(service), running(alone):
        bad = spoiled(good)
        for k, message in enumerate(good):
            for name in "ab":
                put(service, name, message)
            alone.feeds[0].message(json.dumps(message).encode())
            put(service, "bad", *bad[2 * k : 2 * k + 2])
            put(service, "broken", {**message, "ground_speed": 7.0})
            put(service, "lost", message)
            put(service, "old", message)
            put(service, "../escape", message)
            put(service, "", message)
            await asyncio.sleep(0.001)
        for name in "ab":
            await rows_of(service, name, 400)
        await until(lambda: alone.core.rows == 400)
        # It is opened and fails again and again, as long as messages of it wait.
        await until(lambda: "a defect in two lines" in service.monitor.unready().get("broken", ""))
        unready = service.monitor.unready()
        assert service.vehicles.runs["bad"].core.rows > 0
    for name in "ab":
        assert_as_one(tmp_path / "many" / name, tmp_path / "alone")
    assert "defect of Terragrip (RuntimeError: a defect in two lines)" in unready["broken"]
    assert "nowhere.yaml" in unready["lost"]
    assert "is damaged, or of another version" in unready["old"]
    assert service.vehicles.unnamed == 800
    assert {path.name for path in (tmp_path / "many").iterdir()} <= {"a", "b", "bad", "broken", "old", "lock"}
    said = [
        record
        for record in caplog.records
        if record.msg in ("vehicle_refused", "vehicle_failed", "vehicle_started")
    ]
    assert {"a", "b", "bad", "broken", "lost", "old"} <= {getattr(record, "vehicle", None) for record in said}
    assert {r.vehicle for r in caplog.records if r.msg in ("unreadable", "clock_jump")} == {"bad"}


async def test_a_vehicle_that_failed_goes_on_from_its_record(tmp_path, vehicle, everyone, monkeypatch):
    """Once its sender is sound again: rows before and after the failure are those of one run over what it sent."""
    monkeypatch.setattr(many_vehicles, "RETRY", 0.0)
    good = messages(drive(6.0, imu=True).recording, 400)
    service = ManyService(everyone, [NOWHERE], record=tmp_path / "many")
    async with running(service):
        put(service, "a", *good[:200])
        await rows_of(service, "a", 200)
        run = service.vehicles.runs["a"]
        service.vehicles.guarded(run, lambda: 1 / 0)
        assert "a" not in service.vehicles.runs
        for message in good[200:]:
            put(service, "a", message)
            await asyncio.sleep(0)
        await rows_of(service, "a", 400)
    kept, estimates = read_record(tmp_path / "many" / "a")
    through = TractionEstimator(vehicle, channels=tuple(kept.channels)).update_block(kept)
    assert len(kept) == 400
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


async def test_vehicles_appear_while_it_runs_and_so_do_rows_of_the_table(
    tmp_path, vehicle, listed, short, monkeypatch
):
    monkeypatch.setattr(many_vehicles, "RETRY", 0.0)
    good = messages(short.recording, 60)
    service = ManyService(listed, [NOWHERE])
    async with running(service):
        assert service.monitor.unready()["b"] == "nothing has come yet"
        put(service, "a", *good)
        await rows_of(service, "a", 60)
        put(service, "new", *good[:30])
        await until(lambda: "new" in service.vehicles.refusals)
        assert "names no vehicle file for new" in service.vehicles.refusals["new"].why
        with (tmp_path / "index.csv").open("a") as table:
            table.write("new,robot.yaml\n")
        vehicle.save(tmp_path / "nowhere.yaml")
        put(service, "new", *good[30:])
        put(service, "lost", *good)
        await rows_of(service, "new", 30)
        await rows_of(service, "lost", 60)
        assert not service.vehicles.refusals
        (tmp_path / "index.csv").write_text("who,what\n")
        put(service, "b", *good)
        await until(lambda: "b" in service.vehicles.refusals)
        assert "has no column name" in service.vehicles.refusals["b"].why
        put(service, "b", *good)  # the table is no table now; what it said before holds
        await rows_of(service, "b", 60)


async def test_there_are_limits(everyone, short, monkeypatch):
    """On vehicles, on what one may have waiting, and on what is remembered of those refused."""
    good = messages(short.recording, 20)
    service = ManyService(everyone, [NOWHERE], most=2)
    async with running(service):
        for name in ("a", "b", "c"):
            put(service, name, *good)
        await rows_of(service, "b", 20)
        assert service.vehicles.refusals["c"].why == "there are already 2 vehicles; raise --max-vehicles"
        monkeypatch.setattr(many_vehicles, "_REMEMBERED", 5)
        for k in range(50):
            put(service, f"more{k}", good[0])
        assert len(service.vehicles.refusals) <= 6
        put(service, "a", *[{"time": 100 + k / 1000, "ground_speed": 1.0} for k in range(3000)])
        run = service.vehicles.runs["a"]
        assert len(run.inbox.samples) == many_vehicles.CAPACITY
        await until(lambda: not run.inbox.samples)
        assert run.core.counts.total("dropped") == 3000 - many_vehicles.CAPACITY


async def test_a_parked_vehicle_is_predicted_for_a_while_only(everyone, short, monkeypatch):
    monkeypatch.setattr(many_vehicles, "PREDICT", 1.0)
    service = ManyService(everyone, [NOWHERE])
    async with running(service):
        put(service, "a", *messages(short.recording, 60))
        await rows_of(service, "a", 60)
        run = service.vehicles.runs["a"]
        await until(lambda: run.statistics.predicted_rows > 0)
        await until(lambda: time.time() - run.statistics.last_arrival > 1.3)
        predicted = run.statistics.predicted_rows
        await asyncio.sleep(0.5)
        assert run.statistics.predicted_rows == predicted


async def test_one_process_a_folder(tmp_path, everyone):
    service = ManyService(everyone, [NOWHERE], record=tmp_path / "many")
    with pytest.raises(InputError, match="is in use by another terragrip live"):
        ManyService(everyone, [NOWHERE], record=tmp_path / "many")
    async with running(service):
        pass

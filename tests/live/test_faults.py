"""Messages as networks and senders spoil them: the record holds what was estimated, and a restart changes nothing."""

from __future__ import annotations

import json
import random
import shutil

import numpy as np
import pytest

from drives import drive
from machine import estimated, running
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.live import read_record
from terragrip.live.core import Core
from terragrip.live.message import ESTIMATE, EVENT
from terragrip.live.pipeline import Pipeline
from terragrip.live.record_folder import last_snapshot, wal_path
from terragrip.live.service import Service

pytestmark = pytest.mark.asyncio


def rows_in(recording) -> list[list[float]]:
    return np.column_stack([recording.time, *recording.channels.values()]).tolist()


def text_of(recording, row: list[float]) -> bytes:
    return json.dumps(dict(zip(["time", *recording.channels], row, strict=True))).encode()


def texts(recording) -> list[tuple[float, bytes]]:
    """Arrival and message of each row."""
    return [(row[0], text_of(recording, row)) for row in rows_in(recording)]


def stuck_at_6_s(vehicle, seconds: float):
    """A recording of a vehicle that comes to stand with spinning wheels."""
    recording = drive(seconds, imu=True).recording
    recording.channels["ground_speed"][605:] = 0.0
    for wheel in vehicle.wheels:
        recording.channels[f"wheel_speed_{wheel}"][605:] = 4.0
    return recording


def jittered(recording, seed: int) -> list[tuple[float, bytes]]:
    """Arrival and text of each message of a drive; with all that senders and networks do to some of them."""
    generator = random.Random(seed)
    names, result = ["time", *recording.channels], []
    for k, row in enumerate(rows_in(recording)):
        message = dict(zip(names, row, strict=True))
        chance = generator.random() if k > 40 else 1.0
        if chance < 0.01:
            continue
        if chance < 0.02:
            message["ground_speed"] = None
        elif chance < 0.03:
            message = dict(reversed(message.items()))
        elif chance < 0.04:
            del message["drawbar_force"]
        elif chance < 0.05:
            message["slope"] = {"x": 1.0}
        elif chance < 0.06:
            message["ground_speed"] = "fast"
        elif chance < 0.065:
            message["time"] += 86400.0
        elif chance < 0.07:
            message["wheel_speed_fl"] = 1e300
        elif chance < 0.08:
            message["drawbar_force"] = round(message["drawbar_force"])
        data = json.dumps(message, separators=(",", ":") if chance > 0.98 else None).encode()
        if 0.11 < chance < 0.14:
            place = generator.randrange(len(data))
            data = data[:place] + bytes([generator.randrange(256)]) + data[place + 1 :]
        result.append((row[0] + 0.002 * generator.random(), data))
        if 0.08 < chance < 0.09:
            result.append((row[0] + 0.003, data))
        elif 0.09 < chance < 0.1:
            result[-2:] = (
                [(result[-1][0], result[-2][1]), (result[-2][0], result[-1][1])]
                if len(result) > 1
                else result
            )
        elif 0.1 < chance < 0.105:
            result.append((row[0] + 0.004, data[:-5]))
        elif 0.105 < chance < 0.11:
            result.append((row[0] + 0.3, data.replace(b'"time": ', b'"time": 9')))
    return result


async def fed(service, sent, last=lambda: None) -> None:
    """Run a service on these messages by a clock of their own, then do ``last``, and end it."""
    now = [1.7e9]
    service.inbox.clock = lambda: now[0]
    async with running(service):
        for arrival, data in sent:
            now[0] = 1.7e9 + arrival
            service.feeds[0].message(data)
            await estimated(service)
            if service.task.done():  # it failed: a loop would end it now
                break
        last()


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(12))
async def test_what_is_in_the_record_is_the_run_to_the_last_bit(tmp_path, vehicle, port, seed):
    """Copied as a kill would leave it, the record gives the state of the run that goes on, and its rows."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")
    state, rows = {}, []

    def killed():
        service.pipeline.write()
        shutil.copytree(tmp_path / "record", tmp_path / "killed")
        state.update(service.core.state())
        rows.extend(m.row for m in service.seen if m.kind == ESTIMATE and not m.row.predicted)

    await fed(service, jittered(drive(8.0, imu=True, seed=seed).recording, seed), killed)
    again = Pipeline(Core(vehicle, service.core.settings), tmp_path / "killed")
    assert json.loads(json.dumps(again.core.state())) == json.loads(json.dumps(state))
    again.recorder.abandon()
    kept, estimates = read_record(tmp_path / "killed")
    assert [row.estimate.time for row in rows] == kept.time.tolist()
    for name in estimates.columns:
        assert np.array_equal([row.estimate[name] for row in rows], estimates.columns[name], equal_nan=True)
    through = TractionEstimator(vehicle, channels=service.core.estimator.channels).update_block(kept)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


@pytest.mark.sample(7)
@pytest.mark.parametrize("seed", range(20))
async def test_killed_at_any_byte_it_goes_on_as_one_run(tmp_path, vehicle, port, short, seed):
    """The write-ahead file, cut anywhere, is resumed; what is behind the cut is sent again."""
    recording, folder = short.recording, tmp_path / "record"
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=folder)

    def killed():
        service.pipeline.write()
        shutil.copytree(folder, tmp_path / "killed")

    await fed(service, texts(recording), killed)
    torn = wal_path(tmp_path / "killed", last_snapshot(tmp_path / "killed") + 1)
    data = torn.read_bytes()
    torn.write_bytes(data[: random.Random(seed).randrange(len(data) // 3, len(data))])
    again = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "killed")
    newest = again.core.time
    await fed(again, [(2.0 + at, data) for at, data in texts(recording) if at > newest])
    assert newest < recording.time[-1]
    kept, estimates = read_record(tmp_path / "killed")
    through = TractionEstimator(vehicle, channels=tuple(kept.channels)).update_block(kept)
    assert np.array_equal(kept.time, recording.time)
    for name, values in through.columns.items():
        assert np.array_equal(estimates.columns[name], values, equal_nan=True), name


@pytest.mark.parametrize(
    "name",
    [r"wheel_speed_\ud800", r"wheel_speed_a\"b", r"wheel_speed_a\b", r"wheel_speed_\u0000", "wheel_speed_ö"],
)
async def test_fields_of_strange_names_are_no_channels_and_harm_nobody(tmp_path, vehicle, port, short, name):
    sent = [(at, data[:-1] + f', "{name}": 1.0}}'.encode()) for at, data in texts(short.recording)[:120]]
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")
    await fed(service, sent)
    kept, _ = read_record(tmp_path / "record")
    assert service.feeds[0].messages == 120
    assert np.array_equal(kept.time, short.recording.time[:120])
    assert set(service.core.counts.by_channel) == set(short.recording.channels)
    assert sum(message.kind == ESTIMATE for message in service.seen) == 120


async def test_a_listener_that_asks_for_the_core_changes_no_order(vehicle, port):
    service, seen = Service(vehicle, [f"udp://127.0.0.1:{port}"]), []
    service.listeners += [lambda message: service.core.rows, seen.append]
    await fed(service, texts(stuck_at_6_s(vehicle, 9.0)))
    stuck = next(k for k, m in enumerate(seen) if m.kind == EVENT and m.data["kind"] == "stuck")
    assert seen[stuck - 1].kind == ESTIMATE
    assert seen[stuck - 1].time == seen[stuck].time


async def test_the_record_is_closed_whole_though_a_listener_raises(tmp_path, vehicle, port):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")

    def broken(message):
        if b"stuck" in message.json():
            raise RuntimeError("a listener's own")

    service.listeners.append(broken)
    with pytest.raises(RuntimeError, match="a listener's own"):
        await fed(service, texts(stuck_at_6_s(vehicle, 9.0)))
    kept, estimates = read_record(tmp_path / "record")
    assert kept.time[-1] > 6.0
    assert estimates["event"][-1] == "stuck"
    assert list((tmp_path / "record").glob("recording-*.parquet"))


async def test_a_disk_that_is_full_as_the_last_segment_is_closed_is_reported(
    tmp_path, vehicle, port, short, monkeypatch
):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], record=tmp_path / "record")

    def full(self, *arguments):
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left"):
        await fed(
            service, texts(short.recording)[:217],
            lambda: monkeypatch.setattr("terragrip.live.segment.Segment.write", full),
        )  # fmt: skip

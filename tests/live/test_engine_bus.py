"""Live estimates of a stock tractor by its engine's torque: the sum of the drive torques, digit for digit what its log gives."""

from __future__ import annotations

import json
import struct
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from machine import events, rows_of, running, until
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.estimation.engine_estimator import EngineEstimator, live_estimator, restored
from terragrip.estimation.estimates import Estimates
from terragrip.formats import Profile
from terragrip.live import read_record
from terragrip.live.core import Core, Settings
from terragrip.live.options import Options
from terragrip.live.outputs import Row
from terragrip.live.service import Service
from terragrip.simulation.families import Kind, draw

sys.path.insert(0, str(Path(__file__).parents[1] / "formats"))  # for can_frames.py
from stock_tractor import StockMachine, stock_machine


@cache
def tractor() -> StockMachine:
    """40 s of a simulated tractor: it stands, starts, works (10 Hz); its reference torque on the bus every 5 s, as EC1 comes."""
    made = stock_machine(draw(Kind("tractor", "saturating", "even"), 301, rate=20.0, duration=40.0), 301)
    assert made.vehicle.driveline is not None
    reference = np.full(len(made.recording), np.nan)
    reference[::50] = made.vehicle.driveline.reference_torque
    return replace(made, recording=made.recording.with_channels(engine_reference_torque=reference))


@cache
def whole() -> Estimates:
    return tg.estimate(tractor().recording, tractor().vehicle)


def known(estimates: Estimates) -> dict[str, Any]:
    """What `terragrip live --settings` takes of estimates."""
    settings = estimates.about["settings"]
    return {
        "noise": settings["noise"],
        "held": settings["held"],
        "driveline": estimates.about["driveline"],
        "learn": False,
    }


def through(core: Core, log: tg.Recording) -> list[Row]:
    out = []
    for time, values in rows_of(log):
        out += core.process(time, 0, time, values)
    return [one for one in [*out, *core.flush()] if isinstance(one, Row)]


def assert_same(rows: list[Row], estimates: Estimates) -> None:
    assert len(rows) == len(estimates)
    for name in rows[0].estimate.places:
        np.testing.assert_array_equal([row.estimate[name] for row in rows], estimates[name], name)
    assert np.isfinite(estimates["adhesion_driven"]).mean() > 0.5
    assert np.isnan(estimates["adhesion_driven"]).any()  # at rest no torque tells of the ground


def test_every_digit_is_that_of_the_log() -> None:
    settings = Settings(("bus",), channels=tuple(tractor().recording.channels), **known(whole()))
    assert_same(through(Core(tractor().vehicle, settings), tractor().recording), whole())


def test_after_a_kill_it_goes_on_bit_for_bit() -> None:
    """The state as JSON in the middle, as the record keeps it."""
    log = tractor().recording
    core = Core(tractor().vehicle, Settings(("bus",), channels=tuple(log.channels), **known(whole())))
    rows = through(core, log.select(slice(0, 200)))
    again = Core.from_state(json.loads(json.dumps(core.state())))
    rows += through(again, log.select(slice(200, None)))
    assert_same(rows, whole())


def test_by_the_command_and_from_its_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, vehicle, out = tmp_path / "log.parquet", tmp_path / "tractor.yaml", tmp_path / "estimates.parquet"
    tractor().recording.to_pandas().to_parquet(log, index=False)
    tractor().vehicle.save(vehicle)
    assert main(["estimate", str(log), "--vehicle", str(vehicle), "-o", str(out)]) == 0
    words = ["live", "--source", f"replay:{log}?speed=max", "--vehicle", str(vehicle), "--settings", str(out)]
    assert main([*words, "--record", str(tmp_path / "record")]) == 0
    said = capsys.readouterr().out
    assert "Recorded in" in said
    recorded, live = read_record(tmp_path / "record")
    batch = Estimates.read(out)
    anew = tg.estimate(recorded, tractor().vehicle)
    for name in live.columns:
        if name in batch:
            np.testing.assert_array_equal(live[name], batch[name], name)
            np.testing.assert_array_equal(live[name], anew[name], name)
    assert live.wheels == ("driven",)
    assert live.about["driveline"]["vehicle"]["mass"] == tractor().vehicle.mass
    assert main(["advise", str(sorted((tmp_path / "record").glob("estimates-*"))[0]), "--vehicle", str(vehicle),
                 "-o", str(tmp_path / "advice.json")]) == 0  # fmt: skip


def test_by_the_vehicle_file_alone_the_truth_is_held() -> None:
    """No earlier log: the noise is learned while driving, slip counts from the file's radius."""
    log = tractor().recording
    rows = through(Core(tractor().vehicle, Settings(("bus",), channels=tuple(log.channels))), log)
    mu, std = (
        np.array([row.estimate[n] for row in rows]) for n in ("adhesion_driven", "adhesion_driven_std")
    )
    good = tractor().moving & np.isfinite(mu) & (log.time > 12)
    assert good.sum() > 150
    assert np.mean(np.abs(mu - tractor().adhesion)[good] < 1.96 * std[good]) > 0.9


def bus(**machine: Any) -> tg.Vehicle:
    data = {
        "mass": 6000.0, "wheelbase": 2.6, "center_of_gravity_height": 0.9, "hitch_height": 0.5,
        "axles": {"front": {"mass": 2500.0, "wheels": ["fl", "fr"]}, "rear": {"mass": 3500.0, "wheels": ["rl", "rr"]}},
        "wheel": {"radius": 0.8, "inertia": 50.0}, "driveline": {"efficiency": 0.85, "accessory_power": 8000.0},
    }  # fmt: skip
    return tg.Vehicle.from_dict({**data, **machine})


@pytest.mark.asyncio
async def test_frames_of_eec1_and_the_engine_configuration_give_the_adhesion(tmp_path: Path) -> None:
    """EC1 by the transport protocol, as the bus sends 39 bytes; no EEC3: its friction is assumed."""
    can = pytest.importorskip("can")
    from can_frames import WHEEL_BASED, payload

    service = Service(
        bus(), [f"can:{tmp_path.name}?interface=virtual"], profile=Profile.load("tractor-isobus")
    )
    assert isinstance(service.core.estimator, EngineEstimator)
    ec1 = bytearray(b"\xff" * 39)
    ec1[19:21] = struct.pack("<H", 800)  # reference torque
    packets = [bytes([k + 1, *ec1[7 * k : 7 * k + 7].ljust(7, b"\xff")]) for k in range(6)]
    announce = struct.pack("<BHBB", 32, 39, 6, 0xFF) + (65251).to_bytes(3, "little")
    with can.Bus(interface="virtual", channel=tmp_path.name) as link:
        async with running(service):

            def send(identifier: int, data: bytes) -> None:
                link.send(can.Message(arbitration_id=identifier, is_extended_id=True, data=data))

            for k in range(80):
                if k == 20:
                    send(0x1CECFF00, announce)
                    for packet in packets:
                        send(0x1CEBFF00, packet)
                send(0x0CF00400, struct.pack("<BBBHBBB", 0xF0, 195, 195, 12800, 255, 255, 255))
                send(WHEEL_BASED, payload(2.0 + 0.001 * (k % 3)))
                send(0x0CFE4980, payload(2.0 + 0.001 * (k % 2)))
                seen = service.core.rows
                await until(lambda seen=seen: service.core.rows > seen)
    rows = [message.row.estimate for message in service.seen if message.kind == "estimate"]
    assert any(
        "the adhesion of single wheels is not determined" in text for text in events(service, "schema")
    )
    assert np.isnan(rows[20].adhesion_driven)  # what 70 % are of, nobody has said yet
    force = 0.85 * (0.62 * 800 * 1600 * np.pi / 30 - 8000) / 2.0
    assert rows[-1].adhesion_driven == pytest.approx(force / (6000 * 9.80665), abs=0.05)
    assert "adhesion_rl" not in rows[-1].places


def test_a_reference_torque_that_nobody_will_tell_is_asked_for() -> None:
    with pytest.raises(
        InputError, match="reference torque, which neither the log nor the vehicle file gives"
    ):
        Core(
            bus(),
            Settings(
                ("bus",),
                channels=("ground_speed", "wheel_based_speed", "engine_speed", "engine_torque_share"),
            ),
        )


def test_a_set_point_of_slip_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "log.parquet"
    tractor().recording.to_pandas().to_parquet(log, index=False)
    with pytest.raises(InputError, match="each driven wheel"):
        Service(tractor().vehicle, [f"replay:{log}"], options=Options(setpoint=(0.11, 2.0)))


def test_what_cannot_be_used_leaves_it_as_it_was() -> None:
    log = tractor().recording
    one = live_estimator(tractor().vehicle, "bank", tuple(log.channels), sensors={}, held={})
    samples = list(rows_of(log))[:150]
    for time, values in samples:
        one.update_at(time, values)
    state = one.snapshot()
    for time, values in ((samples[3][0], samples[3][1]), (np.nan, {}), (1e3, {"engine_speed": np.inf})):
        with pytest.raises(InputError):
            one.update_at(time, values)
    assert one.snapshot() == state
    other = restored(state)
    time, values = list(rows_of(log))[150]
    np.testing.assert_array_equal(other.update_at(time, values).values, one.update_at(time, values).values)
    with pytest.raises(InputError):
        restored(state[:-4])


def test_stuck_by_one_speed_of_the_drive_is_said_with_its_slip() -> None:
    """A warning names the wheels that the estimates have, which of a drive train is one."""
    vehicle = bus()
    plain = tg.Vehicle.from_dict({k: v for k, v in vehicle.to_dict().items() if k != "driveline"})
    core = Core(plain, Settings(("bus",), channels=("ground_speed", "wheel_based_speed")))
    out = []
    for k in range(900):
        time = 0.1 * k
        ground = 2.0 if time < 40 else 0.0
        out += core.process(
            time,
            0,
            time,
            {"ground_speed": ground + 0.002 * (k % 3), "wheel_based_speed": 2.0 + 0.002 * (k % 2)},
        )
    texts = [one.text for one in out if getattr(one, "kind", "") == "stuck"]
    assert texts
    assert "(drive)" in texts[0]

"""Estimates on python-can's virtual bus, read by cantools with the DBC that comes with the package."""

from __future__ import annotations

import pytest

from machine import running, until
from terragrip.errors import InputError
from terragrip.estimation.engine import EVENTS
from terragrip.live.service import Service
from terragrip.live.sinks.can import DBC


def heard(bus) -> list:
    found = []
    while (frame := bus.recv(0.0)) is not None:
        found.append(frame)
    return found


@pytest.mark.asyncio
async def test_estimates_as_frames_that_the_dbc_describes(tmp_path, vehicle, short):
    import cantools

    log = tmp_path / "drive.parquet"
    short.recording.to_pandas().to_parquet(log)
    service = Service(vehicle, [f"replay:{log}?speed=20"], [f"can:{tmp_path.name}?interface=virtual"])
    import can

    database = cantools.database.load_file(DBC)
    with can.Bus(interface="virtual", channel=tmp_path.name, receive_own_messages=False) as bus:
        async with running(service):
            await until(lambda: service.core.rows == len(short.recording))
        frames = heard(bus)
    rows = [message.row.estimate for message in service.seen if message.kind == "estimate"][::10]
    by_name = {}
    for frame in frames:
        message = database.get_message_by_frame_id(frame.arbitration_id)
        by_name.setdefault(message.name, []).append(message.decode(frame.data))
    assert len(by_name["TG_Vehicle"]) == len(rows) == 60
    for estimate, speeds, wheel, traction in zip(
        rows, by_name["TG_Vehicle"], by_name["TG_Wheel4"], by_name["TG_Traction4"], strict=True
    ):
        assert speeds["GroundSpeed"] == pytest.approx(estimate.ground_speed, abs=0.0006)
        assert speeds["SoilResistanceStd"] == pytest.approx(min(estimate.soil_resistance_std, 1.0), abs=0.003)
        assert speeds["Event"] == (estimate.event or "none")
        assert speeds["Predicted"] == "measured"
        assert wheel["Adhesion4"] == pytest.approx(estimate.adhesion_rr, abs=0.0001)
        if estimate.slip_rr == estimate.slip_rr:
            assert wheel["Slip4"] == pytest.approx(estimate.slip_rr, abs=0.0001)
            assert traction["Efficiency4"] == pytest.approx(
                min(max(estimate.efficiency_rr, -3.2), 3.2255), abs=0.0001
            )
    assert "TG_Wheel5" not in by_name


def test_what_is_missing_is_not_available(vehicle):
    from terragrip.estimation.estimator import Estimate, TractionEstimator
    from terragrip.live.core import Row
    from terragrip.live.sinks.can import CanSink
    from terragrip.live.uri import Uri

    estimator = TractionEstimator(vehicle)
    values = [float("nan")] * len(estimator.update({"time": 0.0}).values)
    values[estimator.engine.index_out["slip_fl"]] = 40.0
    row = Row(0.0, {}, Estimate(0.0, "gap", values, estimator.engine.index_out), predicted=True)
    frames = CanSink(Uri.parse("can:x?interface=virtual", {"can": ("interface",)}, "sink"), vehicle).frames(
        row
    )
    (_, state), (_, wheel) = frames[0], frames[1]
    assert state[:6] == b"\xff" * 6
    assert wheel[:2] == (0xFAFF).to_bytes(2, "little")
    assert wheel[2:] == b"\xff" * 6


def test_the_dbc_knows_every_event():
    import cantools

    choices = (
        cantools.database.load_file(DBC).get_message_by_name("TG_Vehicle").get_signal_by_name("Event").choices
    )
    assert [str(choices[k]) for k in range(len(EVENTS))] == [event or "none" for event in EVENTS]


def test_an_unknown_interface_is_refused(vehicle):
    with pytest.raises(InputError, match="no interface 'socketcam'"):
        Service(vehicle, ["udp://127.0.0.1:9870"], ["can:can0?interface=socketcam"])


@pytest.mark.asyncio
async def test_a_bus_that_is_not_there_is_named(vehicle):
    service = Service(vehicle, ["udp://127.0.0.1:0"], ["can:can99"])
    async with running(service):
        await until(lambda: any(event.kind == "sink_lost" for event in service.statistics.events))

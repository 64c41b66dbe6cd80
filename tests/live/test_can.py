"""A robot's frames in and estimates out on python-can's virtual bus; cantools is the oracle on both sides."""

from __future__ import annotations

import asyncio
import errno
import struct

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from machine import events, rows_of, running, until
from terragrip.errors import InputError
from terragrip.estimation.engine import EVENTS
from terragrip.formats import Profile
from terragrip.live.frame_decoder import FrameDecoder
from terragrip.live.links.can import DBC
from terragrip.live.service import Service


def heard(bus) -> list:
    result = []
    while (frame := bus.recv(0.0)) is not None:
        result.append(frame)
    return result


@pytest.mark.asyncio
async def test_estimates_as_frames_that_the_dbc_describes(tmp_path, vehicle, short):
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
    from terragrip.live.links.can import CanSink
    from terragrip.live.outputs import Row
    from terragrip.live.uri import Uri

    estimator = TractionEstimator(vehicle)
    values = [float("nan")] * len(estimator.update({"time": 0.0}).values)
    values[estimator.engine.slots_out["slip_fl"]] = 40.0
    row = Row(0.0, {}, Estimate(0.0, "gap", values, estimator.engine.slots_out), predicted=True)
    frames = CanSink(Uri.parse("can:x?interface=virtual", {"can": ("interface",)}, "sink"), vehicle).frames(
        row
    )
    (_, state), (_, wheel) = frames[0], frames[1]
    assert state[:6] == b"\xff" * 6
    assert wheel[:2] == (0xFAFF).to_bytes(2, "little")
    assert wheel[2:] == b"\xff" * 6


def test_the_dbc_knows_every_event():
    choices = (
        cantools.database.load_file(DBC).get_message_by_name("TG_Vehicle").get_signal_by_name("Event").choices
    )
    assert [str(choices[k]) for k in range(len(EVENTS))] == [event or "none" for event in EVENTS]


def test_an_unknown_interface_is_refused(vehicle):
    with pytest.raises(InputError, match="interface is 'socketcam'"):
        Service(vehicle, ["udp://127.0.0.1:9870"], ["can:can0?interface=socketcam"])


def test_an_interface_whose_package_is_missing_is_refused_with_the_extra(vehicle, monkeypatch):
    monkeypatch.setattr("terragrip.live.links.can.find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"to use udp_multicast .*'msgpack' is needed; pip install 'terragrip\[live\]'"
    ):
        Service(vehicle, ["udp://127.0.0.1:9870"], ["can:239.0.0.1?interface=udp_multicast"])


@pytest.mark.asyncio
async def test_a_bus_that_is_not_there_is_named(vehicle):
    service = Service(vehicle, ["udp://127.0.0.1:0"], ["can:can99"])
    async with running(service):
        await until(lambda: any(event.kind == "sink_lost" for event in service.statistics.events))


ROBOT = """VERSION ""
NS_ :
BS_:
BU_: Robot
BO_ 257 Hubs: 8 Robot
 SG_ hub_fl : 0|16@1- (0.001,0) [0|0] "rad/s" Vector__XXX
 SG_ hub_fr : 16|16@1- (0.001,0) [0|0] "rad/s" Vector__XXX
 SG_ hub_rl : 32|16@1- (0.001,0) [0|0] "rad/s" Vector__XXX
 SG_ hub_rr : 48|16@1- (0.001,0) [0|0] "rad/s" Vector__XXX
BO_ 258 Motors: 8 Robot
 SG_ motor_fl : 7|16@0- (0.01,0) [0|0] "N m" Vector__XXX
 SG_ motor_fr : 23|16@0- (0.01,0) [0|0] "N m" Vector__XXX
 SG_ motor_rl : 39|16@0- (0.01,0) [0|0] "N m" Vector__XXX
 SG_ motor_rr : 55|16@0- (0.01,0) [0|0] "N m" Vector__XXX
BO_ 259 Radar: 4 Robot
 SG_ radar : 0|32@1- (1,0) [0|0] "km/h" Vector__XXX
BO_ 260 Mixed: 8 Robot
 SG_ page M : 0|4@1+ (1,0) [0|0] "" Vector__XXX
 SG_ odd m1 : 5|11@1- (0.5,-3) [0|0] "" Vector__XXX
 SG_ across m2 : 11|13@0+ (2,0) [0|0] "" Vector__XXX
 SG_ always : 40|7@1+ (1,0) [0|0] "" Vector__XXX
SIG_VALTYPE_ 259 radar : 1;
"""


@pytest.fixture(scope="module")
def dbc(tmp_path_factory):
    path = tmp_path_factory.mktemp("dbc") / "robot.dbc"
    path.write_text(ROBOT)
    return path


@pytest.fixture(scope="module")
def robot_profile(dbc):
    wheels = ("fl", "fr", "rl", "rr")
    return Profile.from_dict(
        {
            "dbc": [str(dbc)],
            "channels": {f"wheel_speed_{w}": f"hub_{w}" for w in wheels}
            | {f"drive_torque_{w}": f"motor_{w}" for w in wheels}
            | {"ground_speed": "radar"},
        }
    )


@given(identifier=st.sampled_from([257, 258, 259, 260]), data=st.binary(min_size=8, max_size=8))
def test_frames_are_decoded_as_cantools_does(dbc, identifier, data):
    message = cantools.database.load_file(dbc).get_message_by_frame_id(identifier)
    data = data[: message.length]
    try:
        expected = message.decode(data)
    except cantools.database.DecodeError:  # a page that there is not
        return
    result = FrameDecoder([str(dbc)], lambda name: True).fields(identifier, False, data)
    assert result == pytest.approx({name: value for name, value in expected.items() if value == value})


def test_j1939s_not_available_is_missing_and_a_sender_has_a_name():
    decoder = FrameDecoder([], lambda name: name.startswith("GroundBasedMachineSpeed"))
    data = struct.pack("<HIBB", 0xFFFF, 0xFFFFFFFF, 0xFF, 0xFF)
    assert decoder.fields(0x0CFE49F0, True, data) == {}
    result = decoder.fields(0x0CFE49F0, True, struct.pack("<HIBB", 1500, 0, 0xFF, 0xFF))
    assert result["GroundBasedMachineSpeed"] == pytest.approx(1.5)
    assert result["GroundBasedMachineSpeed@F0"] == pytest.approx(1.5)
    assert decoder.fields(0x123, False, data) == {}
    assert decoder.unknown == {0x123: 1}


@pytest.mark.asyncio
async def test_a_robots_frames_give_its_slip(tmp_path, vehicle, short, dbc, robot_profile):
    import can

    database = cantools.database.load_file(dbc)
    service = Service(vehicle, [f"can:{tmp_path.name}?interface=virtual"], profile=robot_profile)
    with can.Bus(interface="virtual", channel=tmp_path.name) as bus:
        async with running(service):
            for _, values in list(rows_of(short.recording))[:200]:
                for name, prefix, channel in (
                    ("Hubs", "hub", "wheel_speed"),
                    ("Motors", "motor", "drive_torque"),
                ):
                    signals = {f"{prefix}_{w}": values[f"{channel}_{w}"] for w in vehicle.wheels}
                    send(bus, database.get_message_by_name(name), signals)
                send(bus, database.get_message_by_name("Radar"), {"radar": 3.6 * values["ground_speed"]})
                await asyncio.sleep(0.01)
            await until(lambda: service.core.counts.by_channel["ground_speed"]["received"] == 200)
    rows = [
        message.row for message in service.seen if message.kind == "estimate" and not message.row.predicted
    ]
    speeds = np.array([row.values["ground_speed"] for row in rows if "ground_speed" in row.values])
    assert speeds == pytest.approx(short.recording.channels["ground_speed"][:200], abs=1e-6)
    last = rows[-1].estimate
    # Stamped as they were sent, which here was not at their own pace: slip does not mind.
    assert last.slip_fl == pytest.approx(short.truth["slip_fl"][199], abs=0.05)
    assert not events(service, "schema")


def send(bus, message, signals) -> None:
    import can

    bus.send(can.Message(arbitration_id=message.frame_id, data=message.encode(signals), is_extended_id=False))


def test_a_profile_without_wheel_speeds_is_refused(vehicle):
    profile = Profile.from_dict({"channels": {"ground_speed": "v"}})
    with pytest.raises(InputError, match="the profile gives no wheel_speed_fl"):
        Service(vehicle, ["can:x?interface=virtual"], profile=profile)


@pytest.mark.asyncio
async def test_a_stock_tractors_bus_gives_slip(tmp_path, vehicle):
    import can

    source = f"can:{tmp_path.name}?interface=virtual"
    service = Service(vehicle, [source], profile=Profile.load("tractor-isobus"))
    with can.Bus(interface="virtual", channel=tmp_path.name) as bus:
        async with running(service):
            for _ in range(100):
                for identifier, speed in ((0x0CFE48F0, 2000), (0x0CFE4980, 1800)):
                    data = struct.pack("<HIBB", speed, 0, 255, 0xFD)
                    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True))
                await asyncio.sleep(0.01)
            await until(lambda: service.core.counts.by_channel["wheel_based_speed"]["received"] == 100)
    rows = [m.row for m in service.seen if m.kind == "estimate" and not m.row.predicted]
    assert rows[-1].estimate.slip_drive == pytest.approx(0.1, abs=0.01)  # 1 - 1.8/2
    assert not events(service, "schema")


def test_a_dbc_that_is_none_is_refused(tmp_path, vehicle):
    (tmp_path / "no.dbc").write_text("nothing")
    with pytest.raises(InputError, match=r"no\.dbc"):
        Service(vehicle, [f"can:x?interface=virtual&dbc={tmp_path / 'no.dbc'}"])


def test_the_ground_is_a_frame_too(vehicle):
    from terragrip.live.links.can import CanSink
    from terragrip.live.message import GROUND, SOIL, Message
    from terragrip.live.uri import Uri

    sink = CanSink(Uri.parse("can:x?interface=virtual", {"can": ("interface",)}, "sink"), vehicle)
    message = cantools.database.load_file(DBC).get_message_by_name("TG_Ground")

    def soil(time, name):
        by_soil = {"hard": 0.2, "soft": 0.7, "unknown": 0.1}
        data = {"time": time, "soil": name, "probability": by_soil[name], "probabilities": by_soil}
        ((identifier, payload),) = sink.frames_of(Message(SOIL, time, data=data))
        assert identifier == message.frame_id
        return payload

    assert soil(10.0, "soft")[2:5] == b"\xff\xff\xff"
    assert sink.frames_of(Message(GROUND, 9.0, data={"time": 9.0, "std": 0.3, "probability": 0.9})) == []
    assert message.decode(soil(12.5, "soft")) == pytest.approx(
        {"SoilNumber": 2, "SoilProbability": 0.7, "ChangeProbability": 0.9, "ChangeAge": 3.5}, abs=0.003
    )
    assert message.decode(soil(13.0, "unknown"))["SoilNumber"] == 0


@pytest.mark.asyncio
async def test_a_system_without_socketcan_is_named(vehicle, monkeypatch):
    """'[Errno 97] Address family not supported by protocol'."""
    import can

    def refuse(**_):
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(can, "Bus", refuse)
    service = Service(vehicle, ["can:vcan0"])
    async with running(service):
        await until(lambda: events(service, "source_lost"))
    assert "this system has no SocketCAN" in events(service, "source_lost")[0]

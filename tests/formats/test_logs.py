"""MDF, ROS bags and MCAP: small files written with the libraries give back what was put in."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import asammdf
import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import terragrip as tg
from can_frames import START, drive
from terragrip.formats import inspect, read
from terragrip.formats.reading import read_table

COUNT = 200
TIME = np.arange(COUNT) / 20
SPEED = 1 + 0.2 * np.sin(TIME)
JOINTS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
SNS = 1_000_000_000

# --- MDF -----------------------------------------------------------------------------------------------------------


def write_mdf(path: Path, version: str = "4.10") -> Path:
    slow = np.arange(40) / 4
    with asammdf.MDF(version=version) as file:
        file.append([asammdf.Signal(SPEED, TIME, name="v_ground", unit="m/s")])
        file.append(
            [
                asammdf.Signal(20 + slow, slow, name="rpm_left", unit="rpm"),
                asammdf.Signal(np.arange(40, dtype=np.int16), slow, name="gear"),
            ]
        )
        file.save(path, overwrite=True)
    return path


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_mdf_signals_keep_their_clocks_and_units(tmp_path: Path, version: str) -> None:
    table = read_table(write_mdf(tmp_path / ("log.mdf" if version < "4" else "log.mf4"), version))
    assert len(table.columns["time"]) == COUNT  # the slow clock's instants are among the fast one's
    speed = table.columns["v_ground"]
    assert np.allclose(speed, SPEED)
    turning = table.columns["rpm_left"]
    assert np.isfinite(turning).sum() == 40
    assert np.allclose(turning[::5], 20 + np.arange(40) / 4)
    assert table.units["rpm_left"] == "rpm"


def test_mdf_signals_of_one_name_are_told_apart_by_their_groups_or_sources(tmp_path: Path) -> None:
    """Four motors' Speed were Speed, Speed@1, @2, @3, which inspect read as wheels 1, 2 and 3 (of 0 to 3), each one wheel too far."""
    path = tmp_path / "log.mf4"
    with asammdf.MDF() as file:
        for place in ("FL", "FR"):
            source = asammdf.Source(f"Motor_{place}", "", "", 1, 1)
            file.append([asammdf.Signal(SPEED, TIME, name="Speed", source=source)])
            file.append([asammdf.Signal(SPEED, TIME, name="v")], acq_name=f"bus {place}")
            file.append([asammdf.Signal(SPEED, TIME, name="x")])
        file.save(path)
    names = set(read_table(path).columns) - {"time"}
    assert sorted(names) == ["Speed@Motor_FL", "Speed@Motor_FR", "v@bus FL", "v@bus FR", "x", "x@5"]


def test_mdf_bus_logging_by_the_built_in_table(tmp_path: Path) -> None:
    machine = drive(1000, 20.0)
    kind = np.dtype(
        [
            ("CAN_DataFrame.BusChannel", "u1"),
            ("CAN_DataFrame.ID", "<u4"),
            ("CAN_DataFrame.IDE", "u1"),
            ("CAN_DataFrame.DLC", "u1"),
            ("CAN_DataFrame.DataLength", "u1"),
            ("CAN_DataFrame.DataBytes", "(8,)u1"),
        ]
    )
    records = np.zeros(len(machine.frames), kind)
    for row, (_, identifier, data) in zip(records, machine.frames, strict=True):
        row["CAN_DataFrame.ID"], row["CAN_DataFrame.IDE"] = identifier, 1
        row["CAN_DataFrame.DLC"] = row["CAN_DataFrame.DataLength"] = 8
        row["CAN_DataFrame.DataBytes"] = np.frombuffer(data, np.uint8)
    stamps = np.array([t for t, _, _ in machine.frames]) - START
    source = asammdf.Source("CAN", "CAN", "", asammdf.Source.SOURCE_BUS, asammdf.Source.BUS_TYPE_CAN)
    with asammdf.MDF() as file:
        file.append(
            asammdf.Signal(records, stamps, name="CAN_DataFrame", source=source),
            acq_source=source,
            comment="bus",
        )
        file.save(tmp_path / "bus.mf4", overwrite=True)
    recording = read(tmp_path / "bus.mf4", "tractor-isobus")
    rim = recording["wheel_based_speed"]
    assert np.isfinite(rim).sum() == 200
    assert np.isfinite(recording["ground_speed"]).sum() == 100


def test_mdf_signals_whose_clock_is_no_column_of_numbers_are_left_out(tmp_path: Path) -> None:
    """Damage says that the first group's stamps are integers of 64 bits that begin within a byte: asammdf gives arrays of bytes."""
    path = write_mdf(tmp_path / "log.mf4", "4.10")
    data = bytearray(path.read_bytes())
    blocks = [at for at in range(0, len(data), 8) if data[at : at + 4] == b"##CN"]
    bodies = [at + 24 + 8 * int.from_bytes(data[at + 16 : at + 24], "little") for at in blocks]
    clock = next(body for body in bodies if data[body] == 2)  # a master channel
    data[clock + 2 : clock + 8] = bytes((0, 4, 1, 0, 0, 0))  # type, bit and byte at which it begins
    path.write_bytes(data)
    columns = read_table(path).columns
    assert "rpm_left" in columns
    assert "v_ground" not in columns


def test_measured_mdf_with_its_dbc(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/css_j1939_mf4")
    dbc = folder / "CSS-Electronics-SAE-J1939-DEMO.dbc"
    for name, engine, wheel in (("00000001-60B621D9", 577, 184), ("asammdf_basics_00000001", 3993, 3993)):
        columns = read_table(folder / f"{name}.MF4", databases=(dbc,)).columns
        assert np.isfinite(columns["EngineSpeed"]).sum() == engine
        assert np.isfinite(columns["WheelBasedVehicleSpeed"]).sum() == wheel


def test_measured_gnss_in_fast_packets(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/css_j1939_mf4")
    log = folder / "nmea_94C49784_00000002.MF4"
    by_dbc = read_table(log, databases=(folder / "tp_nmea.dbc",)).columns
    built_in = read_table(log).columns
    assert np.isfinite(by_dbc["latitude"]).sum() == 60  # of 420 frames, seven a position
    rapid = np.nanmedian(built_in["GnssLatitude"])
    assert np.nanmedian(by_dbc["latitude"]) == pytest.approx(rapid, abs=1e-5)
    assert np.array_equal(
        by_dbc["altitude"][np.isfinite(by_dbc["altitude"])],
        built_in["GnssPositionAltitude"][np.isfinite(built_in["GnssPositionAltitude"])],
    )
    assert "signal.time" in by_dbc


# --- ROS -----------------------------------------------------------------------------------------------------------

CUSTOM = """std_msgs/Header header
float64 pull
bool locked
string soil
float32[3] temperature
uint8[400] raw
"""


def ros_messages(store: Any) -> list[tuple[str, str, list[Any]]]:
    """Topic, type and messages of a robot of four wheels that goes at SPEED with 5 % slip."""
    kinds, first = store.types, store is not None and "seq" in str(store.fielddefs["std_msgs/msg/Header"])

    def header(t: float) -> Any:
        whole = int(START + t)
        stamp = kinds["builtin_interfaces/msg/Time"](
            sec=whole, nanosec=round((START + t - whole) * SNS) % SNS
        )
        extra = {"seq": 0} if first else {}
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base", **extra)

    def vector(x: float, y: float = 0.0, z: float = 0.0) -> Any:
        return kinds["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    joints, fixes, velocities, imus, pulls = [], [], [], [], []
    north = np.cumsum(SPEED) / 20
    for k, t in enumerate(TIME.tolist()):
        omega = SPEED[k] / 0.95 / 0.2
        names = list(JOINTS) if k < COUNT // 2 else list(reversed(JOINTS))
        turning = np.array([omega + 0.01 * JOINTS.index(n) for n in names])
        joints.append(
            kinds["sensor_msgs/msg/JointState"](
                header=header(t), name=names, position=np.zeros(4), velocity=turning, effort=10 * turning
            )
        )
        if k % 4 == 0:
            velocities.append(
                kinds["geometry_msgs/msg/TwistStamped"](
                    header=header(t),
                    twist=kinds["geometry_msgs/msg/Twist"](
                        linear=vector(0.6 * SPEED[k], 0.8 * SPEED[k]), angular=vector(0.0)
                    ),
                )
            )
            status = kinds["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
            fixes.append(
                kinds["sensor_msgs/msg/NavSatFix"](
                    header=header(t), status=status, latitude=51 + north[k] / 111_250.0, longitude=13.0, altitude=110.0,
                    position_covariance=np.zeros(9), position_covariance_type=0,
                )
            )  # fmt: skip
        quaternion = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        imus.append(
            kinds["sensor_msgs/msg/Imu"](
                header=header(t), orientation=quaternion, orientation_covariance=np.zeros(9),
                angular_velocity=vector(0, 0, 0.1), angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(0.5, 0, 9.81), linear_acceleration_covariance=np.zeros(9),
            )
        )  # fmt: skip
        pulls.append(
            kinds["farm_msgs/msg/Pull"](
                header=header(t), pull=100.0 + k, locked=k > 5, soil="clay" if k > 100 else "sand",
                temperature=np.array([1, 2, 3], dtype=np.float32), raw=np.zeros(400, np.uint8),
            )
        )  # fmt: skip
    return [
        ("/joint_states", "sensor_msgs/msg/JointState", joints),
        ("/gps/vel", "geometry_msgs/msg/TwistStamped", velocities),
        ("/gps/fix", "sensor_msgs/msg/NavSatFix", fixes),
        ("/imu", "sensor_msgs/msg/Imu", imus),
        ("/pull", "farm_msgs/msg/Pull", pulls),
    ]


def write_ros1(path: Path) -> Path:
    with Writer1(path) as bag:
        fill(bag, Stores.ROS1_NOETIC, "serialize_ros1")
    return path


def write_ros2(
    path: Path, plugin: StoragePlugin, topics: tuple[str, ...] = (), *, packed: bool = False
) -> Path:
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if packed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer as bag:
        fill(bag, Stores.ROS2_HUMBLE, "serialize_cdr", topics)
    return path


def fill(bag: Any, stores: Stores, serialize: str, topics: tuple[str, ...] = ()) -> None:
    """Write the robot's messages, of some topics or of all, received 3 ms after their stamps."""
    store = get_typestore(stores)
    store.register(get_types_from_msg(CUSTOM, "farm_msgs/msg/Pull"))
    for topic, kind, messages in ros_messages(store):
        if topics and topic not in topics:
            continue
        connection = bag.add_connection(topic, kind, typestore=store)
        for message in messages:
            stamp = message.header.stamp
            received = stamp.sec * SNS + stamp.nanosec + 3_000_000
            bag.write(connection, received, getattr(store, serialize)(message, kind))


WRITERS: dict[str, Callable[[Path], Path]] = {
    "ros1": lambda folder: write_ros1(folder / "run.bag"),
    "sqlite": lambda folder: write_ros2(folder / "run", StoragePlugin.SQLITE3),
    "mcap": lambda folder: write_ros2(folder / "run", StoragePlugin.MCAP),
    "sqlite, messages packed": lambda folder: write_ros2(folder / "run", StoragePlugin.SQLITE3, packed=True),
    "one mcap file": lambda folder: next(write_ros2(folder / "run", StoragePlugin.MCAP).glob("*.mcap")),
    "one sqlite file": lambda folder: next(write_ros2(folder / "run", StoragePlugin.SQLITE3).glob("*.db3")),
}


@pytest.mark.parametrize("kind", list(WRITERS))
def test_ros_bags_by_topic_and_field(tmp_path: Path, kind: str) -> None:
    table = read_table(WRITERS[kind](tmp_path))
    columns = table.columns
    turning = columns["/joint_states.velocity.rear_left_wheel"]
    assert np.allclose(
        turning[np.isfinite(turning)], SPEED / 0.95 / 0.2 + 0.02
    )  # though the joints' order changes
    assert np.allclose(columns["/pull.pull"], 100 + np.arange(COUNT))
    assert list(columns["/pull.soil"][[0, 150]]) == ["sand", "clay"]
    assert columns["/pull.temperature[2]"][0] == 3
    assert not [name for name in table.names if "covariance" in name or "raw" in name]
    # Stamps are the sender's, not the recorder's 3 ms later.
    assert table.start == pytest.approx(START, abs=1e-3)
    assert np.allclose(columns["time"], TIME, atol=1e-6)


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_the_shipped_profile_takes_gnss_not_the_wheels(tmp_path: Path, kind: str) -> None:
    bag = WRITERS[kind](tmp_path)
    recording = tg.read(bag, "ros2-4wd")
    assert recording.wheels == ("fl", "fr", "rl", "rr")
    assert np.nanmax(np.abs(recording["ground_speed"][::4] - SPEED[::4])) < 1e-9  # √(0.6² + 0.8²) = 1
    assert np.nanmedian(recording["drive_torque_fl"] / recording["wheel_speed_fl"]) == pytest.approx(10)
    assert recording["acceleration_z"][0] == 9.81
    assert inspect(bag).fitting == ("ros2-4wd",)


def test_speed_from_a_position_in_degrees(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "run", StoragePlugin.MCAP, ("/joint_states", "/gps/fix"))
    recording = tg.read(bag, "ros2-4wd")
    speed = recording["ground_speed"]
    inner = np.isfinite(speed) & (recording.time > 1) & (recording.time < 9)
    assert np.sqrt(np.mean((speed[inner] - SPEED[inner]) ** 2)) < 0.02


def test_types_that_a_bag_does_not_describe_are_named(tmp_path: Path) -> None:
    import sqlite3

    file = next(write_ros2(tmp_path / "run", StoragePlugin.SQLITE3).glob("*.db3"))
    with sqlite3.connect(file) as base:
        base.execute("DROP TABLE message_definitions")
    base.close()
    table = read_table(file)
    assert "/imu.linear_acceleration.x" in table.columns
    assert any("farm_msgs/msg/Pull" in note for note in table.notes)


def test_measured_bags_with_a_type_of_their_own(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/cmu_rosbag1")
    for name, count in (("force-displacement_1", 3004), ("force-displacement_1_zero", 925)):
        table = read_table(folder / f"{name}.bag", lambda n: n.endswith("wrench.wrench.force.z"))
        force = table.columns["/rokubimini_cosmo/forcetorque_readings.wrench.wrench.force.z"]
        assert np.isfinite(force).sum() == count
        assert 1 / np.median(np.diff(table.columns["time"])) == pytest.approx(100, rel=0.02)
        assert "/rokubimini_cosmo/forcetorque_readings.temperature" in table.names


# --- MCAP ----------------------------------------------------------------------------------------------------------


def protobuf_schema() -> tuple[bytes, Any]:
    """A serialised descriptor set of a message with a speed and a nested wheel, and the class."""
    file = FileDescriptorProto(name="machine.proto", package="farm", syntax="proto3")
    wheel = file.message_type.add(name="Wheel")
    wheel.field.add(name="omega", number=1, type=FieldDescriptorProto.TYPE_DOUBLE, label=1)
    machine = file.message_type.add(name="Machine")
    machine.field.add(name="speed", number=1, type=FieldDescriptorProto.TYPE_DOUBLE, label=1)
    machine.field.add(
        name="left", number=2, type=FieldDescriptorProto.TYPE_MESSAGE, label=1, type_name=".farm.Wheel"
    )
    machine.field.add(name="loads", number=3, type=FieldDescriptorProto.TYPE_DOUBLE, label=3)
    pool = DescriptorPool()
    pool.Add(file)
    return FileDescriptorSet(file=[file]).SerializeToString(), GetMessageClass(
        pool.FindMessageTypeByName("farm.Machine")
    )


def write_mcap(path: Path, messages: int = COUNT) -> Path:
    described, machine = protobuf_schema()
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000)
        writer.start()
        plain = writer.register_schema("speed", "jsonschema", b"{}")
        as_json = writer.register_channel("/speed", "json", plain)
        schema = writer.register_schema("farm.Machine", "protobuf", described)
        as_protobuf = writer.register_channel("/machine", "protobuf", schema)
        odd = writer.register_channel("/odd", "flatbuffer", 0)
        for k, t in enumerate(TIME[:messages].tolist()):
            stamp = int((START + t) * SNS)
            text = json.dumps({"v": SPEED[k], "wheels": [{"omega": 5.0 + k}, {"omega": 6.0}], "ok": True})
            writer.add_message(as_json, stamp, text.encode(), stamp)
            message = machine(speed=SPEED[k], loads=[1.0, 2.0 + k])
            message.left.omega = 7.0 + k
            writer.add_message(as_protobuf, stamp, message.SerializeToString(), stamp)
            writer.add_message(odd, stamp, b"\0\1", stamp)
        writer.finish()
    return path


def test_mcap_with_json_and_protobuf(tmp_path: Path) -> None:
    table = read_table(write_mcap(tmp_path / "log.mcap"))
    assert np.allclose(table.columns["/speed.v"], SPEED)
    assert table.columns["/speed.wheels[0].omega"][3] == 8
    assert np.allclose(table.columns["/machine.speed"], SPEED)
    assert table.columns["/machine.left.omega"][3] == 10
    assert table.columns["/machine.loads[1]"][3] == 5
    assert any("/odd (flatbuffer)" in note for note in table.notes)
    assert np.allclose(table.columns["time"], TIME, atol=1e-6)


def test_a_json_field_that_comes_later_and_seldom_is_a_signal(tmp_path: Path) -> None:
    with (tmp_path / "log.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/bus", "json", writer.register_schema("bus", "jsonschema", b"{}"))
        for k, t in enumerate(TIME.tolist()):
            message = {"rim": 5.0 + k} | (
                {"gps": SPEED[k]} if k % 5 == 2 else {"gps": None} if k % 5 == 3 else {}
            )
            writer.add_message(channel, int(t * SNS), json.dumps(message).encode(), int(t * SNS))
        writer.finish()
    table = read_table(tmp_path / "log.mcap")
    seldom = np.arange(COUNT) % 5 == 2
    np.testing.assert_allclose(table.columns["/bus.gps"], np.where(seldom, SPEED, np.nan))
    np.testing.assert_allclose(table.columns["/bus.rim"], 5.0 + np.arange(COUNT))


def test_mcap_cut_off_and_with_a_damaged_chunk(tmp_path: Path) -> None:
    whole = write_mcap(tmp_path / "log.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    cut = read_table(tmp_path / "cut.mcap")
    assert 0 < len(cut.columns["time"]) < COUNT
    assert any("ends early" in note for note in cut.notes)
    hurt = bytearray(whole)
    hurt[whole.find(b"\x28\xb5\x2f\xfd", len(whole) // 3) + 40] ^= 0xFF  # in the Zstandard frame of a chunk
    (tmp_path / "hurt.mcap").write_bytes(hurt)
    damaged = read_table(tmp_path / "hurt.mcap")
    assert COUNT * 0.8 < len(damaged.columns["time"]) < COUNT
    assert any("1 chunks are damaged" in note for note in damaged.notes)


def test_a_schema_that_changes_in_mid_stream_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(
            "/speed", "json", writer.register_schema("speed", "jsonschema", b"{}")
        )
        for k in range(100):
            body = {"v": 1.0} if k < 60 else {"v": "fast"} if k < 80 else {"velocity": 1.0}
            raw = b"no json" if k == 99 else json.dumps(body).encode()
            writer.add_message(channel, k * SNS, raw, k * SNS)
        writer.finish()
    table = read_table(path)
    assert np.isfinite(table.columns["/speed.v"]).sum() == 60
    assert any("39 values are absent, or of another type" in note for note in table.notes)
    assert any("1 messages cannot be read" in note for note in table.notes)

"""Logs of gigabytes for `bench_formats.py --large`: some minutes of a machine, again and again under new stamps.

Each writer takes a path and the bytes that the file shall have.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from large_can_logs import asc, blf, candump, mf4_bus

START = 1_750_000_000_000_000_000  # ns since 1970
TICK = 10_000_000  # ns: 100 Hz
TICKS = 6000  # a minute, which is repeated
CORNERS = ("fl", "fr", "rl", "rr")
JOINTS = ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]
IMAGE = (640, 480)
EVERY = 10  # ticks between two images

Message = tuple[int, int, bytes]  # connection, stamp [ns], content
Connection = tuple[str, str]  # topic, type
CONNECTIONS: list[Connection] = [
    ("/joint_states", "sensor_msgs/msg/JointState"),
    ("/vio/odometry", "nav_msgs/msg/Odometry"),
    ("/imu/data", "sensor_msgs/msg/Imu"),
    ("/camera/image_raw", "sensor_msgs/msg/Image"),
]


def drive(rows: int) -> dict[str, np.ndarray]:
    """A robot of four driven wheels that pulls, at 100 Hz, by the recording's own names."""
    draws = np.random.default_rng(0)
    speed = 1 + 0.2 * np.sin(np.arange(rows) / 300)
    result = {"ground_speed": speed + 0.01 * draws.standard_normal(rows)}
    result |= {f"wheel_speed_{w}": speed / 0.2 / 0.9 + 0.02 * draws.standard_normal(rows) for w in CORNERS}
    result |= {f"drive_torque_{w}": 15 + draws.standard_normal(rows) for w in CORNERS}
    return result | {"drawbar_force": 200 + 4 * draws.standard_normal(rows)}


# --- ROS -----------------------------------------------------------------------------------------------------------


def ros_minute(store: Any, *, one: bool) -> list[tuple[list[bytes], ...]]:
    """The messages of a minute by connection, serialised; ``one``: for ROS 1."""
    kinds, machine = store.types, drive(TICKS)

    def made(kind: str, /, **fields: Any) -> Any:
        return kinds[kind](**fields)

    header = made(
        "std_msgs/msg/Header",
        stamp=made("builtin_interfaces/msg/Time", sec=0, nanosec=0),
        frame_id="base_link",
        **({"seq": 0} if one else {}),
    )

    def vector(x: float) -> Any:
        return made("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.0)

    turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    pose = made(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=made(
            "geometry_msgs/msg/Pose",
            position=made("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
            orientation=turn,
        ),
        covariance=np.zeros(36),
    )
    raw = np.random.default_rng(1).integers(0, 255, IMAGE[0] * IMAGE[1], dtype=np.uint8)
    image = made(
        CONNECTIONS[3][1], header=header, height=IMAGE[1], width=IMAGE[0], encoding="mono8", is_bigendian=0,
        step=IMAGE[0], data=raw,
    )  # fmt: skip
    write = store.serialize_ros1 if one else store.serialize_cdr
    result: list[tuple[list[bytes], ...]] = []
    for k in range(TICKS):
        joints = made(
            CONNECTIONS[0][1],
            header=header,
            name=JOINTS,
            position=np.zeros(4),
            velocity=np.array([machine[f"wheel_speed_{w}"][k] for w in CORNERS]),
            effort=np.array([machine[f"drive_torque_{w}"][k] for w in CORNERS]),
        )
        twist = made(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=made(
                "geometry_msgs/msg/Twist", linear=vector(machine["ground_speed"][k]), angular=vector(0.0)
            ),
            covariance=np.zeros(36),
        )
        odometry = made(CONNECTIONS[1][1], header=header, child_frame_id="base", pose=pose, twist=twist)
        imu = made(
            CONNECTIONS[2][1], header=header, orientation=turn, orientation_covariance=np.zeros(9),
            angular_velocity=vector(0.01), angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(0.1 * np.sin(k)), linear_acceleration_covariance=np.zeros(9),
        )  # fmt: skip
        result.append(
            tuple(bytes(write(m, c[1])) for m, c in zip((joints, odometry, imu), CONNECTIONS, strict=False))
        )
    result.append((bytes(write(image, CONNECTIONS[3][1])),))
    return result


def ros_messages(store: Any, size: int, *, one: bool, images: bool) -> Iterator[Message]:
    """Messages of ``size`` bytes in all; both serialisations have the stamp in bytes 4 to 12. The three clocks differ."""
    *minute, (image,) = ros_minute(store, one=one)
    written = tick = 0
    while written < size:
        for connection, content in enumerate(minute[tick % TICKS]):
            stamp = START + tick * TICK + connection * 3_000_000
            whole = content[:4] + struct.pack("<II", *divmod(stamp, 1_000_000_000)) + content[12:]
            written += len(whole)
            yield connection, stamp, whole
        if images and tick % EVERY == 0:
            stamp = START + tick * TICK + 9_000_000
            written += len(image)
            yield 3, stamp, image[:4] + struct.pack("<II", *divmod(stamp, 1_000_000_000)) + image[12:]
        tick += 1


def _store(*, one: bool) -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)


def mcap(path: Path, size: int, *, images: bool) -> None:
    """ROS 2 messages in an MCAP file, as ``ros2 bag record -s mcap`` writes it."""
    from mcap.writer import CompressionType, Writer

    store = _store(one=False)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, chunk_size=768 << 10)
        writer.start("ros2")
        channels = []
        for topic, kind in CONNECTIONS:
            text = store.generate_msgdef(kind, ros_version=2)[0]
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channels.append(writer.register_channel(topic, "cdr", schema))
        for connection, stamp, content in ros_messages(store, size, one=False, images=images):
            writer.add_message(channels[connection], stamp, content, stamp)
        writer.finish()


def ros2_sqlite(path: Path, size: int, *, images: bool) -> None:
    """ROS 2 messages in SQLite, as rosbag2 writes it."""
    store = _store(one=False)
    base = sqlite3.connect(path)
    base.executescript(
        "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    )
    base.executemany(
        "INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", [(k + 1, *c) for k, c in enumerate(CONNECTIONS)]
    )
    rows = ((c + 1, t, m) for c, t, m in ros_messages(store, size, one=False, images=images))
    base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    base.commit()
    base.close()


def ros1(path: Path, size: int, *, images: bool) -> None:
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer

    store = _store(one=True)
    with Writer(path) as writer:
        known = [writer.add_connection(topic, kind, typestore=store) for topic, kind in CONNECTIONS]
        for connection, stamp, content in ros_messages(store, size, one=True, images=images):
            writer.write(known[connection], stamp, content)


# --- tables --------------------------------------------------------------------------------------------------------


def table(extras: int, rows: int) -> dict[str, np.ndarray]:
    """`drive` beside columns that nobody asks for."""
    draws = np.random.default_rng(2)
    return drive(rows) | {f"extra_{k}": draws.standard_normal(rows) for k in range(extras)}


def csv(path: Path, size: int) -> None:
    """11 of 40 columns wanted, 10 000 rows again and again under new stamps."""
    rows = 10_000
    columns = table(29, rows)
    lines = [",".join(f"{column[k]:.5f}" for column in columns.values()) for k in range(rows)]
    with path.open("w") as stream:
        stream.write(",".join(["time", *columns]) + "\n")
        written, first = 0, 0
        while written < size:
            text = "".join(f"{(first + k) / 100:.2f},{line}\n" for k, line in enumerate(lines))
            stream.write(text)
            written, first = written + len(text), first + rows


def parquet(extras: int) -> Callable[[Path, int], None]:
    """A Parquet file of `table`."""

    def write(path: Path, size: int) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        rows, first = 100_000, 0
        columns = {name: pa.array(column) for name, column in table(extras, rows).items()}
        schema = pa.schema([("time", pa.float64()), *((name, pa.float64()) for name in columns)])
        with pq.ParquetWriter(path, schema, use_dictionary=False) as writer:
            while first * 8 * len(schema) < size:
                time = pa.array((first + np.arange(rows)) / 100)
                writer.write_table(pa.table([time, *columns.values()], schema=schema))
                first += rows

    return write


def matlab73(extras: int) -> Callable[[Path, int], None]:
    """A struct of `table` with its time, in HDF5 as MATLAB 7.3 lays it out."""

    def write(path: Path, size: int) -> None:
        import h5py

        rows = 100_000
        columns = table(extras, rows)
        count = max(size // (8 * (len(columns) + 1)) // rows, 1) * rows
        with h5py.File(path, "w", userblock_size=512) as file:
            group = file.create_group("log")
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for name in ("time", *columns):
                data = group.create_dataset(name, (1, count), "f8", chunks=(1, rows))
                data.attrs["MATLAB_class"] = np.bytes_("double")
                for first in range(0, count, rows):
                    time = (first + np.arange(rows)) / 100
                    data[0, first : first + rows] = time if name == "time" else columns[name]
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\x02IM")

    return write


def matlab5(path: Path, size: int) -> None:
    """The same struct in version 5, packed as MATLAB saves it; it repeats itself less than once a minute."""
    import scipy.io

    columns = table(29, size // (8 * 41))
    columns = {"time": np.arange(len(next(iter(columns.values())))) / 100, **columns}
    scipy.io.savemat(
        path, {"log": {name: column[:, None] for name, column in columns.items()}}, do_compression=True
    )


@dataclass(frozen=True)
class Large:
    """A large log: what writes it, its file's name, options of the command line, and the loop of the library that reads such files.

    ``recording_fits``: what is wanted of 5 GB fits 2 GB at 8 bytes a value.
    """

    write: Callable[[Path, int], None]
    file: str
    profile: tuple[str, ...] = ()
    loop: str = ""
    recording_fits: bool = True


ROS = ("--profile", "ros2-4wd")
STRUCT = ("--profile", "{folder}/struct.yaml")
TRACTOR = ("--profile", "tractor-isobus")
MAT5_LOOP = "import matio\nmatio.load_from_mat({path!r})"
MCAP_LOOP = "from mcap.stream_reader import StreamReader\nfor record in StreamReader(open({path!r}, 'rb')).records: pass"
ROS1_LOOP = (
    "from rosbags.rosbag1 import Reader\nwith Reader({path!r}) as bag:\n for message in bag.messages(): pass"
)
SQL_LOOP = "import sqlite3\nfor row in sqlite3.connect({path!r}).execute('SELECT timestamp, data FROM messages'): pass"
MDF_LOOP = "import asammdf\nasammdf.MDF({path!r}).get('CAN_DataFrame', raw=True)"
CAN_LOOP = "import can\nfor message in can.LogReader({path!r}): pass"
LARGE = {
    "CSV, 11 of 40 columns wanted": Large(csv, "log.csv"),
    "Parquet, 11 of 40 columns wanted": Large(parquet(29), "log.parquet"),
    "Parquet, all columns wanted": Large(parquet(0), "log.parquet", recording_fits=False),
    "MATLAB 7.3, 11 of 40 columns wanted": Large(matlab73(29), "log.mat", STRUCT),
    "MATLAB 7.3, all columns wanted": Large(matlab73(0), "log.mat", STRUCT, recording_fits=False),
    "MATLAB 5, 11 of 40 columns wanted": Large(matlab5, "log.mat", STRUCT, MAT5_LOOP),
    "MCAP, ROS 2 beside images": Large(partial(mcap, images=True), "log.mcap", ROS, MCAP_LOOP),
    "MCAP, ROS 2, all wanted": Large(partial(mcap, images=False), "log.mcap", ROS, MCAP_LOOP),
    "ROS 2 bag (SQLite) beside images": Large(partial(ros2_sqlite, images=True), "log.db3", ROS, SQL_LOOP),
    "ROS 2 bag (SQLite), all wanted": Large(partial(ros2_sqlite, images=False), "log.db3", ROS, SQL_LOOP),
    "ROS 1 bag beside images": Large(partial(ros1, images=True), "log.bag", ROS, ROS1_LOOP),
    "ROS 1 bag, all wanted": Large(partial(ros1, images=False), "log.bag", ROS, ROS1_LOOP),
    "MF4 bus, two of 20 messages wanted": Large(mf4_bus, "bus.mf4", TRACTOR, MDF_LOOP),
    "BLF, two of 20 messages wanted": Large(blf, "bus.blf", TRACTOR, CAN_LOOP),
    "ASC, two of 20 messages wanted": Large(asc, "bus.asc", TRACTOR, CAN_LOOP),
    "candump, two of 20 messages wanted": Large(candump, "bus.log", TRACTOR, CAN_LOOP),
}


def profile_of_struct() -> str:
    """A profile in YAML that takes `drive` from the fields of a struct ``log``."""
    return "channels:\n" + "".join(f"  {name}: log.{name}\n" for name in drive(1))

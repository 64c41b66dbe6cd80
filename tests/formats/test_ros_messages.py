"""Messages of ROS: every number by topic and field, whatever their type, and those that are damaged are counted."""

from __future__ import annotations

import bz2
import random
import shutil
import sqlite3
import struct
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Reader, ReaderError, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from terragrip.errors import InputError
from terragrip.formats.messages import Topic, log_of
from terragrip.formats.reading import read_table
from terragrip.formats.ros_types import Types
from test_logs import COUNT, fill, write_ros1, write_ros2

DEFINITION = """std_msgs/Header header
bool locked
string[] name
float64[] velocity
uint8 gear
Inner[] parts
string soil
int16[3] triple
float32[] samples
Inner one
uint8[] image
char letter
uint64[] big
float64[9] pose_covariance
builtin_interfaces/Duration span
int64 last
================================================================================
MSG: farm_msgs/Inner
uint8 kind
float64 value
string label
"""


def make(store: Any, draws: random.Random) -> Any:
    """A message whose lists and texts have any lengths."""
    kinds = store.types
    inner = kinds["farm_msgs/msg/Inner"]
    extra = {"seq": 7} if "seq" in str(store.fielddefs["std_msgs/msg/Header"]) else {}
    stamp = kinds["builtin_interfaces/msg/Time"](
        sec=draws.choice([0, 1_750_000_000]), nanosec=draws.randrange(10**9)
    )
    joints = draws.choice([[], ["left", "right"], ["right", "left"], ["a", "b", "c"]])
    numbers = [draws.random() for _ in range(draws.choice([len(joints), 2, 0]))]

    def part() -> Any:
        return inner(kind=draws.randrange(256), value=draws.random(), label="x" * draws.randrange(4))

    return kinds["farm_msgs/msg/Odd"](
        header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="f" * draws.randrange(3), **extra),
        locked=draws.random() < 0.5,
        name=joints,
        velocity=np.array(numbers),
        gear=draws.randrange(256),
        parts=[part() for _ in range(draws.choice([0, 1, 2]))],
        soil=draws.choice(["", "clay", "sänd"]),
        triple=np.array([draws.randrange(-9, 9) for _ in range(3)], dtype=np.int16),
        samples=np.array([draws.random() for _ in range(draws.choice([0, 3, 40]))], dtype=np.float32),
        one=part(),
        image=np.zeros(draws.choice([0, 500]), dtype=np.uint8),
        letter=draws.randrange(256),
        big=np.array([draws.randrange(2**40) for _ in range(draws.choice([0, 2]))], dtype=np.uint64),
        pose_covariance=np.zeros(9),
        span=kinds["builtin_interfaces/msg/Duration"](sec=1, nanosec=2),
        last=draws.randrange(-(2**40), 2**40),
    )


def flat(value: Any, name: str, labels: list[str], depth: int = 0) -> dict[str, Any]:
    """The signals of what rosbags read: lists of at most 16 numbers or 8 messages, no times, frames or covariances."""
    if isinstance(value, bool | int | float | str | np.number | np.bool_):
        return {name: value if isinstance(value, str) else float(value)}
    if isinstance(value, list | np.ndarray):
        numbers = isinstance(value, np.ndarray)
        if len(value) > (16 if numbers else 8) or any(isinstance(one, str) for one in value[:1]):
            return {}
        own = [f".{label}" for label in labels] if depth == 1 and len(labels) == len(value) else None
        names = own or [f"[{k}]" for k in range(len(value))]
        parts = [flat(one, name + own, labels, depth + 1) for own, one in zip(names, value, strict=True)]
        return {key: number for part in parts for key, number in part.items()}
    fields = {key: getattr(value, key) for key in value.__dataclass_fields__ if key != "__msgtype__"}
    if set(fields) in ({"sec", "nanosec"}, {"sec", "nsec"}):
        return {}
    left_out = ("frame_id", "pose_covariance")
    kept = {key: one for key, one in fields.items() if key not in left_out}
    parts = [flat(one, f"{name}.{key}", labels, depth + 1) for key, one in kept.items()]
    return {key: number for part in parts for key, number in part.items()}


@pytest.mark.parametrize("how", ["ROS 1", "little endian", "big endian"])
def test_messages_of_a_type_of_ones_own(how: str) -> None:
    one = how == "ROS 1"
    draws = random.Random(1030)
    stores = Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE
    types, store = Types(stores.name), get_typestore(stores)
    store.register(get_types_from_msg(DEFINITION, "farm_msgs/msg/Odd"))
    name = types.learn("farm_msgs/msg/Odd", DEFINITION, "msg")
    topic, decode = Topic("/odd"), types.decoder(name, "/odd", one=one)
    order = {} if one else {"little_endian": how == "little endian"}
    write = partial(store.serialize_ros1 if one else store.serialize_cdr, **order)
    expected: list[dict[str, Any]] = []
    for k in range(300):
        message = make(store, draws)
        raw = bytes(write(message, name))
        if k % 97 == 0:
            raw = raw[: draws.randrange(len(raw) - 8)]  # cut off
        else:
            expected.append(flat(message, "/odd", message.name))
        topic.push(float(k), raw, decode)
    signals, notes = topic.signals()
    assert (topic.count, topic.bad) == (len(expected), 4)
    assert "/odd: 4 messages cannot be read and were left out." in notes
    assert set(signals) == {name for fields in expected for name in fields}
    for name, signal in signals.items():
        values = [fields.get(name) for fields in expected]
        if signal.values.dtype == object:
            assert signal.values.tolist() == values
        else:
            assert np.array_equal(signal.values, np.array(values, dtype=float), equal_nan=True), name


@pytest.mark.parametrize("packing", ["none", "bz2", "lz4"])
def test_a_ros1_bag_that_was_cut_off_is_read_as_far_as_it_goes(tmp_path: Path, packing: str) -> None:
    bag = write_ros1(tmp_path / "run.bag") if packing == "none" else tmp_path / "packed.bag"
    if packing != "none":
        whole = write_ros1(tmp_path / "run.bag").read_bytes()
        bag.write_bytes(packed(whole, packing))
    content = bag.read_bytes()
    pull = "/pull.pull"
    assert np.array_equal(read_table(bag, lambda n: n == pull).columns[pull], 100 + np.arange(COUNT))
    bag.write_bytes(content[: int(0.8 * len(content))])  # within the messages, so that the index is lost
    with pytest.raises(ReaderError), Reader(bag):
        pass  # rosbags reads none of it: why our own reader stays (decision 0107)
    if packing == "none":
        table = read_table(bag, lambda n: n == pull)
        assert any("ends early" in note for note in table.notes)
        assert 10 < len(table.columns[pull]) < COUNT
    else:  # all of it is in one chunk, which is of no use in part
        bag.write_bytes(content[:-100])
        with pytest.raises(InputError, match="is a damaged ROS 1 bag"):
            read_table(bag)


def test_a_ros1_bag_with_a_damaged_chunk_is_read_around_it(tmp_path: Path) -> None:
    path = tmp_path / "run.bag"
    bag = Writer(path)
    bag.set_compression(Writer.CompressionFormat.LZ4)
    bag.chunk_threshold = 20_000
    with bag:
        fill(bag, Stores.ROS1_NOETIC, "serialize_ros1")
    whole = read_table(path).columns
    content = bytearray(path.read_bytes())
    chunks = [k for k in range(len(content)) if content.startswith(b"compression=lz4", k)]
    assert len(chunks) > 5
    middle = chunks[len(chunks) // 2] + 200
    content[middle : middle + 50] = bytes(50)
    path.write_bytes(content)
    table = read_table(path)
    assert any("chunks are damaged" in note for note in table.notes)
    left = (
        np.isfinite(table.columns["/pull.pull"]).sum()
        + np.isfinite(table.columns["/imu.linear_acceleration.z"]).sum()
    )
    before = np.isfinite(whole["/pull.pull"]).sum() + np.isfinite(whole["/imu.linear_acceleration.z"]).sum()
    assert 0.5 * before < left < before


def packed(whole: bytes, packing: str) -> bytes:
    """The bag with its chunks packed, and without what stands between them: index and bag header are not needed."""
    pack = bz2.compress if packing == "bz2" else lz4.frame.compress
    result, place = bytearray(whole[:13]), 13
    while place < len(whole):
        (length,) = struct.unpack_from("<I", whole, place)
        header = whole[place + 4 : place + 4 + length]
        (size,) = struct.unpack_from("<I", whole, place + 4 + length)
        data = whole[place + 8 + length : place + 8 + length + size]
        place += 8 + length + size
        if b"op=\x05" in header:
            fields = [b"op=\x05", b"compression=" + packing.encode(), b"size=" + struct.pack("<I", size)]
            header = b"".join(struct.pack("<I", len(f)) + f for f in fields)
            data = pack(data)
            result += struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data
    return bytes(result)


def header_of(kinds: dict[str, Any], second: int, frame: str) -> Any:
    """A header of ROS 1, stamped at a second."""
    stamp = kinds["builtin_interfaces/msg/Time"](sec=1_750_000_000 + second, nanosec=0)
    return kinds["std_msgs/msg/Header"](seq=second, stamp=stamp, frame_id=frame)


def test_a_topic_whose_first_messages_are_empty(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    with Writer(tmp_path / "log.bag") as bag:
        connection = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for k in range(100):
            header = header_of(kinds, k, "")
            names = ["fl", "fr"] if k > 2 else []
            values = np.full(len(names), float(k))
            message = kinds["sensor_msgs/msg/JointState"](header, names, values, values, values)
            bag.write(connection, k * 10**9, store.serialize_ros1(message, "sensor_msgs/msg/JointState"))
    wanted = "/joint_states.velocity.fr"
    speed = read_table(tmp_path / "log.bag", lambda name: name == wanted).columns[wanted]
    assert speed.tolist() == list(range(3, 100))


def test_a_text_that_is_none_costs_its_message_alone(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    with Writer(tmp_path / "log.bag") as bag:
        connection = bag.add_connection("/pull", "geometry_msgs/msg/WrenchStamped", typestore=store)
        for k in range(100):
            vector = kinds["geometry_msgs/msg/Vector3"](float(k), 0.0, 0.0)
            wrench = kinds["geometry_msgs/msg/Wrench"](vector, vector)
            header = header_of(kinds, k, "pin")
            message = kinds["geometry_msgs/msg/WrenchStamped"](header, wrench)
            raw = bytes(store.serialize_ros1(message, "geometry_msgs/msg/WrenchStamped"))
            bag.write(connection, k * 10**9, raw.replace(b"pin", b"p\x8dn") if k == 50 else raw)
    table = read_table(tmp_path / "log.bag")
    assert len(table.columns["/pull.wrench.force.x"]) == 99
    assert "/pull: 1 messages cannot be read and were left out." in table.notes


def test_an_integer_beyond_all_numbers_leaves_the_others_in_their_places() -> None:
    """JSON has integers of any size."""
    topic = Topic("t")
    for k, value in enumerate((1, 10**400, 2)):
        topic.push(float(k), b"", lambda _, value=value: (None, {"t.x": value}))
    assert topic.strange == 1
    np.testing.assert_array_equal(np.array(topic._columns["t.x"].numbers), [1.0, np.nan, 2.0])


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_parts_of_a_bag_that_are_torn_empty_packed_or_gone(tmp_path: Path, plugin: StoragePlugin) -> None:
    """What a part held was missing without a word; a torn one of SQLite, or an empty one, cost the whole bag."""
    folder = write_ros2(tmp_path / "run", plugin, ("/joint_states",))
    first = next(p for p in folder.iterdir() if p.suffix in (".db3", ".mcap"))
    whole, names = first.read_bytes(), [f"run_{k}{first.suffix}" for k in range(5)]
    first.unlink()
    for name, content in zip(names, (whole[: len(whole) * 2 // 3], b"", whole), strict=False):
        (folder / name).write_bytes(content)
    (folder / f"{names[3]}.zst").write_bytes(b"")
    (folder / "metadata.yaml").write_text(
        yaml.safe_dump({"rosbag2_bagfile_information": {"relative_file_paths": names}})
    )
    table = read_table(folder)
    assert np.isfinite(table.columns["/joint_states.velocity.front_left_wheel"]).sum() == COUNT
    for words in ("0{} ", "1{} is a damaged", "3{}.zst is packed", "4{} is missing"):
        assert sum(words.format(first.suffix) in note for note in table.notes) == 1, words
    if plugin is StoragePlugin.SQLITE3:  # this MCAP is one chunk
        assert COUNT * 0.2 < len(read_table(folder / names[0]).columns["time"]) < COUNT


def test_messages_that_a_killed_recorder_left_beside_the_bag(tmp_path: Path) -> None:
    """17 of 60 s of such a bag were read, without a word: SQLite's write-ahead file was not looked at."""
    file = next(write_ros2(tmp_path / "run", StoragePlugin.SQLITE3, ("/joint_states",)).glob("*.db3"))
    killed = tmp_path / "killed"
    with closing(sqlite3.connect(file)) as base:
        base.execute("PRAGMA journal_mode = WAL")
        base.execute("CREATE TEMP TABLE late AS SELECT * FROM messages WHERE id > 50")
        base.execute("DELETE FROM messages WHERE id > 50")
        base.commit()
        base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        base.execute("INSERT INTO messages SELECT * FROM late")
        base.commit()
        shutil.copytree(file.parent, killed)
    assert len(read_table(killed).columns["time"]) == COUNT
    index = killed / f"{file.name}-shm"
    index.unlink()
    left = (killed / f"{file.name}-wal").read_bytes()
    index.symlink_to(tmp_path / "none" / "none")
    # so it cannot be made, as on a disk that is mounted to be read: 'is a damaged ROS 2 bag, or none'
    assert len(read_table(killed).columns["time"]) == COUNT
    assert (killed / f"{file.name}-wal").read_bytes() == left


def test_joints_of_two_publishers_on_one_topic_keep_their_values() -> None:
    """A message without a joint, at the instant of one that has it, took its value away: 'it was sent as "not available" throughout'."""
    topic = Topic("/joint_states")
    for second in range(1, 4):
        for joint, value in (("fl", float(second)), ("rl", 2.0), ("tool", "mower")):
            topic.push(second, b"", lambda _, joint=joint, value=value: (None, {joint: value}))  # type: ignore[misc]
    table = log_of([topic], "bag", []).table()
    assert table.columns["fl"].tolist() == [1, 2, 3]
    assert table.columns["rl"].tolist() == [2, 2, 2]
    assert table.columns["tool"].tolist() == ["mower"] * 3
    assert not any("replace" in note for note in table.notes)


def test_a_recorders_clock_that_is_set_back_is_named() -> None:
    """Three seconds of a drive were mixed with the three before, without a word where no two stamps were equal."""
    topic = Topic("/odom")
    for k in range(100):
        topic.push(k * 0.1 - 3.02 * (k > 50), b"", lambda _: (None, {"/odom.v": 1.0}))
    (note,) = log_of([topic], "bag", []).table().notes
    assert note.startswith("The clock goes back by 2.92 s, 5 s after the start: ")

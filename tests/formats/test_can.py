"""CAN logs: every container gives the same signals; bits against cantools; codes, senders, long messages, damage."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from can_frames import START, WHEEL_BASED, drive, payload, write_log
from terragrip.errors import InputError
from terragrip.formats.can.bits import Field, leaps
from terragrip.formats.can.catalog import EXTENDED, Catalog, catalog, group_of, message_of
from terragrip.formats.can.decoding import signals_of
from terragrip.formats.can.frames import Frames
from terragrip.formats.reading import read, read_log, read_table

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 291 Wheels: 8 ECU
 SG_ front m0 : 7|16@0+ (0.01,0) [0|0] "m/s" ECU
 SG_ rear m1 : 0|16@1- (0.5,-3) [0|0] "rad/s" ECU
 SG_ page M : 60|4@1+ (1,0) [0|0] "" ECU
 SG_ odd : 21|13@0- (0.25,1) [0|0] "" ECU
 SG_ wide : 33|26@1+ (1,0) [0|0] "" ECU
BO_ 2147483940 Floats: 8 ECU
 SG_ ratio : 0|32@1- (1,0) [0|0] "" ECU
 SG_ big : 39|32@0- (1,0) [0|0] "" ECU
SIG_VALTYPE_ 2147483940 ratio : 1;
SIG_VALTYPE_ 2147483940 big : 1;
"""


@pytest.fixture(scope="module")
def dbc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("dbc") / "bus.dbc"
    path.write_text(DBC)
    return path


def cycles(stamps: list[float]) -> np.ndarray:
    """The first of messages of a cycle of .1 s: those 5 ms apart at most."""
    return np.array(stamps)[np.diff(stamps, prepend=-1.0) > 0.005]


@pytest.mark.parametrize("suffix", ["blf", "asc", "trc", "log", "csv"])
def test_every_container_gives_the_same_signals(tmp_path: Path, suffix: str) -> None:
    machine = drive(1000, 30.0)
    table = read_table(write_log(tmp_path / f"log.{suffix}", machine.frames))
    sent = [struct.unpack("<H", d[:2])[0] / 1000 for _, i, d in machine.frames if i == WHEEL_BASED]
    wheel = table.columns["WheelBasedMachineSpeed"]
    assert np.allclose(wheel[np.isfinite(wheel)], sent, atol=1e-9)
    assert np.isfinite(table.columns["GroundBasedMachineSpeed"]).sum() == 150
    stamps = cycles([t - START for t, _, _ in machine.frames])
    assert np.allclose(table.columns["time"], stamps, atol=2e-3)
    assert table.units["WheelBasedMachineSpeed"] == "m/s"
    assert table.start is None if suffix == "asc" else table.start == pytest.approx(START, abs=1e-3)


def test_candump_as_printed_and_other_tables(tmp_path: Path) -> None:
    texts = {
        "printed.txt": "(1700000000.500000)  can0  RX - -  0CFE48F0   [8]  E8 03 00 00 00 00 FF FD\n" * 3
        + "(1700000001.000000)  can0  0CFE4980   [8]  D0 07 00 00 00 00 FF FD\n",
        "semicolon.csv": "Timestamp;Type;ID;Data\n1700000000.5;1;CFE48F0;E8030000000000FD\n1700000001.0;1;CFE4980;D0070000000000FD\n",
        "groups.csv": ",time,pgn,priority,source,destination,data\n0,500,65096,3,240,255,E8 03 00 00 00 00 FF FD \n"
        + "1,1000,65097,3,128,255,D0 07 00 00 00 00 FF FD \n" * 2,
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        columns = read_table(tmp_path / name).columns
        assert np.nanmax(columns["WheelBasedMachineSpeed"]) == 1.0, name
        assert np.nanmax(columns["GroundBasedMachineSpeed"]) == 2.0, name


def test_tables_of_frames_as_other_loggers_write_them(tmp_path: Path) -> None:
    """SavvyCAN, CL2000, Kvaser and Vehicle Spy: they were read as tables of numbers, and refused: 'log the wheels too'."""
    moves = [(0.5, 0x0CFE48F0, "E8 03 00 00 00 00 FF FD"), (1.0, 0x0CFE4980, "D0 07 00 00 00 00 FF FD")]
    frames = [(time + n, number, bytes.fromhex(data)) for n in range(3) for time, number, data in moves]
    cells = [(time, number, [f"{byte:02X}" for byte in data]) for time, number, data in frames]
    texts = {
        "savvycan.csv": "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
        + "".join(f"{1e6 * t + 5e8:.0f},{i:08X},true,Rx,0,8,{','.join(d)},\n" for t, i, d in cells),
        "cl2000.txt": "# Logger type: CANLogger2000\n# Time format: 6\nTimestamp;Type;ID;Data\n"
        + "".join(f"20240914T10000{t:.3f};1;{i:x};{''.join(d)}\n" for t, i, d in cells),
        "kvaser.csv": "Time,Channel,ID,Flags,DLC,Data0,Data1,Data2,Data3,Data4,Data5,Data6,Data7,Counter\n"
        + "".join(f"{t:.6f},0,{i},X,8,{','.join(map(str, d))},1\n" for t, i, d in frames),
        "spy.csv": "Vehicle Spy 3 Log\nsaved,today\nLine,Abs Time(Sec),Tx,Network,Arb ID,Remote,Xtd,B1,B2,B3,B4,B5,B6,B7,B8\n"
        + "".join(f"1,{t:.6f},F,HS CAN,{i:08X},F,T,{','.join(d)}\n" for t, i, d in cells),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        table = read_table(tmp_path / name)
        time = table.columns["time"]
        assert time[-1] - time[0] == pytest.approx(2.5), name
        assert np.nanmax(table.columns["WheelBasedMachineSpeed"]) == 1.0, name
        assert np.nanmax(table.columns["GroundBasedMachineSpeed"]) == 2.0, name


def decoded(
    frames: list[tuple[float, int, bytes]], databases: tuple[Path, ...] = ()
) -> dict[str, np.ndarray]:
    collected = Frames(catalog(databases))
    for time, identifier, data in frames:
        collected.add(time, identifier, data)
    return {name: signal.values for name, signal in signals_of(collected)[0].items()}


@settings(max_examples=60)
@given(data=st.binary(min_size=8, max_size=8))
def test_bits_agree_with_cantools(data: bytes) -> None:
    database = cantools.database.load_string(DBC, "dbc")
    collected = Frames(Catalog(message_of(database, message) for message in database.messages))
    collected.add(0.0, 291, data)
    collected.add(0.0, 292 | EXTENDED, data)
    result = {name: signal.values[0] for name, signal in signals_of(collected)[0].items()}
    expected: dict[str, float] = {}
    name_of = {291: "Wheels", 292: "Floats"}
    for identifier in (291, 292):
        try:
            expected |= database.get_message_by_name(name_of[identifier]).decode(data, decode_choices=False)
        except cantools.database.errors.DecodeError:  # no such page: the other signals are there all the same
            page = data[7] >> 4
            assert page > 1
            assert result["page"] == page
    for name, value in expected.items():
        assert result[name] == pytest.approx(value, rel=1e-12, nan_ok=True), name
    for name in {"front", "rear"} - set(expected):
        assert np.isnan(result[name])


def test_signals_of_one_name_are_told_apart(tmp_path: Path) -> None:
    head = 'VERSION ""\nBS_:\nBU_: E\n'
    pages = 'BO_ 256 Drive: 8 E\n SG_ Page M : 0|8@1+ (1,0) [0|3] "" X\n' + "".join(
        f' SG_ Speed m{page} : 8|16@1+ (0.01,0) [0|600] "rpm" X\n' for page in (0, 1)
    )
    both = "".join(
        f'BO_ {key} Drive: 8 E\n SG_ Speed : 8|16@1+ (0.01,0) [0|600] "rpm" X\n' for key in (256, 257)
    )
    rows = [
        (
            0.1 * k,
            256 + key,
            bytes([k % 2]) + (1000 + 500 * key + 100 * (k % 2)).to_bytes(2, "little") + bytes(5),
        )
        for k in range(4)
        for key in (0, 1)
    ]
    for text, expected in (
        (pages, {"Speed.m0": [10, np.nan] * 2, "Speed.m1": [np.nan, 11] * 2}),
        (both, {"Drive(100).Speed": [10, 11] * 2, "Drive(101).Speed": [15, 16] * 2}),
    ):
        file = tmp_path / "bus.dbc"
        file.write_text(head + text)
        result = decoded(rows, (file,))
        for name, values in expected.items():
            np.testing.assert_allclose(result[name], values, err_msg=name)


def test_two_dbcs_that_differ_on_a_message_are_named(tmp_path: Path) -> None:
    """The first counted, without a word."""
    files = []
    for name, scale in (("a", "0.01"), ("b", "0.1")):
        files.append(tmp_path / f"{name}.dbc")
        files[-1].write_text(
            f'VERSION ""\nBS_:\nBU_: E\nBO_ 256 Drive: 8 E\n SG_ Speed : 0|16@1+ ({scale},0) [0|600] "rpm" X\n'
        )
    for paths, said in ((files, True), (files[:1] * 2, False)):
        collected = Frames(catalog(paths))
        collected.add(0.0, 256, bytes(8))
        notes = " ".join(signals_of(collected)[1])
        assert ("unlike ways; the first one given counts: Drive." in notes) == said


def test_a_short_frame_lacks_what_it_does_not_reach(dbc: Path) -> None:
    result = decoded([(0.0, 291, bytes(3)), (1.0, 291, bytes(8))], (dbc,))
    assert np.isnan(result["page"][0])
    assert result["page"][1] == 0
    assert np.isnan(result["wide"][0])
    assert result["odd"][1] == 1.0


@pytest.mark.parametrize(
    ("bits", "valid", "missing"),
    [
        (2, (0, 1), (2, 3)),
        (8, (0, 0xFA), (0xFB, 0xFE, 0xFF)),
        (16, (0, 0xFAFF), (0xFB00, 0xFE00, 0xFEFF, 0xFF00, 0xFFFF)),
        (32, (0, 0xFAFFFFFF), (0xFB000000, 0xFE000000, 0xFFFFFFFF)),
    ],
)
def test_codes_for_error_and_not_available(
    bits: int, valid: tuple[int, ...], missing: tuple[int, ...]
) -> None:
    codes = Field("x", 0, bits, codes=True).missing
    assert [raw in codes for raw in (*valid, *missing)] == [False] * len(valid) + [True] * len(missing)


def test_not_available_is_missing_and_reverse_is_negative() -> None:
    frames = [
        (0.0, WHEEL_BASED | EXTENDED, payload(1.5)),
        (0.1, WHEEL_BASED | EXTENDED, payload(1.5, direction=0)),
        (0.2, WHEEL_BASED | EXTENDED, payload(65.535)),
        (0.3, WHEEL_BASED | EXTENDED, payload(65.024)),
    ]
    speed = decoded(frames)["WheelBasedMachineSpeed"]
    assert list(speed[:2]) == [1.5, -1.5]
    assert np.isnan(speed[2:]).all()


def test_any_source_address_and_priority() -> None:
    assert group_of(0x18EA1234) == 0xEA00  # a destination is no part of the group
    for identifier in (0x0CFE48F0, 0x18FE4803, 0x1CFE48FE):
        assert decoded([(0.0, identifier | EXTENDED, payload(2.0))])["WheelBasedMachineSpeed"] == 2.0


def test_of_several_senders_the_one_with_values_counts() -> None:
    silent, sending = 0x0CFE4903 | EXTENDED, 0x0CFE4980 | EXTENDED
    frames = [(0.1 * k, silent, payload(65.535)) for k in range(5)]
    frames += [(0.1 * k, sending, payload(2.0)) for k in range(4)]
    result = decoded(frames)
    assert list(result["GroundBasedMachineSpeed"]) == [2.0] * 4
    assert np.isnan(result["GroundBasedMachineSpeed@03"]).all()
    collected = Frames(catalog())
    for frame in frames:
        collected.add(*frame)
    assert any("address 80" in note for note in signals_of(collected)[1])


def test_messages_of_several_frames() -> None:
    latitude, longitude, altitude = 51.25, 13.5, 120.5
    body = bytes(7) + struct.pack(
        "<qqq", round(latitude * 1e16), round(longitude * 1e16), round(altitude * 1e6)
    )
    body = body.ljust(43, b"\xff")
    fast = [bytes([0x40, 43]) + body[:6]]
    fast += [bytes([0x40 | k + 1]) + body[6 + 7 * k : 13 + 7 * k].ljust(7, b"\xff") for k in range(6)]
    position = 0x0DF80501 | EXTENDED
    frames = [(0.1 * k, position, data) for k, data in enumerate(fast)]
    frames += [(1.0, position, fast[0]), (1.1, position, fast[2])]  # a part is lost
    frames += [(2.0 + 0.1 * k, position, data) for k, data in enumerate(fast)]
    result = decoded(frames)
    assert list(result["GnssPositionLatitude"]) == [latitude] * 2
    assert list(result["GnssPositionAltitude"]) == [altitude] * 2
    # The same group by J1939's broadcast announce message.
    announce = bytes([32, 43, 0, 7, 255, 0x05, 0xF8, 0x01])
    frames = [(0.0, 0x1CECFF05 | EXTENDED, announce)]
    frames += [
        (0.1 * k + 0.1, 0x1CEBFF05 | EXTENDED, bytes([k + 1]) + body[7 * k : 7 * k + 7].ljust(7, b"\xff"))
        for k in range(7)
    ]
    assert list(decoded(frames)["GnssPositionLongitude"]) == [longitude]


def test_only_what_a_profile_asks_for_is_kept(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.blf", drive(1000, 10.0).frames)
    table = read_table(path, lambda name: name == "GroundBasedMachineSpeed")
    assert set(table.columns) == {"time", "GroundBasedMachineSpeed"}
    assert "WheelBasedMachineSpeed" in table.names


def test_refusals(tmp_path: Path, dbc: Path) -> None:
    frames = [(START + k, 0x7F0, bytes(8)) for k in range(5)]
    log = write_log(tmp_path / "other.blf", frames, extended=False)
    with pytest.raises(
        InputError,
        match="its only identifier, 7F0, is not in the built-in table of J1939; give the bus's DBC",
    ):
        read_table(log)
    with pytest.raises(InputError, match="is not in the DBC"):
        read_table(log, databases=(dbc,))
    tractor = write_log(tmp_path / "log.blf", drive(1000, 10.0).frames)
    with pytest.raises(InputError, match="is missing"):
        read(tractor)
    with pytest.raises(InputError, match="map its signals in a profile: tractor-isobus, ros2-4wd"):
        read(tractor)
    with pytest.raises(InputError, match=r"'tractor-isobos' is neither a file.*did you mean tractor-isobus"):
        read(tractor, "tractor-isobos")
    with pytest.raises(InputError, match="no such file"):
        read(tractor, "tractor-isobus", dbc=tmp_path / "absent.dbc")
    wrong = read_table(
        tractor, databases=(dbc,)
    )  # a DBC that lacks every message of the log: said, and the table serves
    assert any(
        "None of the DBC's messages occurs in the log (Floats, Wheels)" in note for note in wrong.notes
    )
    (tmp_path / "broken.dbc").write_text("BO_ x\n")
    with pytest.raises(InputError, match="is a damaged DBC, or none"):
        read(tractor, "tractor-isobus", dbc=tmp_path / "broken.dbc")
    (tmp_path / "table.csv").write_text("time,a\n0,1\n")
    with pytest.raises(InputError, match="is a text table, which needs no DBC"):
        read(tmp_path / "table.csv", dbc=dbc)


def test_a_log_cut_off_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.blf", drive(1000, 200.0).frames)
    whole = len(read_table(path).columns["time"])
    path.write_bytes(path.read_bytes()[: -path.stat().st_size // 3])
    cut = read_table(path)
    assert 0 < len(cut.columns["time"]) < whole
    assert any("The file ends early: it has" in note for note in cut.notes)
    lines = write_log(tmp_path / "log.log", drive(1000, 10.0).frames).read_text().splitlines(keepends=True)
    (tmp_path / "log.log").write_text("".join(["@@@\n", *lines]))
    assert any("1 line has no frame: line 1 ('@@@')" in n for n in read_table(tmp_path / "log.log").notes)


def test_measured_john_deere(shared: Callable[[str], Path]) -> None:
    folder = shared("data/ingest_samples/tractorhacking_j1939_5055E")
    for log in sorted(folder.glob("*.csv")):
        table = read_table(log)
        assert np.isnan(table.columns["GroundBasedMachineSpeed"]).all(), "65.535 m/s is no speed"
        assert np.nanmax(np.abs(table.columns["WheelBasedVehicleSpeed"])) == 0
        assert any("milliseconds" in note for note in table.notes)
    assert np.nanmax(read_table(folder / "highRPM1.csv").columns["EngineSpeed"]) == 1259.5
    with pytest.raises(
        InputError, match='signal GroundBasedMachineSpeed: has no value: it was sent as "not available"'
    ):
        read(folder / "idle10sec.csv", "tractor-isobus")


@pytest.mark.parametrize("suffix", ["asc", "log"])
def test_frames_of_no_use_are_counted_all_the_same(tmp_path: Path, suffix: str) -> None:
    frames = [
        f
        for k, f in enumerate(drive(1000, 20.0).frames)
        for f in (f, (f[0] + 1e-3, 0x18FF0017 + 256 * (k % 5), bytes(8)))
    ]
    log = write_log(tmp_path / f"log.{suffix}", frames)
    every, one = read_table(log), read_table(log, lambda name: name == "GroundBasedMachineSpeed")
    assert any(
        "300 of 600 frames are in no DBC or table, those of the identifiers 18FF0017 (PGN 65280)" in note
        for note in every.notes
    )
    assert [n for n in one.notes if "frames" in n] == [n for n in every.notes if "frames" in n]
    speed = every.columns["GroundBasedMachineSpeed"]
    assert np.array_equal(one.columns["GroundBasedMachineSpeed"], speed[np.isfinite(speed)])


def test_asc_stamps_that_count_from_the_event_before(tmp_path: Path) -> None:
    frames = drive(1000, 20.0).frames
    log = write_log(tmp_path / "log.asc", frames)
    whole = read_table(log).columns
    lines = log.read_text().replace("timestamps absolute", "timestamps relative").splitlines()
    last = 0.0
    for k, line in enumerate(lines):
        stamp, _, rest = line.strip().partition(" ")
        if re.fullmatch(r"\d+\.\d+", stamp):
            lines[k], last = f"{float(stamp) - last:.6f} {rest}", float(stamp)
    log.write_text("\n".join(lines) + "\n")
    again = read_table(log).columns
    assert np.allclose(again["time"], whole["time"], atol=1e-5)
    assert np.array_equal(again["GroundBasedMachineSpeed"], whole["GroundBasedMachineSpeed"], equal_nan=True)


def test_an_asc_log_without_an_end_is_said_to_be_cut(tmp_path: Path) -> None:
    """Cut between two lines it has no line without a frame."""
    log = write_log(tmp_path / "log.asc", drive(1000, 20.0).frames)
    assert not any("cut" in note for note in read_table(log).notes)
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[: len(lines) // 2]))
    assert any("has no 'End TriggerBlock': it was cut" in note for note in read_table(log).notes)


def test_a_line_whose_identifier_has_more_than_29_bits_has_no_frame(tmp_path: Path) -> None:
    """Found by a fuzzer: one of more than 64 bits ended the reading by an OverflowError."""
    frames = drive(1000, 20.0).frames
    log = write_log(tmp_path / "log.asc", frames)
    whole = read_table(log).columns
    lines = log.read_text().splitlines()
    for identifier in ("FFFFFFFFFFFFFFFFFFx", "FFFFFFFFFFFFFFFFFF", "3FFFFFFFx"):
        log.write_text("\n".join([*lines[:60], f"   1.5 1  {identifier}  Rx  d 1 00", *lines[60:]]) + "\n")
        again = read_table(log)
        assert any(note.startswith("1 line has no frame: line 61 (") for note in again.notes), identifier
        assert all(np.array_equal(again.columns[name], whole[name], equal_nan=True) for name in whole)


@pytest.mark.parametrize("head", ["time,id,data", "time,pgn,source,data"])
@pytest.mark.parametrize("bad", ["FFFFFFFFFFFFFFFFFF", "-1", str(1 << 70)])
def test_a_row_whose_identifier_has_more_than_29_bits_has_no_frame(
    tmp_path: Path, head: str, bad: str
) -> None:
    frames, by_group = drive(1000, 20.0).frames, "pgn" in head
    rows = [
        f"{t:.6f},{(i >> 8) & 0x3FFFF},{i & 0xFF},{d.hex()}" if by_group else f"{t:.6f},{i:08X},{d.hex()}"
        for t, i, d in frames
    ]
    rows.insert(60, f"{frames[60][0]},{bad},{'1,' if by_group else ''}00")
    log = tmp_path / "log.csv"
    log.write_text("\n".join([head, *rows]) + "\n")
    assert any("1 line has no frame: line 62 (" in note for note in read_table(log).notes)


def blanks(data: bytes) -> str:
    return data.hex(" ").upper()


DATE = datetime(2025, 6, 15, 12, 0, tzinfo=UTC)
TEXTS = {
    "candump -l": lambda t, i, d: f"({START + t:.6f}) can0 {i:08X}#{d.hex()}",
    "candump -L -x": lambda t, i, d: f"({START + t:.6f}) can0 {i:08X}#{d.hex()} R",
    "candump -ta": lambda t, i, d: f" ({START + t:.6f})  can0  {i:08X}   [8]  {blanks(d)}",
    "candump -ta -x -a": lambda t, i, d: (
        f" ({START + t:.6f})  can0  RX - -  {i:08X}   [8]  {blanks(d)}   '........'"
    ),
    "candump -tA": lambda t, i, d: (
        f" ({DATE + timedelta(seconds=t):%Y-%m-%d %H:%M:%S.%f})  can0  {i:08X}   [8]  {blanks(d)}"
    ),
    "candump -tz": lambda t, i, d: f" ({t:010.6f})  can0  {i:08X}   [8]  {blanks(d)}",
    "FD frames": lambda t, i, d: f"({START + t:.6f}) can0 {i:08X}##1{d.hex()}",
    "TRC 1.0": lambda t, i, d: f"{1:6d}) {1000 * t:9.0f} {i:08X}  8  {blanks(d)}",
    "TRC 1.1": lambda t, i, d: f"{1:6d}) {1000 * t:11.1f}  Rx {i:08X}  8  {blanks(d)}",
    "TRC 1.3": lambda t, i, d: f"{1:6d}) {1000 * t:11.3f} 1  Rx {i:08X} -  8  {blanks(d)}",
    "TRC 2.0": lambda t, i, d: f"{1:6d} {1000 * t:11.3f} DT {i:08X} Rx 8 {blanks(d)}",
    "TRC 2.1": lambda t, i, d: f"{1:6d} {1000 * t:11.3f} DT 1 {i:08X} Rx - 8 {blanks(d)}",
}
HEADS = {
    "TRC 1.0": ";  made by PCAN-Explorer\n;\n",
    **{f"TRC 1.{k}": f";$FILEVERSION=1.{k}\n;$STARTTIME=45000.5\n;\n" for k in (1, 3)},
    "TRC 2.0": ";$FILEVERSION=2.0\n;$STARTTIME=45000.5\n;$COLUMNS=N,O,T,I,d,l,D\n",
    "TRC 2.1": ";$FILEVERSION=2.1\n;$STARTTIME=45000.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
}


@pytest.mark.parametrize("form", [*TEXTS, "candump -td"])
def test_forms_of_text_logs_by_their_content(tmp_path: Path, form: str) -> None:
    frames = [(t - START, i, d) for t, i, d in drive(1000, 40.0).frames]
    written, last = TEXTS.get(form, TEXTS["candump -tz"]), 0.0
    text = HEADS.get(form, "")
    for t, i, d in frames:
        text, last = text + written(t - last if form == "candump -td" else t, i, d) + "\n", t
    path = tmp_path / "log.txt"  # the name tells nothing
    path.write_text(text)
    recording = read(path, "tractor-isobus")
    assert np.allclose(recording.time, cycles([t for t, _, _ in frames]), atol=1e-3)
    assert np.isfinite(recording["ground_speed"]).sum() == 200


def test_printed_frames_without_stamps_say_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text("".join(f"  can0  {i:08X}   [8]  {blanks(d)}\n" for _, i, d in drive(1000, 5.0).frames))
    with pytest.raises(InputError, match=r"line 1 .*: its frames have no stamps; record it by candump -l"):
        read(path, "tractor-isobus")


FOREIGN = {
    "asc": [
        "   1.5 1  18FEF1ZZx  Rx  d 8 00 11",
        "�%&",
        "   2.5 1  CFE48F0x  Rx  d 8 00 XX 22 33 44 55 66 77",
    ],
    "TRC 1.1": ["     7)      1500.0  Rx 0CFE48F0  8  00 XX 22 33 44 55 66 77", "garbage", "     8)  "],
    "TRC 2.1": ["      7   1500.000 DT 1 0CFE48F0 Rx - 8 00 XX 22 33", "garbage", "      8 x"],
}


@pytest.mark.parametrize("form", FOREIGN)
def test_bad_lines_are_left_out_and_the_first_is_named(tmp_path: Path, form: str) -> None:
    if form == "asc":
        lines = write_log(tmp_path / "log.asc", drive(1000, 40.0).frames).read_text().splitlines()
    else:
        lines = [TEXTS[form](t - START, i, d) for t, i, d in drive(1000, 40.0).frames]
        lines = [*HEADS[form].splitlines(), *lines]
    whole, damaged = tmp_path / "whole.txt", tmp_path / "damaged.txt"
    whole.write_text("\n".join(lines) + "\n")
    for place, bad in zip((60, 20, 40), FOREIGN[form], strict=True):
        lines.insert(place, bad)
    damaged.write_text("\n".join(lines) + "\n")
    table, expected = read_table(damaged), read_table(whole)
    assert len(table.columns["time"]) == len(expected.columns["time"]) > 250
    for name, column in expected.columns.items():
        np.testing.assert_array_equal(table.columns[name], column)
    assert any(note.startswith("3 lines have no frame, the first is line 21 (") for note in table.notes)
    unwanted = read_table(damaged, lambda name: name == "GroundBasedMachineSpeed")
    assert any("the first is line 21 (" in note for note in unwanted.notes)


BUSES = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Drive: 8 ECU
 SG_ speed : {at[0]}|16@{order}- (0.01,0) [0|0] "m/s" ECU
 SG_ torque : {at[1]}|16@{order}- (0.1,0) [0|0] "Nm" ECU
BO_ 257 Still: 8 ECU
 SG_ other : 0|16@1- (0.01,0) [0|0] "" ECU
"""
SENT = 2 + np.sin(np.arange(400) / 30)


def _sent(tmp_path: Path, *, order: int = 1, second_bus: bool = False, suffix: str = "blf") -> list[Path]:
    at = (0, 16) if order else (7, 23)
    (tmp_path / "machine.dbc").write_text(BUSES.format(at=at, order=order))
    with can.Logger(tmp_path / f"log.{suffix}") as log:
        for k, speed in enumerate(SENT):
            data = struct.pack("<hhxxxx", round(100 * speed), round(-300 * speed))
            for number, payload_ in enumerate((data, bytes(8))[: 1 + second_bus]):
                log.on_message_received(
                    can.Message(
                        timestamp=START + 0.02 * k + 0.001 * number,
                        arbitration_id=256,
                        is_extended_id=False,
                        data=payload_,
                        channel=number,
                    )
                )
    return [tmp_path / f"log.{suffix}", tmp_path / "machine.dbc"]


@pytest.mark.parametrize("suffix", ["blf", "asc", "log"])
def test_a_message_on_two_buses_is_two_signals(tmp_path: Path, suffix: str) -> None:
    """Two controllers of one type, each on a bus of its own, were one signal that jumped from one to the other, silently."""
    log, dbc = _sent(tmp_path, second_bus=True, suffix=suffix)
    read = read_log(log, databases=(str(dbc),))
    assert np.allclose(read.signals["speed"].values, SENT, atol=0.006)
    assert not read.signals["speed@bus1"].values.any()
    assert any("speed has several senders; that of bus 0 is used" in note for note in read.notes)


@pytest.mark.parametrize("suffix", ["blf", "asc", "log"])
def test_one_buss_signal_is_read_by_its_name(tmp_path: Path, suffix: str) -> None:
    """Of an ASC log nothing was."""
    log, dbc = _sent(tmp_path, second_bus=True, suffix=suffix)
    read = read_log(log, lambda name: name == "speed@bus1", (str(dbc),))
    assert len(read.signals["speed@bus1"].values) == len(SENT)


@pytest.mark.parametrize("suffix", ["blf", "asc", "log", "trc"])
def test_a_message_on_one_bus_has_no_second_name(tmp_path: Path, suffix: str) -> None:
    """Of an ASC log it was one of 'several senders', speed@bus-1 the other."""
    log, dbc = _sent(tmp_path, suffix=suffix)
    read = read_log(log, databases=(str(dbc),))
    assert set(read.names) == {"speed", "torque"}
    assert not read.notes


def test_a_dbc_in_the_wrong_byte_order_is_refused(tmp_path: Path) -> None:
    """All signals were noise over their whole range, proposed without a question mark."""
    log, dbc = _sent(tmp_path, order=0)
    with pytest.raises(
        InputError, match=r"by the DBC speed, torque leap .* would not in the other byte order"
    ):
        read_log(log, databases=(str(dbc),))


def test_what_leaps_in_either_byte_order_is_noise() -> None:
    noise = np.random.default_rng(0).integers(-30000, 30000, (400, 1)).astype("<i2").view(np.uint8)
    steps = np.repeat(np.arange(20, dtype="<i2"), 20)[:, None].view(np.uint8)
    for data in (noise, steps):
        assert not any(
            leaps(Field("x", at, 16, order, signed=True), data) for at, order in ((0, True), (7, False))
        )


@pytest.mark.parametrize("code", [0xFFFF, 0xFFFE, 0xFF00, 0x8000, 0x7FFF])
@pytest.mark.parametrize("little_endian", [True, False])
def test_a_code_for_not_available_is_no_wrong_byte_order(code: int, little_endian: bool) -> None:
    """Small values of a right DBC, and three payloads without one: the log was refused."""
    values = np.round(120 - 120 * np.cos(np.arange(1000) / 80)).astype(int)
    for at in (0, 250):  # where it is 0, and where it is 240
        sent = np.r_[values[:at], [code] * 3, values[at:]]
        data = sent.astype("<u2" if little_endian else ">u2")[:, None].view(np.uint8)
        for signed in (True, False):
            assert not leaps(Field("x", 0 if little_endian else 7, 16, little_endian, signed=signed), data)


@pytest.mark.parametrize("names", [("left", "right"), ("can0", "vcan0"), ("canB", "can0")])
@pytest.mark.parametrize("form", ["candump", "table"])
def test_two_buses_without_numbers_of_their_own_are_two(
    tmp_path: Path, names: tuple[str, str], form: str
) -> None:
    """`left` and `right` were one bus, and their controllers one signal that jumped; so were can0 and vcan0."""
    (tmp_path / "machine.dbc").write_text(BUSES.format(at=(0, 16), order=1))
    lines = ["time,bus,id,data"] if form == "table" else []
    for k, speed in enumerate(SENT):
        data = struct.pack("<hhxxxx", round(100 * speed), 0).hex()
        for bus, shown in zip(names, (data, bytes(8).hex()), strict=True):
            stamp = f"{START + 0.02 * k:.6f}"
            lines.append(f"{stamp},{bus},100,{shown}" if form == "table" else f"({stamp}) {bus} 100#{shown}")
    log = tmp_path / ("log.csv" if form == "table" else "log.log")
    log.write_text("\n".join(lines) + "\n")
    read = read_log(log, databases=(str(tmp_path / "machine.dbc"),))
    speeds = [read.signals[name].values for name in read.names if name.startswith("speed@")]
    assert sorted(float(values.max()) for values in speeds) == [0.0, pytest.approx(SENT.max(), abs=0.006)]
    assert any(f"{names[0]} is bus " in note for note in read.notes)


@pytest.mark.parametrize("form", ["candump", "table"])
def test_which_bus_speaks_first_changes_no_number(tmp_path: Path, form: str) -> None:
    """A profile made of a log whose left bus came first had left and right exchanged in one that began with the right one."""
    (tmp_path / "machine.dbc").write_text(BUSES.format(at=(0, 16), order=1))
    numbers = []
    for names in (("left", "right", "can1"), ("right", "can1", "left")):
        lines = ["time,bus,id,data"] if form == "table" else []
        for k, bus in enumerate(names * 30):
            stamp, data = f"{START + 0.01 * k:.6f}", struct.pack("<hhxxxx", 100 * len(bus), 0).hex()
            lines.append(f"{stamp},{bus},100,{data}" if form == "table" else f"({stamp}) {bus} 100#{data}")
        log = tmp_path / ("log.csv" if form == "table" else "log.log")
        log.write_text("\n".join(lines) + "\n")
        read = read_log(log, databases=(str(tmp_path / "machine.dbc"),))
        numbers.append({n: float(read.signals[n].values[0]) for n in read.names if "@" in n})
        assert "Buses: can1 is bus 1, left is bus 0, right is bus 2." in read.notes
    assert len(numbers[0]) >= 3
    assert numbers[0] == numbers[1]

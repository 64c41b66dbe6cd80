"""Estimates in the files of others, read back by readers that are not ours."""

from __future__ import annotations

import json
import sqlite3
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from drives import drive, robot
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.engine import EVENTS

START = 1_560_326_400.25  # 2019-06-12 08:00:00.25 UTC
NOTE = 'A note, "quoted" & <tagged>.'
TURN = "The rate of turn is that of the positions."


def log(*, clock: bool = True, places: bool = True) -> Any:
    """30 s at 50 Hz; a position every tenth row; a soil whose name needs quoting."""
    recording = drive(30.0, rate=50.0, imu=True).recording
    time = recording.time
    fixed = np.where(np.arange(len(time)) % 10 == 0, 1.0, np.nan)
    if places:
        recording = recording.with_channels(
            latitude=fixed * (51 + 1e-9 * time), longitude=fixed * (13 + 8.5e-6 * time)
        )
    soil = np.where(time < 15, "fine", 'wé"t, 50 %').astype(object)
    return replace(recording, labels={"soil": soil}, start=START if clock else None, notes=(NOTE,))


@pytest.fixture(scope="module")
def estimates() -> Estimates:
    found = estimate(log(), robot())
    # an event in a row of its own, so that something begins and ends
    codes = found.event_codes.copy()
    codes[1000:1010] = EVENTS.index("stuck")
    return replace(found, event_codes=codes)


@pytest.fixture
def written(estimates: Estimates, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Writes a suffix by the command, in blocks."""
    monkeypatch.setattr("terragrip.estimation.converting.ROWS", 350)
    estimates.write(tmp_path / "e.parquet")

    def write(suffix: str) -> Path:
        target = tmp_path / f"x{suffix}"
        assert main(["convert", str(tmp_path / "e.parquet"), "-o", str(target), "-q"]) == 0
        assert sorted(p.name for p in tmp_path.iterdir()) == ["e.parquet", target.name]
        return target

    return write


def test_export_is_the_same_command(written: Any, tmp_path: Path) -> None:
    converted = written(".csv").read_bytes()
    assert main(["export", str(tmp_path / "e.parquet"), "-o", str(tmp_path / "again.csv"), "-q"]) == 0
    assert (tmp_path / "again.csv").read_bytes() == converted


def same(found: Any, estimates: Estimates, rows: Any = slice(None), rtol: float = 0) -> None:
    """Columns read back are the estimates', digit by digit, or as near as ``rtol``."""
    for name in estimates:
        if name in found:
            mine = estimates[name][rows]
            if mine.dtype.kind == "f":
                np.testing.assert_allclose(
                    np.asarray(found[name], dtype=float), mine, rtol=rtol, err_msg=name
                )
            else:
                assert [x or "" for x in found[name]] == mine.tolist(), name


def test_parquet_says_what_its_columns_mean(estimates, tmp_path):

    estimates.write(tmp_path / "e.parquet")
    schema = pq.read_schema(tmp_path / "e.parquet")
    assert schema.field("wheel_speed_fl").metadata[b"unit"] == b"rad/s"
    assert schema.field("vertical_load_front").metadata[b"unit"] == b"N"
    assert b"wheel fl" in schema.field("slip_fl").metadata[b"description"]
    assert all(f.metadata[b"description"] for f in schema)
    about = json.loads(schema.metadata[b"terragrip"])
    assert about["recording"]["start"] == "2019-06-12T08:00:00.250000+00:00"
    assert about["notes"] == [NOTE, TURN]
    assert about["vehicle"]["mass"] == 139.0


def test_an_excel_workbook(written, estimates):
    from openpyxl import load_workbook

    book = load_workbook(written(".xlsx"), read_only=True)
    assert book.sheetnames == ["estimates", "columns", "about"]
    heads, *rows = book["estimates"].iter_rows(values_only=True)
    table = pd.DataFrame(rows, columns=heads)
    table[["event", "soil"]] = table[["event", "soil"]].fillna("")
    same(table, estimates, rtol=1e-15)  # a workbook holds 16 digits
    assert table["clock (UTC)"][0] == pd.Timestamp("2019-06-12 08:00:00.250")
    assert table["clock (UTC)"].iloc[-1] == pd.Timestamp("2019-06-12 08:00:30.230")
    meaning = {row[0]: row[1:] for row in book["columns"].iter_rows(values_only=True)}
    assert meaning["ground_speed_std"][0] == "m/s"
    said = list(book["about"].iter_rows(values_only=True))
    about = {row[0]: row[1] for row in said}
    assert about["start"] == "2019-06-12T08:00:00.250000+00:00"
    assert [row[1] for row in said if row[0] == "note"] == [NOTE, TURN]
    assert json.loads(about["vehicle"])["mass"] == 139.0


def test_a_matlab_file_is_plain_structs(written, estimates):
    from scipy.io import loadmat

    path = written(".mat")
    structs = ("estimates", "units", "descriptions", "texts", "about")
    assert top_level_of(path.read_bytes()) == dict.fromkeys(structs, 2)
    found = loadmat(path, simplify_cells=False)
    struct_ = found["estimates"][0, 0]
    assert struct_.dtype.names == estimates.names
    assert all(struct_[name].shape == (len(estimates), 1) for name in estimates)
    columns = {name: struct_[name][:, 0] for name in estimates}
    for name in ("event", "soil"):
        texts = [str(cell[0]) if len(cell) else "" for cell in found["texts"][0, 0][name][:, 0]]
        columns[name] = [texts[int(number) - 1] for number in columns[name]]
    same(columns, estimates)
    assert found["units"][0, 0]["wheel_speed_rr"][0] == "rad/s"
    assert found["about"][0, 0]["start"][0] == "2019-06-12T08:00:00.250000+00:00"
    assert found["about"][0, 0]["notes"][0, 0][0] == NOTE


def top_level_of(data: bytes) -> dict[str, int]:
    """Name and class of each variable of a MAT file of version 5 (MAT-File Format, MathWorks, 1-5): a struct is 2."""
    assert data[:10] == b"MATLAB 5.0"
    assert data[124:128] == b"\x00\x01IM"  # version 1.0, little endian
    found, place = {}, 128
    while place < len(data):
        kind, size = struct.unpack_from("<II", data, place)
        assert kind == 14  # miMATRIX
        flags = place + 16
        dimensions = flags + 8
        (length,) = struct.unpack_from("<I", data, dimensions + 4)
        name = dimensions + 8 + -(-length // 8) * 8
        _, length = struct.unpack_from("<HH", data, name)
        if length:  # a short name stands in its own tag
            text = data[name + 4 : name + 4 + length]
        else:
            _, length = struct.unpack_from("<II", data, name)
            text = data[name + 8 : name + 8 + length]
        found[text.decode()] = data[flags]
        place += 8 + size
    return found


def placed_rows(estimates: Estimates) -> Any:
    return np.flatnonzero(np.isfinite(estimates["latitude"]))


def test_geojson_as_gdal_and_json_read_it(written, estimates):
    geopandas = pytest.importorskip("geopandas", reason="needs terragrip[geo]")
    path, rows = written(".geojson"), placed_rows(estimates)
    frame = geopandas.read_file(path)
    assert len(frame) == len(rows) == 150
    np.testing.assert_array_equal(frame.geometry.y, estimates["latitude"][rows])
    np.testing.assert_array_equal(frame.geometry.x, estimates["longitude"][rows])
    same(frame, estimates, rows)
    plain = json.loads(path.read_text(encoding="utf-8"))
    assert plain["features"][0]["properties"]["clock"].startswith("2019-06-12T08:00:00.250")
    assert plain["columns"]["slip_fl"]["unit"] == "1"
    assert plain["about"]["notes"] == [NOTE, TURN]


def test_a_geopackage_as_sqlite_and_gdal_read_it(written, estimates):
    geopandas = pytest.importorskip("geopandas", reason="needs terragrip[geo]")
    path, rows = written(".gpkg"), placed_rows(estimates)
    frame = geopandas.read_file(path)
    assert frame.crs.to_epsg() == 4326
    same(frame, estimates, rows)
    assert frame["clock"][0] == pd.Timestamp("2019-06-12 08:00:00.250", tz="UTC")
    with sqlite3.connect(path) as base:
        (name, kind, srs) = base.execute("select table_name, data_type, srs_id from gpkg_contents").fetchone()
        assert (name, kind, srs) == ("estimates", "features", 4326)
        shapes = [row[0] for row in base.execute("select geom from estimates order by fid")]
        comments = dict(base.execute("select column_name, description from gpkg_data_columns").fetchall())
        (about,) = base.execute("select metadata from gpkg_metadata").fetchone()
    # GeoPackage binary: "GP", version, flags, srs; then the point as well-known binary behind the envelope
    points = np.array([struct.unpack("<dd", blob[-16:]) for blob in shapes])
    assert all(blob[:2] == b"GP" for blob in shapes)
    np.testing.assert_array_equal(points, np.c_[estimates["longitude"][rows], estimates["latitude"][rows]])
    assert comments["wheel_speed_fl"].endswith("[rad/s]")
    assert "139.0" in about
    base.close()


def test_mcap_opens_as_foxglove_wants_it(written, estimates):
    from mcap.reader import make_reader

    path = written(".mcap")
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        messages = [(s, c.topic, m) for s, c, m in reader.iter_messages(log_time_order=False)]
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    by_topic: dict[str, list[Any]] = {}
    for schema, topic, message in messages:
        assert schema.encoding == "jsonschema"
        data = json.loads(message.data)
        obeys(data, json.loads(schema.data))
        by_topic.setdefault(topic, []).append((schema.name, message.log_time, data))
    rows = by_topic["/terragrip/estimate"]
    assert {name for name, _, _ in rows} == {"terragrip.TractionEstimate"}
    same({n: [np.nan if d[n] is None else d[n] for _, _, d in rows] for n in estimates}, estimates)
    stamps = [when for _, when, _ in rows]
    np.testing.assert_allclose(np.array(stamps) / 1e9, START + estimates.time, rtol=0, atol=1e-6)
    fixes = by_topic["/terragrip/position"]
    assert len(fixes) == 150
    name, when, fix = fixes[7]
    assert name == "foxglove.LocationFix"
    assert fix["timestamp"]["sec"] * 10**9 + fix["timestamp"]["nsec"] == when
    assert (fix["latitude"], fix["longitude"]) == (estimates["latitude"][70], estimates["longitude"][70])
    said = [(name, data["message"], data["level"]) for name, _, data in by_topic["/terragrip/event"]]
    assert said == [("foxglove.Log", "stuck begins", 3), ("foxglove.Log", "stuck ends", 2)]
    assert metadata["terragrip"]["notes"] == f"{NOTE}\n{TURN}"


@pytest.mark.parametrize(("last", "is_one"), [(9.2e9, True), (9.3e9, False), (-1.0, False)])
def test_a_stamp_of_an_mcap_is_of_64_bits(estimates, tmp_path, capsys, last, is_one):
    late = replace(estimates, time=estimates.time + (last - START - estimates.time[-1]))
    late.write(tmp_path / "e.parquet")
    code = main(["convert", str(tmp_path / "e.parquet"), "-o", str(tmp_path / "x.mcap"), "-q"])
    assert code == (0 if is_one else 2)
    assert ("cannot be the stamp of a message" in capsys.readouterr().err) is not is_one


def obeys(data: Any, schema: Any) -> None:
    """The part of JSON schema that these schemas use."""
    kinds = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float)}
    wanted = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    assert any(data is None if kind == "null" else isinstance(data, kinds[kind]) for kind in wanted), schema
    if isinstance(data, dict):
        assert set(data) <= set(schema["properties"])
        for name, value in data.items():
            obeys(value, schema["properties"][name])
    if isinstance(data, list):
        assert schema["minItems"] <= len(data) <= schema["maxItems"]
    if isinstance(data, int):
        assert schema.get("minimum", data) <= data <= schema.get("maximum", data)


def test_foxglove_schemas_have_the_fields_of_foxgloves_own():
    """Against the descriptors that Foxglove's SDK carries."""
    messages = pytest.importorskip("foxglove.messages", reason="needs terragrip[live]")
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    from terragrip.estimation.export.foxglove import LOCATION_FIX, LOG

    for mine, theirs in ((LOCATION_FIX, messages.LocationFix), (LOG, messages.Log)):
        published = theirs.get_schema()
        assert published.name == mine["title"]
        files = FileDescriptorSet.FromString(published.data)
        short = published.name.split(".")[1]
        (fields,) = [
            {f.name for f in m.field} for file in files.file for m in file.message_type if m.name == short
        ]
        assert set(mine["properties"]) <= fields, fields


def test_pandas_has_clock_units_and_notes(estimates):
    table = estimates.to_pandas()
    assert table.index[0] == pd.Timestamp("2019-06-12 08:00:00.250", tz="UTC")
    assert table.index.name == "clock"
    assert table.loc["2019-06-12 08:00:20":"2019-06-12 08:00:21", "time"].between(19.7, 21.8).all()
    assert table.attrs["units"]["wheel_speed_fl"] == "rad/s"
    assert table.attrs["notes"] == [NOTE, TURN]
    assert table.attrs["vehicle"]["mass"] == 139.0
    plain = estimate(log(clock=False), robot()).to_pandas()
    assert isinstance(plain.index, pd.RangeIndex)


def test_without_a_clock_messages_count_from_the_logs_own_zero(tmp_path):
    from mcap.reader import make_reader

    estimate(log(clock=False), robot()).write(tmp_path / "x.mcap")
    with (tmp_path / "x.mcap").open("rb") as stream:
        first = next(iter(make_reader(stream).iter_messages(topics="/terragrip/estimate")))[2]
    assert first.log_time == 0


def test_no_place_is_refused_before_the_work(tmp_path, capsys, monkeypatch):
    log(places=False).to_pandas().to_csv(tmp_path / "log.csv", index=False)
    robot().save(tmp_path / "v.yaml")

    def worked(*_: Any, **__: Any) -> Any:
        raise AssertionError("rows were estimated")

    monkeypatch.setattr("terragrip.estimation.batch.run", worked)
    for suffix in (".gpkg", ".geojson"):
        words = ["estimate", str(tmp_path / "log.csv"), "--vehicle", str(tmp_path / "v.yaml"), "-o"]
        assert main([*words, str(tmp_path / f"x{suffix}")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"x{suffix}" in line
        assert "latitude" in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "v.yaml"]


@pytest.mark.parametrize(("suffix", "limit"), [(".xlsx", "SHEET_ROWS"), (".mat", "_STRUCT_BYTES")])
def test_more_rows_than_a_file_takes_are_refused_before_the_work(
    estimates, tmp_path, capsys, monkeypatch, suffix, limit
):
    monkeypatch.setattr(f"terragrip.estimation.export.{limit}", 1000 if "ROWS" in limit else 100_000)
    estimates.write(tmp_path / "e.parquet")
    monkeypatch.setattr("terragrip.estimation.converting.write_parts", None)  # none is written
    assert main(["convert", str(tmp_path / "e.parquet"), "-o", str(tmp_path / f"x{suffix}")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "1500 rows are more than " in line
    assert ".parquet" in line
    assert [p.name for p in tmp_path.iterdir()] == ["e.parquet"]


def test_excels_own_limit():
    from terragrip.estimation.export import require_room

    require_room("x.xlsx", 1_048_575, ["time"])
    with pytest.raises(InputError, match=r"1048576 rows are more than an Excel sheet can hold \(1048575\)"):
        require_room("x.xlsx", 1_048_576, ["time"])


def test_a_missing_package_is_named_with_its_extra(estimates, tmp_path, monkeypatch):
    monkeypatch.setattr("terragrip.estimation.export.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pyogrio.*terragrip\[geo\]"):
        estimates.write(tmp_path / "x.gpkg")
    assert not list(tmp_path.iterdir())


def test_what_is_no_estimates_is_not_converted(tmp_path, capsys):
    pd.DataFrame({"time": [0.0]}).to_parquet(tmp_path / "log.parquet")
    assert main(["convert", str(tmp_path / "log.parquet"), "-o", str(tmp_path / "x.csv")]) == 2
    assert "not a table of estimates" in capsys.readouterr().err
    assert main(["convert", str(tmp_path / "log.parquet"), "-o", str(tmp_path / "x.doc")]) == 2
    assert "x.doc: --output: is not named .parquet or" in capsys.readouterr().err


def test_a_write_that_fails_leaves_nothing(estimates, tmp_path):
    latest = 2**63 / 1e9 - START + 0.01  # a stamp's nanoseconds are 64 bits with a sign
    for shift, wrong in (
        (latest - estimates.time[-1], r"7\.66305e\+09"),  # the last row alone
        (-START - 0.01, r"-1\.56033e\+09"),  # the first alone is before 1970
    ):
        shifted = replace(estimates, time=estimates.time + shift)
        with pytest.raises(InputError, match=rf"x\.mcap: a time of {wrong} s .*stamp"):
            shifted.write(tmp_path / "x.mcap")
    nowhere = replace(estimates, columns={**estimates.columns, "latitude": np.full(len(estimates), np.nan)})
    for suffix in (".gpkg", ".geojson"):
        with pytest.raises(InputError, match=f"x{suffix}.*no row has a position"):
            nowhere.write(tmp_path / f"x{suffix}")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_while_parquet_is_written_is_no_full_disk(estimates, tmp_path, monkeypatch):
    """Arrow's complaint of a half-written row group came in place of Ctrl-C: 'cannot be written (Column 16 had ...); free space'."""

    def stop(*_):
        raise KeyboardInterrupt

    def complain(self):
        raise OSError("Column 16 had 1048576 while previous column had 240000")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", stop)
    monkeypatch.setattr(pq.ParquetWriter, "close", complain)
    with pytest.raises(KeyboardInterrupt):
        estimates.write(tmp_path / "x.parquet")
    assert not list(tmp_path.iterdir())


def test_a_sheet_that_finds_no_room_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sheets' rows stayed beside it on a full disk, three files of `tmp...`."""
    from terragrip.estimation.export.spreadsheet import Spreadsheet

    def full(self: Spreadsheet) -> None:
        raise OSError(28, "No space left on device")

    estimates = estimate(log(), robot())
    monkeypatch.setattr(Spreadsheet, "close", full)
    with pytest.raises(InputError, match="No space left on device"):
        estimates.write(tmp_path / "e.xlsx")
    assert list(tmp_path.iterdir()) == []

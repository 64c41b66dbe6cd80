"""Text tables in all their dialects give the same recording; what is none is refused with row and hint."""

from __future__ import annotations

import gzip
import hashlib
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read, read_table
from terragrip.recording import Recording


def as_text(log: pd.DataFrame, separator: str = ",", decimal: str = ".") -> str:
    return log.to_csv(index=False, sep=separator, decimal=decimal)


def same(recording: Recording, log: pd.DataFrame) -> None:
    for name in log.columns:
        if name == "soil":
            assert list(recording["soil"]) == list(log["soil"])
        else:
            np.testing.assert_allclose(recording[name], log[name], rtol=1e-12)


def put(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def in_levels(log: pd.DataFrame) -> pd.DataFrame:
    """The log with columns of two levels, ``wheel_speed`` above each wheel, and time as the index."""
    pairs = [tuple(name.rsplit("_", 1)) if name[-2:] in ("_l", "_r") else (name, "") for name in log.columns]
    return log.set_axis(pd.MultiIndex.from_tuples(pairs), axis=1)


DIALECTS: dict[str, Callable[[pd.DataFrame], bytes]] = {
    "comma": lambda log: as_text(log).encode(),
    "semicolon": lambda log: as_text(log, ";").encode(),
    "semicolon, decimal comma": lambda log: as_text(log, ";", ",").encode(),
    "tab, decimal comma": lambda log: as_text(log, "\t", ",").encode(),
    "bar": lambda log: as_text(log, "|").encode(),
    "blanks": lambda log: log.to_string(index=False).encode(),
    "quoted decimal comma": lambda log: as_text(log, ",", ",").encode(),
    "gzip": lambda log: gzip.compress(as_text(log).encode()),
    "byte order mark": lambda log: b"\xef\xbb\xbf" + as_text(log).encode(),
    "UTF-16": lambda log: as_text(log, "\t").encode("utf-16"),
    "UTF-16 without mark": lambda log: as_text(log).encode("utf-16-le"),
    "latin-1": lambda log: as_text(log.assign(Höhe=1)).encode("latin-1"),
    "Windows line ends": lambda log: as_text(log).replace("\n", "\r\n").encode(),
    "old Mac line ends": lambda log: as_text(log).replace("\n", "\r").encode(),
    "pandas' columns of two levels": lambda log: in_levels(log).to_csv(index=False).encode(),
    "pandas' columns of two levels and index": lambda log: in_levels(log).set_index("time").to_csv().encode(),
    "pandas' time spans": lambda log: as_text(log.assign(time=pd.to_timedelta(log["time"], unit="s"))).encode(),
    "comments first": lambda log: b"# logger 3\n# run 7, 2021\n\n" + as_text(log).encode(),
    "Excel hint": lambda log: b"sep=;\n" + as_text(log, ";").encode(),
    "blank trailing column": lambda log: as_text(log).replace("\n", ",\n").encode(),
    "trailing separator in rows only": lambda log: as_text(log).replace("\n", ",\n").replace(",\n", "\n", 1).encode(),
    "blanks after commas": lambda log: as_text(log).replace(",", ", ").encode(),
    "quoted header": lambda log: as_text(log).replace(as_text(log).split("\n")[0], ",".join(f'"{c}"' for c in log)).encode(),
    "blank lines": lambda log: as_text(log).replace("\n", "\n\n").encode(),
    "units row": lambda log: as_text(log).replace("\n", "\ns,m/s,rad/s,rad/s,N m,N m,N,\n", 1).encode(),
    "units row in brackets": lambda log: as_text(log).replace("\n", "\n[s],[m/s],[rad/s],[rad/s],[Nm],[Nm],[N],-\n", 1).encode(),
    "no line end at the end": lambda log: as_text(log).rstrip("\n").encode(),
}  # fmt: skip


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_reads_alike(tmp_path: Path, log: pd.DataFrame, dialect: str) -> None:
    content = DIALECTS[dialect](log)
    recording = read(put(tmp_path, content))
    same(recording, log)
    assert recording.sha256 == hashlib.sha256(content).hexdigest()
    assert recording.source == str(tmp_path / "log.csv")


def test_missing_cells_of_any_spelling_are_nan(tmp_path: Path) -> None:
    spellings = ["", "NaN", "nan", "NA", "n/a", "null", "None", "-", "1.#QNAN"]
    rows = "\n".join(f"{k},{cell},1" for k, cell in enumerate(spellings))
    recording = read(put(tmp_path, f"time,ground_speed,wheel_speed_l\n{rows}\n90,2.5,1\n"))
    assert np.isnan(recording["ground_speed"][:-1]).all()
    assert recording["ground_speed"][-1] == 2.5


@pytest.mark.parametrize(
    "header",
    [
        "time [s],ground_speed [km/h],wheel_speed_l [rpm],drawbar_force [kN]",
        "time (ms),ground_speed (km/h),wheel_speed_l (rpm),drawbar_force (kN)",
        "time,ground_speed,wheel_speed_l,drawbar_force\ns,km/h,rpm,kN",
    ],
)
def test_units_that_the_file_states_are_converted(tmp_path: Path, header: str) -> None:
    stamp = 2000 if "(ms)" in header else 2
    recording = read(put(tmp_path, f"{header}\n0,3.6,60,1.5\n{stamp},7.2,30,2\n"))
    np.testing.assert_allclose(recording.time, [0, 2])
    np.testing.assert_allclose(recording["ground_speed"], [1, 2])
    np.testing.assert_allclose(recording["wheel_speed_l"], [2 * np.pi, np.pi])
    np.testing.assert_allclose(recording["drawbar_force"], [1500, 2000])


@pytest.mark.parametrize(
    "header",
    ["time [s],v [km/h],w[0],w[1]", "time [s],v [km/h],w(1),w(2)", "time [s],v [km/h],w (L),w (R)"],
)
def test_an_index_or_a_letter_of_a_side_is_no_unit(tmp_path: Path, header: str) -> None:
    """'1' is a unit and 'L' is litres, but not beside 'w[0]' and 'w (R)'."""
    table = read_table(put(tmp_path, f"{header}\n0,3.6,60,1.5\n2,7.2,30,2\n"))
    assert table.units == {"time": "s", "v": "km/h"}
    assert list(table.columns)[2:] == header.split(",")[2:]


def test_dates_in_the_time_column(tmp_path: Path) -> None:
    rows = "".join(f"2021-05-04 10:00:0{k}.5,1,2\n" for k in range(3))
    recording = read(put(tmp_path, "time,ground_speed,wheel_speed_l\n" + rows))
    np.testing.assert_allclose(recording.time, [0, 1, 2])


def test_a_last_row_that_was_cut_off_is_left_out(tmp_path: Path, log: pd.DataFrame) -> None:
    text = as_text(log)
    recording = read(put(tmp_path, text[: text.rindex("\n", 0, -1) + 12]))
    same(recording, log.iloc[:-1])
    assert any("cut off" in note for note in recording.notes)


def test_a_last_row_that_was_cut_off_leaves_dates_as_they_are(tmp_path: Path) -> None:
    rows = "".join(f"11.05.2026 08:12:0{k},0;{k},5;5\n" for k in range(4))
    whole = read(str(put(tmp_path, "time;ground_speed;wheel_speed_l\n" + rows)))
    cut = read(str(put(tmp_path, "time;ground_speed;wheel_speed_l\n" + rows + "11.05.2026 08:1", "cut.csv")))
    np.testing.assert_array_equal(cut.time, [0.0, 1.0, 2.0, 3.0])
    assert cut.start == whole.start
    assert any("cut off" in note for note in cut.notes)


MIXED = {
    "a sheet's error": (["1,136", "#DIV/0!"], "column v, row 11 .*'#DIV/0!' is not a number"),
    "a point among commas": (
        ["1,136", "1.2"],
        "column v, row 11 .*'1.2' has a decimal point, other rows a comma",
    ),
    "a comma among points": (
        ["1.13", "0,2"],
        "column v, row 11 .*'0,2' has a decimal comma, other rows a point",
    ),
}


@pytest.mark.parametrize("kind", MIXED)
def test_the_cell_is_named_that_differs_from_the_others(tmp_path: Path, kind: str) -> None:
    (usual, odd), message = MIXED[kind]
    other = "2,5" if "," in usual else "2.5"
    rows = [f"{k};{odd if k == 10 else usual};{other}" for k in range(20)]
    path = put(tmp_path, "\n".join(["t;v;w", *rows, ""]))
    profile = put(tmp_path, "time: {from: t}\nchannels: {ground_speed: v, wheel_speed_l: w}", "p.yaml")
    with pytest.raises(InputError, match=message):
        read(str(path), str(profile))


def test_a_row_of_means_below_the_dates_is_named(tmp_path: Path) -> None:
    rows = [f"11.05.2026 08:12:0{k},0;1,5;5" for k in range(4)]
    path = put(tmp_path, "\n".join(["Zeit;v;w", *rows, "Mittelwert;1,5;5", ""]))
    profile = put(tmp_path, "time: {from: Zeit}\nchannels: {ground_speed: v, wheel_speed_l: w}", "p.yaml")
    with pytest.raises(InputError, match="column Zeit, row 5: 'Mittelwert' is not a time"):
        read(str(path), str(profile))


def test_a_header_with_blanks_and_no_rows_is_an_empty_table(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the table is empty"):
        read(str(put(tmp_path, "time [s];ground_speed [m/s];wheel_speed_l [1/min]\n")))


def test_a_number_in_the_first_row_of_a_text_column_is_no_units_row(tmp_path: Path) -> None:
    table = read_table(put(tmp_path, "time,state\n0,s\n1,m\n"))
    assert list(table.columns["state"]) == ["s", "m"]


HEAD = "time,ground_speed,wheel_speed_l\n"
GOOD_ROWS = "0,1,5\n1,1,5\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty; give a table"),
        ("\n  \n", "is empty; give a table"),
        (HEAD, "the table is empty; give a log with at least one row"),
        ("# only\n# comments\n", "is empty"),
        ("0,1,5\n1,1,5\n", "the first row has numbers, not column names; put a header row"),
        (HEAD + GOOD_ROWS + "2,fast,5\n", "column ground_speed, row 3: 'fast' is not a number; leave the cell empty"),
        (HEAD + GOOD_ROWS + "zwei,1,5\n", "column time, row 3: 'zwei' is not a number; give seconds, 10:00:00.5 or"),
        (HEAD + "05:03.2,1,5\n05:03.4,1,5\n", "column time, row 1: '05:03.2' is not a number; give seconds, 10:00:00.5 or"),
        (HEAD + GOOD_ROWS + "2,1\n3,1,5\n", "row 3: has 2 cells, the header 3; give every row the same number of cells"),
        (HEAD + GOOD_ROWS + "2,1,5,6,7\n", "row 3: has 5 cells, the header 3"),
        (HEAD + GOOD_ROWS + "2,inf,5\n", "column ground_speed, row 3 (time 2 s): is infinite"),
        (HEAD + GOOD_ROWS + "1,2,5\n", "column time, row 3 (time 1 s): time repeats"),
        (HEAD + GOOD_ROWS + ",1,5\n", "column time, row 3: time is not a finite number"),
        ("time,groundspeed,wheel_speed_l\n" + GOOD_ROWS, "column ground_speed: is missing; the nearest column is 'groundspeed'"),
        ("t;v;w\n0;1;5\n", "column time: is missing; map the log's columns in a profile"),
        ("time,ground_speed,wheel_speed_l,ground_speed\n0,1,5,1\n", "column ground_speed: occurs twice"),
        ("time,ground_speed [N],wheel_speed_l\n0,1,5\n", "column ground_speed: 'N' measures a force, where a speed is"),
        (b"PK\x03\x04 rest", "is a zip, an Excel workbook or NumPy's npz; save the sheet as CSV"),
        (b"\x89HDF\r\n\x1a\n", "is a damaged MATLAB file, or none"),
        (b"\x28\xb5\x2f\xfd\x04", "is packed by zstd; unpack it first: zstd -d FILE"),
        (b"\xfd7zXZ\x00", "is packed by xz; unpack it first: xz -d FILE"),
        (b"\x00\x01\x02\x03binary", "is not a table of text; give a CSV or Parquet file"),
        (b"\x1f\x8b\x08\x00broken", "is a damaged gzip file"),
        (gzip.compress(HEAD.encode(), mtime=0)[:-6], "is a damaged gzip file"),
        (b"PAR1" + b"x" * 30, "is a damaged Parquet file, or none"),
    ],
)  # fmt: skip
def test_refusal(tmp_path: Path, content: str | bytes, message: str) -> None:
    path = put(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert caught.value.hint
    assert "\n" not in str(caught.value)


def test_text_in_a_large_table_names_its_row(tmp_path: Path) -> None:
    rows = [f"{k},1,5" for k in range(60_000)]
    rows[54_321] = "54321,1,much"
    with pytest.raises(InputError, match="column wheel_speed_l, row 54322: 'much' is not a number"):
        read(put(tmp_path, HEAD + "\n".join(rows) + "\n"))


def test_no_such_file(tmp_path: Path) -> None:
    put(tmp_path, HEAD + GOOD_ROWS, "field_run_3.csv")
    with pytest.raises(InputError, match=r"field_run3\.csv: no such file; did you mean field_run_3\.csv\?"):
        read(tmp_path / "field_run3.csv")
    with pytest.raises(InputError, match=r"is a folder; name a file in it, such as field_run_3\.csv"):
        read(tmp_path)
    with pytest.raises(InputError, match="no such file; there is no folder"):
        read(tmp_path / "nowhere" / "log.csv")


_cell = st.sampled_from(
    [
        "",
        "1",
        "2.5",
        "-3e5",
        "1,5",
        "nan",
        "inf",
        "x",
        '"',
        "'",
        "é",
        "#",
        " ",
        "2021-01-01",
        "1;2",
        "0x10",
        "\x00",
        "\r",
    ]
)
_row = st.lists(_cell, max_size=5)
_text = st.builds(
    lambda rows, separator, end: end.join(separator.join(row) for row in rows),
    st.lists(_row, max_size=6),
    st.sampled_from([",", ";", "\t", " ", "|", ""]),
    st.sampled_from(["\n", "\r\n", "\r"]),
)
_headed = st.builds(
    lambda rows: "time,ground_speed,wheel_speed_a,soil\n" + "\n".join(",".join(row) for row in rows),
    st.lists(st.lists(_cell, min_size=3, max_size=5), max_size=6),
)
_content = st.binary(max_size=80) | (_text | _headed).flatmap(
    lambda text: st.sampled_from(["utf-8", "utf-16", "latin-1", "utf-16-le"]).map(
        lambda e: text.encode(e, "ignore")
    )
)


@settings(max_examples=500)
@given(_content, st.booleans())
def test_any_bytes_are_a_recording_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, packed: bool
) -> None:
    path = tmp_path_factory.mktemp("bytes") / "log.csv"
    path.write_bytes(gzip.compress(content) if packed else content)
    try:
        recording = read(path)
    except InputError as refusal:
        message = str(refusal)
    else:
        assert np.all(np.diff(recording.time) > 0)
        return
    assert "\n" not in message
    assert str(path) in message


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_reading_leaves_pandas_asleep(tmp_path: Path, log: pd.DataFrame, suffix: str) -> None:
    """A command line that reads a minute of log must not wait for pandas."""
    path = tmp_path / f"log.{suffix}"
    log.to_csv(path, index=False) if suffix == "csv" else log.to_parquet(path)
    code = (
        f"import sys; from terragrip.formats import read; read({str(path)!r});"
        "sys.exit(bool({'pandas', 'polars', 'pint', 'scipy'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


ROWS = 200


@pytest.mark.parametrize(
    "before", ["Logger: X200\nSerial: 12\n\n", "% by hand\n", "// export\n# 3 Hz\n", "Kunde;Müller;\n"]
)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_lines_before_the_header_are_passed_over(tmp_path: Path, before: str, separator: str) -> None:
    names = ("time", "ground_speed", "wheel_speed_l", "drive_torque_l", "drawbar_force", "soil")
    text = before + separator.join(names) + "\n"
    for k in range(ROWS):
        cells = [f"{k / 10:.1f}", *(f"{k + j}.5" for j in range(4)), "clay"]
        text += separator.join(cells).replace(".", "," if separator == ";" else ".") + "\n"
    path = tmp_path / "log.csv"
    path.write_text(text)
    table = read_table(path)
    assert table.names == names
    assert np.array_equal(table.columns["drawbar_force"], np.arange(ROWS) + 3.5)


def test_a_header_that_lacks_a_name_is_no_line_before_it(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,ground_speed,wheel_speed_l\n" + "0.1,a,c,d\n" * 20)
    with pytest.raises(InputError, match="row 1: has 4 cells, the header 3"):
        read_table(path)


@pytest.mark.parametrize(
    ("form", "is_date"),
    [
        ("%H:%M:%S.%f", False),
        ("%H:%M:%S:%f", False),
        ("%d.%m.%Y %H:%M:%S,%f", True),
        ("%Y/%m/%d %H:%M:%S.%f", True),
        ("%Y-%m-%d %H:%M:%S,%f", True),
    ],
)
@pytest.mark.parametrize("name", ["time", "Zeit"])
def test_times_and_dates_as_loggers_write_them(tmp_path: Path, form: str, is_date: bool, name: str) -> None:
    start = datetime(2026, 5, 1, 23, 59, 55, tzinfo=UTC)  # past midnight
    stamps = [start + timedelta(milliseconds=100 * k) for k in range(ROWS)]
    path = tmp_path / "log.csv"
    rows = (f"{t.strftime(form)};{k},5;3,0\n" for k, t in enumerate(stamps))
    path.write_text(f"{name};ground_speed;wheel_speed_l\n" + "".join(rows))
    table = read_table(path)
    assert (table.columns[name].dtype.kind == "M") is is_date
    channels = {"ground_speed": "ground_speed", "wheel_speed_l": "wheel_speed_l"}
    profile = Profile.from_dict({"time": {"from": name, "zero": "first"}, "channels": channels})
    assert np.allclose(read(path, profile).time, np.arange(ROWS) / 10, atol=1e-6)
    if name == "time" and is_date:
        assert np.allclose(read(path).time, np.arange(ROWS) / 10, atol=1e-6)
        assert inspect(path).time is not None


def dated(path: Path, name: str, *days: str) -> Path:
    rows = "".join(f"{day} 10:00:{k:02d}.5,{k},3\n" for k, day in enumerate(days))
    path.write_text(f"{name},ground_speed,wheel_speed_l\n{rows}")
    return path


CHANNELS = {"ground_speed": "ground_speed", "wheel_speed_l": "wheel_speed_l"}


@pytest.mark.parametrize("name", ["time", "Date"])
@pytest.mark.parametrize(
    ("days", "hours"), [(("12/04/2024", "13/04/2024"), 24), (("04-13-2024", "04-12-2024"), -24)]
)
def test_a_number_above_12_shows_the_day(
    tmp_path: Path, name: str, days: tuple[str, str], hours: int
) -> None:
    columns = read_table(dated(tmp_path / "log.csv", name, *days)).columns
    assert np.diff(columns[name]) / np.timedelta64(1, "s") == [3600 * hours + 1]


@pytest.mark.parametrize("name", ["time", "Date"])
def test_dates_that_do_not_show_the_day_are_refused_until_the_profile_says_it(
    tmp_path: Path, name: str
) -> None:
    log = dated(tmp_path / "log.csv", name, "03/04/2024", "04/04/2024")
    said = (
        f"{log}: column {name}, row 1: '03/04/2024 10:00:00.5' may be the 3. of month 4 or the 4. of month 3"
    )
    for dates, expected in ((None, None), ("dd/mm/yyyy", 86_401.0), ("mm/dd/yyyy", 31 * 86_400 + 1.0)):
        time = {"from": name, "zero": "first"} | ({} if dates is None else {"dates": dates})
        profile = Profile.from_dict({"time": time, "channels": CHANNELS})
        if expected is None:
            with pytest.raises(InputError) as caught:
                read(log, profile)
            assert str(caught.value).startswith(said)
            assert "'dates: dd/mm/yyyy' (or mm/dd/yyyy) for time" in str(caught.value)
        else:
            recording = read(log, profile)
            assert recording.time[1] == pytest.approx(expected)
            month = 4 if dates == "dd/mm/yyyy" else 3
            assert datetime.fromtimestamp(recording.clock_zero, UTC).month == month
    inspection = inspect(log)
    assert any("may be the 3. of month 4" in note for note in inspection.warnings)
    assert f"time: {{from: {name}, dates: dd/mm/yyyy, zero: first}}   # ? " in inspection.profile
    if name == "time":
        with pytest.raises(InputError, match=r"may be the 3\. of month 4"):
            read(log)


def test_the_order_of_dates_that_do_not_show_it_is_proposed_by_what_is_likelier(tmp_path: Path) -> None:
    """'No time column was found', of a day that an American logger wrote."""
    half = "".join(f"11/03/2024 01:58:{k:02d} PM,1,5\n" for k in range(20))
    days = "".join(f"11/{day:02d}/2024 23:59:{k:02d},1,5\n" for day in (3, 4) for k in range(40, 60))
    for rows in (half, days):
        log = put(tmp_path, f"Timestamp,ground_speed,wheel_speed_l\n{rows}")
        inspection = inspect(log)
        assert "time: {from: Timestamp, dates: mm/dd/yyyy, zero: first}   # ? " in inspection.profile
        (tmp_path / "p.yaml").write_text(inspection.profile)
        assert read(log, tmp_path / "p.yaml").time[1] == 1


def test_dates_in_two_orders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="and other dates have day and month in different order"):
        read(dated(tmp_path / "log.csv", "time", "13/04/2024", "04/14/2024"))


@pytest.mark.parametrize(
    "row",
    [
        "03-Nov-2024 13:58:{:06.3f}",
        "03-NOV-2024 01:58:{:06.3f} PM",
        "2024-11-03 13:58:{:06.3f} UTC",
        "{:.2f} sec",
    ],
)
def test_times_as_matlab_and_databases_write_them(tmp_path: Path, row: str) -> None:
    """'is not a number', of what MATLAB's writetable and writetimetable write by themselves."""
    rows = "".join(f"{row.format(0.05 * k)},1,5\n" for k in range(40))
    recording = read(put(tmp_path, f"time,ground_speed,wheel_speed_l\n{rows}"))
    np.testing.assert_allclose(recording.time, 0.05 * np.arange(40), atol=1e-9)
    if "2024" in row:
        assert recording.start == datetime(2024, 11, 3, 13, 58, tzinfo=UTC).timestamp()


def test_dates_in_digits_are_no_milliseconds(tmp_path: Path) -> None:
    """'since 1970 in ms?' was advised, by which rows a second apart were a thousandth apart."""
    rows = "".join(f"202411031358{k:02d},1,5\n" for k in range(40))
    log = put(tmp_path, f"time,ground_speed,wheel_speed_l\n{rows}")
    inspection = inspect(log)
    assert any(
        "time: is 20241103135800, a date and a time of day in digits" in w for w in inspection.warnings
    )
    (tmp_path / "p.yaml").write_text(inspection.profile)
    for profile in (None, tmp_path / "p.yaml"):  # 59 would be followed by 100
        with pytest.raises(InputError, match="time of day in digits; give seconds"):
            read(log, profile)


def test_half_days(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,ground_speed,wheel_speed_l\n11:59:59 AM,1,5\n12:00:00 PM,1,5\n01:00:00 PM,1,5\n")
    assert np.array_equal(read(path).time, [43_199, 43_200, 46_800])


def test_texts_that_are_no_times_stay_texts(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,remark,day\n0,12:00:00,31.02.2026 10:00:00\n1,later,01.13.2026 10:00:00\n")
    columns = read_table(path).columns
    assert columns["remark"].tolist() == ["12:00:00", "later"]
    assert columns["day"].dtype == object


THOUSANDS = {
    "a comma, quoted": ('"1,234"', ",", "0.5", "'1,234' may be 1234 or 1.234"),
    "a comma": ("1,234", ";", "0.5", "'1,234' may be 1234 or 1.234"),
    "a point": ("-1.234", ";", "0,5", "'-1.234' may be -1234 or -1.234"),
    "a comma and a fraction": ('"1,234.5"', ",", "0.5", "'1,234.5' is not a number"),
    "an apostrophe": ("1'234", ",", "0.5", '"1\'234" is not a number'),
}


@pytest.mark.parametrize("written", THOUSANDS)
def test_thousands_are_no_fractions(tmp_path: Path, written: str) -> None:
    """1,234 N m must not become 1.234 N m: the row is named, with what to write."""
    high, separator, speed, problem = THOUSANDS[written]
    log = tmp_path / "log.csv"
    names = ("time", "ground_speed", "wheel_speed_l", "wheel_speed_r", "drawbar_force")
    rows = [[str(k), speed, speed, speed, "970" if k % 2 else high] for k in range(20)]
    log.write_text("\n".join(separator.join(row) for row in (names, *rows)) + "\n")
    with pytest.raises(InputError) as caught:
        read(log)
    assert f"column drawbar_force, row 1: {problem}" in str(caught.value)
    assert "write numbers without a thousands separator" in str(caught.value)
    foreign = {name: f"x_{name}" for name in names[1:]}
    log.write_text("\n".join(separator.join(row) for row in (("time", *foreign.values()), *rows)) + "\n")
    with pytest.raises(InputError, match="row 1"):
        read(log, Profile.from_dict({"channels": foreign}))


def test_three_decimals_behind_a_comma_are_a_fraction(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = "".join(f"{k};1,2{k:02d};12,3{k:02d};12,4{k:02d}\n" for k in range(20))
    log.write_text("time;ground_speed;wheel_speed_l;wheel_speed_r\n" + rows)
    assert read(log).channels["ground_speed"][3] == pytest.approx(1.203)


def test_a_cell_of_blanks_is_empty(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = "".join(f"{k},{'   ' if k == 4 else 1.5},2,2\n" for k in range(20))
    log.write_text("time,ground_speed,wheel_speed_l,wheel_speed_r\n" + rows)
    assert np.flatnonzero(np.isnan(read(log).channels["ground_speed"])).tolist() == [4]


@pytest.mark.parametrize(
    "header", ["time,signal,value", "Zeit;Kanal;Wert", "stamp,device,channel_name,Value,unit"]
)
def test_a_long_table_says_how_to_pivot_it(
    tmp_path: Path, header: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from terragrip.cli import main

    mark = ";" if ";" in header else ","
    names = header.split(mark)
    rows = [
        mark.join(
            {0: str(k / 10)}.get(n, "ground_speed" if n == len(names) - 2 else "1.5")
            for n in range(len(names))
        )
        for k in range(30)
    ]
    log = tmp_path / "long.csv"
    log.write_text("\n".join([header, *rows]) + "\n")
    assert main(["inspect", str(log)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"table.pivot_table(index={names[0]!r}, columns=" in line
    with pytest.raises(
        InputError,
        match="is a long table, with a row for each value; make a column of each signal, in pandas",
    ):
        read(log)
    profile = tmp_path / "p.yaml"
    profile.write_text(f"time: {{from: {names[0]}}}\nchannels:\n  ground_speed: {{from: speed, unit: m/s}}\n")
    with pytest.raises(InputError, match="make a column of each signal"):
        read(log, profile)


def _some_rows(names: list[str]) -> list[list[str]]:
    return [[f"{k / 10}", *[f"{1 + k / 100 + n:.3f}" for n in range(len(names) - 1)]] for k in range(40)]


def test_a_header_of_two_rows_names_the_columns_by_group_where_a_name_alone_does_not(tmp_path: Path) -> None:
    names = ["Time", "Ground speed", "FL", "FR", "FL", "FR"]
    rows = _some_rows(names)
    text = ["General,,Wheel speed,,Torque,", ",".join(names), "s,m/s,rad/s,rad/s,Nm,Nm", *map(",".join, rows)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(text) + "\n")
    table = read_table(log)
    assert table.names == (
        "Time",
        "Ground speed",
        "Wheel speed FL",
        "Wheel speed FR",
        "Torque FL",
        "Torque FR",
    )
    assert table.units["Torque FR"] == "Nm"
    assert table.columns["Torque FL"].tolist() == [float(row[4]) for row in rows]
    log.write_text("\n".join([text[0], text[1], *text[3:]]) + "\n")
    assert read_table(log).names == table.names
    found = inspect(log).proposals
    assert {
        "wheel_speed_fl",
        "wheel_speed_fr",
        "drive_torque_fl",
        "drive_torque_fr",
        "ground_speed",
    } <= found.keys()


def test_a_sheet_saved_with_title_lines_and_merged_cells_is_read_whole(tmp_path: Path) -> None:
    """A spreadsheet fills every line with separators: the title was the one column, and merged cells left their group's first."""
    rows = [[f"{k / 10}", *[f"{k % 7 + n},5" for n in range(5)], ""] for k in range(40)]
    text = [
        "Zugversuch Feld 3;;;;;;",
        "Fahrer: M.;Gang: 3;;;;;",
        ";;;;;;",
        "Temps;Roues;;Couples;;Vitesse;Note",
    ]
    text += [
        "(s);AVG (tr/min);AVD (tr/min);AVG (N.m);AVD (N.m);avance (km/h);",
        *map(";".join, rows),
        ";;;;;;",
        ";;;;;;",
    ]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(text) + "\n")
    table = read_table(log)
    assert table.names == (
        "Temps",
        "Roues AVG",
        "Roues AVD",
        "Couples AVG",
        "Couples AVD",
        "Vitesse avance",
        "Note",
    )
    assert table.units["Temps"] == "s"
    assert table.units["Couples AVD"] == "N.m"
    assert table.columns["Vitesse avance"].tolist() == [k % 7 + 4.5 for k in range(40)]
    found = inspect(log).proposals
    assert {
        "wheel_speed_fl",
        "wheel_speed_fr",
        "drive_torque_fl",
        "drive_torque_fr",
        "ground_speed",
    } <= found.keys()


def test_values_without_a_name_are_counted_and_an_empty_column_or_an_index_is_not(tmp_path: Path) -> None:
    """A drawbar force whose name was lost was left out without a word."""
    log = tmp_path / "log.csv"
    rows = [f"{k},{k / 10},{1 + k % 3},2,,7\n" for k in range(30)]
    log.write_text(",time,ground_speed,wheel_speed_l,,\n" + "".join(rows))
    said = "Columns that have values but no name in the header were left out: 1."
    assert [note for note in read(log).notes if "no name" in note] == [said]
    log.write_text(",time,ground_speed,wheel_speed_l,,torque\n" + "".join(rows))
    assert not any("no name" in note for note in read(log).notes)


def test_dates_of_an_index_that_pandas_wrote_without_a_name_are_the_time(tmp_path: Path) -> None:
    """They were left out, and `inspect` had no time to propose; an index of row numbers is none."""
    log = tmp_path / "log.csv"
    index = pd.date_range("2026-03-01 10:00", periods=30, freq="100ms", tz="Europe/Berlin")
    table = pd.DataFrame({"ground_speed": 1.0, "wheel_speed_l": 2.0}, index=index)
    table.to_csv(log)
    recording = read(log)
    assert recording.time.tolist() == pytest.approx(np.arange(30) / 10)
    assert recording.start == index[0].timestamp()
    table.reset_index(drop=True).to_csv(log)
    with pytest.raises(InputError, match="column time: is missing"):
        read(log)


def test_names_with_blanks_hide_no_tab_where_cells_are_missing(tmp_path: Path) -> None:
    """Blanks made more cells numbers than tabs did."""
    names = ["time", "ground speed", "wheel speed fl", "wheel speed fr"]
    rows = [[row[0], row[1] if k % 2 else "", *row[2:]] for k, row in enumerate(_some_rows(names))]
    log = tmp_path / "log.txt"
    log.write_text("\n".join("\t".join(row) for row in [names, *rows]) + "\n")
    assert read_table(log).names == tuple(names)


def test_three_dashes_are_no_value(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,ground_speed,wheel_speed_l\n0,1,2\n0.1,---,2.1\n0.2,1.1,---\n")
    table = read_table(log)
    assert np.isnan(table.columns["ground_speed"]).tolist() == [False, True, False]


@pytest.mark.parametrize("long", [False, True])
def test_a_name_that_occurs_twice_is_in_the_way_of_that_column_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, long: bool
) -> None:
    """A bus and a receiver both write 'Speed': inspect refused the log for a column that nobody asked for."""
    rows = "".join(f"{k / 10},{k % 7},{k % 5},{k % 3},{k % 2}\n" for k in range(100))
    path = put(tmp_path, "t [s],Speed,v [m/s],Speed,w [rad/s]\n" + rows)
    if long:
        looking = sys.modules["terragrip.formats.seen"]
        monkeypatch.setattr(looking, "_LONG", 0)
        monkeypatch.setattr(looking, "_ENOUGH", 500)
    report = inspect(path)
    assert "Columns that occur twice are left out: Speed. Rename one to use it." in report.warnings
    profile = {"time": {"from": "t"}, "channels": {"ground_speed": "v", "wheel_speed_l": "w"}}
    assert len(read(path, Profile.from_dict(profile))) == 100
    with pytest.raises(InputError, match="column Speed: occurs twice"):
        read(path, Profile.from_dict(profile | {"channels": {"ground_speed": "Speed", "wheel_speed_l": "w"}}))


def test_a_line_of_types_under_the_names_is_named(tmp_path: Path) -> None:
    """Types alone; with a row of units beside them they are read (test_public_headers.py)."""
    path = tmp_path / "log.csv"
    path.write_text("time,ground_speed\nf8,f8\n" + "".join(f"{k / 10},1\n" for k in range(50)))
    with pytest.raises(
        InputError, match="'f8' is not a number; delete lines of types, units or sources under the names"
    ):
        read(path)


@pytest.mark.parametrize("units", ["", "s,km/h,1/min,1/min\n"])
def test_a_header_that_stands_again_between_the_rows_is_left_out(tmp_path: Path, units: str) -> None:
    """Loggers write it whenever they begin anew (Torque does); every column was then one of texts, or the log refused."""
    header = "time,v_gps,n_l,n_r\n" + units
    rows = [f"{0.1 * k:.1f},{3 + k % 7},{20 + k % 5},{21 + k % 5}\n" for k in range(60)]
    path = put(
        tmp_path, header + "".join(rows[:20]) + header + "".join(rows[20:40]) + header + "".join(rows[40:])
    )
    table = read_table(path).columns
    assert len(table["n_l"]) == 60
    assert table["v_gps"].dtype.kind in "fi"
    assert [w for w in inspect(path).warnings if "stands 2 times more between the rows" in w]
    assert not [w for w in inspect(put(tmp_path, header + "".join(rows))).warnings if "between the rows" in w]


def test_marks_of_missing_values_may_have_a_blank_before_them(tmp_path: Path) -> None:
    """Of rows as '1, -, 2' the column was one of texts."""
    rows = "".join(f"{0.1 * k:.1f}, {'-' if k < 3 else k}, {'NaN' if k == 5 else 2}\n" for k in range(20))
    table = read_table(put(tmp_path, "time, n_l, n_r\n" + rows)).columns
    assert (np.isnan(table["n_l"]).sum(), np.isnan(table["n_r"]).sum()) == (3, 1)


def test_rows_of_several_kinds_are_refused_by_their_names(tmp_path: Path) -> None:
    """A script's export of a robot's messages: its first row was taken for the header, and 'has no wheel speed' was all that was said."""
    rows = []
    for k in range(40):
        stamp = f"2024:06:01 14:23:{k:02d}.490188"
        rows += [f"Odometry;{stamp};Position;{k};2.5;DeltaPosition;0.1", f"IMU;{stamp};Rate;0.1"]
        rows += [f"GPS;{stamp};51.98;5.66;4"] * (k % 2)
    with pytest.raises(
        InputError, match=r"rows of several kinds \(GPS, IMU, Odometry\), each with columns of its own"
    ):
        read_table(put(tmp_path, "\n".join(rows) + "\n"))
    labels = "".join(f"{'sand' if k % 3 else 'clay'},{k / 10},1.5\n" for k in range(40))
    assert list(read_table(put(tmp_path, "soil,time,v\n" + labels)).columns) == ["soil", "time", "v"]

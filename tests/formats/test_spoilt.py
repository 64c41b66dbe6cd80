"""What keeps a column of a foreign log from being a number or a time is named by `inspect`, with its row and what to write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile, inspect, read
from terragrip.vehicle import Vehicle

NAMES = ("Zeit", "Fahrgeschwindigkeit [km/h]", "Raddrehzahl VL [1/min]", "Raddrehzahl VR [1/min]", "Raddrehzahl HL [1/min]",
         "Raddrehzahl HR [1/min]", "Radmoment VL [Nm]")  # fmt: skip
ROWS = 300


def table() -> pd.DataFrame:
    """A drive of 1 to 2 m/s at 10 Hz on wheels of .3 m."""
    time = np.arange(ROWS) / 10
    speed = 1.5 + 0.5 * np.sin(time / 3)
    turning = speed / 0.95 / 0.3 * 30 / np.pi
    columns = [time, 3.6 * speed, *[turning + 0.1 * k for k in range(4)], 40 * speed]
    return pd.DataFrame(dict(zip(NAMES, columns, strict=True))).round(4)


def log(
    path: Path, column: str = "", cells: dict[int, str] | None = None, *, every: pd.Series | None = None
) -> Path:
    """The drive as CSV, some cells (or all) of a column written otherwise."""
    content = table().astype(object)
    for row, cell in (cells or {}).items():
        content.loc[row, column] = cell
    if every is not None:
        content[column] = every
    content.to_csv(path, index=False, sep=";")
    return path


def said(path: Path) -> str:
    return "\n".join(inspect(path).warnings)


@pytest.mark.parametrize("cell", ["#DIV/0!", "ERR", "****", "\u22120.35", "Mittelwert"])
def test_a_text_among_numbers_is_named_with_its_row(tmp_path: Path, cell: str) -> None:
    note = said(log(tmp_path / "a.csv", NAMES[1], {99: cell, 199: cell}))
    assert (
        f"column Fahrgeschwindigkeit, row 100 (and 1 more): {cell!r} is not a number, though most cells there are; leave it empty"
        in note
    )
    assert "is not a number" not in said(log(tmp_path / "b.csv"))


def test_units_in_the_cells_are_read_where_they_are_one(tmp_path: Path) -> None:
    """Grafana's export writes them; one row may be in another unit than the next. All were refused."""
    head, rows = "time;ground_speed;wheel_speed_l\n", ["0 s;3,6 km/h;1\n", "1 s;--;1,5\n", "2 s;7,2 km/h;2\n"]
    (tmp_path / "a.csv").write_text(head + "".join(rows))
    result = read(tmp_path / "a.csv")
    np.testing.assert_allclose(result.channels["ground_speed"], [1.0, np.nan, 2.0])
    np.testing.assert_allclose(result.time, [0, 1, 2])
    (tmp_path / "b.csv").write_text(head + "".join(rows) + "3 s;2,1 m/s;1\n")
    with pytest.raises(InputError, match=r"has its unit in the cell"):
        read(tmp_path / "b.csv")
    later = [f"{k} s;{k % 9} km/h;1\n" for k in range(3, 200)]
    (tmp_path / "c.csv").write_text(head + "".join(rows + later) + "200 s;2,1 m/s;1\n")
    with pytest.raises(InputError, match="column ground_speed, row 201: is in m/s, the first rows in km/h"):
        read(tmp_path / "c.csv")
    note = said(log(tmp_path / "d.csv", NAMES[1], every=table()[NAMES[1]].map("{:.1f} km/h".format)))
    assert "in the cell" not in note


def test_signs_between_thousands_are_named(tmp_path: Path) -> None:
    grouped = (100 * table()[NAMES[6]]).map("{:,.1f}".format)
    note = said(log(tmp_path / "a.csv", NAMES[6], every=grouped))
    assert "column Radmoment VL, row 1" in note
    assert "write numbers without a thousands separator" in note


@pytest.mark.parametrize("form", ["%M:%S.0", "%m-%d-%y %H:%M:%S", "%d.%m.%Y %H:%M"])
def test_a_time_in_another_form_is_named(tmp_path: Path, form: str) -> None:
    stamps = pd.Series(
        pd.Timestamp("2024-04-13 10:00") + pd.to_timedelta(np.arange(ROWS), unit="min")
    ).dt.strftime(form)
    note = said(log(tmp_path / "a.csv", "Zeit", every=stamps))
    assert (
        f"column Zeit, row 1: {stamps[0]!r} is not a time; give seconds, 10:00:00.5 or 2024-04-03 10:00:00.5."
        in note
    )


@pytest.mark.parametrize(
    ("first", "what"),
    [
        (45385.4166667, "a spreadsheet's dates do (45385.4 is 2024-04-03)"),
        (739345.4166667, "MATLAB's datenum does (739345 is 2024-04-03)"),
    ],
)
def test_days_are_proposed_as_those_of_a_calendar(tmp_path: Path, first: float, what: str) -> None:
    """Datenum was read as seconds: a drive of a hundredth of a second; in days, of the year 3990."""
    path = log(tmp_path / "a.csv", "Zeit", every=first + table()["Zeit"] / 86_400)
    assert f"Zeit: counts days, as {what}: d?" in said(path)
    (tmp_path / "p.yaml").write_text(inspect(path).profile, encoding="utf-8")
    recording = read(path, Profile.load(tmp_path / "p.yaml"))
    assert recording.time[-1] == pytest.approx((ROWS - 1) / 10, abs=1e-4)
    assert recording.start == pytest.approx(1_712_138_400, abs=1)
    assert recording.to_pandas().index[0].isoformat().startswith("2024-04-03T10:00:00.00")


def test_numbers_as_texts_and_durations_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    table().astype(str).assign(Zeit=pd.to_timedelta(table()["Zeit"], unit="s")).to_parquet(path)
    seen = inspect(path)
    assert seen.time is not None
    assert {"ground_speed", "wheel_speed_fl", "drive_torque_fl"} <= seen.proposals.keys()
    (tmp_path / "p.yaml").write_text(seen.profile, encoding="utf-8")
    recording = read(path, Profile.load(tmp_path / "p.yaml"))
    assert recording.time[-1] == pytest.approx((ROWS - 1) / 10)
    np.testing.assert_allclose(recording["ground_speed"], table()[NAMES[1]] / 3.6)
    table().astype(str).apply(lambda column: column.str.replace(".", ",")).to_parquet(path)
    assert "column Fahrgeschwindigkeit has numbers with a decimal comma as texts" in said(path)


def test_wheels_that_contradict_their_unit_are_named(tmp_path: Path) -> None:
    """Turns a minute that the header calls rad/s, contradicted by ground speed and gyroscope: they were left out without a word."""
    content = table()
    turn = 0.3 * np.sin(content["Zeit"] / 4)
    for name, side in zip(NAMES[2:6], (-1, 1, -1, 1), strict=True):
        content[name] += side * turn * 0.95 / 2 / 0.3 * 30 / np.pi
    content.columns = [name.replace("1/min", "rad/s") for name in NAMES]
    content.assign(**{"Gierrate [rad/s]": turn}).to_csv(tmp_path / "a.csv", index=False)
    seen = inspect(tmp_path / "a.csv", vehicle=german())
    assert not any(name.startswith("wheel_speed_") for name in seen.proposals)
    start = "Raddrehzahl HL in rad/s has the name of wheel_speed_hl, but "
    (note,) = [one for one in seen.warnings if one.startswith(start)]
    assert note.endswith(": check its unit.")


def test_json_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    table().to_json(path, orient="records", lines=True)
    with pytest.raises(InputError, match="is JSON; save it as CSV or Parquet"):
        inspect(path)


def german() -> Vehicle:
    axles = {"vorn": {"mass": 190, "wheels": ["vl", "vr"]}, "hinten": {"mass": 230, "wheels": ["hl", "hr"]}}
    wheel = {"radius": 0.3, "inertia": 1.6}
    return Vehicle.from_dict(
        {"mass": 420, "wheelbase": 1.1, "center_of_gravity_height": 0.5, "axles": axles, "wheel": wheel}
    )


def test_wheels_go_by_the_vehicles_own_names(tmp_path: Path) -> None:
    """A German vehicle file, whose radii tell the unit, too."""
    content = table()
    content.columns = [name.removesuffix(" [1/min]") for name in NAMES]
    content.to_csv(tmp_path / "a.csv", index=False)
    proposals = inspect(tmp_path / "a.csv", vehicle=german()).proposals
    assert {f"wheel_speed_{wheel}" for wheel in german().wheels} <= proposals.keys()
    assert proposals["wheel_speed_hl"].unit == "rpm"
    assert not any(name.endswith(("_fl", "_rr")) for name in proposals)


def test_the_wheels_of_a_single_axle_that_is_counted_go_by_the_vehicles_names(tmp_path: Path) -> None:
    """Proposed as l and r, which the vehicle does not have, the log was refused."""
    axles = {"axle": {"mass": 420, "wheels": ["1l", "1r"]}}
    told = {"mass": 420, "axles": axles, "wheel": {"radius": 0.3, "inertia": 1.6}}
    content = table()
    content.columns = [
        *NAMES[:2],
        "other",
        "another",
        "Raddrehzahl 1L [1/min]",
        "Raddrehzahl 1R [1/min]",
        *NAMES[6:],
    ]
    content.to_csv(tmp_path / "a.csv", index=False)
    proposals = inspect(tmp_path / "a.csv", vehicle=Vehicle.from_dict(told)).proposals
    assert {name for name in proposals if name.startswith("wheel_speed")} == {
        "wheel_speed_1l",
        "wheel_speed_1r",
    }


def test_a_time_in_a_unit_of_something_else_is_one_line(tmp_path: Path) -> None:
    """It was a defect of Terragrip with a traceback."""
    path = tmp_path / "t.csv"
    path.write_text("time [km/h],ground_speed,wheel_speed_l\n0,1,2\n1,1,2\n")
    with pytest.raises(InputError, match=r"t\.csv: column time: 'km/h' measures a speed, where a time is"):
        read(path)

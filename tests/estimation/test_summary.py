"""The summary of an estimate, on one screen."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.summary import Tally


@pytest.fixture(scope="module")
def drive() -> tuple[tg.Estimates, str]:
    """A drive over two soils, with an unlabelled stretch."""
    result = tg.simulate("constant", 7)
    soil = np.where(result.recording.time < 20, "loam", np.where(result.recording.time < 30, "sand", ""))
    recording = result.recording.to_pandas().assign(soil=soil)
    estimates = tg.estimate(recording, result.vehicle)
    return estimates, estimates.summary()


def cells(line: str) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in re.findall(r"(-?\d+\.\d+) ± (\d+\.\d+)", line)]


@pytest.mark.parametrize("label", ["loam", "sand", "no label", "all"])
def test_medians_and_intervals_by_label(drive: tuple[tg.Estimates, str], label: str) -> None:
    estimates, text = drive
    table = estimates.to_pandas()
    rows = (table["event"].isna() | (table["event"] == "")) & {
        "all": True,
        "no label": (table["soil"].isna() | (table["soil"] == "")),
    }.get(label, table["soil"] == label)
    line = next(line for line in text.splitlines() if line.strip().startswith(f"{label}  "))
    speed, slip, adhesion, efficiency, resistance = cells(line)

    def expected(*names: str) -> tuple[float, float]:
        some = table.loc[rows]
        return (
            float(np.mean([some[name].median() for name in names])),
            1.96 * float(np.mean([some[f"{name}_std"].median() for name in names])),
        )

    wheels = ("fl", "fr", "rl", "rr")
    for cell, names in (
        (speed, ["ground_speed"]),
        (slip, [f"slip_{w}" for w in wheels]),
        (adhesion, [f"adhesion_{w}" for w in wheels]),
        (efficiency, [f"efficiency_{w}" for w in wheels]),
        (resistance, ["soil_resistance"]),
    ):
        assert cell == pytest.approx(expected(*names), abs=6e-4)


def test_it_says_what_was_driven_what_is_assumed_and_what_next(drive: tuple[tg.Estimates, str]) -> None:
    estimates, text = drive
    assert len(text.splitlines()) <= 24
    assert text.startswith("Innok Heros 444 (4 wheels): ")
    assert "\n  by wheel" in text
    head, row = (next(one for one in text.splitlines() if word in one) for word in ("speed m/s", "  all "))
    assert len(head) == len(row), "names stand over the ends of their columns"
    assert f"{estimates['distance'][-1]:.1f} m in 40.0 s" in text
    assert "Assumed: considered as unknown drive_torque_gain ±2 %" in text
    assert "the vehicle is not calibrated" in text
    assert text.splitlines()[-1].startswith("Next: 'terragrip soils ESTIMATES")
    moving = re.search(r"([\d.]+) s of it moving", text)
    assert moving is not None
    assert float(moving[1]) == pytest.approx(np.sum(estimates["event"] == "") * 0.01, abs=0.2)


def test_blocks_give_the_summary_of_the_whole(drive: tuple[tg.Estimates, str]) -> None:
    estimates, text = drive
    tally = Tally()
    for rows in np.array_split(np.arange(len(estimates)), 7):
        part = tg.Estimates(
            estimates.time[rows],
            {name: values[rows] for name, values in estimates.columns.items()},
            estimates.event_codes[rows],
            {name: values[rows] for name, values in estimates.labels.items()},
            estimates.about,
            estimates.notes,
        )
        tally.add(part)
    assert tally.text(estimates.notes).splitlines() == text.splitlines()


@pytest.mark.parametrize("cut", [1000, 2000])
def test_a_clock_that_was_set_in_the_log_is_no_time_driven(drive: tuple[tg.Estimates, str], cut: int) -> None:
    """'in 28333335.8 min', where the clock went from 1970 to today between two rows."""
    estimates, _ = drive
    time = estimates.time + 1.7e9 * (np.arange(len(estimates)) >= 1000)
    leaping = replace(estimates, time=time)
    tally = Tally()
    for rows in (slice(0, cut), slice(cut, None)):
        tally.add(leaping.select(rows))
    assert " m in 40.0 s, " in tally.text()


def test_a_label_that_begins_with_a_blocks_last_row_has_its_time(drive: tuple[tg.Estimates, str]) -> None:
    """A row lasts until the next one, which the next block has."""
    estimates, _ = drive
    moving = estimates.event_codes == 0
    first = int(np.flatnonzero((estimates.soil == "sand") & moving)[0])
    tally = Tally()
    for rows in (slice(first - 99, first + 1), slice(first + 1, first + 101)):
        tally.add(estimates.select(rows))
    assert moving[first - 99 : first + 101].all()
    assert tally.moving == pytest.approx({"loam": 0.99, "sand": 1.00}, abs=1e-6)


def test_nothing_considered_is_said_and_doubtful_units_come_first() -> None:
    time = np.arange(0, 40, 0.1)
    speed = np.clip(np.minimum(time - 2, 1.0), 0, None)
    columns = {"time": time, "ground_speed": 3.6 * speed, "drawbar_force": 0 * time}
    columns |= {f"wheel_speed_{w}": speed / 0.9 / 0.2 for w in ("l", "r")}
    columns |= {f"drive_torque_{w}": np.where(speed > 0, 5.0, 0.0) for w in ("l", "r")}
    vehicle = {
        "mass": 60,
        "axles": {"one": {"mass": 60, "wheels": ["l", "r"]}},
        "wheel": {"radius": 0.2, "inertia": 0.1},
    }
    text = tg.estimate(pd.DataFrame(columns), tg.Vehicle.from_dict(vehicle)).summary()
    assert "Medians ± half the 95 % interval, the mean over the driven wheels:" in text
    assert "\n  by wheel" in text
    assert "the intervals cover the sensors' noise alone" in text
    assert text.splitlines()[-1].startswith("Next: correct the units and signs")


@pytest.mark.parametrize(
    ("nis", "verdict"),
    [
        (30.0, "noise may be set too high"),
        (90.0, "as expected"),
        (130.0, "as expected"),
        (300.0, "noise may be set too low"),
    ],
)
def test_innovations_smaller_than_their_noise_are_of_noise_set_too_high(nis: float, verdict: str) -> None:
    tally = replace(Tally(), nis=nis, channels=100.0)
    (line,) = [one for one in tally.text(()).splitlines() if one.startswith("Normalised innovation")]
    assert f"{nis / 100:.2f}, expected 1" in line
    assert verdict in line


def test_an_efficiency_that_could_be_anything_is_not_printed(drive: tuple[tg.Estimates, str]) -> None:
    estimates, _ = drive
    vague = {f"efficiency_{wheel}_std": np.full(len(estimates), 0.6) for wheel in estimates.wheels}
    text = replace(estimates, columns={**estimates.columns, **vague}).summary()
    line = next(line for line in text.splitlines() if line.lstrip().startswith("all "))
    assert line.count("not known") == 1


def test_one_label_on_every_row_makes_one_line() -> None:
    result = tg.simulate("constant", 7)
    text = tg.estimate(result.recording.to_pandas().assign(soil="loam"), result.vehicle).summary()
    lines = [line.strip() for line in text.splitlines()]
    assert sum(line.startswith("all: loam  ") for line in lines) == 1
    assert not any(line.startswith(("loam  ", "all  ")) for line in lines)


def test_a_tally_counts_rows_times_and_events_as_a_table_does(drive: tuple[tg.Estimates, str]) -> None:
    estimates, _ = drive
    tally = Tally()
    tally.add(estimates)
    assert tally.duration == estimates.time[-1] - estimates.time[0]
    assert tally.distance == estimates["distance"].max()
    assert tally.rows == len(estimates)
    events = pd.Series(estimates["event"])
    begins = events[events != events.shift(fill_value="")]
    for code, name in enumerate(EVENTS):
        assert tally.event_rows[code] == (events == name).sum(), name
        assert tally.event_starts[code] == (begins == name).sum(), name
    still = (events == "standstill").to_numpy()
    assert tally.nis == pytest.approx(np.nansum(estimates["nis"][~still]))
    assert tally.channels == pytest.approx(np.nansum(estimates["channels"][~still]))
    lasts = np.diff(estimates.time, append=estimates.time[-1])
    for label in ("loam", "sand", ""):
        rows = (estimates.labels["soil"] == label) & (events == "").to_numpy()
        assert tally.moving[label] == pytest.approx(lasts[rows].sum()), label


def test_words_of_a_summary_that_no_drive_above_needs() -> None:
    """A driveline as one wheel, held channels, spreads with units, noise far from what was expected, ten labels, minutes."""
    time = np.arange(0.0, 700.0, 0.5)
    rows = len(time)
    labels = np.array([f"field {k}" for k in range(10)], dtype=object)[np.arange(rows) * 10 // rows]
    columns = {name: np.full(rows, value) for name, value in {
        "distance": 900.0, "ground_speed": 1.25, "ground_speed_std": 0.01, "slip_drive": 0.125, "slip_drive_std": 0.02,
        "nis": 4.0, "channels": 2.0,
    }.items()}  # fmt: skip
    about = {
        "method": "slip-only",
        "vehicle": {
            "name": "tractor",
            "uncertainty": {"slope": 0.01, "drawbar_offset": 120.0, "drawbar_gain": 0.015, "wheel_radius": 0.0, "hitch_load_offset": 150.0},
        },
        "settings": {"held": {"ground_speed": 0.2}},
    }  # fmt: skip
    codes = np.zeros(rows, dtype=np.uint8)
    codes[10:14] = codes[20:21] = EVENTS.index("outlier")
    text = tg.Estimates(time, columns, codes, {"soil": labels}, about).summary()
    lines = text.splitlines()
    assert lines[0].startswith("tractor (its drive as one wheel): 900.0 m in 11.7 min, 11.6 min of it moving")
    assert lines[1].startswith("Events: outlier 2 (5 rows)")
    assert "Normalised innovation squared a channel: 2.00, expected 1 (the noise may be set too low" in text
    assert "  and 2 more labels" in lines
    assert "Medians ± half the 95 % interval:" in lines  # of one wheel, which has no table of its own
    assert "by wheel" not in text
    assert sum(line.startswith("  field ") for line in lines) == 8
    whole = next(line for line in lines if line.startswith("  all "))
    assert cells(whole) == [pytest.approx((1.25, 0.02), abs=5e-4), pytest.approx((0.125, 0.039), abs=5e-4)]
    assert (
        "considered as unknown slope ±0.57 deg, drawbar_offset ±120 N, drawbar_gain ±1.5 %, hitch_load_offset ±150 N;"
        in text
    )
    assert "repeated values are missing ones, of ground_speed (5 Hz)" in text
    assert "the vehicle is not calibrated" in text
    assert "'terragrip calibrate' on a pass without load makes slip absolute; " in lines[-1]
    quiet = {**columns, "nis": np.full(rows, 0.5)}
    calibrated = {**about, "vehicle": {**about["vehicle"], "calibration": {"wheel_based_speed_gain": 1.01}}}
    tally = Tally()
    some = {name: values[:1000] for name, values in quiet.items()}
    tally.add(tg.Estimates(time[:1000], some, codes[:1000], {}, calibrated))
    text = tally.text(output="out.parquet")
    assert "a channel: 0.25, expected 1 (the noise may be set too high" in text
    assert "499.5 s, 497.0 s of it moving" in text
    assert "not calibrated" not in text
    assert (
        text.splitlines()[-1]
        == "Next: 'terragrip report out.parquet -o report.html' shows slip over time and place."
    )


@pytest.mark.parametrize(
    "note",
    [
        "With hardly a torque the wheels l, r slip by 0.51 [...]. Check the radius (not the diameter).",
        "drawbar_force is -0.16 of the weight on average: a backward pull is positive; write 'sign: -1' for it in the profile.",
        "pitch reaches 2.86 rad: it may be in degrees.",
        "The samples are 50 s apart: time may not be in seconds.",
        "time is a time of day written as hhmmss: 59 is followed by 100.",
    ],
)
def test_what_a_note_doubts_is_settled_before_all_else(note: str) -> None:
    tally = Tally()
    assert tally.text([note]).splitlines()[-1].startswith("Next: correct the units and signs")


def test_the_next_command_is_not_given_a_file_that_it_cannot_read() -> None:
    time = np.arange(0, 10, 0.1)
    columns = {
        f"{name}{end}": np.full(100, 0.1) for name in ("adhesion_l", "ground_speed") for end in ("", "_std")
    }
    tally = Tally()
    tally.add(tg.Estimates(time, columns, np.zeros(100, dtype=int), {}, {"vehicle": {}}))
    assert "'terragrip report out.parquet" in tally.text(output="out.parquet").splitlines()[-1]
    last = tally.text(output="out.xlsx").splitlines()[-1]
    assert (
        last
        == "Next: estimate again into a Parquet file ('-o out.parquet') for the commands that go on from it."
    )

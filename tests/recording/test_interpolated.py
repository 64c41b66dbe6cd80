"""Speeds that lie on straight lines between fewer samples: interpolated, not measured."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation import estimate
from terragrip.estimation.engine import EVENTS
from terragrip.recording import Recording, unit_warnings
from terragrip.recording.interpolated import lines_in, lines_of, without_lines
from terragrip.vehicle import Vehicle

TIME = 0.05 * np.arange(2400)
DRAWS = np.random.default_rng(13)
AXLE = {"mass": 100, "wheels": ["l", "r"]}
VEHICLE = Vehicle.from_dict({"mass": 100, "axles": {"a": AXLE}, "wheel": {"radius": 0.2, "inertia": 0.1}})
SPEED = 1.5 + np.sin(TIME / 5) + 0.03 * DRAWS.standard_normal(len(TIME))


@pytest.mark.parametrize("digits", [4, 15])
@pytest.mark.parametrize("late", [0.0, 0.013])
def test_a_speed_on_straight_lines_is_named(digits: int, late: float) -> None:
    """1 Hz drawn at 20 Hz: slip was held in 84 % of the rows, without a word."""
    drawn = np.round(np.interp(TIME - late, TIME[::20], SPEED[::20]), digits)
    channels = {"ground_speed": drawn, "wheel_speed_l": 5 * SPEED, "wheel_speed_r": 5 * SPEED}
    notes = [n for n in unit_warnings(Recording(TIME, channels), None) if "straight lines" in n]
    assert len(notes) == 1
    assert notes[0].startswith("ground_speed (1 s): values lie on straight lines")


@pytest.mark.parametrize(
    "values",
    [
        SPEED,
        np.round(SPEED, 2),
        np.round(1.5 + np.sin(TIME / 5), 2),  # coarse
        1.5 + np.sin(TIME / 5),  # without noise, as of a filter
        np.round(1.5 + 0.2 * np.sin(TIME / 50), 8),  # slowly: its bends come and go with the rounding
        SPEED[::20].repeat(20),  # held
        np.convolve(SPEED, np.ones(20) / 20, mode="same"),
        np.interp(TIME, [0, 40, 80, 120], [0, 2, 2, 0]),  # a command
        np.interp(TIME, np.sort(DRAWS.uniform(0, 120, 120)), SPEED[:120]),  # unevenly: as of a command, too
    ],
)
def test_other_channels_are_not(values: np.ndarray) -> None:
    assert lines_of(TIME, values) is None


@pytest.mark.parametrize("hertz", [1.0, 3.0])
@pytest.mark.parametrize("part", [slice(0, 2400), slice(1001, 2400)])
def test_one_value_in_each_period_is_left(hertz: float, part: slice) -> None:
    """What lay between counted as measured: slip held in 91 % of the rows, now in 99 (simulated, 1 Hz drawn at 20 Hz)."""
    at = np.arange(0, 120, 1 / hertz)
    log = Recording(TIME, {"ground_speed": np.interp(TIME, at, np.interp(at, TIME, SPEED))})
    left = without_lines(log.select(part), lines_in(log))
    rows = np.flatnonzero(np.isfinite(left["ground_speed"]))
    assert len(rows) == pytest.approx(hertz * np.ptp(left.time), abs=1.5)
    off = np.abs((left.time[rows] * hertz + 0.5) % 1 - 0.5) / hertz
    assert off.max() < 0.06
    assert without_lines(log, {})["ground_speed"] is log["ground_speed"]


@pytest.mark.parametrize("every", [0, 80, 20])
def test_the_note_comes_where_the_estimate_leaves_values_out(every: int) -> None:
    """Of a speed with a code between its samples the note was made without the code, and said what the estimate did not do."""
    drawn = np.interp(TIME, TIME[::20], SPEED[::20])
    if every:
        drawn[7::every] = 9999.0
    log = Recording(TIME, {"ground_speed": drawn, "wheel_speed_l": 5 * SPEED, "wheel_speed_r": 5 * SPEED})
    named = any("'estimate' leaves most of it out" in note for note in unit_warnings(log, None))
    assert named is bool(lines_in(log))


def test_estimates_are_those_of_one_value_in_each_period() -> None:
    rims = {f"{q}_{w}": k * SPEED for w in "lr" for q, k in (("wheel_speed", 5.5), ("drive_torque", 10.0))}
    log = Recording(TIME, {"ground_speed": np.interp(TIME, TIME[::20], SPEED[::20]), **rims})
    found, due = (estimate(one, VEHICLE) for one in (log, without_lines(log, lines_in(log))))
    np.testing.assert_allclose(
        found["slip_l_std"], due["slip_l_std"], rtol=0.02
    )  # their lags differ a little
    assert np.isnan(without_lines(log, lines_in(log))["ground_speed"]).mean() > 0.9


@pytest.mark.parametrize("period", [3.0, 5.0])
def test_samples_that_are_far_apart_leave_no_gaps(period: float) -> None:
    """5 s apart, or a simulation by ramps without noise: slip was .7 +- 1 for .05, and a gap in 61 % of the rows."""
    at = np.arange(0, 125, period)
    time = np.arange(0, 120, 0.05)
    speed = np.interp(time, at, 1.5 + DRAWS.uniform(-1, 1, len(at)))
    rims = {f"wheel_speed_{w}": speed / 0.2 / 0.95 for w in "lr"}
    log = Recording(
        time, {"ground_speed": speed, **rims, **{f"drive_torque_{w}": 20 + 3 * speed for w in "lr"}}
    )
    assert len(lines_in(log)) == 5
    found = estimate(log, VEHICLE)
    assert not np.any(found.event_codes == EVENTS.index("gap"))
    assert np.median(found["slip_l"]) == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize("hertz", [30, 60])
def test_stamps_in_whole_milliseconds_shift_no_period(hertz: int) -> None:
    """33 ms between two rows of 30 Hz made it .99 s: in 100 s the values used went through a whole period."""
    time = np.arange(0, 120, 1 / hertz)
    drawn = np.interp(time, TIME[::20], SPEED[::20])
    lines = lines_of(np.round(time, 3), drawn)
    assert lines is not None
    assert lines.period == pytest.approx(1, abs=1e-4)

"""Samples of one cycle, stamped milliseconds apart, are of one instant."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from terragrip.recording.cycles import cycle_of, cycles_in, in_cycles

PERIOD = 0.1


def apart(*delays: float, rows: int = 50) -> tg.Recording:
    """Ground speed and two wheel speeds at 10 Hz, each in rows of its own, stamped ``delays`` [s] after the cycle's beginning."""
    names = ("ground_speed", "wheel_speed_l", "wheel_speed_r")
    begin = 1.0 + PERIOD * np.arange(rows)
    time = np.unique(np.concatenate([begin + delay for delay in delays]))
    columns = {"time": time}
    for k, (name, delay) in enumerate(zip(names, delays, strict=True)):
        values = np.full(len(time), np.nan)
        values[np.isin(time, begin + delay)] = 100.0 * k + np.arange(rows)
        columns[name] = values
    return tg.Recording.from_frame(columns)


def test_a_cycle_is_one_row_at_its_first_instant() -> None:
    log = apart(0.002, 0.0, 0.004)
    one = in_cycles(log)
    assert (len(log), len(one)) == (150, 50)
    np.testing.assert_allclose(one.time, 1.0 + PERIOD * np.arange(50))
    for k, name in enumerate(log.channels):
        assert np.array_equal(one[name], 100.0 * k + np.arange(50))


@pytest.mark.parametrize(("delay", "rows"), [(0.004, 50), (0.006, 100), (0.05, 100)])
def test_samples_further_apart_than_a_twentieth_of_the_period_are_not_joined(delay: float, rows: int) -> None:
    assert len(in_cycles(apart(0.0, delay, delay))) == rows


def test_nothing_is_joined_where_a_channel_is_in_every_row() -> None:
    log = apart(0.0, 0.002, 0.004)
    full = log.with_channels(ground_speed=np.linspace(0.0, 1.0, len(log)))
    assert in_cycles(full) is full


def test_late_samples_in_a_burst_keep_rows_of_their_own() -> None:
    log = apart(0.0, 0.002, 0.004)
    time = log.time.copy()
    time[30:60] = time[30] + 1e-3 * np.arange(30)  # ten cycles that arrive at once
    burst = tg.Recording(time, log.channels)
    starts = cycles_in(burst, cycle_of(time, burst.channels))
    assert np.array_equal(np.diff(starts)[: 30 // 3], np.full(10, 3))
    assert np.all(np.isin(np.arange(30, 60), starts))


def test_a_reference_in_every_row_does_not_keep_them_apart() -> None:
    log = apart(0.0, 0.002, 0.004)
    log = log.with_channels(true_adhesion_l=np.linspace(0.0, 1.0, len(log)))
    assert len(in_cycles(log)) == 50

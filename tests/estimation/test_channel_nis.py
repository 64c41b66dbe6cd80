"""The NIS of each channel: its chi-square law, which channel's noise is misstated, and what is no measurement."""

from __future__ import annotations

import numpy as np
import pytest

import terragrip as tg
from drives import WHEELS, drive, robot
from terragrip.estimation import estimate
from terragrip.estimation.channel_nis import PREFIX, estimate_with_channel_nis

pytestmark = pytest.mark.usefixtures("unchecked")

SPEEDS = (*(f"wheel_speed_{wheel}" for wheel in WHEELS), "ground_speed")


def moving_nis(estimates: tg.Estimates) -> dict[str, tuple[float, int]]:
    """Mean NIS of each channel over the rows in which the vehicle moves and nothing is flagged, and how many rows these are."""
    result = {}
    for name in estimates:
        if name.startswith(PREFIX):
            values = estimates[name][(estimates.event_codes == 0) & np.isfinite(estimates[name])]
            if len(values):
                result[name.removeprefix(PREFIX)] = (float(values.mean()), len(values))
    return result


@pytest.mark.parametrize("method", ["kalman", "bank", "aukf-fs"])
def test_it_stands_beside_the_estimates_and_changes_none(method: str) -> None:
    log = drive(10, seed=3).recording
    estimates, plain = estimate_with_channel_nis(log, robot(), method), estimate(log, robot(), method)
    assert estimates.about == plain.about
    for name in plain:
        np.testing.assert_array_equal(estimates[name], plain[name], err_msg=name)
    moving = (estimates.event_codes == 0) & (
        estimates["channels"] > 0
    )  # the first row starts the filter and updates nothing
    assert moving.sum() > 900
    for name in SPEEDS:
        assert np.isfinite(estimates[f"nis_{name}"][moving]).all()
    assert (most_of(estimates) <= estimates["nis"] * (1 + 1e-9) + 1e-9)[moving].all()


def most_of(estimates) -> np.ndarray:
    """The largest NIS of a channel in each row. The row's, of all channels together, cannot be less: a channel's own knows no other."""
    return np.max([estimates[f"nis_{name}"] for name in SPEEDS], axis=0)


def test_of_steps_that_are_predicted_in_pieces_too() -> None:
    """At 2 Hz a noisy torque makes most of what is expected of a rim, and its bearing has taken some of it away again."""
    log = drive(120, seed=3, rate=2.0, noise=3.0).recording
    estimates = estimate_with_channel_nis(log, robot(), "kalman", sensors={"drive_torque": 20.0})
    rows = (estimates.event_codes == 0) & (estimates["channels"] == len(SPEEDS))
    assert rows.sum() > 150
    assert (most_of(estimates) <= estimates["nis"] * (1 + 1e-9) + 1e-9)[rows].all()


def test_stated_noise_gives_what_the_filter_expects() -> None:
    """The wheels' expected innovation holds a walk of adhesion that this even drive does not make: below 1."""
    log = drive(60, seed=4).recording
    for name, (mean, rows) in moving_nis(estimate_with_channel_nis(log, robot(), "kalman")).items():
        assert rows > 5000
        assert 0.6 < mean < 1.1, name


@pytest.mark.parametrize("wrong", ["ground_speed", "wheel_speed_rl"])
def test_it_names_the_channel_whose_noise_is_stated_at_half(wrong: str) -> None:
    log = drive(60, seed=5).recording
    right = moving_nis(estimate_with_channel_nis(log, robot(), "kalman"))
    half = {"ground_speed": 0.01, "wheel_speed_rl": 0.015}[wrong]
    estimates = moving_nis(estimate_with_channel_nis(log, robot(), "kalman", sensors={wrong: half}))
    for name in SPEEDS:
        rise = estimates[name][0] / right[name][0]
        assert rise > 1.25 if name == wrong else 0.9 < rise < 1.1


def test_a_missing_channel_and_a_reckoned_ground_speed_have_none() -> None:
    given = drive(30, seed=6).recording
    columns = {name: given[name].copy() for name in given.channels}
    silent = (given.time > 10) & (given.time < 20)
    columns["ground_speed"][silent] = np.nan
    columns["wheel_speed_fr"][50:60] = np.nan
    estimates = estimate_with_channel_nis(
        tg.Recording.from_frame({"time": given.time, **columns}), robot(), "kalman"
    )
    np.testing.assert_array_equal(np.isnan(estimates["nis_ground_speed"][silent]), True)
    np.testing.assert_array_equal(np.isnan(estimates["nis_wheel_speed_fr"][50:60]), True)
    assert np.isfinite(estimates["nis_wheel_speed_fl"][silent]).all()
    # Nor does the row count them: four wheels are left.
    assert set(estimates["channels"][silent][20:]) == {4.0}


def test_of_speeds_alone_the_channels_add_up_to_the_row() -> None:
    given = drive(30, seed=7).recording
    columns = {"time": given.time, **{name: given[name] for name in SPEEDS}}
    estimates = estimate_with_channel_nis(tg.Recording.from_frame(columns), robot())
    assert "slip_fl" in estimates
    assert "adhesion_fl" not in estimates
    started = np.flatnonzero(estimates["nis"] > 0)
    assert len(started) > 2000
    total = np.sum([estimates[f"nis_{name}"] for name in SPEEDS], axis=0)
    np.testing.assert_allclose(total[started], estimates["nis"][started], rtol=1e-9)
    for name, (mean, _) in moving_nis(estimates).items():
        assert 0.6 < mean < 1.3, name

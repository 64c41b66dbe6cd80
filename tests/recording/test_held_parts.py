"""When a channel counts as held, and how its noise is judged: bounds and formulas, on rows laid out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.recording import Recording, held_periods, sensor_noise
from terragrip.recording.checks import NOTHING_TOWED, check_time, refuse_other_mass, remarks, require_columns
from terragrip.recording.held import fresh_samples, held_period, measured_part, quantum
from terragrip.recording.noise import white_noise
from terragrip.vehicle import Vehicle


def runs(lengths: list[int], seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Runs of so many equal rows at 10 Hz, each another value of no resolution."""
    values = np.repeat(np.random.default_rng(seed).uniform(1.0, 9.0, len(lengths)), lengths)
    return 0.1 * np.arange(len(values)), values


@pytest.mark.parametrize(("count", "period"), [(9, None), (10, 0.5)])
def test_eight_whole_runs_are_needed(count: int, period: float | None) -> None:
    """The first and the last may be cut off."""
    assert held_period(*runs([5] * count)) == (None if period is None else pytest.approx(period))


@pytest.mark.parametrize(("odd", "held"), [(8, True), (9, False)])
def test_three_fifths_of_the_runs_must_be_alike(odd: int, held: bool) -> None:
    """Of 20 runs of 5 rows; 12 rows are beyond twice the median."""
    lengths = [5, *([5, 12] * odd + [5] * 20)[:20], 5]
    assert lengths.count(12) == odd
    result = held_period(*runs(lengths))
    assert result == (pytest.approx(0.5) if held else None)


@pytest.mark.parametrize(
    ("lengths", "period"),
    [
        ([5] * 15 + [8] * 5, (15 * 0.5 + 5 * 0.8) / 20),  # up to 1.7 times the median counts in the mean
        ([5] * 15 + [9] * 5, 0.5),  # beyond it is a missed update
        ([5] * 15 + [3] * 5, (15 * 0.5 + 5 * 0.3) / 20),
        ([5] * 15 + [2] * 5, 0.5),  # under half of it is none
    ],
)
def test_a_period_is_the_mean_of_runs_between_half_and_seventeen_tenths_of_the_median(
    lengths: list[int], period: float
) -> None:
    assert held_period(*runs([5, *lengths, 5])) == pytest.approx(period)


@pytest.mark.parametrize(("repeats", "held"), [(5, False), (6, True)])
def test_more_than_a_fifth_of_the_runs_must_repeat(repeats: int, held: bool) -> None:
    """Of 25 runs; the others are single rows."""
    lengths = [1, *([2] * repeats + [1] * (25 - repeats)), 1]
    result = held_period(*runs(lengths))
    assert (result is not None) is held
    if result is not None:
        assert result == pytest.approx(0.1 * (25 + repeats) / 25)


@pytest.mark.parametrize(("repeats", "held"), [(10, False), (11, True)])
def test_at_steps_of_two_quanta_two_fifths_of_the_runs_may_repeat_by_chance(repeats: int, held: bool) -> None:
    """0.8 over their median size, of 25 runs."""
    values = np.cumsum([5.0, *[2.0, -2.0, 3.0, -2.0] * 6, 2.0, -2.0])
    series = np.repeat(values, [1, *([2] * repeats + [1] * (25 - repeats)), 1])
    assert quantum(series) == 1.0
    assert (held_period(0.1 * np.arange(len(series)), series) is not None) is held


def test_steps_of_one_and_a_half_quanta_end_no_run_that_counts() -> None:
    steps = np.tile([3.0, -3.0, 2.0, -2.0], 10)
    time, values = 0.1 * np.arange(205), np.repeat(np.cumsum(np.r_[5.0, steps]), 5)
    assert quantum(values) == 1.0
    assert held_period(time, values) == pytest.approx(0.5)
    single = np.repeat(np.cumsum(np.r_[5.0, np.sign(steps)]), 5)
    assert held_period(time, single) is None


def test_a_channel_with_hardly_a_repeat_is_fresh() -> None:
    values = np.random.default_rng(1).uniform(size=1001)
    assert held_period(np.arange(1001.0), values) is None
    assert held_period(np.arange(1.0), values[:1]) is None
    log = Recording(
        np.arange(110) / 10, {"true_ground_speed": runs([5] * 22)[1], "ground_speed": runs([5] * 22)[1]}
    )
    assert list(held_periods(log)) == ["ground_speed"]


@pytest.mark.parametrize(("coarse", "again"), [(3, True), (2, False)])
def test_where_a_tenth_of_the_steps_is_a_single_quantum_equal_updates_are_to_be_expected(
    coarse: int, again: bool
) -> None:
    steps = np.r_[np.tile([4.0, -4.0], 14)[: 29 - coarse], np.ones(coarse)]
    values = np.r_[np.repeat(10.0 + np.cumsum(np.r_[0.0, steps]), 2), np.full(12, 50.0)]
    fresh = fresh_samples(0.5 * np.arange(len(values)), values, 1.0)
    assert fresh[:60:2].all()
    assert not fresh[1:60:2].any()
    assert np.flatnonzero(fresh[60:]).tolist() == ([0, 3, 5, 7, 9, 11] if again else [0])


def test_unknown_samples_are_no_updates() -> None:
    values = np.array([np.nan, 1.0, np.nan, 1.0, 2.0])
    assert fresh_samples(np.arange(5.0), values, 9.0).tolist() == [False, True, False, False, True]
    assert not fresh_samples(np.arange(2.0), np.full(2, np.nan), 1.0).any()
    time, known = measured_part(np.arange(5.0), values)
    assert (time.tolist(), known.tolist()) == ([1.0, 3.0, 4.0], [1.0, 1.0, 2.0])


def test_noise_is_what_a_parabola_leaves_of_four_samples() -> None:
    """The residual of a quadratic by least squares through four points is their third divided difference over √Σc²."""
    draws = np.random.default_rng(5)
    time = np.cumsum(draws.uniform(0.05, 0.15, 60))
    values = 3.0 + time**2 + 0.1 * draws.standard_normal(60)
    left = []
    for k in range(57):
        when, x = time[k : k + 4], values[k : k + 4]
        left.append(np.linalg.norm(x - np.polyval(np.polyfit(when, x, 2), when)))
    assert white_noise(time, values) == pytest.approx(1.482602218505602 * np.median(left), rel=1e-6)


def test_noise_of_what_is_sensed_is_found_beside_what_is_not() -> None:
    values = np.random.default_rng(7).standard_normal(400)
    names = ("true_ground_speed", "latitude", "ground_speed", "fuel_rate", "pitch")
    noise = sensor_noise(Recording(0.1 * np.arange(400), dict.fromkeys(names, values)))
    assert noise == {"ground_speed": pytest.approx(1.0, rel=0.1), "pitch": pytest.approx(1.0, rel=0.1)}


@pytest.mark.parametrize(("gap", "counts"), [(3.9, True), (4.1, False)])
def test_four_samples_straddle_a_gap_of_four_steps(gap: float, counts: bool) -> None:
    time = np.cumsum(np.where(np.arange(60) % 3 == 0, gap, 1.0))
    noise = white_noise(time, np.random.default_rng(1).standard_normal(60))
    assert (noise is not None) is counts


@pytest.mark.parametrize(("rows", "known"), [(22, False), (23, True)])
def test_twenty_differences_are_needed(rows: int, known: bool) -> None:
    values = np.random.default_rng(1).standard_normal(rows)
    assert (white_noise(np.arange(float(rows)), values) is not None) is known
    assert white_noise(np.arange(19.0), np.arange(19.0)) is None


def test_noise_is_never_under_a_ten_thousandth_of_the_signal() -> None:
    time = np.arange(200.0)
    assert white_noise(time, 1e-3 * time**2 + np.sqrt(2)) == pytest.approx(
        1e-4 * np.quantile(1e-3 * time**2 + np.sqrt(2), 0.95)
    )
    log = Recording(
        time, {"wheel_speed_l": np.repeat(np.random.default_rng(1).standard_normal(40), 5), "fuel_rate": time}
    )
    assert set(sensor_noise(log, {"wheel_speed_l": 5.0})) == {"wheel_speed_l"}


# --- what makes a table unusable


@pytest.mark.parametrize(
    ("mass", "words"),
    [
        (28.0, ""), (27.0, "reads 27 kg, the vehicle file has 139 kg"), (1390.0, ""), (1391.0, "reads 1391 kg"), (0.139, "in t?"),
        (0.0974, "in t?"), (0.0972, "it is of the whole machine"), (1500.0, "it is of the whole machine"), (139e3, "in g?"),
    ],
)  # fmt: skip
def test_a_measured_mass_of_another_machine_is_refused_with_its_likely_unit(
    vehicle: Vehicle, mass: float, words: str
) -> None:
    channel = {"mass": np.array([np.nan, mass, mass, 1.0])}
    if not words:
        refuse_other_mass(vehicle, channel)
        return
    with pytest.raises(InputError) as error:
        refuse_other_mass(vehicle, channel, "l.csv")
    assert words in str(error.value)
    refuse_other_mass(vehicle, {})
    refuse_other_mass(vehicle, {"mass": np.full(3, np.nan)})


def test_of_a_block_rows_and_time_count_from_the_table() -> None:
    check_time(np.array([2.0, 3.0]), None, first_row=10, after=1.0)
    for time, after, words in (
        ([1.0, 3.0], 1.0, r"row 11 \(time 1 s\): time repeats"),
        ([0.5, 3.0], 1.0, r"row 11 \(time 0\.5 s\): time goes back from 1 s"),
        ([2.0, 3.0, 2.5], 1.0, r"row 13 \(time 2\.5 s\): time goes back from 3 s"),
        ([2.0, np.inf], None, "row 12: time is not a finite number"),
        ([np.nan, 3.0], None, "row 11: time is not a finite number"),
    ):
        with pytest.raises(InputError, match=words):
            check_time(np.array(time), None, first_row=10, after=after)


def test_the_last_stamp_may_be_of_a_year_that_no_clock_shows() -> None:
    with pytest.raises(InputError, match=r"is 1\.7e\+12 s, past the year 5000: since 1970 in ms\?"):
        check_time(np.array([1.7e9, 1.7e12]), None)


def test_what_is_missing_and_what_is_not_used_is_said() -> None:
    with pytest.raises(InputError, match=r"column ground_speed: is missing.*nearest column is 'groundspeed'"):
        require_columns(("time", "groundspeed", "wheel_speed_l"), None)
    with pytest.raises(InputError, match=r"column wheel_speed_<wheel>"):
        require_columns(("time", "ground_speed", "wheel_speed_"), None)
    require_columns(("time", "ground_speed", "wheel_based_speed"), None)
    names = [f"x{k}" for k in range(8)]
    assert remarks(("time", "soil", "drawbar_force", *names)) == [
        f"Columns that are not used: {', '.join(names)}."
    ]
    assert remarks(("drawbar_force", *names, "y", "z"))[0].endswith("x7 and 2 more.")
    assert remarks(("time",)) == [NOTHING_TOWED]

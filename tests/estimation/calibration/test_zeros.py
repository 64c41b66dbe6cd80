"""Zeros from standstill: what counts as one, and what does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import sem

from terragrip import read
from terragrip.errors import InputError
from terragrip.estimation import calibrate
from terragrip.estimation.calibration.zeros import spell_mean
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("unchecked")

OFFSET = (0.5, -0.4, 0.2, -0.1)
WHEELS = ("fl", "fr", "rl", "rr")
Make = Callable[..., Recording]


def test_torque_zero_is_the_mean_at_standstill(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(drive(60, offset=OFFSET, standing=10, noise=1.0), vehicle)
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        quantity = result[f"drive_torque_offset {wheel}"]
        assert abs(quantity.value - offset) < 4 * quantity.std
        assert quantity.std == pytest.approx(1 / np.sqrt(475), rel=0.3)  # noise over 9.5 s at 50 Hz
        assert quantity.evidence[0].start == 0
        assert quantity.evidence[0].end == pytest.approx(9.5)  # in the last half second it may start
        assert quantity.samples == 475


def test_torque_that_rises_before_the_wheels_turn_is_no_zero(drive: Make, vehicle: Vehicle) -> None:
    log = drive(60, offset=OFFSET, standing=10, noise=1.0)
    rising = 20.0 * np.clip((log.time - log.time[0] - 9.6) / 0.4, 0.0, 1.0) * (log["ground_speed"] < 0.01)
    log = log.with_channels(**{f"drive_torque_{w}": log[f"drive_torque_{w}"] + rising for w in WHEELS})
    result = calibrate(log, vehicle)
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        quantity = result[f"drive_torque_offset {wheel}"]
        assert (
            abs(quantity.value - offset) < 4 * quantity.std
        )  # .4 N m off, eight of them, with that half second


@pytest.mark.parametrize("readings", [[0.2, 0.6], [0.2, 0.6, 0.1], [0.3, 0.6, 0.2, 0.5, 0.2]])
def test_what_differs_from_stop_to_stop_is_in_the_error(readings: list[float]) -> None:
    """The standard error of the stops' means, though each stop reads the same all along."""
    stops = [slice(100 * k, 100 * k + 50) for k in range(len(readings))]
    values = np.repeat(readings, 100)
    value, error = spell_mean(values, stops, np.full(len(values), 25.0), noise=0.1)
    within = max(
        np.std(np.repeat(readings, 50), ddof=1) / np.sqrt(50 * len(readings)),
        0.1 / np.sqrt(50 * 25.0 * len(readings)),
    )
    between = float(sem(readings))
    assert value == pytest.approx(np.mean(readings))
    assert error == pytest.approx(np.hypot(between, within) if len(readings) == 2 else between)


def test_of_one_stop_the_noise_alone_is_in_the_error() -> None:
    value, error = spell_mean(np.full(50, 0.3), [slice(0, 50)], np.full(50, 25.0), noise=0.1)
    assert (value, error) == (pytest.approx(0.3), pytest.approx(0.1 / np.sqrt(50 * 25)))


def test_zeros_do_not_disturb_the_gains(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(drive(offset=OFFSET, standing=10, gain=(1.02, 0.98, 1.0, 1.0)), vehicle)
    assert result["drive_torque_gain fl"].value == pytest.approx(1.02, abs=2e-3)


def test_a_drive_that_holds_the_vehicle_is_no_zero(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(drive(60, standing=10, held_torque=6.0), vehicle)
    assert "drive_torque_offset fl" not in result
    assert any("seems to hold the vehicle" in u.why for u in result.unknown)


def test_what_counts_as_a_zero_goes_by_the_torque_of_driving(drive: Make, vehicle: Vehicle) -> None:
    unknown_zero = Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": {"drive_torque_gain": 0.02}})
    log = drive(60, offset=OFFSET, standing=10)  # driving takes some 40 N m, the zeros are 0.1 to 0.5
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        assert calibrate(log, unknown_zero)[f"drive_torque_offset {wheel}"].value == pytest.approx(offset)


def test_stops_that_read_alike_outvote_stops_that_hold(drive: Make, vehicle: Vehicle) -> None:
    idle = [drive(40, offset=OFFSET, standing=5, noise=1.0, seed=k) for k in range(4)]
    holding = [
        drive(40, offset=OFFSET, standing=5, noise=1.0, seed=9 + k, held_torque=0.4 + 0.4 * k)
        for k in range(3)
    ]
    result = calibrate(idle + holding, vehicle)
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        quantity = result[f"drive_torque_offset {wheel}"]
        assert abs(quantity.value - offset) < 4 * quantity.std
        assert quantity.std < 0.06
        assert len(quantity.evidence) == 4


def test_stops_of_which_few_agree_are_off_by_what_the_others_differ_by(drive: Make, vehicle: Vehicle) -> None:
    """Seven stops of 5 s, motors that hold on slopes that nothing measures: two read alike, 1.2 N m off, to .03 N m."""
    holds = (-1.5, -0.6, 0.5, 1.2, 1.2, 2.0, 2.9)
    stops = [
        drive(40, offset=OFFSET, standing=5, noise=1.0, seed=k, held_torque=h) for k, h in enumerate(holds)
    ]
    unsure = Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": {"drive_torque_offset": 2.0}})
    result = calibrate(stops, unsure)
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        quantity = result[f"drive_torque_offset {wheel}"]
        assert abs(quantity.value - offset) < 2 * quantity.std


def test_motors_that_hold_the_vehicle_on_slopes_show_no_zero(drive: Make, vehicle: Vehicle) -> None:
    """Three stops on slopes, of which two read alike, by chance: 140 kg times g sin(pitch), by a speed control; then one without."""
    pitches = (0.02, -0.015, -0.0152)
    stops = []
    for k, pitch in enumerate(pitches):
        held = 0.9 * 140 * GRAVITY * np.sin(pitch) * 0.2 / 4
        log = drive(40, offset=OFFSET, standing=5, noise=1.0, seed=k, held_torque=held)
        stops.append(log.with_channels(pitch=np.full(len(log), pitch)))
    unsure = Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": {"drive_torque_offset": 2.0}})
    result = calibrate(stops, unsure)
    assert "drive_torque_offset fl" not in result
    assert any("those that hold the vehicle: stand with the motors off" in u.why for u in result.unknown)
    off = drive(40, offset=OFFSET, standing=10, noise=1.0, seed=7)
    result = calibrate([*stops, off.with_channels(pitch=np.full(len(off), 0.02))], unsure)
    for wheel, offset in zip(WHEELS, OFFSET, strict=True):
        quantity = result[f"drive_torque_offset {wheel}"]
        assert abs(quantity.value - offset) < 4 * quantity.std < 0.4


def test_drawbar_zero_and_a_taut_bar(drive: Make, vehicle: Vehicle) -> None:
    slack = calibrate(drive(60, drawbar_offset=-5.0, standing=10, noise=1.0), vehicle)["drawbar_offset"]
    assert abs(slack.value + 5.0) < 4 * slack.std
    assert slack.std < 0.4
    taut = calibrate(drive(60, standing=10, bar_tension=80.0), vehicle)
    assert "drawbar_offset" not in taut
    assert any("under tension" in u.why for u in taut.unknown)


def test_a_bar_left_under_tension_at_a_short_stop_is_no_zero(drive: Make, vehicle: Vehicle) -> None:
    """2 N of tension are less than the file's 3 N, and a stop of 3 s shows no difference; 10 s are stood for the zeros."""
    short = calibrate(drive(60, standing=3, bar_tension=2.0, noise=0.1), vehicle)
    assert "drawbar_offset" not in short
    assert any("stand 10 s with the motors off" in u.why for u in short.unknown)
    twice = [drive(60, standing=3, drawbar_offset=-2.0, noise=0.1, seed=k) for k in range(2)]
    assert calibrate(twice, vehicle)["drawbar_offset"].value == pytest.approx(-2.0, abs=0.2)


def test_a_bar_that_the_motors_hold_at_the_only_stop_has_a_wide_zero(drive: Make, vehicle: Vehicle) -> None:
    """8 N of tension, which the motors hold, were the zero, surely (to .3 N)."""
    held = {"bar_tension": 8.0, "held_torque": 8.0 * 0.2 / 4, "noise": 1.0}
    assert "drawbar_offset" not in calibrate(
        drive(60, standing=10, **held), vehicle
    )  # no better than the file's 3 N
    unsure = Vehicle.from_dict({**vehicle.to_dict(), "uncertainty": {"drawbar_offset": 30.0}})
    zero = calibrate(drive(60, standing=10, **held), unsure)["drawbar_offset"]
    assert abs(zero.value) < 1.96 * zero.std < 20.0


def test_three_wheels_that_hold_the_vehicle_say_that_the_fourth_does_too(
    drive: Make, vehicle: Vehicle
) -> None:
    log = drive(60, standing=10, held_torque=6.0)  # driving takes some 40 N m: a twentieth is 2
    first = np.where(log["ground_speed"] < 0.01, 1.5, log["drive_torque_fl"])
    result = calibrate(log.with_channels(drive_torque_fl=first), vehicle)
    assert "drive_torque_offset fl" not in result


def test_drawbar_zero_from_driving_without_a_tool(drive: Make, vehicle: Vehicle) -> None:
    log = drive(60, noise=1.0)
    free = 2.5 + 4 * np.random.default_rng(5).standard_normal(len(log))
    quantity = calibrate(log.with_channels(drawbar_force=free), vehicle)["drawbar_offset"]
    assert abs(quantity.value - 2.5) < 4 * quantity.std
    assert "nothing is towed" in quantity.sentence


def test_no_standstill_is_said(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(drive(60), vehicle)
    reasons = {u.name: u.why for u in result.unknown}
    assert "no standstill" in reasons["drive_torque_offset"]
    assert "no standstill" in reasons["drawbar_offset"]
    assert "no acceleration_x" in reasons["acceleration_bias_x"]


def inclined(drive: Make, bias: float, pitch_zero: float | None, slope: float = 0.01) -> Recording:
    log = drive(60, standing=10, noise=0.1)
    a = np.gradient(log["ground_speed"], log.time) * (log.time >= 10)
    channels = {"acceleration_x": a + GRAVITY * np.sin(slope) + bias}
    if pitch_zero is not None:
        channels["pitch"] = np.full(len(log), slope + pitch_zero)
    return log.with_channels(**channels)


def test_with_pitch_the_difference_is_told_and_split_by_the_priors(drive: Make, vehicle: Vehicle) -> None:
    data = vehicle.to_dict()
    data["uncertainty"] = {**data["uncertainty"], "acceleration_bias": 0.05}
    machine = Vehicle.from_dict(data)
    result = calibrate(inclined(drive, bias=0.06, pitch_zero=-0.004), machine)
    bias, pitch = result["acceleration_bias_x"], result["pitch_offset"]
    reported = 0.06 + GRAVITY * 0.004  # b - g p: the data know no more
    assert bias.value - GRAVITY * pitch.value == pytest.approx(reported, abs=2e-3)
    share = 0.05**2 / (0.05**2 + (GRAVITY * np.radians(0.2)) ** 2)
    assert bias.value == pytest.approx(share * reported, abs=2e-3)
    assert bias.interval[0] < 0.06 < bias.interval[1]
    assert bias.std < 0.05
    assert result.apply(machine).uncertainty.acceleration_bias == pytest.approx(bias.std, rel=0.01)


def test_without_pitch_the_slope_stays_in_the_interval(drive: Make, vehicle: Vehicle) -> None:
    result = calibrate(inclined(drive, bias=0.3, pitch_zero=None), vehicle)
    bias = result["acceleration_bias_x"]
    assert bias.interval[0] < 0.3 < bias.interval[1]
    assert bias.std > 0.8 * GRAVITY * np.radians(0.5)
    assert "cannot be distinguished" in bias.sentence


def test_a_bias_beyond_its_prior_is_not_shrunk_away(drive: Make, vehicle: Vehicle) -> None:
    data = vehicle.to_dict()
    data["uncertainty"] = {**data["uncertainty"], "acceleration_bias": 0.01}
    bias = calibrate(inclined(drive, bias=0.8, pitch_zero=0.0), Vehicle.from_dict(data))[
        "acceleration_bias_x"
    ]
    assert bias.value == pytest.approx(0.8, abs=0.05)


def test_a_table_is_calibrated_as_a_file_of_it_is(drive: Make, vehicle: Vehicle, tmp_path: Path) -> None:
    table = drive(40).to_pandas()
    table.to_parquet(tmp_path / "log.parquet")

    def values(given: object) -> list[tuple[str, str | None, float, float]]:
        return [(q.key, q.wheel, q.value, q.std) for q in calibrate(given, vehicle).quantities]

    of_file = values(read(tmp_path / "log.parquet"))
    assert of_file
    for same in (table, [table], dict(table.items()), iter([table])):
        assert values(same) == of_file


def test_nothing_to_calibrate_from_and_foreign_logs_are_refused(drive: Make, vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="no recording"):
        calibrate([], vehicle)
    log = drive(20)
    for wrong in (None, [log, None]):
        with pytest.raises(InputError, match=r"NoneType is not a table; give what tg.read"):
            calibrate(wrong, vehicle)
    channels = {name.replace("_fl", "_xx"): values for name, values in log.channels.items()}
    with pytest.raises(InputError, match="no wheel xx"):
        calibrate(Recording(log.time, channels), vehicle)


def test_of_an_impossible_bias_no_pitch_is_left(drive: Make, vehicle: Vehicle) -> None:
    """A logger's -9999 in single rows: a bias of -329 m/s² was refused, and a pitch_offset of .44 rad was written."""
    log = inclined(drive, 0.1, 0.01)
    rows = np.arange(len(log)) % 97 == 0
    codes = {n: np.where(rows, -9999.0, log[n]) for n in ("acceleration_x", "pitch")}
    result = calibrate(log.with_channels(**codes), vehicle)
    assert not {"acceleration_bias_x", "pitch_offset"} & {quantity.name for quantity in result.quantities}
    assert any("is impossible" in one.why for one in result.unknown)

"""The ground speed's sensor is silent for over a minute while wheels and torques go on: intervals hold, and an event says so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.estimation.drives import RADIUS, WHEELS, Drive, drive, robot, with_values

from terragrip.estimation import Estimates, estimate
from terragrip.ground.events import events
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

LOST, BACK = 60.0, 130.0  # s


def lost(made: Drive, begin: float = LOST, end: float = BACK) -> tuple[Estimates, NDArray[np.bool_]]:
    """Estimates of the drive without its ground speed from ``begin`` to ``end``, and the rows there in which it moves."""
    time, channels = made.recording.time, dict(made.recording.channels)
    silent = (time > begin) & (time < end)
    channels["ground_speed"] = np.where(silent, np.nan, channels["ground_speed"])
    estimates = estimate(replace(made.recording, channels=channels), robot())
    return estimates, silent & (made.truth["ground_speed"] > 0.05)


def held(estimates: Estimates, made: Drive, rows: NDArray[np.bool_], name: str) -> float:
    """The share of rows whose 95 % interval holds the truth."""
    error, spread = estimates[name] - made.truth[name], estimates[f"{name}_std"]
    return float(np.mean(np.abs(error[rows]) < 1.96 * spread[rows]))


def soils(t: Any) -> Any:
    """Slip that steps every 8 s."""
    return np.interp(t, np.arange(0, 161, 8), [0.05, 0.15, 0.08, 0.22, 0.1, 0.06, 0.18] * 3)


def stops(t: Any) -> Any:
    """A stop of 8 s every 20 s."""
    phase = t % 20
    return 0.6 * np.clip(phase / 2, 0, 1) * np.clip((12 - phase) / 2, 0, 1)


@pytest.mark.parametrize("imu", [True, False])
@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_intervals_hold_and_are_no_wider_than_soils_differ(rate: float, imu: bool) -> None:
    made = drive(140.0, rate=rate, imu=imu, slip=soils)
    estimates, rows = lost(made)
    assert held(estimates, made, rows, "slip_fl") > 0.92
    assert held(estimates, made, rows, "adhesion_fl") > 0.92
    assert np.mean(estimates["slip_fl_std"][rows]) < 3 * np.std(made.truth["slip_fl"])


@pytest.mark.parametrize("speed", [lambda t: 0.6 + 0.05 * np.sin(t / 3), stops])
@pytest.mark.parametrize("rate", [5.0, 50.0])
def test_without_torques_as_well(rate: float, speed: Any) -> None:
    """Held in 0 to 93 % of rows, without a word, while each wheel's slip speed was assumed to stay as it was."""
    made = drive(140.0, rate=rate, slip=soils, speed=speed)
    channels = {name: v for name, v in made.recording.channels.items() if "torque" not in name}
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)))
    assert held(estimates, made, rows, "slip_fl") > 0.92
    assert held(estimates, made, rows, "ground_speed") > 0.92
    assert np.mean(estimates["slip_fl_std"][rows]) < 4 * np.std(made.truth["slip_fl"])
    silent = (made.recording.time > LOST + 4) & (made.recording.time < BACK)
    assert np.isin(estimates["event"][silent], ["gap", "standstill"]).all()


def test_without_torques_backward_is_the_mirror_image() -> None:
    made = drive(100.0, rate=20.0, slip=soils)
    log = {name: v for name, v in made.recording.channels.items() if "torque" not in name}
    ahead, _ = lost(replace(made, recording=replace(made.recording, channels=log)), end=90.0)
    log = {name: -v for name, v in log.items()}
    back, _ = lost(replace(made, recording=replace(made.recording, channels=log)), end=90.0)
    moves = made.recording.time > 1.0
    np.testing.assert_allclose(back["ground_speed"][moves], -ahead["ground_speed"][moves], atol=1e-6)
    np.testing.assert_allclose(back["slip_fl"][moves], ahead["slip_fl"][moves], atol=1e-6)


def test_before_the_first_ground_speed_no_slip_is_taken_for_known() -> None:
    """Without torques; the slip that a drive begins with is no measurement."""
    made = drive(20.0, rate=20.0)
    log = {name: v for name, v in made.recording.channels.items() if "torque" not in name}
    early = made.recording.time < 15
    log["ground_speed"] = np.where(early, np.nan, log["ground_speed"])
    estimates = estimate(replace(made.recording, channels=log), robot())
    assert estimates["slip_fl_std"][early].min() > 0.25
    assert (estimates["event"][early] == "gap").all()


@pytest.mark.parametrize("imu", [True, False])
def test_wheels_that_spin_as_it_goes_do_not_spin_for_the_rest(imu: bool) -> None:
    """As usual they slip .1; when the sensor goes, .7 for 3 s."""

    def spins(t: Any) -> Any:
        return 0.1 + 0.6 * np.clip((t - LOST + 3) / 0.5, 0, 1) * np.clip((LOST + 0.5 - t) / 0.5, 0, 1)

    made = drive(140.0, rate=20.0, imu=imu, slip=spins, speed=lambda t: 0.6 * (1 - spins(t)) / 0.9)
    estimates, rows = lost(made)
    assert held(estimates, made, rows, "slip_fl") > 0.7
    late = rows & (made.recording.time > LOST + 40)
    assert np.max(np.abs(estimates["slip_fl"] - made.truth["slip_fl"])[late]) < 0.15


@pytest.mark.parametrize("imu", [True, False])
def test_the_last_slip_is_taken_for_some_metres_of_each_outage(imu: bool) -> None:
    """On softer ground for 10 s, and lost there for the second time."""
    made = drive(125.0, rate=20.0, imu=imu, slip=lambda t: 0.1 + 0.1 * (t > 110))
    time, channels = made.recording.time, dict(made.recording.channels)
    channels["ground_speed"] = np.where((time > 40) & (time < 100), np.nan, channels["ground_speed"])
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)), 120.0, 125.0)
    assert np.mean(estimates["slip_fl"][rows & (time > 122)]) > 0.16


@pytest.mark.parametrize("imu", [True, False])
def test_ground_that_ends_behind_the_last_measurement_is_in_the_interval(imu: bool) -> None:
    """Last and usual slip differ, and which of them lies ahead is not known."""
    made = drive(110.0, rate=20.0, imu=imu, slip=lambda t: 0.1 + 0.2 * ((t > 75) & (t < 81)))
    estimates, rows = lost(made, 80.0, 100.0)
    assert held(estimates, made, rows, "slip_fl") > 0.9


@pytest.mark.parametrize("imu", [True, False])
def test_slips_that_a_drive_of_five_seconds_has_not_shown_are_in_the_interval(imu: bool) -> None:
    made = drive(50.0, rate=20.0, imu=imu, slip=lambda t: 0.05 + 0.15 * (t > 7))
    estimates, rows = lost(made, 5.0, 40.0)
    assert held(estimates, made, rows, "slip_fl") > 0.9


@pytest.mark.parametrize("names", [["wheel_speed_rr"], ["wheel_speed_rr", "drive_torque_rr"]])
def test_a_wheel_that_is_lost_as_well_does_not_drive_the_vehicle(names: list[str]) -> None:
    """The ground speed followed its belief, to 1.5 m/s for .6, surely: held in 6 % of rows."""
    made = drive(90.0, rate=20.0)
    time, channels = made.recording.time, dict(made.recording.channels)
    for name in names:
        channels[name] = np.where((time > LOST) & (time < 80), np.nan, channels[name])
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)), LOST, 80.0)
    assert held(estimates, made, rows, "slip_fl") > 0.92
    assert held(estimates, made, rows, "ground_speed") > 0.92


def test_slip_grows_with_the_pull_along_the_curves_tangent() -> None:
    """From .10 on it pulls by .083 of the load more, without a ground speed: by the slope there, .4 at most, slip is .133."""
    made = drive(66.0, rate=20.0, noise=0.3, slip=lambda t: 0.1 + 0.06 * np.clip((t - 60.5) / 0.5, 0, 1))
    estimates, rows = lost(made, LOST, 66.0)
    late = rows & (made.recording.time > 61.5) & (made.recording.time < 64)
    pulls = made.truth["adhesion_fl"]
    expected = 0.1 + 0.4 * (pulls[-1] - pulls[0])
    assert np.mean(estimates["slip_fl"][late]) == pytest.approx(expected, abs=0.003)


def test_the_usual_slip_is_learned_from_a_slow_receiver_as_well() -> None:
    """Of one second a value; rows of the wheels come twenty times as often."""
    made = drive(100.0, rate=20.0, slip=lambda t: 0.25 + 0 * t)
    channels = dict(made.recording.channels)
    channels["ground_speed"] = np.where(
        np.arange(len(made.recording)) % 20 == 0, channels["ground_speed"], np.nan
    )
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)), LOST, 100.0)
    assert np.mean(estimates["slip_fl"][rows & (made.recording.time > 90)]) > 0.2


def test_an_accelerometers_bias_does_not_drive_a_vehicle_that_stands() -> None:
    made = drive(140.0, rate=50.0, imu=True, speed=stops)
    channels = dict(made.recording.channels)
    time = made.recording.time
    channels["acceleration_x"] = channels["acceleration_x"] + 0.15 * np.clip((time - LOST) / 5, 0, 1)
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)))
    error = np.abs(estimates["ground_speed"] - made.truth["ground_speed"])[rows]
    assert np.quantile(error, 0.98) < 0.2


def test_after_a_long_stop_it_starts_at_its_own_speed() -> None:
    """Meanwhile nothing measured but the accelerometer, whose sum of noise and bias is no speed."""

    def stop(t: Any) -> Any:
        return 0.6 * np.where(
            t < 72, np.clip(t / 2, 0, 1) * np.clip((72 - t) / 2, 0, 1), np.clip((t - 118) / 2, 0, 1)
        )

    made = drive(140.0, rate=50.0, imu=True, speed=stop)
    channels = dict(made.recording.channels)
    channels["acceleration_x"] = channels["acceleration_x"] + 0.15 * (made.recording.time > LOST)
    estimates, rows = lost(replace(made, recording=replace(made.recording, channels=channels)))
    error = np.abs(estimates["ground_speed"] - made.truth["ground_speed"])
    assert np.max(error[rows & (made.recording.time > 118)]) < 0.1


@pytest.mark.parametrize("imu", [True, False])
def test_ten_seconds_of_spinning_hardly_move_the_usual_slip(imu: bool) -> None:
    def spins(t: Any) -> Any:
        return 0.1 + 0.6 * ((t > LOST - 10) & (t < LOST))

    made = drive(140.0, rate=20.0, imu=imu, slip=spins, speed=lambda t: 0.6 * (1 - spins(t)) / 0.9)
    estimates, rows = lost(made)
    late = rows & (made.recording.time > LOST + 40)
    assert np.mean(np.abs(estimates["slip_fl"] - made.truth["slip_fl"])[late]) < 0.05


def test_an_event_says_so() -> None:
    made = drive(140.0, rate=20.0)
    estimates, _ = lost(made)
    time, gap = made.recording.time, estimates["event"] == "gap"
    assert gap[(time > LOST + 3) & (time < BACK)].all()
    assert not gap[(time < LOST + 2) | (time > BACK + 0.1)].any()
    assert all(np.isfinite(estimates[f"adhesion_{w}"][gap]).all() for w in WHEELS)
    (only,) = events(estimates)
    assert (only.kind, "no ground speed" in only.why) == ("gap", True)


def test_a_stop_meanwhile_is_a_standstill() -> None:
    made = drive(140.0, rate=20.0, speed=stops)
    estimates, _ = lost(made)
    phase, time = made.recording.time % 20, made.recording.time
    stands = (time > LOST + 3) & (time < BACK) & (phase > 14) & (phase < 19)
    assert np.mean(estimates["event"][stands] == "standstill") > 0.95


@pytest.mark.parametrize("torques", [True, False])
@pytest.mark.parametrize("lost_channel", ["ground_speed", "wheel_speed_fl"])
def test_a_sensor_lost_while_driving_does_not_drive_a_vehicle_that_stands(
    lost_channel: str, torques: bool
) -> None:
    """From 9 s on nothing is measured of it; the stop begins at 12 s and lasts 8 s. Its last value was that of a vehicle at speed."""
    made = drive(40.0, rate=20.0, speed=stops)
    time, channels = made.recording.time, dict(made.recording.channels)
    channels[lost_channel] = np.where((time > 9) & (time < 30), np.nan, channels[lost_channel])
    kept = {name: values for name, values in channels.items() if torques or "torque" not in name}
    estimates = estimate(replace(made.recording, channels=kept), robot())
    stands = (time > 14) & (time < 19.5)
    for name in ("ground_speed", "wheel_speed_fl"):
        error, spread = np.abs(estimates[name][stands]), estimates[f"{name}_std"][stands]
        assert np.max(error) * (1.0 if name == "ground_speed" else RADIUS) < 0.1, name
        assert np.mean(error < 1.96 * spread) > 0.92, name


def dead_reckoned(made: Drive, seed: int = 0) -> Drive:
    """From LOST to BACK the receiver has no fix: it shows its last mean, a walk of .1 m/s in 40 s, and a seventh of what happens."""
    time, speed = made.recording.time, made.recording["ground_speed"].copy()
    rows = (time > LOST) & (time < BACK)
    usual = np.mean(made.truth["ground_speed"][(time > LOST - 3) & (time <= LOST)])
    walk = (
        np.cumsum(np.random.default_rng(seed).standard_normal(rows.sum()))
        * 0.016
        * np.sqrt(time[1] - time[0])
    )
    speed[rows] = usual + walk + 0.15 * (made.truth["ground_speed"][rows] - usual)
    return replace(
        made,
        recording=replace(made.recording, channels=dict(made.recording.channels) | {"ground_speed": speed}),
    )


@pytest.mark.parametrize("imu", [True, False])
def test_a_receiver_that_reckons_without_saying_so_is_not_believed(imu: bool) -> None:
    """Its slips, .3 beside the truth in the mean, were held in 3 % of rows."""
    made = drive(160.0, rate=50.0, imu=imu, slip=soils, speed=lambda t: 0.8 + 0.4 * np.sin(t / 3))
    time, right = made.recording.time, estimate(made.recording, robot())
    wrong = estimate(dead_reckoned(made).recording, robot())
    assert held(wrong, made, (time > LOST + 5) & (time < BACK), "slip_fl") > 0.75
    fixed = (time < LOST) | (time > BACK + 10)
    assert np.median(wrong["slip_fl_std"][fixed]) < 1.1 * np.median(right["slip_fl_std"][fixed])


@pytest.mark.parametrize(("rate", "every", "after", "again"), [(50.0, 10, None, 15.0), (50.0, 1, 0.45, 45.0)])
def test_a_receiver_with_a_fix_is_believed_again(
    rate: float, every: int, after: float | None, again: float
) -> None:
    """One of 5 Hz among wheels of 50 Hz was in doubt for 80 s more, and one on other ground than before for the rest of the log."""

    def slip(t: Any) -> Any:
        return np.where((after is None) | (t < BACK), soils(t), after or 0.0)

    made = drive(200.0, rate=rate, slip=slip, speed=lambda t: 0.8 + 0.4 * np.sin(t / 3))
    rare = np.arange(len(made.recording.time)) % every > 0

    def estimated(log: Recording) -> Estimates:
        return estimate(with_values(log, "ground_speed", rare, np.nan), robot())

    wrong, right = estimated(dead_reckoned(made).recording), estimated(made.recording)
    late = made.recording.time > BACK + again
    assert np.median(wrong["slip_fl_std"][late]) < 1.1 * np.median(right["slip_fl_std"][late])


def test_the_signs_of_slips_between_two_samples_of_a_wheel_are_no_receiver_that_reckons() -> None:
    """Wheels at 4 Hz in rows of 20 Hz: while the pace changes the ground speed goes on, and a right receiver was in doubt."""
    made = drive(120.0, rate=20.0, slip=soils, speed=lambda t: 0.6 + 0.4 * np.sin(0.9 * t))
    rows = np.arange(len(made.recording.time))
    slow = Recording(
        made.recording.time,
        {
            n: np.where(rows % 5 == 0, v, np.nan) if n.startswith("wheel") else v
            for n, v in made.recording.channels.items()
        },
    )
    sampled = (rows % 5 == 0) & (rows > 200)
    wide, usual = (estimate(log, robot())["slip_fl_std"][sampled] for log in (slow, made.recording))
    assert np.mean(wide) < 1.5 * np.mean(usual)


def test_the_slip_of_a_start_is_not_believed_until_the_receiver_is_back() -> None:
    """It is computed from .1 m/s by a receiver of ±.05. A measured robot that drove .7 m/s was estimated at .2 for 4 s; here .038 m/s off
    (RMS of eight drives), now .019."""
    inside, off = [], []
    for seed in range(8):
        made = drive(
            30.0,
            rate=10.0,
            seed=seed,
            speed=lambda t: 0.7 * np.clip((t - 20) / 1.5, 0, 1),
            slip=lambda t: 0.04 + 0.3 * np.exp(-np.maximum(t - 20, 0) / 0.3),
        )
        rng = np.random.default_rng(seed)
        noisy = made.truth["ground_speed"] + 0.05 * rng.standard_normal(len(made.recording.time))
        log = made.recording.with_channels(ground_speed=noisy)
        vehicle = robot(sensors={**robot().to_dict()["sensors"], "ground_speed": 0.05})
        silent = (log.time > 20.35) & (log.time < 25)
        estimates = estimate(with_values(log, "ground_speed", silent, np.nan), vehicle)
        rows = silent & (log.time > 21)
        error = (estimates["ground_speed"] - made.truth["ground_speed"])[rows]
        inside.append(np.mean(np.abs(error) < 1.96 * estimates["ground_speed_std"][rows]))
        off.append(np.mean(error**2))
    assert np.mean(inside) > 0.92
    assert np.sqrt(np.mean(off)) < 0.03


@pytest.mark.parametrize(("imu", "torques"), [(True, True), (False, True), (False, False)])
def test_a_row_in_which_nothing_is_measured_is_as_unsure_as_those_beside_it(imu: bool, torques: bool) -> None:
    """Rows of a receiver that is silent: the interval of the row before holds on."""
    made = drive(80.0, rate=20.0, imu=imu, slip=soils)
    log = {n: v for n, v in made.recording.channels.items() if torques or "torque" not in n}
    log["ground_speed"] = np.where(made.recording.time > LOST, np.nan, log["ground_speed"])
    between = np.sort(np.r_[made.recording.time, made.recording.time[1:] - 0.025])
    own = np.isin(between, made.recording.time)
    spaced = {n: np.full(len(between), np.nan) for n in log}
    for name, values in log.items():
        spaced[name][own] = values
    spread = estimate(Recording(between, spaced), robot())["ground_speed_std"]
    late = np.flatnonzero(~own & (between > LOST + 5))
    assert np.min(spread[late] / spread[late - 1]) > 0.9


def test_a_turn_on_the_spot_is_no_speed_that_is_known() -> None:
    """The sides' rims cancel, but each slips: .05 to .2 of its own speed."""
    made = drive(80.0, rate=20.0, slip=soils)
    log, time = dict(made.recording.channels), made.recording.time
    spot = time > LOST + 5
    log["ground_speed"] = np.where(time > LOST, np.nan, log["ground_speed"])
    for wheel in WHEELS:
        side = -1.0 if wheel.endswith("l") else 1.0
        log[f"wheel_speed_{wheel}"] = np.where(spot, side * 3.0, log[f"wheel_speed_{wheel}"])
    bare = {n: v for n, v in log.items() if "torque" not in n}
    spread = estimate(Recording(time, bare), robot())["ground_speed_std"]
    rim = 3.0 * RADIUS
    assert np.min(spread[spot & (time > LOST + 8)]) > 0.03 * rim


def test_rims_that_change_from_row_to_row_are_of_no_certain_instant() -> None:
    """Speeds alone at 1 Hz, the rims' of any instant within half a second; steady as long as the receiver speaks."""
    draws, time = np.random.default_rng(3), np.arange(600.0)

    def speed(t: Any) -> Any:
        return 2 - 0.75 * (t > 10) * np.clip(np.sin((t % 20) * np.pi / 5), 0, 1) * (t % 20 < 5)

    rims = speed(time + draws.random(600) - 0.5) / 0.95 / RADIUS
    log = {f"wheel_speed_{w}": rims + 0.03 * draws.standard_normal(600) for w in WHEELS}
    silent = (time % 20 < 5) & (time > 10)
    log["ground_speed"] = np.where(silent, np.nan, speed(time) + 0.02 * draws.standard_normal(600))
    estimates = estimate(Recording(time, log), robot())
    late = silent & (time % 20 >= 2)
    error = np.abs(estimates["ground_speed"] - speed(time))[late]
    assert np.mean(error < 1.96 * estimates["ground_speed_std"][late]) > 0.75

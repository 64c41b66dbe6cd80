"""The warning of immobilization and `stuck` on drives of known slip: what must warn, what must not, and when they begin and end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drives import RADIUS, WHEELS, begins, drive, robot, steady_rims
from terragrip.estimation import Estimates, estimate, estimator
from terragrip.estimation.settings import watch_limits
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from test_warning_signs import shifted

LIMITS = watch_limits(RADIUS)


def warned(log: Recording, vehicle: Vehicle | None = None) -> Any:
    return begins(estimate(log, vehicle or robot()), "immobilization")


def stuck(log: Recording, vehicle: Vehicle | None = None) -> Any:
    return begins(estimate(log, vehicle or robot()), "stuck")


def receiver(deviation: float) -> Vehicle:
    """The robot with a ground speed of that SD [m/s]."""
    return robot(sensors={"wheel_speed": 0.03, "ground_speed": deviation, "drive_torque": 1.0})


def rising(rate: float, start: float = 25.0) -> Any:
    return lambda t: 0.06 + np.minimum(rate * np.clip(t - start, 0, None), 0.8)


# --- what warns


def test_slip_that_rises_warns_sooner_where_the_leading_wheels_lose_adhesion() -> None:
    log = steady_rims(rising(0.1), 30.0, pull_known=True)
    alone, with_balance = warned(log), warned(shifted(log, lambda t: 0.25 * np.clip(t - 25, 0, 1)))
    assert 25 < with_balance[0] < alone[0]


def test_a_larger_vehicle_is_given_more_time() -> None:
    log = steady_rims(rising(0.2), 30.0)
    small, large = (warned(log, robot(wheelbase=length)) for length in (0.16, 2.5))
    assert small[0] < large[0]


def test_rims_that_gain_while_the_vehicle_loses_speed_are_no_command() -> None:
    """The motors run up as the wheels lose their hold."""
    log = steady_rims(
        lambda t: 0.1 + 0.8 * np.clip(t - 24, 0, 1),
        26.0,
        rim=lambda t: 0.22 * (1 + 0.15 * np.clip(t - 24, 0, 1)),
    )
    assert 24 < warned(log)[0] < 24.8


# --- what does not


def test_a_steady_drive_and_a_short_hit_are_no_warning() -> None:
    assert not len(warned(steady_rims(lambda t: 0.06 + 0.12 * ((t > 25) & (t < 25.3)), 30.0)))


def test_a_start_from_rest_with_much_slip_is_no_warning() -> None:
    log = steady_rims(
        lambda t: np.clip(0.55 - 0.9 * (t - 1), 0.06, 0.55), 6.0, rim=lambda t: 0.8 * np.minimum(t, 1)
    )
    assert not len(warned(log))


def test_noise_of_a_slow_ground_speed_is_no_warning() -> None:
    """At .3 m/s slip has an SD of .12."""
    log = steady_rims(lambda t: 0.06 + 0 * t, 600.0, 5.0, rim=lambda t: 0.3 + 0 * t)
    noise = np.random.default_rng(5).normal(0, 0.036, len(log.time))
    noisy = log.with_channels(ground_speed=log["ground_speed"] + noise)
    assert not len(warned(noisy, receiver(0.036)))


@pytest.mark.parametrize("deviation", [0.01, 0.06, 0.18])
def test_rims_tell_a_command_however_coarse_the_ground_speed_is(deviation: float) -> None:
    """Rims and vehicle 60 % faster within half a second: the most that a command takes off, slip's SD or not."""
    log = steady_rims(
        lambda t: 0.06 + 0 * t, 10.5, 10.0, rim=lambda t: 0.6 * (1 + 1.2 * np.clip(t - 9.9, 0, 0.5))
    )
    table = estimate(log, receiver(deviation))
    assert table["warning_command"][-1] == pytest.approx(-2 * LIMITS["most"])


def test_a_vehicle_that_stands_at_once_is_stuck_without_a_warning() -> None:
    log = steady_rims(lambda t: np.where(t < 25, 0.06, 0.999), 27.0)
    assert not len(warned(log))
    assert len(stuck(log)) == 1


# --- stuck


def test_a_start_is_not_stuck_before_the_wheels_made_half_a_turn() -> None:
    log = steady_rims(lambda t: 0.999 + 0 * t, 6.0, 10.0, rim=lambda t: 0.2 + 0 * t)
    assert stuck(log) == pytest.approx([np.pi * RADIUS / 0.2], abs=0.2)


@pytest.mark.parametrize("deviation", [0.01, 0.09])
def test_a_ground_speed_too_coarse_to_show_going_shows_no_stuck(deviation: float) -> None:
    log = steady_rims(
        lambda t: np.where(t < 8, 0.05, 0.999), 14.0, 2.5, rim=lambda t: 0.12 + 0 * t, noise=0.01
    )
    assert len(stuck(log, receiver(deviation))) == (deviation < 0.05)


def test_stuck_comes_in_time_though_the_estimate_lags() -> None:
    """It loses its speed from 9.6 to 10 s."""
    log = steady_rims(
        lambda t: np.clip(0.1 + 0.9 * (t - 9.6) / 0.4, 0.1, 0.999),
        12.0,
        rim=lambda t: 0.45 + 0 * t,
        noise=1.0,
    )
    assert 10.2 < stuck(log)[0] <= 10.5


@pytest.mark.parametrize(
    ("silent", "travel", "event"),
    [
        (0.0, 0.3, "stuck"),  # hardly free: under four tenths of the rims
        (0.0, 0.5, ""),
        (
            1.8,
            0.3,
            "immobilization",
        ),  # what was seen more than a second and a half ago is no longer stuck; it slips by .7
    ],
)
def test_a_machine_is_stuck_until_it_comes_free_or_is_not_seen_for_long(
    silent: float, travel: float, event: str
) -> None:
    """Rims at 1 m/s; from 6 s on no ground speed for so long, and then that."""
    log = steady_rims(
        lambda t: np.where(t < 2, 0.05, np.where(t < 6, 0.98, 1 - travel)),
        8.5,
        20.0,
        rim=lambda t: 1.0 + 0 * t,
    )
    seen = np.where((log.time > 6) & (log.time < 6 + silent), np.nan, log["ground_speed"])
    table = estimate(log.with_channels(ground_speed=seen), robot())
    assert table["event"][np.searchsorted(table.time, 5.9)] == "stuck"
    assert table["event"][-1] == event


@pytest.mark.parametrize("warns", [True, False])
def test_after_a_warning_a_vehicle_that_may_stand_is_stuck(
    warns: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """.18 ± .11 of the rims' speed is not certainly under a tenth of it: a stop after a warning, else perhaps a start."""
    made_by = estimator.settings_of

    def settings_of(*args: Any, **more: Any) -> Any:
        made = made_by(*args, **more)
        made.watch.warn = made.watch.warn if warns else 99.0
        return made

    monkeypatch.setattr(estimator, "settings_of", settings_of)
    log = steady_rims(
        lambda t: 0.05 + np.minimum(0.3 * np.clip(t - 8, 0, None), 0.77),
        16.0,
        10.0,
        rim=lambda t: 1.0 + 0 * t,
    )
    table = estimate(log, receiver(0.15))
    assert len(begins(table, "immobilization")) == warns
    assert (table["event"][-1] == "stuck") == warns


# --- one drive with everything


def slip(t: Any) -> Any:
    """Up to 76 % from 15 to 18 s, back again from there to 23 s."""
    return 0.06 + 0.7 * np.clip(np.minimum((t - 15) / 3.0, (23 - t) / 5.0), 0, 1)


@pytest.fixture(scope="module")
def table() -> Estimates:
    """A soft spot that is left behind, wheels that lock from 25 to 28 s, a stop from 35 s, wheels that spin from 38 s on,
    and from 41 s on a slide back while they do."""
    log = drive(42.0, rate=50.0, noise=0.3, slip=slip, speed=lambda t: 0.55 * (1 - slip(t))).recording
    time = log.time
    locked, standing, spinning = (time > 25) & (time < 28), (time > 35) & (time < 38), time >= 38
    slide = np.where(time > 41, -1.2, 0.0)
    changed = {"ground_speed": np.where(time < 35, log["ground_speed"], slide), "pitch": np.zeros(len(time))}
    for wheel in WHEELS:
        speed, torque = log[f"wheel_speed_{wheel}"], log[f"drive_torque_{wheel}"]
        cases = [locked, standing, spinning]
        changed[f"wheel_speed_{wheel}"] = np.select(cases, [0.67 * speed, 0.0, 2.0 / RADIUS], speed)
        changed[f"drive_torque_{wheel}"] = np.select(cases, [-torque, 0.0, 30.0], torque)
    return estimate(log.with_channels(**changed), robot())


def spell(table: Estimates, kind: str) -> tuple[int, int]:
    """The first row of an event's first spell and the row behind it."""
    has = table["event"] == kind
    first = int(np.argmax(has))
    assert has[first]
    return first, first + int(np.argmin(has[first:]))


def test_a_warning_begins_above_its_limit_and_ends_below_half_of_it(table: Estimates) -> None:
    first, behind = spell(table, "immobilization")
    assert 15 < table.time[first] < 17
    assert table["warning"][first - 1] <= LIMITS["warn"] < table["warning"][first]
    assert (table["warning"][first:behind] > LIMITS["warn"] / 2).all()
    assert table["warning"][behind] <= LIMITS["warn"] / 2


def test_wheels_that_lock_warn_of_nothing(table: Estimates) -> None:
    locked = (table.time > 25) & (table.time < 34)
    assert not np.isin(table["event"][locked], ["immobilization", "stuck"]).any()


def test_wheels_that_spin_after_a_stop_are_stuck_after_half_a_second(table: Estimates) -> None:
    first, behind = spell(table, "stuck")
    assert table.time[first] == pytest.approx(38.0 + LIMITS["stuck_duration"], abs=0.03)
    assert table.time[behind - 1] == pytest.approx(41.0, abs=0.3)  # what slides back is not stuck

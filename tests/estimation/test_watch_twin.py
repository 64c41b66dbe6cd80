"""The warning of immobilization over all that a log can hold: the kernel and its Python twin, row by row."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drives import RADIUS, WHEELS, drive, robot
from kernel_twin.immobilization import Row, Watch, pace, rows_of, undisputed
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.engine import SIGNS
from terragrip.estimation.noise import DELAY
from terragrip.estimation.settings import watch_limits
from terragrip.recording import Recording


def slip(t: Any) -> Any:
    """Up to 76 % from 15 to 18 s, back again from there to 23 s."""
    return 0.06 + 0.7 * np.clip(np.minimum((t - 15) / 3.0, (23 - t) / 5.0), 0, 1)


def eventful() -> Recording:
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
    return log.with_channels(**changed)


def watched(log: Recording) -> tuple[Recording, Estimates]:
    log = log.with_channels(angular_velocity_z=np.zeros(len(log.time)))
    with (
        undisputed()
    ):  # the twin reads spreads, of which the kernel leaves the delay and an unseen turn out, too
        return log, estimate(log, robot(), sensors={DELAY: 0.0})


@pytest.fixture(scope="module")
def table() -> tuple[Recording, Estimates]:
    return watched(eventful())


@pytest.fixture(scope="module")
def blind() -> tuple[Recording, Estimates]:
    """Nothing tells the slope."""
    log = eventful()
    return watched(Recording(log.time, {name: x for name, x in log.channels.items() if name != "pitch"}))


def spell(table: Estimates, kind: str) -> tuple[int, int]:
    """The first row of an event's first spell and the row behind it."""
    has = table["event"] == kind
    first = int(np.argmax(has))
    assert has[first]
    return first, first + int(np.argmin(has[first:]))


@pytest.mark.parametrize("drive", ["table", "blind"])
def test_kernel_and_twin_say_the_same_of_every_row(drive: str, request: pytest.FixtureRequest) -> None:
    log, result = request.getfixturevalue(drive)
    limits = watch_limits(RADIUS)
    watch, events, points, score = Watch(limits, pace(result.vehicle, limits), RADIUS), [], [], []
    rows = rows_of(result, np.isfinite(log["ground_speed"]))
    for row in rows:
        events.append(watch.update(row))
        points.append(watch.points)
        score.append(watch.score)
    known = np.array([row.slip for row in rows])
    assert np.nanmin(known) == -0.2  # as deep as wheels are watched that slip the other way
    assert np.isnan(known).any()
    watched = ("immobilization", "stuck")
    assert events == [one if one in watched else "" for one in result["event"]]
    np.testing.assert_allclose(score, result["warning"], atol=1e-9)
    for k, sign in enumerate(SIGNS):
        np.testing.assert_allclose(np.array(points)[:, k], result[f"warning_{sign}"], atol=1e-9)


@pytest.mark.parametrize("work", [0.15, 0.17])
def test_kernel_and_twin_warn_in_the_same_row_of_a_slip_that_rises_slowly(work: float) -> None:
    """From the slip at which the machine works, in 8 s to .7 more: what is surely beyond it decides, and not the score."""

    def rises(t: Any) -> Any:
        return work + 0.7 * np.clip((t - 20) / 8, 0, 1)

    made = drive(24.0, rate=20.0, noise=0.3, slip=rises, speed=lambda t: 0.6 * (1 - rises(t))).recording
    channels = {name: x for name, x in made.channels.items() if name != "drawbar_force"}
    log, result = watched(Recording(made.time, channels))
    limits = watch_limits(RADIUS)
    watch = Watch(limits, pace(result.vehicle, limits), RADIUS)
    events = [watch.update(row) for row in rows_of(result, np.isfinite(log["ground_speed"]))]
    assert events.index("immobilization") == np.argmax(result["event"] == "immobilization")


def test_a_warning_begins_above_its_limit_and_ends_below_half_of_it(
    table: tuple[Recording, Estimates],
) -> None:
    _, result = table
    first, behind = spell(result, "immobilization")
    warn = watch_limits(RADIUS)["warn"]
    assert result["warning"][first - 1] <= warn < result["warning"][first]
    assert (result["warning"][first:behind] > warn / 2).all()
    assert result["warning"][behind] <= warn / 2


def test_wheels_that_spin_after_a_stop_are_stuck_after_half_a_second(
    table: tuple[Recording, Estimates],
) -> None:
    _, result = table
    first, _ = spell(result, "stuck")
    assert result.time[first] == pytest.approx(38.0 + watch_limits(RADIUS)["stuck_duration"], abs=0.03)


def test_what_slides_back_over_its_spinning_wheels_is_not_stuck(table: tuple[Recording, Estimates]) -> None:
    _, result = table
    _, behind = spell(result, "stuck")
    assert result.time[behind - 1] == pytest.approx(41.0, abs=0.3)


@pytest.mark.parametrize(
    ("after", "travel", "event"),
    [
        (1.0, 0.3, "stuck"),  # hardly free: under four tenths of the rims
        (1.0, 0.5, ""),
        (2.0, 0.3, ""),  # what was seen more than a second and a half ago counts no more
        (2.0, 0.02, ""),
    ],
)
def test_a_machine_is_stuck_until_it_comes_free_or_is_not_seen_for_long(
    after: float, travel: float, event: str
) -> None:
    """Rims at 1 m/s: for half a second, and half a turn of a wheel of .2 m, they must make no way."""
    watch = Watch(watch_limits(RADIUS), 1.0, RADIUS)

    def row(time: float, travel: float) -> Row:
        return Row(time, 1 - travel, 0.01, 1.0, 0.3, 0.3, 0.1, 1.0, travel, travel_deviation=0.001)

    events = [watch.update(row(0.125 * k, 0.02)) for k in range(17)]
    first = events.index("stuck")
    assert 0.125 * first == pytest.approx(max(0.5, np.pi * RADIUS), abs=0.13)
    assert set(events[first:]) == {"stuck"}
    assert watch.update(row(2.0 + after, travel)) == event


@pytest.mark.parametrize("warned", [True, False])
def test_after_a_warning_a_vehicle_that_may_stand_is_stuck(warned: bool) -> None:
    """.15 ± .1 of the rims' speed is not certainly under a tenth of it: a stop after a warning, else perhaps a start."""
    limits = watch_limits(RADIUS)
    watch = Watch(limits if warned else limits | {"warn": 99.0}, 1.0, RADIUS)
    events = []
    for k in range(60):
        slip = min(0.05 + 0.3 * max(0.1 * k - 3.0, 0.0), 0.85)
        row = Row(0.1 * k, slip, 0.02, 1.0, 0.3, 0.3, 0.1, 1.0, 1 - slip, travel_deviation=0.1)
        events.append(watch.update(row))
    assert ("immobilization" in events) == warned
    assert (events[-1] == "stuck") == warned

"""Each sign of the warning of immobilization on a drive that shows it: its points as docs/events.md defines them, in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drives import GRAVITY, RADIUS, Drive, begins, drive, robot, steady_rims
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.engine import SIGNS
from terragrip.estimation.noise import DELAY
from terragrip.estimation.settings import watch_limits
from terragrip.recording import Recording

LIMITS = watch_limits(RADIUS)
UNIT = LIMITS["pace"] * np.sqrt(0.638 / GRAVITY)
LAG = 0.9 * UNIT
"""s by which a mean over the unit of time is behind one over a tenth of it, where something rises steadily."""


def exactly(log: Recording | Drive) -> Estimates:
    """Without the delay's part of the SDs, which the warning leaves out."""
    return estimate(log if isinstance(log, Recording) else log.recording, robot(), sensors={DELAY: 0.0})


def later(start: float, rate: float) -> Any:
    """What rises from an instant on."""
    return lambda t: rate * np.clip(t - start, 0, None)


def deviation_before(table: Estimates, time: float) -> float:
    """SD of slip before it rises: what the filter has not followed yet adds to it later, which the warning leaves out."""
    return float(table["slip_fl_std"][np.searchsorted(table.time, time) - 1])


def test_rising_slip() -> None:
    more = later(20.0, 0.02)
    table = exactly(steady_rims(lambda t: 0.05 + more(t), 26.0, noise=0.01, pull_known=True))
    expected = 0.02 * LAG / np.hypot(LIMITS["change"], deviation_before(table, 20.0))
    assert table["warning_rise"][-1] == pytest.approx(expected, rel=0.1)


def test_high_slip() -> None:
    table = exactly(steady_rims(lambda t: 0.4 + 0 * t, 20.0, noise=0.0, pull_known=True))
    point = np.hypot(LIMITS["high_slip"] / LIMITS["most"], table["slip_fl_std"][-1])
    expected = (0.4 - LIMITS["high_slip"]) / point
    assert table["warning_high_slip"][-1] == pytest.approx(expected, rel=0.05)
    points = sum(float(table[f"warning_{sign}"][-1]) for sign in SIGNS)
    assert table["warning"][-1] == pytest.approx(points, abs=0.01)  # what stays is its own low-pass


def test_slip_is_by_the_newest_reading_of_a_slow_receiver_and_as_unsure_as_that() -> None:
    """At 2 Hz with a stated SD of .1 m/s, rims at .6 m/s: the estimate follows half of what the reading leaps by."""
    noise = 0.1
    log = steady_rims(lambda t: 0.1 + 0 * t, 20.6, 20.0, noise=0.0, pull_known=True)
    reading = np.where(log.time < 20.25, 0.54, 0.24)
    reading[np.arange(len(reading)) % 10 != 0] = np.nan
    table = estimate(
        log.with_channels(ground_speed=reading), robot(), sensors={DELAY: 0.0, "ground_speed": noise}
    )
    expected = (0.6 - LIMITS["high_slip"]) / np.hypot(LIMITS["high_slip"] / LIMITS["most"], noise / 0.6)
    assert table["warning_high_slip"][-1] == pytest.approx(expected, rel=0.1)
    assert table["slip_fl"][-1] < 0.5


def rising_resistance() -> Drive:
    """By .005 of the weight a second from 20 s on."""
    more = later(20.0, 0.005)
    return drive(26.0, noise=0.0, imu=True, slip=lambda t: 0.1 + 0 * t, speed=lambda t: 0.5 + 0 * t,
                 resistance=lambda t: 0.08 + more(t))  # fmt: skip


def test_rising_resistance() -> None:
    table = exactly(rising_resistance())
    expected = 0.005 * LAG / np.hypot(LIMITS["resistance"], table["soil_resistance_std"][-1])
    assert expected < table["warning_resistance"][-1] < 0.005 * LAG / LIMITS["resistance"]


@pytest.mark.parametrize(("gain", "off"), [(0.03, 0.03), (-0.06, 0.03), (0.5, np.inf)])
def test_a_command_takes_points_off_and_a_slower_one_half_as_many(gain: float, off: float) -> None:
    """Rims and vehicle together by so much a second, relative."""
    table = exactly(
        drive(
            22.5,
            noise=0.0,
            imu=True,
            slip=lambda t: 0.1 + 0 * t,
            speed=lambda t: 0.5 * np.exp(gain * np.clip(t - 18, 0, None)),
        )
    )
    expected = min(off * LAG / LIMITS["command"], 2 * LIMITS["most"])
    assert table["warning_command"][-1] == pytest.approx(-expected, rel=0.06)


def test_a_start_takes_points_off_for_no_longer_than_another_command() -> None:
    """From rest to .5 m/s in a second: all points off at its end, and as those of any low-pass they fade within units of time."""
    table = exactly(drive(18.0, noise=0.0, imu=True, speed=lambda t: 0.5 * np.clip(t - 10, 0, 1)))
    at = {units: int(np.searchsorted(table.time, 11.0 + units * UNIT)) for units in (0, 1, 2)}
    assert table["warning_command"][at[0]] == pytest.approx(-2 * LIMITS["most"])
    for units in (1, 2):
        most = (
            2 * LIMITS["most"] * np.exp(0.4 - units)
        )  # the signal itself is a mean over a tenth of the unit
        assert 0 < -table["warning_command"][at[units]] < most


def balance(table: Estimates, row: int) -> Any:
    """Of the leading wheels' adhesion against the trailing ones', and its SD by finite differences."""
    front, rear = (0.5 * (table[f"adhesion_{a}l"][row] + table[f"adhesion_{a}r"][row]) for a in "fr")
    spread = np.sqrt(sum(table[f"adhesion_{w}_std"][row] ** 2 for w in ("fl", "fr", "rl", "rr")) / 8)

    def share(a: float, b: float) -> float:
        return (a - b) / (a + b + 0.1)

    by_front, by_rear = (
        share(front + 1e-6, rear) - share(front, rear),
        share(front, rear + 1e-6) - share(front, rear),
    )
    return share(front, rear), np.hypot(by_front, by_rear) / 1e-6 * spread


def shifted(log: Recording, share: Any) -> Recording:
    """So much of the front wheels' torque moves to the rear ones."""
    torque = {w: log[f"drive_torque_{w}"] for w in ("fl", "fr", "rl", "rr")}
    for front, rear in (("fl", "rl"), ("fr", "rr")):
        moved = share(log.time) * torque[front]
        torque[front], torque[rear] = torque[front] - moved, torque[rear] + moved
    return log.with_channels(**{f"drive_torque_{w}": x for w, x in torque.items()})


def test_leading_wheels_that_lose_adhesion_to_the_trailing_ones() -> None:
    level = steady_rims(lambda t: 0.1 + 0 * t, 22.0, noise=0.0, pull_known=True)
    table = exactly(shifted(level, lambda t: 0.1 * np.clip(t - 20, 0, 1)))
    before, after = (int(np.searchsorted(table.time, t)) for t in (19.9, 21.99))
    (usual, _), (now, deviation) = balance(table, before), balance(table, after)
    expected = (usual - now) / np.hypot(LIMITS["change"], deviation)
    assert table["warning_leading"][after] == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("work", [0.15, 0.17])
def test_slip_that_rises_slowly_warns_once_it_will_surely_be_far_beyond_its_usual(work: float) -> None:
    """From the slip at which the machine works, in 8 s to .7 more: by the columns, the row in which that is so."""
    rises = later(20.0, 0.7 / 8)
    table = exactly(steady_rims(lambda t: work + rises(t), 24.0, 20.0, noise=0.01))
    slip, deviation = work + rises(table.time), deviation_before(table, 20.0)
    rise = table["warning_rise"] * np.hypot(LIMITS["change"], deviation)
    least = np.maximum(LIMITS["ahead"], LIMITS["beyond"] * table["warning_usual_slip"])
    far = (slip - deviation + rise > least) & (table.time > 20)
    assert (table["warning"][far] > LIMITS["warn"]).all()
    assert begins(table, "immobilization")[-1] == pytest.approx(table.time[np.argmax(far)], abs=0.2 * UNIT)


def test_where_one_axle_drives_no_leading_wheels_lose_adhesion_to_others() -> None:
    """Adhesion of the front wheels alone, by turns above and below 0."""
    log = steady_rims(lambda t: 0.05 * np.cos(t / 2), 20.0, 20.0, noise=0.0, pull_known=True)
    front = {n: v for n, v in log.channels.items() if not n.startswith("drive_torque_r")}
    axles = robot().to_dict()["axles"]
    vehicle = robot(axles={**axles, "rear": {**axles["rear"], "driven": False}})
    table = estimate(Recording(log.time, front), vehicle)
    assert table["adhesion_fl"].min() < -0.05 < 0.05 < table["adhesion_fl"].max()
    assert not table["warning_leading"].any()


def test_how_large_an_unmeasured_pull_may_be_changes_no_warning() -> None:
    """A pull that stays is in no rise of the resistance, whatever it is."""
    harder = later(12.0, 0.015)
    log = steady_rims(
        lambda t: 0.1 + 3 * np.minimum(harder(t), 0.1),
        20.0,
        20.0,
        noise=1.0,
        resistance=lambda t: 0.08 + harder(t),
    )
    of_none, of_some = (
        estimate(log, robot(uncertainty={"drive_torque_gain": 0.02, "drawbar_force": pull}), held={})
        for pull in (0.0, 250.0)
    )
    under_way = log.time > 8  # at first the resistance itself is unknown
    assert of_none["warning"].max() > 3
    np.testing.assert_allclose(of_some["warning"][under_way], of_none["warning"][under_way], atol=0.01)


def test_how_uncertain_a_torque_gain_is_changes_no_warning() -> None:
    """What lasts is in no rise of the resistance: twenty times the gain's SD, the same points."""
    log = rising_resistance().recording
    sure, unsure = (estimate(log, robot(uncertainty={"drive_torque_gain": sd})) for sd in (0.005, 0.1))
    assert unsure["soil_resistance_std"][-1] > 1.5 * sure["soil_resistance_std"][-1]
    assert sure["warning_resistance"][-1] > 0.3
    np.testing.assert_allclose(unsure["warning_resistance"], sure["warning_resistance"], rtol=1e-6)

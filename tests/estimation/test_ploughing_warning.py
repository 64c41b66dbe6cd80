"""A tool that comes in raises slip as digging in does: it warns while the machine has not shown that it works at such slip. And `stuck`
of slow receivers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drives import GRAVITY, RADIUS, begins, robot, steady_rims
from terragrip.estimation import Estimates, estimate
from terragrip.estimation.settings import watch_limits
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

WORK, TURN, DIGS, STOPS = 10.0, 6.0, 115.0, 119.0


def ploughing(t: Any) -> Any:
    """Slip of .04 in turns and of .22 with the tool in, which comes in within 1.5 s; at the end the wheels dig themselves in."""
    since = np.mod(t - TURN, WORK + TURN)
    tool = np.clip(since / 1.5, 0, 1) * np.clip(WORK + 1 - since, 0, 1) * (t > TURN)
    work = np.where(t < DIGS - WORK, 0.04 + 0.18 * tool, 0.22)
    return np.where(t < DIGS, work, 0.22 + 0.75 * np.clip((t - DIGS) / (STOPS - DIGS), 0, 1) ** 2)


def unseen_pull(slip: Any, seconds: float, rate: float, since: float = 0.0) -> Estimates:
    """Estimates of a drive with steady rims and no drawbar cell, whose clock begins at ``since`` [s]."""
    log = steady_rims(slip, seconds, rate)
    return estimate(Recording(log.time + since, log.channels), robot())


def test_the_slip_at_which_a_machine_works_warns_no_more_and_digging_in_from_it_does() -> None:
    warnings = begins(unseen_pull(ploughing, 125.0, 10.0), "immobilization")
    assert not ((warnings > 3 * (WORK + TURN)) & (warnings < DIGS)).any()
    assert ((warnings > DIGS) & (warnings < STOPS - 0.5)).any()


@pytest.mark.parametrize("rate", [3.0, 5.0])
@pytest.mark.parametrize("since", [0.0, 1000.1, 1.7e9])
def test_stuck_comes_within_half_a_second_whatever_the_clock(rate: float, since: float) -> None:
    """Half a second from 3 or 5 Hz ends between two samples: which one decided was how their times were rounded."""
    stop = 20.05
    estimates = unseen_pull(lambda t: np.where(t < stop, 0.1, 0.99), 25.0, rate, since)
    first = begins(estimates, "stuck")[0] - since
    seen = np.ceil(stop * rate) / rate
    assert first == pytest.approx(seen + 1 / rate * (rate == 5), abs=0.01)
    assert first <= stop + 0.5


@pytest.mark.parametrize(
    ("before", "after", "seconds", "memory"),
    [(0.05, 0.2, 3.0, 6), (0.2, 0.05, 40.0, 96), (-0.1, -0.1, 3.0, 6)],
)
def test_more_slip_is_soon_usual_and_less_is_not(
    before: float, after: float, seconds: float, memory: float
) -> None:
    """As docs/events.md has it, in units of time, and never faster than within the age of what was seen."""
    unit = watch_limits(RADIUS)["pace"] * np.sqrt(0.638 / GRAVITY)
    change = 130.0
    usual = unseen_pull(lambda t: np.where(t < change, before, after), change + seconds, 10.0)[
        "warning_usual_slip"
    ]
    expected = after + (before - after) * np.exp(-seconds / (memory * unit))
    assert usual[-1] == pytest.approx(expected, abs=0.02)


def test_the_unit_of_time_of_a_machine_of_one_axle_is_that_of_three_wheel_radii() -> None:
    """Speeds alone; the slip's usual as above, by the unit."""
    radius, change, seconds = 0.3, 130.0, 3.0
    time = np.arange(0, change + seconds, 0.1)
    noise = np.random.default_rng(0).normal(0, 0.003, (3, len(time)))
    slip = np.where(time < change, 0.05, 0.2)
    channels = {"ground_speed": 1 - slip + noise[0]}
    channels |= {f"wheel_speed_{w}": (1 + more) / radius for w, more in zip("lr", noise[1:], strict=True)}
    axles = {"only": {"mass": 60.0, "wheels": ["l", "r"]}}
    machine = Vehicle.from_dict({"mass": 60.0, "axles": axles, "wheel": {"radius": radius, "inertia": 0.1}})
    usual = estimate(Recording(time, channels), machine)["warning_usual_slip"]
    limits = watch_limits(radius)
    memory = limits["soon"] * limits["pace"] * np.sqrt(3 * radius / GRAVITY)
    assert usual[-1] == pytest.approx(0.2 - 0.15 * np.exp(-seconds / memory), abs=0.01)


def test_stuck_comes_half_a_second_after_the_last_sample_that_shows_it_free() -> None:
    first = begins(unseen_pull(lambda t: np.where(t < 20.05, 0.1, 0.99), 25.0, 8.0), "stuck")[0]
    assert first == pytest.approx(20.0 + 0.5, abs=0.01)

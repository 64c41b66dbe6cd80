"""Load that a stiff chassis shifts from one diagonal to the other is no adhesion; what axles and sides do differently is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.estimation.drives import BEARING, MASS, RADIUS, TIRE, WHEELS, Drive, drive, robot

from terragrip.estimation import Estimates, estimate
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("unchecked")

WEIGHT = MASS * 9.81 / 4
AXLES = ("front", "front", "rear", "rear")
LAYOUT = {"diagonal": (1, -1, -1, 1), "side": (1, -1, 1, -1), "axle": (1, 1, -1, -1)}


def shifted(pattern: str, by: NDArray[np.float64]) -> Drive:
    """The drive with wheel loads that differ by a pattern, ``by`` (n,) of a quarter of the weight; nothing but torque tells."""
    plain = drive(20.0)
    channels = dict(plain.recording.channels)
    for wheel, sign in zip(WHEELS, LAYOUT[pattern], strict=True):
        force = (plain.truth[f"adhesion_{wheel}"] + TIRE) * sign * by * WEIGHT
        channels[f"drive_torque_{wheel}"] = channels[f"drive_torque_{wheel}"] + RADIUS * force
    return replace(plain, recording=replace(plain.recording, channels=channels))


def swing(made: Drive, pattern: str, machine: Vehicle | None = None) -> float:
    """SD of the pattern in the estimated adhesions over their mean, after the first 5 s."""
    estimates, late = estimate(made.recording, machine or robot()), made.recording.time > 5
    mu = np.stack([estimates[f"adhesion_{w}"][late] for w in WHEELS])
    return float(np.std(np.array(LAYOUT[pattern]) @ mu / 4) / np.mean(mu))


def bumps(made: Drive) -> NDArray[np.float64]:
    """30 % to and fro, once on four wheel radii of way."""
    return np.asarray(0.3 * np.sin(2 * np.pi * 0.6 * made.recording.time / (4 * RADIUS)))


def test_of_a_diagonals_bumps_little_is_left() -> None:
    by = bumps(drive(20.0))
    assert swing(shifted("diagonal", by), "diagonal") < 0.25 * np.std(by)


def test_no_diagonal_is_a_load_where_an_axle_pivots() -> None:
    """Three supports carry any ground alike: a tractor's adhesions that differ by diagonal counted as loads, R² was .97 for .99."""
    by = bumps(drive(20.0))
    for pivoting in ("front", "rear"):
        axles = robot().to_dict()["axles"]
        axles[pivoting] |= {"pivots": True}
        assert swing(shifted("diagonal", by), "diagonal", robot(axles=axles)) > 0.75 * np.std(by)


@pytest.mark.parametrize("pattern", ["side", "axle"])
def test_sides_and_axles_may_differ_at_once(pattern: str) -> None:
    by = bumps(drive(20.0))
    assert swing(shifted(pattern, by), pattern) > 0.75 * np.std(by)


def test_what_a_diagonal_always_does_may_be_adhesion_or_load() -> None:
    """A rut lasts, and so does what a hill shifts: the estimate lies between them, and its interval holds either."""
    plain = drive(20.0)
    made = shifted("diagonal", np.full(len(plain.recording.time), 0.1))
    with_it, without = (estimate(one.recording, robot()) for one in (made, plain))
    late = made.recording.time > 10
    as_load, found, spread, load = (
        np.stack([one[name.format(w, axle)][late] for w, axle in zip(WHEELS, AXLES, strict=True)], axis=1)
        for one, name in (
            (without, "adhesion_{0}"), (with_it, "adhesion_{0}"), (with_it, "adhesion_{0}_std"), (with_it, "vertical_load_{1}"),
        )
    )  # fmt: skip
    pattern = np.array(LAYOUT["diagonal"])
    as_adhesion = as_load + pattern * 0.1 * WEIGHT / (load / 2) * (as_load + TIRE)
    assert 0.4 < np.mean((found - as_load) @ pattern) / np.mean((as_adhesion - as_load) @ pattern) < 0.6
    for truth in (as_load, as_adhesion):
        assert np.mean(np.abs(found - truth) < 1.96 * spread) > 0.95


def test_the_thrust_of_all_wheels_stays() -> None:
    """Shifted loads keep their sum, so soil resistance and the force of all wheels together are those without bumps."""
    made, plain = shifted("diagonal", bumps(drive(20.0))), drive(20.0)
    with_bumps, without = (estimate(one.recording, robot()) for one in (made, plain))
    late = made.recording.time > 5

    def thrust(estimates: Estimates) -> NDArray[np.float64]:
        mu = np.stack([estimates[f"adhesion_{w}"][late] for w in WHEELS])
        return np.asarray(np.array([27, 27, 42.5, 42.5]) @ mu / MASS)

    assert np.std(thrust(with_bumps) - thrust(without)) < 0.05 * np.mean(thrust(without))


def slipping(plain: Drive, gap: float = 0.0, share: float = 0.03, radii: float = 8.0) -> Drive:
    """The drive with one diagonal's wheels now a ``share`` faster, now slower, once on so many ``radii`` of way, and without any value for
    ``gap`` s of every 5 s."""
    by = share * np.sin(2 * np.pi * 0.6 * plain.recording.time / (radii * RADIUS))
    channels = dict(plain.recording.channels)
    for wheel, sign in zip(WHEELS, LAYOUT["diagonal"], strict=True):
        channels[f"wheel_speed_{wheel}"] = channels[f"wheel_speed_{wheel}"] * (1 + sign * by)
    lost = plain.recording.time % 5 < gap
    channels = {name: np.where(lost, np.nan, values) for name, values in channels.items()}
    return replace(plain, recording=replace(plain.recording, channels=channels))


def told(made: Drive) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The diagonal's pattern in adhesion and in slip after 10 s, and the secant of the curve."""
    estimates, late = estimate(made.recording, robot()), made.recording.time > 10
    mu, slip = (np.stack([estimates[f"{name}_{w}"][late] for w in WHEELS]) for name in ("adhesion", "slip"))
    pattern, slips = (np.array(LAYOUT["diagonal"]) @ one / 4 for one in (mu, slip))
    return pattern, slips, float(mu.mean() / slip.mean())


def test_a_diagonal_that_slips_more_is_higher_on_the_curve() -> None:
    """Wheels share a curve: at one torque a wheel that slips more bears less, so that its adhesion is larger."""
    pattern, slips, secant = told(slipping(drive(30.0)))
    assert np.corrcoef(pattern, slips)[0, 1] > 0.7
    assert 0.2 * secant < np.std(pattern) / np.std(slips) < 0.7 * secant


def test_what_wheels_slip_one_by_one_is_no_load() -> None:
    """On soft spots, or by a tyre that yields, each wheel slips for itself, as much along and across as by the diagonal: no chassis shifts
    that. It counted as a diagonal's load, half of the secant."""
    made = drive(120.0)
    channels, radius = dict(made.recording.channels), np.arange(30)  # .3 s at .6 m/s
    for k, wheel in enumerate(WHEELS):
        drawn = np.random.default_rng(k).standard_normal(len(made.recording.time) + 29)
        by = 0.02 * np.convolve(drawn, np.sin(np.pi * radius / 29), "valid") / np.sqrt(15)
        channels[f"wheel_speed_{wheel}"] = channels[f"wheel_speed_{wheel}"] * (1 + by)
    pattern, slips, secant = told(replace(made, recording=replace(made.recording, channels=channels)))
    assert np.polyfit(slips, pattern, 1)[0] < 0.28 * secant


def test_slips_that_differ_by_half_of_what_they_are_tell_of_the_load_as_small_differences_do() -> None:
    """Wheels that slip by .1 and .3 in place of .2, on 32 radii of way, do not spin: half of the secant, as of small ones."""
    made = slipping(drive(30.0, slip=lambda t: 0.2 + 0 * t), share=0.12, radii=32)
    pattern, slips, secant = told(made)
    assert 0.45 * secant < np.std(pattern) / np.std(slips) < 0.6 * secant


def test_what_slips_tell_is_no_later_than_their_mean_over_a_quarter_of_a_radius() -> None:
    """An eighth of a radius: the adhesion of a wheel that loses load follows its slip."""
    pattern, slips, _ = told(slipping(drive(30.0)))
    here = slips[50:-50]
    late = max(range(-20, 40), key=lambda k: np.corrcoef(pattern[50 + k :][: len(here)], here)[0, 1])
    assert late / 100 * 0.6 / RADIUS < 0.125


def test_gaps_do_not_make_slips_tell_less() -> None:
    """A row whose slips are hardly known, as after a gap, says little of how well they are known as a rule."""
    plain = drive(30.0)
    without, _, _ = told(slipping(plain))
    with_gaps, _, _ = told(slipping(plain, gap=0.6))
    assert np.std(with_gaps) > 0.85 * np.std(without)


def test_wheels_that_spin_do_not_go_on_along_the_curves_tangent() -> None:
    """A diagonal spins in a hole that the vehicle leaves at a fifth of its speed: no curve bears more by the secant of the slips before."""
    made = slipping(drive(30.0))
    time, channels = made.recording.time, dict(made.recording.channels)
    slow = 1 - 0.8 * (np.clip((time - 20) / 0.5, 0, 1) - np.clip((time - 21.5) / 0.5, 0, 1))
    still = [f"wheel_speed_{w}" for w, sign in zip(WHEELS, LAYOUT["diagonal"], strict=True) if sign < 0]
    channels |= {name: channels[name] * slow for name in ("ground_speed", *still)}
    estimates = estimate(replace(made.recording, channels=channels), robot())
    mu = np.stack([estimates[f"adhesion_{w}"] for w in WHEELS])
    usual, spins = mu[:, (time > 19) & (time < 20)].mean(), (time > 20.5) & (time < 21.5)
    assert np.abs(np.array(LAYOUT["diagonal"]) @ mu[:, spins] / 4).max() < usual


def test_a_diagonals_slip_is_forgotten_as_its_wheels_roll_on() -> None:
    """The vehicle all but stops, its wheels spin on at one speed: what a diagonal slipped before says nothing of them any more."""
    plain, before = drive(30.0), slipping(drive(30.0))
    time = plain.recording.time
    stop = (
        20 + np.argmax(np.abs(told(before)[0][(time > 20)[time > 10]])) / 100
    )  # where the diagonal's adhesions differ most
    alike = time > stop
    slow = 1 - 0.85 * np.clip((time - stop) / 0.1, 0, 1)
    channels = {
        name: np.where(alike, plain.recording.channels[name], values)
        * (slow if name == "ground_speed" else 1)
        for name, values in before.recording.channels.items()
    }
    estimates = estimate(replace(before.recording, channels=channels), robot())
    pattern = np.array(LAYOUT["diagonal"]) @ np.stack([estimates[f"adhesion_{w}"] for w in WHEELS]) / 4
    at, later = np.searchsorted(time, stop), (time > stop + 0.2) & (time < stop + 0.3)
    assert np.abs(pattern[later]).max() < 0.1 * abs(pattern[at])


def test_what_a_wheel_slipped_while_it_spun_is_not_its_usual() -> None:
    """For ninety wheel radii one wheel spins; two seconds after it grips, its adhesion is that of the others."""
    plain = drive(50.0)
    time, channels = plain.recording.time, dict(plain.recording.channels)
    spins = (time > 10) & (time < 40)
    channels["wheel_speed_fl"] = channels["wheel_speed_fl"] * np.where(spins, 10.0, 1.0)
    estimates = estimate(replace(plain.recording, channels=channels), robot())
    late = time > 42
    for wheel in WHEELS:
        true = plain.truth[f"adhesion_{wheel}"][late]
        assert np.mean(np.abs(estimates[f"adhesion_{wheel}"][late] - true)) < 0.15 * np.mean(true)
        assert np.mean(estimates[f"adhesion_{wheel}_std"][late]) < 0.4 * np.mean(true)


def spinning_alone(plain: Drive) -> Drive:
    """From 20 to 25 s one wheel spins at the torque that it had, past its curve's peak."""
    time, channels = plain.recording.time, dict(plain.recording.channels)
    speed = channels["wheel_speed_fl"]
    channels["wheel_speed_fl"] = speed * np.where((time > 20) & (time < 25), 10.0, 1.0)
    channels["drive_torque_fl"] = channels["drive_torque_fl"] + RADIUS * BEARING * (
        channels["wheel_speed_fl"] - speed
    )
    return replace(plain, recording=replace(plain.recording, channels=channels))


def test_a_wheel_that_spins_alone_does_not_move_the_adhesions() -> None:
    """No load has shifted, and each wheel's force is what it was."""
    made = spinning_alone(drive(30.0))
    estimates, time = estimate(made.recording, robot()), made.recording.time
    spinning = (time > 21) & (time < 25)
    for wheel in WHEELS:
        true = made.truth[f"adhesion_{wheel}"][spinning]
        assert np.mean(np.abs(estimates[f"adhesion_{wheel}"][spinning] - true)) < 0.3 * np.mean(true)


def test_a_wheel_that_spun_alone_does_not_widen_the_rest_of_the_log() -> None:
    """What its slip hid of loads while it spun says nothing of loads once it grips."""
    made = spinning_alone(drive(40.0))
    estimates, late = estimate(made.recording, robot()), made.recording.time > 28
    for wheel in WHEELS:
        true = made.truth[f"adhesion_{wheel}"][late]
        assert np.mean(estimates[f"adhesion_{wheel}_std"][late]) < 0.3 * np.mean(true)


def test_slips_tell_the_same_where_channels_have_stamps_of_their_own() -> None:
    """Between a wheel's samples its slip is only predicted: the diagonal's adhesion goes by the measured ones."""
    made = slipping(drive(30.0, rate=25.0))
    time, channels = made.recording.time, made.recording.channels
    kinds = ("wheel", "drive", "ground", "drawbar")
    stamps = np.concatenate([time + 0.01 * k for k in range(4)])
    order = np.argsort(stamps)
    spread = {name: np.full((4, len(time)), np.nan) for name in channels}
    for name, rows in spread.items():
        rows[next(k for k, kind in enumerate(kinds) if name.startswith(kind))] = channels[name]
    apart = Recording(stamps[order], {name: rows.ravel()[order] for name, rows in spread.items()})
    together, differ = told(made)[0], told(replace(made, recording=apart))[0]
    at = np.isfinite(apart["wheel_speed_fl"])[apart.time > 10]
    assert np.std(differ[at] - together) < 0.06 * np.std(together)

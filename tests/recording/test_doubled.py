"""Wheels whose pulses count double, or by halves, for some seconds."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.doubled import doubled_warnings

TIME = 0.05 * np.arange(1200)
DRAWS = np.random.default_rng(14)
SPEED = 6 + np.sin(TIME / 5)


def log(factor: np.ndarray | float) -> Recording:
    rims = {
        f"wheel_speed_{w}": SPEED * (1 + 0.01 * DRAWS.standard_normal(len(TIME))) for w in ("fl", "fr", "rl")
    }
    return Recording(TIME, {"ground_speed": SPEED / 6, **rims, "wheel_speed_rr": factor * SPEED})


@pytest.mark.parametrize(("factor", "word"), [(2.0, "twice"), (0.5, "half")])
def test_pulses_that_count_double_for_a_while_are_named(factor: float, word: str) -> None:
    """4 s at twice the speed were a slip near .5, with its usual interval and without a word."""
    changed = log(np.where((TIME >= 30) & (TIME < 34), factor, 1.0))
    notes = [n for n in unit_warnings(changed, None) if "from one sample to the next" in n]
    assert len(notes) == 1
    assert notes[0].startswith(f"wheel_speed_rr is {word} as fast from 30 to 33.95 s as before and after")


@pytest.mark.parametrize(
    "factor",
    [
        1.0,
        np.where((TIME >= 30) & (TIME < 34), 1.7, 1.0),  # spins
        np.interp(TIME, [30, 30.2, 34, 34.2], [1, 2, 2, 1]),  # a spin takes time
        np.where((TIME >= 30) & (TIME < 34), 2 + 0.1 * np.sin(TIME * 2), 1.0),
        np.where(TIME == 30, 2.0, 1.0),  # a spike
        np.where(TIME >= 30, 2.0, 1.0),  # another scale from here on
    ],
)
def test_wheels_that_spin_are_not(factor: np.ndarray | float) -> None:
    assert doubled_warnings(log(factor)) == []


def test_all_wheels_at_once_are_a_start() -> None:
    rims = {f"wheel_speed_{w}": np.where((TIME >= 30) & (TIME < 34), 2, 1) * SPEED for w in ("l", "r")}
    assert doubled_warnings(Recording(TIME, rims)) == []


@pytest.mark.parametrize("inner", [1 / 2, 2 / 3])
@pytest.mark.parametrize("wheels", [("l", "r"), ("fl", "fr", "rl", "rr")])
def test_turns_whose_inner_wheels_are_half_as_fast_are_not(inner: float, wheels: tuple[str, ...]) -> None:
    """Of a robot that begins a turn within a sample each wheel was named, the outer ones as twice and the inner ones as half."""
    turns = (TIME >= 30) & (TIME < 34)
    left, right = (np.where(turns, part, 1.0) for part in (inner, 2 * inner))
    rims = {f"wheel_speed_{w}": left if w.endswith("l") else right for w in wheels}
    assert doubled_warnings(Recording(TIME, {"ground_speed": (left + right) / 2, **rims})) == []


def test_of_two_wheels_the_ground_shows_which_one() -> None:
    """Both were named, one as twice as fast, the other as half."""
    rims = {"wheel_speed_l": SPEED, "wheel_speed_r": np.where((TIME >= 30) & (TIME < 34), 2, 1) * SPEED}
    notes = doubled_warnings(Recording(TIME, {"ground_speed": SPEED / 6, **rims}))
    assert [note.split()[0] for note in notes] == ["wheel_speed_r"]


def test_wheels_held_at_unlike_instants_are_not() -> None:
    """A start in which one wheel's value came half a second before the others'."""
    speed = np.interp(TIME, [20.8, 20.9], [1, 2])
    at = {w: np.floor(TIME - k / 4) + k / 4 for k, w in enumerate(("fl", "fr", "rl", "rr"))}
    rims = {f"wheel_speed_{w}": np.interp(when, TIME, speed) for w, when in at.items()}
    assert doubled_warnings(Recording(TIME, rims)) == []

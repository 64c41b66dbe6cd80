"""Torques against the pull and the change of speed: their scale and their time, on a made drive (quasi-steady)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.mechanics import means_of
from terragrip.recording.torques import torque_warnings
from terragrip.vehicle import Vehicle

MASS, RADIUS, G = 900.0, 0.4, 9.80665


def vehicle() -> Vehicle:
    axles = {"front": {"mass": 400, "wheels": ["fl", "fr"]}, "rear": {"mass": 500, "wheels": ["rl", "rr"]}}
    base = {"mass": MASS, "wheelbase": 1.4, "track": 1.1, "center_of_gravity_height": 0.5, "axles": axles}
    return Vehicle.from_dict({**base, "wheel": {"radius": RADIUS, "inertia": 1}})


def working(
    *, late: float = 0.0, scale: float = 1.0, pulled: float = 1.0, cell: float = 1.0, rate: float = 20.0
) -> Recording:
    """Changing pull at 1.5 m/s with starts and slower stretches; torques ``late`` [s] and ``scale`` times as large, the cell's ``cell``."""
    rng, time = np.random.default_rng(5), np.arange(0, 180, 1 / rate)

    def thrust(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        v = 1.5 + 0.3 * np.sin(at / 7) + 0.15 * np.sin(at / 1.3)
        pull = pulled * MASS * G * (0.15 + 0.08 * np.sin(at / 11) + 0.04 * np.sin(at / 0.9))
        change = 0.3 / 7 * np.cos(at / 7) + 0.15 / 1.3 * np.cos(at / 1.3)
        return v, pull, pull + MASS * change + 0.06 * MASS * G

    (v, pull, _), (_, _, delayed) = thrust(time), thrust(time - late)
    columns = {"time": time, "ground_speed": v + 0.01 * rng.standard_normal(len(time))}
    columns["drawbar_force"] = cell * pull + 20 * rng.standard_normal(len(time))
    for wheel, share in (("fl", 0.2), ("fr", 0.2), ("rl", 0.3), ("rr", 0.3)):
        columns[f"wheel_speed_{wheel}"] = 1.05 * v / RADIUS + 0.01 * rng.standard_normal(len(time))
        columns[f"drive_torque_{wheel}"] = scale * share * delayed * RADIUS + 2 * rng.standard_normal(
            len(time)
        )
    return Recording.from_frame(columns)


def without_cell(log: Recording) -> Recording:
    return replace(log, channels={n: v for n, v in log.channels.items() if n != "drawbar_force"})


def notes_of(log: Recording) -> list[str]:
    """What is said of a log's torques."""
    return torque_warnings(log, vehicle(), means_of(log, vehicle()))


@pytest.mark.parametrize("rate", [5.0, 20.0, 100.0])
def test_a_right_log_is_left_alone(rate: float) -> None:
    assert unit_warnings(working(rate=rate), vehicle()) == []
    assert notes_of(without_cell(working(rate=rate))) == []


@pytest.mark.parametrize(("late", "side"), [(0.3, "behind"), (0.5, "behind"), (-0.5, "ahead of")])
def test_torques_that_are_late_are_said_with_their_delay(late: float, side: str) -> None:
    (note,) = unit_warnings(working(late=late), vehicle())
    assert f"{abs(late):.2f} s {side} drawbar force and wheel speeds" in note
    assert f"'delay: {abs(late):.2f} s'" in note


def test_a_tenth_of_a_second_is_left_to_tyres_and_filters() -> None:
    assert unit_warnings(working(late=0.1), vehicle()) == []


def test_without_a_cell_late_torques_are_held_against_the_wheels() -> None:
    (note,) = notes_of(without_cell(working(late=0.5, pulled=0.0)))
    assert "0.50 s behind the wheel speeds" in note
    assert "pull that is not logged" in note


@pytest.mark.parametrize(
    ("scale", "cell", "words"),
    [
        (
            2.2,
            1.0,
            "changes by 2.2 times what the drawbar force does, beyond the force that moves the vehicle: check the units and scales of both",
        ),
        (1.0, 0.2248, "it may be in lbf"),
        (0.45, 1.0, "leaves nothing to drive the vehicle"),
    ],
)
def test_torques_of_another_scale_than_the_pull_are_named(scale: float, cell: float, words: str) -> None:
    (note,) = unit_warnings(working(scale=scale, cell=cell), vehicle())
    assert words in note


def test_uncalibrated_torques_and_cells_are_no_wrong_scale() -> None:
    for scale in (0.75, 1.3):
        assert notes_of(working(scale=scale)) == []


@pytest.mark.parametrize("cell", [True, False])
def test_a_thrust_that_no_ground_carries_is_a_unit(cell: bool) -> None:
    log = working(scale=100.0)
    notes = unit_warnings(log if cell else without_cell(log), vehicle())
    assert any("times the weight on average, which no ground can bear" in n for n in notes)


def test_wheels_that_brake_on_average_while_nothing_pulls_have_a_sign() -> None:
    notes = notes_of(without_cell(working(scale=-1.0)))
    assert notes[0].startswith(
        "The drive torques over the wheel radius are -0.22 times the weight on average"
    )


@pytest.mark.parametrize("pitched", [False, True])
def test_an_accelerometer_without_a_value_hides_no_wrong_sign(pitched: bool) -> None:
    """The mean of nothing was compared, with a RuntimeWarning on standard error."""
    log = without_cell(working(scale=-1.0))
    silent = np.full(len(log), np.nan)
    log = log.with_channels(acceleration_x=silent, **({"pitch": silent} if pitched else {}))
    assert any("-0.22 times the weight on average" in note for note in notes_of(log))

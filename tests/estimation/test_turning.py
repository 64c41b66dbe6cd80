"""Where no sensor gives a rate of turn: the positions do, with torques too; where nothing does, it is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.test_rim_parts import RIMS, TIME, log_of
from tests.estimation.turning_log import TRACK, machine, turning_log

import terragrip as tg
from terragrip.arrays import Bools, Floats
from terragrip.estimation.batch import estimated
from terragrip.estimation.turning import _unseen_turns, turn_in
from terragrip.recording import LogBlocks, Recording

POSITIONS = ("latitude", "longitude", "altitude")
SAID = "The rate of turn is that of the positions."


def without(log: Recording, *names: str) -> Recording:
    return replace(log, channels={name: v for name, v in log.channels.items() if name not in names})


def test_torques_with_positions_and_no_gyroscope_give_slip_against_the_hub() -> None:
    log = turning_log(3, seconds=120.0, free=0.0)
    told = tg.estimate(log, machine())
    turning = log.time % 40 > 32
    assert SAID in told.notes
    apart = np.median(np.abs(told["slip_r"] - told["slip_l"])[turning])
    bare = tg.estimate(without(log, *POSITIONS), machine())
    hubs = TRACK * np.pi / 10 / 1.2  # of the speed, between the hubs
    assert apart < 0.15 * hubs < 0.5 * np.median(np.abs(bare["slip_r"] - bare["slip_l"])[turning])


def test_torques_without_positions_and_gyroscope_are_said_to_be_wrong_in_turns() -> None:
    bare = tg.estimate(without(turning_log(3, seconds=120.0), *POSITIONS), machine())
    assert any("no signal shows how fast the machine turned" in note for note in bare.notes)


def test_blocks_tell_the_turn_of_the_whole_log() -> None:
    log = turning_log(3, seconds=120.0)
    whole, _ = turn_in(LogBlocks.of(log), log, machine())
    parts, _ = turn_in(LogBlocks.of(log, 250), log, machine())
    assert whole is not None
    assert parts is not None
    np.testing.assert_array_equal(whole.track.turn, parts.track.turn)


def test_a_gyroscope_is_not_replaced() -> None:
    log = turning_log(3, seconds=60.0).with_channels(angular_velocity_z=np.zeros(600))
    assert turn_in(LogBlocks.of(log), log, machine()) == (None, [])


@pytest.mark.parametrize(("measured", "said"), [(lambda t: t < 60, True), (lambda t: t % 3 < 2, False)])
def test_a_gyroscope_that_falls_silent_is_said(measured: Callable[[Floats], Bools], said: bool) -> None:
    """The slips of inner and outer wheel were .2 off in every turn behind it, without a word; a second's silence hardly counts."""
    log = turning_log(3, seconds=160.0)
    turn = np.where(log.time % 40 > 30, np.pi / 10, 0.0) * np.where(log.time % 80 > 40, 1, -1)
    turn = np.where(measured(log.time), np.convolve(turn, np.ones(10) / 10, "same"), np.nan)
    estimates = tg.estimate(without(log, *POSITIONS).with_channels(angular_velocity_z=turn), machine())
    assert any("Log the yaw rate throughout" in note for note in estimates.notes) is said


def test_a_gyroscope_that_falls_silent_is_replaced_by_the_positions_there() -> None:
    """Slips of inner and outer wheel were as far apart as their hubs in every turn behind it, though positions showed the turn."""
    log = turning_log(3, seconds=160.0, free=0.0)
    turn = np.where(log.time % 40 > 30, np.pi / 10, 0.0) * np.where(log.time % 80 > 40, 1, -1)
    yaw = np.convolve(turn, np.ones(10) / 10, "same")
    full = log.with_channels(angular_velocity_z=yaw)
    part = log.with_channels(angular_velocity_z=np.where(log.time < 60, yaw, np.nan))
    blind = tg.estimate(without(part, *POSITIONS), machine())
    truth, shown = tg.estimate(full, machine()), tg.estimate(part, machine())
    assert any("is that of the positions there" in note for note in shown.notes)
    assert not any("positions" in note for note in truth.notes)
    late = (log.time > 62) & (np.abs(yaw) > 0.3)
    hubs = TRACK * np.pi / 10 / 1.2
    off = [np.median(np.abs(one["slip_r"] - truth["slip_r"])[late]) for one in (shown, blind)]
    assert off[0] < 0.1 * hubs < off[1]
    early = log.time < 55
    np.testing.assert_allclose(shown["slip_r"][early], truth["slip_r"][early], atol=1e-3)
    parts = list(estimated(LogBlocks.of(part, 250), machine()))
    np.testing.assert_array_equal(np.concatenate([one["slip_r"] for one in parts]), shown["slip_r"])


@pytest.mark.parametrize(
    ("share", "apart", "said"),
    [(0.06, 0.1, False), (0.12, 0.1, True), (0.5, 0.035, False), (0.5, 0.045, True)],
)
def test_turns_that_nothing_tells_are_said_where_they_are_a_tenth(
    share: float, apart: float, said: bool
) -> None:
    turn = np.where(60 * share - 1e-9 > TIME, apart / 2, 0.0)
    log = log_of(wheel_speed_rl=2.0 * (1 - turn), wheel_speed_rr=2.0 * (1 + turn))
    words = _unseen_turns(log, RIMS)
    assert bool(words) is said
    if said:
        windows = np.mean(turn.reshape(-1, 4).mean(axis=1) * 2 > 0.04)
        assert words[0].startswith(f"The rims of left and right differ in {windows:.0%} of the driving")
    still = log_of(wheel_speed_rl=0.05 * (1 - turn), wheel_speed_rr=0.05 * (1 + turn))
    assert _unseen_turns(still, RIMS) == []


def test_positions_that_are_silent_where_the_gyroscope_is_show_nothing() -> None:
    """'The rate of turn is that of the positions there' was said of rows without any, and nothing of their slips."""
    log = turning_log(3, seconds=160.0)
    known = log.time < 60
    log = log.with_channels(angular_velocity_z=np.where(known, 0.1, np.nan))
    log = log.with_channels(**{name: np.where(known, log[name], np.nan) for name in POSITIONS})
    shown, (note,) = turn_in(LogBlocks.of(log), log, machine())
    assert shown is None
    assert "Log the yaw rate throughout" in note


def test_positions_of_a_part_of_the_log_leave_the_other_turns_said() -> None:
    log = turning_log(3, seconds=160.0)
    log = log.with_channels(**{name: np.where(log.time < 60, log[name], np.nan) for name in POSITIONS})
    shown, notes = turn_in(LogBlocks.of(log), log, machine())
    assert shown is not None
    assert notes[0] == SAID
    (unseen,) = notes[1:]
    assert unseen.startswith("The rims of left and right differ in")


def test_the_last_rate_before_a_silence_is_the_gyroscopes() -> None:
    log = turning_log(3, seconds=160.0)
    measured = log.time < 60
    log = log.with_channels(angular_velocity_z=np.where(measured, 0.123, np.nan))
    shown, _ = turn_in(LogBlocks.of(log), log, machine())
    assert shown is not None
    assert (shown.over(log)[measured] == 0.123).all()
    assert shown.over(log)[np.flatnonzero(measured)[-1] + 1] != 0.123


def test_stamps_before_0_change_no_interval_in_a_turn() -> None:
    """Without a yaw rate the turn counted only from 1 s on: slips of a log with stamps from before its trigger were too sure."""
    log = turning_log(3, seconds=40.0, circling=True)
    log = without(log, *POSITIONS)
    plain = tg.estimate(log, machine())["slip_r_std"]
    early = tg.estimate(replace(log, time=log.time - 100), machine())["slip_r_std"]
    np.testing.assert_allclose(early, plain, rtol=0.01)


@pytest.mark.parametrize("silent", ["l", "r"])
def test_a_side_that_is_silent_with_the_ground_speed_in_a_turn_shifts_no_speed(silent: str) -> None:
    """The other side's rims were taken for the machine's: the inner ones too slow, the outer ones too fast."""
    log = turning_log(1000, seconds=40.0, circling=True, soft=0.0)
    yaw = np.convolve(0.12 + 0.08 * np.sin(log.time / 17), np.ones(10) / 10, "same")
    lost = (log.time >= 30) & (log.time < 38)
    names = ("ground_speed", f"wheel_speed_{silent}")
    log = without(log, *POSITIONS).with_channels(angular_velocity_z=yaw)
    log = log.with_channels(**{name: np.where(lost, np.nan, log[name]) for name in names})
    estimates = tg.estimate(log, machine())
    true, late = 1.2 + 0.2 * np.sin(log.time / 11), (log.time > 32) & lost
    off = (estimates["ground_speed"] - true)[late]
    assert np.mean(np.abs(off) < 1.96 * estimates["ground_speed_std"][late]) > 0.95
    assert abs(np.mean(off)) < TRACK / 2 * np.mean(yaw[late])

"""A table whose channels were stamped one after another is estimated cycle by cycle, with a row for each of its rows."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from drives import drive, robot
from terragrip.estimation import RunOptions, by_cycle, estimated
from terragrip.live.core import Core, Settings
from terragrip.live.outputs import Row
from terragrip.recording import LogBlocks
from terragrip.recording.cycles import cycles_in
from terragrip.recording.survey import joined

pytestmark = pytest.mark.usefixtures("unchecked")

STEP = 0.001
DURATION = 12.0


def whole() -> tg.Recording:
    """A drive at 10 Hz, a row for each cycle."""
    recording = drive(DURATION, rate=10.0).recording
    return recording.with_channels(latitude=50.0 + 1e-6 * recording.time)


def by_message(recording: tg.Recording) -> tg.Recording:
    """The same measurements as a bus carries them: each kind of sensor 1 ms after the one before, in a row of its own."""
    groups = ("wheel_speed", "ground_speed", "drive_torque", "drawbar", "acceleration", "latitude")
    order = {
        n: next((k for k, g in enumerate(groups) if n.startswith(g)), len(groups)) for n in recording.channels
    }
    used = sorted(set(order.values()))
    time = (recording.time[:, None] + STEP * np.arange(len(used))).ravel()
    channels = {}
    for name, values in recording.channels.items():
        channels[name] = np.full(len(time), np.nan)
        channels[name][used.index(order[name]) :: len(used)] = values
    return tg.Recording(time, channels)


def same(one: tg.Estimates, other: tg.Estimates, rows: slice) -> None:
    for name in one.columns:
        if name != "latitude":
            assert np.array_equal(one[name], other[name][rows], equal_nan=True), name
    assert np.array_equal(one.event_codes, other.event_codes[rows])


@pytest.mark.parametrize("smooth", [False, True])
def test_a_row_for_each_message_gives_the_estimates_of_a_row_for_each_cycle(smooth: bool) -> None:
    log = whole()
    apart = by_message(log)
    one, other = (tg.estimate(some, robot(), smooth=smooth) for some in (log, apart))
    per = len(apart) // len(log)
    assert per > 3
    assert np.array_equal(other.time, apart.time)
    for k in range(per):  # each row of a cycle has the cycle's
        same(one, other, slice(k, None, per))
    assert np.array_equal(other["latitude"], apart["latitude"], equal_nan=True)
    assert other.about["settings"]["cycle"] == pytest.approx(0.005)
    assert "cycle" not in one.about["settings"]


def test_the_cycles_are_those_of_the_time_in_the_settings() -> None:
    """Stamps that scatter: some are as far apart as a cycle lasts, and were joined once more by the spacing of the joined rows."""
    log = by_message(drive(240.0, rate=10.0).recording)
    scatter = np.random.default_rng(4).normal(0.0, 0.0015, len(log))
    order = np.argsort(time := np.round(log.time + scatter - log.time[0] + 1.0, 6))
    log = tg.Recording(time, log.channels).select(order)
    estimates = tg.estimate(log, robot())
    changes = np.flatnonzero(np.diff(estimates["adhesion_rr"], prepend=np.nan) != 0.0)
    assert np.array_equal(changes, cycles_in(log, estimates.about["settings"]["cycle"]))


@pytest.mark.parametrize("rows", [1, 7, 100])
def test_blocks_of_any_length_give_the_same_digits(rows: int) -> None:
    apart = by_message(whole())
    once = tg.estimate(apart, robot())
    parts = list(estimated(LogBlocks.of(apart, rows), robot(), RunOptions()))
    assert np.array_equal(np.concatenate([part.time for part in parts]), apart.time)
    for name in ("adhesion_rr", "slip_fl_std", "soil_resistance", "nis"):
        joined = np.concatenate([part[name] for part in parts])
        assert np.array_equal(joined, once[name], equal_nan=True)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_log_from_disk_is_not_held_in_memory(smooth: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of its rows waited in memory for their estimates, from the first pass on."""
    apart, made, most = by_message(whole()), [], 0

    def remembered(*parts: Any) -> tg.Recording:
        result = joined(*parts)
        made.append(weakref.ref(result.time))
        return result

    def blocks() -> Iterator[tg.Recording]:
        nonlocal most
        for block in LogBlocks.of(apart, 20).blocks():
            most = max(most, sum(time() is not None for time in made))
            yield block

    monkeypatch.setattr(by_cycle, "joined", remembered)
    log = LogBlocks(len(apart), blocks, lambda: apart, from_disk=True)
    assert sum(map(len, estimated(log, robot(), RunOptions(smooth=smooth)))) == len(apart)
    assert len(apart) // 20 > 20
    assert 0 < most < 8


def test_live_joins_a_cycle_too_and_with_the_logs_settings_gives_its_digits() -> None:
    apart = by_message(whole())
    once = tg.estimate(apart, robot())
    known = once.about["settings"]
    channels = tuple(apart.channels)
    settings = Settings(
        sources=("replay:x",), channels=channels, noise=known["noise"], held=known["held"], learn=False, cycle=known["cycle"]
    )  # fmt: skip
    core, rows = Core(robot(), settings), []
    for k, time in enumerate(apart.time):
        values = {n: float(v[k]) for n, v in apart.channels.items() if v[k] == v[k]}
        rows += [out for out in core.process(float(time), 0, float(time), values) if isinstance(out, Row)]
    rows += [out for out in core.flush() if isinstance(out, Row)]
    per = len(apart) // len(whole())
    assert np.array_equal([row.estimate.time for row in rows], once.time[::per])
    for name in ("adhesion_rr", "slip_fl", "soil_resistance_std"):
        live = np.array([row.estimate[name] for row in rows])
        assert np.array_equal(live, once[name][::per], equal_nan=True), name


def test_live_without_settings_joins_a_cycle_once_the_periods_are_known() -> None:
    apart = by_message(whole())
    core, rows = Core(robot(), Settings(sources=("can:x",), channels=tuple(apart.channels))), []
    for k, time in enumerate(apart.time):
        values = {n: float(v[k]) for n, v in apart.channels.items() if v[k] == v[k]}
        rows += [out for out in core.process(float(time), 0, float(time), values) if isinstance(out, Row)]
    rows += [out for out in core.flush() if isinstance(out, Row)]
    late = [row for row in rows if row.estimate.time > 3.0]
    assert np.all(np.diff([row.estimate.time for row in late]) > 0.05)
    assert all(set(row.values) == set(apart.channels) for row in late)

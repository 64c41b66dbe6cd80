"""Samples find their row; what is late, doubled or missing is counted; nothing waits without a reason."""

from __future__ import annotations

import json
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from machine import rows_of
from terragrip.live.clock import Pace, SourceClock
from terragrip.live.core import Core, Settings
from terragrip.live.counts import Counts
from terragrip.live.outputs import Event
from terragrip.live.reorder import Reorder

STEP = 0.01


def settled(window: float = 0.05, channels=("a",), rows: int = 30) -> tuple[Reorder, Counts, list]:
    """A buffer that has met its streams, at time `rows` * STEP."""
    counts = Counts()
    buffer, out = Reorder(window, counts), []
    for k in range(rows):
        for name in channels:
            buffer.add(k * STEP, 0, k * STEP, {name: float(k)})
        out += buffer.ready(k * STEP)
    out += buffer.ready(rows * STEP + window)
    return buffer, counts, out


def test_in_good_order_nothing_waits():
    buffer, counts, out = settled()
    assert len(out) == 30
    for k in range(30, 60):
        now = k * STEP + 1.0
        buffer.add(now, 0, k * STEP, {"a": 1.0})
        assert [row.time for row in buffer.ready(now)] == [k * STEP]
    assert counts.total("missing") == counts.total("late") == 0


def test_a_sample_out_of_order_finds_its_place():
    buffer, counts, _ = settled()
    buffer.add(1.0, 0, 31 * STEP, {"a": 31.0})
    assert buffer.ready(1.0) == []
    buffer.add(1.01, 0, 30 * STEP, {"a": 30.0})
    assert [row.values["a"] for row in buffer.ready(1.01)] == [30.0, 31.0]
    assert counts.total("missing") == counts.total("late") == 0


def test_a_sample_sent_twice_is_refused_wherever_in_its_cycle_it_is():
    """Of a cycle's later messages the second copy became a row of its own."""
    counts = Counts()
    buffer, out = Reorder(0.05, counts), []
    for k in range(60):
        for name, delay in (("a", 0.0), ("b", 0.0003), ("b", 0.0003)):
            buffer.add(k * STEP + delay, 0, k * STEP + delay, {name: float(k)})
            out += buffer.ready(k * STEP + delay)
    assert [set(row.values) for row in out[-40:]] == [{"a", "b"}] * 40
    assert counts.by_channel["b"]["doubled"] == 60
    assert counts.total("late") == counts.total("missing") == 0


def test_of_late_samples_in_a_burst_no_row_is_joined_with_the_next():
    """The last of them were, and the estimates were not those of the log (`terragrip.recording.cycles`)."""
    buffer = Reorder(0.05, Counts(), cycle=0.001)
    for k, name in enumerate("abac"):
        buffer.add(1.0, 0, 0.001 * k, {name: 1.0})
    assert [set(row.values) for row in buffer.flush()] == [{"a"}, {"b"}, {"a"}, {"c"}]


def test_a_hole_is_waited_for_once_and_counted():
    buffer, counts, _ = settled(window=0.05)
    buffer.add(1.0, 0, 32 * STEP, {"a": 0.0})
    assert buffer.ready(1.049) == []
    assert len(buffer.ready(1.051)) == 1
    assert counts.by_channel["a"]["missing"] == 2
    buffer.add(1.06, 0, 31 * STEP, {"a": 0.0})
    assert counts.by_channel["a"]["late"] == 1
    buffer.add(1.06, 0, 32 * STEP, {"a": 0.0})
    assert counts.by_channel["a"]["doubled"] == 1
    buffer.add(1.07, 0, 33 * STEP, {"a": 0.0})
    assert len(buffer.ready(1.07)) == 1


def test_parts_of_one_instant_become_one_row():
    buffer, _, _ = settled(channels=("a", "b", "c"))
    for name in ("c", "a"):
        buffer.add(1.0, 0, 30 * STEP, {name: 1.0})
        assert buffer.ready(1.0) == []
    buffer.add(1.001, 0, 30 * STEP, {"b": 1.0})
    (row,) = buffer.ready(1.001)
    assert row.values.keys() == {"a", "b", "c"}


def test_a_channel_that_stays_away_is_lost_and_no_longer_waited_for():
    buffer, _, _ = settled(channels=("a", "b"))
    for k in range(30, 45):
        now = 1.0 + k * STEP
        buffer.add(now, 0, k * STEP, {"a": 1.0})
        buffer.ready(now)
    assert buffer.ready(2.0) is not None
    assert ("channel_lost", 0, "b comes no longer") in buffer.changes
    buffer.add(3.0, 0, 50 * STEP, {"a": 1.0, "b": 1.0})
    buffer.ready(3.1)
    assert ("channel_back", 0, "b comes again") in buffer.changes


def test_after_a_pause_of_all_channels_none_is_lost_but_one_that_stays_away():
    """As after a kill, or between the parts of a log: the first row is not yet whole, and everything has been missing for long."""
    for come in (("b",), ()):
        buffer, _, _ = settled(channels=("a", "b"))
        for k in range(400, 420):
            now = 10.0 + k * STEP
            buffer.add(now, 0, k * STEP, {"a": 1.0})
            buffer.ready(now + 0.05)
            for name in come:
                buffer.add(now, 0, k * STEP + 1e-4, {name: 1.0})
        assert [text for _, _, text in buffer.changes] == ([] if come else ["b comes no longer"])


def test_slow_and_fast_channels_live_side_by_side():
    counts = Counts()
    buffer, times = Reorder(0.05, counts), []
    for k in range(400):
        now = k * STEP
        buffer.add(now, 0, now, {"fast": 1.0, **({"slow": 1.0} if k % 10 == 0 else {})})
        times += [(row.time, now) for row in buffer.ready(now)]
    late = [now - time for time, now in times if time > 1.0]
    assert max(late) == 0.0
    assert counts.total("missing") == 0


@given(st.tuples(*[st.sets(st.integers(30, 69), max_size=5)] * 3))
def test_missing_is_counted_by_channel_however_messages_are_composed(absent):
    """Three channels, each absent from some rows (from few, or its period were another): so many are missing."""
    buffer, counts, _ = settled(channels=("a", "b", "c"))
    for k in range(30, 71):
        now = 1.0 + k * STEP
        values = {name: 1.0 for name, gone in zip("abc", absent, strict=True) if k not in gone}
        if values:
            buffer.add(now, 0, k * STEP, values)
        buffer.ready(now)
    buffer.ready(5.0)
    for name, gone in zip("abc", absent, strict=True):
        assert counts.by_channel.get(name, {"missing": 0})["missing"] == len(gone)
    assert sorted(name for stream in buffer.streams for name in stream.channels) == ["a", "b", "c"]


@given(st.permutations(range(40)), st.integers(0, 2**32 - 1))
def test_whatever_the_order_rows_come_out_sorted_and_all_is_accounted_for(order, seed):
    buffer, counts, out = settled(window=0.03)
    before = len(out)
    for n, k in enumerate(order):
        now = 1.0 + n * STEP
        if buffer.add(now, 0, (30 + k) * STEP, {"a": float(k)}) == {}:
            pass
        out += buffer.ready(now)
    out += buffer.flush()
    times = [row.time for row in out]
    assert times == sorted(set(times))
    assert len(out) - before + counts.total("late") == 40


@given(st.lists(st.floats(0, 1, width=16), min_size=30, max_size=60, unique=True), st.integers(5, 25))
def test_going_on_from_its_state_changes_nothing(stamps, split):
    def run(restart: bool) -> list:
        counts = Counts()
        buffer, out = Reorder(0.05, counts), []
        for n, stamp in enumerate(stamps):
            if restart and n == split:
                state = json.loads(json.dumps(buffer.state()))
                buffer = Reorder(0.05, counts)
                buffer.restore(state)
            buffer.add(n * STEP, n % 2, stamp, {"a": stamp})
            out += buffer.ready(n * STEP)
        return [(row.time, row.values) for row in [*out, *buffer.flush()]] + [counts.state()]

    assert run(True) == run(False)


class TestClock:
    def run(self, stamps_and_arrivals, align=False):
        clock = SourceClock(align)
        times, jumps, refused = [], [], 0
        for arrival, stamp in stamps_and_arrivals:
            going, lost, jump = clock.place(arrival, stamp, {})
            times += [time for _, time, _ in going]
            refused += len(lost)
            jumps += [jump] if jump else []
        return times, jumps, refused

    @pytest.mark.parametrize("day", [86400.0, -86400.0])
    def test_a_jump_of_a_day_is_seen_and_time_goes_on(self, day):
        before = [(1000 + k * 0.1, 5 + k * 0.1) for k in range(50)]
        after = [(1005 + k * 0.1, 10 + day + k * 0.1) for k in range(50)]
        times, (jump,), refused = self.run([*before, *after])
        assert jump == pytest.approx(day)
        assert refused == 0
        assert times == pytest.approx([5 + k * 0.1 for k in range(100)])

    @pytest.mark.parametrize("wild", [4.0, 11.0, 1e6, -1e6])
    def test_one_wild_stamp_is_refused(self, wild):
        good = [(k * 0.1, k * 0.1) for k in range(60)]
        times, jumps, refused = self.run([*good[:20], (2.0, wild), *good[20:]])
        assert (jumps, refused, times) == ([], 1, [stamp for _, stamp in good])

    @pytest.mark.parametrize("lag", [0.5, 1.5, 9.0])
    def test_channels_of_one_source_that_lag_are_both_taken(self, lag):
        """As of a profile with a delay: each message gives a sample of then and one of now."""
        both = [(k * 0.1, k * 0.1 - then) for k in range(60) for then in (lag, 0.0)]
        times, jumps, refused = self.run(both)
        assert (jumps, refused) == ([], 0)
        assert sorted(times) == sorted(stamp for _, stamp in both)

    def test_a_second_stamp_that_agrees_shows_a_hole(self):
        """A burst out of which 5 s are missing, and no sample behind it."""
        stamps = [*range(30), *range(80, 120)]
        times, jumps, refused = self.run([(0.001 * k, 0.1 * stamp) for k, stamp in enumerate(stamps)])
        assert (jumps, refused, times) == ([], 0, [0.1 * stamp for stamp in stamps])

    def test_what_was_dropped_explains_a_hole_of_any_length(self):
        clock, times = SourceClock(), []
        for k in range(100):
            if k == 50:
                clock.dropped(0.05)
            accepted, refused, jump = clock.place(0.001 * k, k * 0.1 + (1000.0 if k >= 50 else 0.0), {})
            assert (refused, jump) == ([], 0.0)
            times += [time for _, time, _ in accepted]
        assert times == [k * 0.1 + (1000.0 if k >= 50 else 0.0) for k in range(100)]

    def test_old_stamps_in_a_flood_are_no_jump(self):
        """A second and a half of messages from long ago, delivered once more between those of now."""
        now = [(k * 0.1, 100.0 + k * 0.1) for k in range(60)]
        flood = [(3.05 + 1e-4 * k, 50.0 + 1e-5 * k) for k in range(15_000)]
        times, jumps, refused = self.run(sorted([*now, *flood]))
        assert jumps == []
        assert refused == len(flood)
        assert times == [stamp for _, stamp in now]

    def test_a_backlog_keeps_its_stamps(self):
        live = [(k * 0.1, k * 0.1) for k in range(50)]
        backlog = [(40.0 + 0.0005 * k, 5.0 + 0.1 * k) for k in range(350)]  # 35 s of samples in 0.2 s
        times, jumps, _ = self.run([*live, *backlog])
        assert jumps == []
        assert times[-1] == pytest.approx(39.9)

    @pytest.mark.parametrize("period", [0.01, 1.0, 3.0])
    def test_batches_keep_their_stamps(self, period):
        """Ten samples at once, as a tracker sends them by radio."""
        batches = [((k // 10 + 1) * 10 * period + 1e-4 * k, k * period) for k in range(60)]
        times, jumps, refused = self.run(batches)
        assert (jumps, refused) == ([], 0)
        # The last of a batch of slow samples waits for the next batch.
        assert times == [stamp for _, stamp in batches[: 59 if period > 1.0 else 60]]

    def test_several_clocks_are_set_against_the_machines_own(self):
        times, _, _ = self.run([(1000.0 + k, 3.0 + k) for k in range(3)], align=True)
        assert times == [1000.0, 1001.0, 1002.0]
        times, _, _ = self.run([(1000.0 + k, 999.97 + k) for k in range(3)], align=True)
        assert times == [999.97, 1000.97, 1001.97]


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        ([0.0, 600.0, 1200.0, 1800.0, 2400.0], 1000.0),  # ms, given as s: every .6 s
        ([0.0, 0.6, 1.2, 1.8, 2.4], None),
        ([0.0, 600.0, 600.6, 601.2, 601.8], None),  # a clock that is set while the vehicle drives
        ([0.0, 60.0, 180.0, 480.0, 1200.0], None),  # set again and again: no one factor
    ],
)
def test_a_clock_that_runs_far_too_fast_is_named_once(stamps: list[float], said: float | None) -> None:
    pace = Pace()
    found = [pace.wrong(0.6 * k, stamp) for k, stamp in enumerate(stamps)]
    assert [one for one in found if one is not None] == ([] if said is None else [pytest.approx(said)])


def test_samples_that_were_held_up_and_come_at_once_are_no_fast_clock() -> None:
    pace = Pace()
    late = [pace.wrong(10.0 + 0.001 * k, 0.1 * k) for k in range(100)]
    assert late + [pace.wrong(10.1 + 0.1 * k, 10.0 + 0.1 * k) for k in range(100)] == [None] * 200


def two_clocks(vehicle, short, stamp, lag=0.001) -> tuple[Core, list[Event]]:
    """Wheels of one source, on the machine's clock; ground speed of another, stamped by ``stamp(time)`` and so late [s]."""
    core = Core(vehicle, Settings(("udp://a", "udp://b"), learn=False))
    out = []
    for time, values in list(rows_of(short.recording))[::10]:
        speed = {"ground_speed": values.pop("ground_speed")}
        out += core.process(time, 0, time, values)
        out += core.process(time + lag, 1, stamp(time), speed)
    return core, [one for one in out if isinstance(one, Event)]


@pytest.mark.parametrize(
    ("shift", "text"),
    [(-0.4, "0.4 s behind"), (0.4, "+0.399 s"), (3600.0, "+3599.999"), (-3600.0, "-3600.001")],
)
def test_a_second_clock_that_is_off_is_corrected_and_named(vehicle, short, shift, text):
    core, (event,) = two_clocks(vehicle, short, lambda time: time + shift)
    assert (event.kind, event.source) == ("clock_corrected", "udp://b")
    assert text in event.text
    assert event.time < 3.0
    assert all(counts["late"] <= 22 for counts in core.counts.by_channel.values())


def test_clocks_in_step_and_a_lag_of_a_second_are_no_late_source(vehicle, short):
    for stamp in (lambda time: time, lambda time: time - (0.4 if time < 1.0 else 0.0)):
        assert two_clocks(vehicle, short, stamp)[1] == []


@pytest.mark.parametrize("ppm", [-50.0, 50.0])
def test_a_clock_that_drifts_is_followed(ppm):
    clock, wrong, news = SourceClock(align=True), [], []
    for k in range(36000):  # an hour at 10 Hz
        arrival = 0.1 * k + 0.005 + 0.002 * (k % 7)
        ((_, time, _),), _, _ = clock.place(arrival, 0.1 * k * (1 + 1e-6 * ppm), {})
        wrong.append(time - 0.1 * k)
        news += [clock.news] if clock.news else []
        clock.news = ""
    assert max(map(abs, wrong)) < 0.003  # unfollowed: 0.18 s
    assert 2 <= len(news) <= 4
    assert f"{1e-6 * ppm * 400:+.2g}" in news[0]


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (lambda sent, k: sent - 0.09 + 0.01 * k, []),
        (lambda sent, k: sent, ["stamp of the one before, and are refused: send the time of each"]),
        (
            lambda sent, k: sent + 3e-5 * k,
            ["come in bundles, stamped as these arrive: send the time of each"],
        ),
    ],
    ids=["right", "all that of sending", "that of arrival"],
)
def test_bundles_whose_stamps_are_those_of_sending_are_named(vehicle, short, stamp, words):
    core, said = Core(vehicle, Settings(("udp://test",))), []
    for n, (_, values) in enumerate(list(rows_of(short.recording))[:500]):
        bundle, k = divmod(n, 10)
        sent = 0.1 * bundle
        said += core.process(sent + 3e-5 * k, 0, stamp(sent, k), values)
    said += core.flush()
    texts = [out.text for out in said if isinstance(out, Event)]
    assert len(texts) == len(words)
    assert all(word in text for word, text in zip(words, texts, strict=True))


def test_a_row_does_not_wait_for_a_frame_that_has_come_a_little_later():
    """Three frames of a bus, .1 ms apart and not quite regular, waited for the whole window for each other."""
    buffer, random, waits = Reorder(0.02, Counts()), Random(3), []
    for k in range(400):
        now = k * STEP
        for name in ("a", "b", "c"):
            now += 1e-4 + 5e-5 * random.random()
            buffer.add(now, 0, now, {name: 1.0})
            waits += [now - row.arrival for row in buffer.ready(now)]
    assert max(waits[-300:]) < 1e-3

"""Ground speed and wheel speeds of one file on one clock: a certain lag of a sensor is corrected and reported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.held import held_period
from terragrip.recording.lag import Lag, delay_of, is_copy, lag_within, measured
from terragrip.recording.noise import white_noise
from terragrip.recording.ranks import median
from terragrip.recording.survey import BEGINNING, first_speeds
from terragrip.recording.table import Recording

_LONGEST = 1.0  # s, or three samples, across which nothing is interpolated


def recording_of(given: Recording | Any) -> Recording:
    """A recording as it is; of a table that :meth:`Recording.from_frame` accepts, the one that a file of it would give: aligned.

    Raises InputError as `Recording.from_frame` does.
    """
    return given if isinstance(given, Recording) else next(aligned([Recording.from_frame(given)]))


def aligned(blocks: Iterable[Recording]) -> Iterator[Recording]:
    """Consecutive blocks of a log with its ground speed shifted by the lag of `lag_within`, and a note; an uncertain lag is only noted.

    The rows stay. At each instant of a ground speed the result is the value measured then, on a straight line between two
    samples, or the last one of a held channel. The lag is that of the first `BEGINNING` rows, whatever the blocks.
    """
    source, ahead = iter(blocks), list[Recording]()
    for block in source:
        ahead.append(block)
        if sum(map(len, ahead)) >= BEGINNING:
            break
    time, columns = first_speeds(ahead)
    lag = lag_within(time, columns)
    if lag is None or not lag.is_to_correct:
        yield from (_as_it_is(block, lag) for block in chain(ahead, source))
        return
    shift = _Shift.by(lag, time, columns)
    tail: list[Recording] = []
    while ahead or (ahead := [more for more in (next(source, None),) if more is not None]):
        end = ahead[0].time[-1] + shift.reach
        while ahead[-1].time[-1] < end and (more := next(source, None)) is not None:
            ahead.append(more)
        block = ahead.pop(0)
        yield shift.moved(block, [*tail, block, *ahead])
        tail = [b for b in (*tail, block) if b.time[-1] > block.time[-1] - shift.reach]


def _as_it_is(block: Recording, lag: Lag | None) -> Recording:
    """A block of a log, not shifted, with its delay, and a note where the lag is too uncertain to correct."""
    block = replace(block, delay=delay_of(lag))
    return block.with_notes(_doubt(lag)) if lag is not None and lag.is_of_the_clock else block


@dataclass(frozen=True)
class _Shift:
    """The shift and its channels: their names, the longest gap [s] for interpolation, whether they are held.

    ``noise``: of the channels as measured, where it is known. On a line between two samples noise is smaller by up to a half and
    shared with the neighbours, so that it averages out as that of the samples does, but no longer shows.
    """

    lag: Lag
    names: tuple[str, ...]
    longest: float
    held: bool
    noise: dict[str, float]

    @classmethod
    def by(cls, lag: Lag, time: Floats, columns: dict[str, Floats]) -> _Shift:
        """The shift by a lag, with the channels' properties from the first rows of a log."""
        ground = columns["ground_speed"]
        when, kept = time[np.isfinite(ground)], ground[np.isfinite(ground)]
        late = [
            n
            for n in columns
            if n == "ground_speed" or (n != "wheel_based_speed" and is_copy(columns[n], ground))
        ]
        longest = max(_LONGEST, 3 * median(np.diff(when)))
        samples = {n: s for n in late if (s := measured(time, columns[n])) is not None}
        known = {n: sd for n, s in samples.items() if (sd := white_noise(*s)) is not None}
        return cls(lag, tuple(late), longest, held_period(when, kept) is not None, known)

    @property
    def reach(self) -> float:
        """How far beyond a block its values may come from [s]."""
        return abs(self.lag.of_the_clock) + self.longest

    def moved(self, block: Recording, near: list[Recording]) -> Recording:
        """A block with its late channels corrected, by the samples of the blocks ``near`` it."""
        channels = dict(block.channels)
        for name in self.names:
            time = np.concatenate([b.time[np.isfinite(b.channels[name])] for b in near])
            values = np.concatenate([b.channels[name][np.isfinite(b.channels[name])] for b in near])
            rows = np.flatnonzero(np.isfinite(block.channels[name]))
            channels[name] = np.full(len(block), np.nan)
            channels[name][rows] = self._at(block.time[rows] + self.lag.of_the_clock, time, values)
        noise = {**self.noise, **block.noise}
        return replace(block, channels=channels, noise=noise, delay=self.lag.delay_left).with_notes(
            _sentence(self.lag)
        )

    def _at(self, when: Floats, time: Floats, values: Floats) -> Floats:
        """A channel (n,) of instants ``time`` at others; NaN outside, and in gaps."""
        after = np.searchsorted(time, when, side="right")
        known = (after > 0) & (after < len(time))
        after = np.clip(after, 1, max(len(time) - 1, 1))
        known[known] = (time[after] - time[after - 1])[known] <= self.longest
        result = values[after - 1] if self.held else np.interp(when, time, values)
        return np.where(known, result, np.nan)


def _evidence(lag: Lag) -> str:
    side = "behind" if lag.seconds > 0 else "ahead of"
    return (
        f"{abs(lag.seconds):.3f} ± {lag.std:.3f} s {side} the wheel speeds, by the correlation of the speeds "
        f"({lag.correlation:.3f}), where the vehicle's own lag is up to {lag.explained[1]:.2f} s"
    )


def _sentence(lag: Lag) -> str:
    return (
        f"ground_speed was {_evidence(lag)}; it was shifted by {abs(lag.of_the_clock):.3f} s. If you know which sensor is late, and by how "
        "much, give its 'delay:' in a profile."
    )


def _doubt(lag: Lag) -> str:
    return (
        f"ground_speed is {_evidence(lag)}, which is too uncertain to correct: if a sensor is late, write "
        f"'delay: {abs(lag.seconds):.2f} s' for it in a profile."
    )

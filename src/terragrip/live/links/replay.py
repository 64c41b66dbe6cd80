"""A log as if it were live: at its own pace, faster, or as fast as it goes."""

from __future__ import annotations

import asyncio
import math

import numpy as np

from terragrip.errors import InputError
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed
from terragrip.live.uri import Uri

_AT_ONCE = 256  # rows
_PAUSE = 10.0  # s that are waited at most: a log of two days has a night in it


class ReplaySource:
    """``replay:LOG?speed=10``: any log that ``terragrip estimate`` reads, through the same profile; ``speed=max`` does not wait,
    and of a pause of the log ten seconds are waited.

    Rows arrive at their own stamps, so that a replay gives the same at any speed, and goes on after a kill where it was. Raises
    InputError where the log cannot be read.
    """

    real_time = False

    def __init__(self, uri: Uri, decoder: Decoder) -> None:
        from terragrip.formats import read

        if not uri.path:
            raise InputError("names no log", place=uri.text, hint="write replay:drive.csv")
        self.speed = math.inf if uri.options.get("speed") == "max" else uri.number("speed", 1.0)
        self.recording = read(uri.path, decoder.profile)
        self.channels = tuple(n for n in self.recording.channels if n not in self.recording.references)

    async def run(self, feed: Feed) -> None:
        """Feed the rows behind the newest that the record holds."""
        time = self.recording.time
        columns = [self.recording.channels[name] for name in self.channels]
        first = int(np.searchsorted(time, feed.after, side="right"))
        feed.connected()
        loop = asyncio.get_running_loop()
        began, at = loop.time(), float(time[first]) if first < len(time) else 0.0
        while first < len(time):
            last = min(first + _AT_ONCE, len(time))
            if math.isfinite(self.speed):
                wait = (float(time[first]) - at) / self.speed - (loop.time() - began)
                if wait > 0.0:
                    await asyncio.sleep(min(wait, _PAUSE))
                if wait > _PAUSE:
                    began, at = loop.time(), float(time[first])
                now = at + (loop.time() - began) * self.speed
                last = min(last, max(first + 1, int(np.searchsorted(time, now, side="right"))))
            await feed.inbox.room()
            rows = np.column_stack([column[first:last] for column in columns]).tolist()
            for stamp, row in zip(time[first:last].tolist(), rows, strict=True):
                values = {n: v for n, v in zip(self.channels, row, strict=True) if v == v}
                if values:
                    feed.sample(stamp, values, arrival=stamp)
            first = last

"""Frames of a CAN bus, by DBC files and the built-in table of J1939 and ISO 11783."""

from __future__ import annotations

from functools import partial
from typing import Any

from terragrip.live.can_bus import bus_of, check
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed
from terragrip.live.frame_decoder import FrameDecoder
from terragrip.live.thread_bridge import ThreadBridge, repeated_in_thread
from terragrip.live.uri import Uri

_PATIENCE = 0.2  # s
_AT_ONCE = 64  # frames
_BATCHES = 256


class CanSource:
    """``can:can0?interface=socketcan&dbc=machine.dbc``; several DBC files by commas. The profile's own are read too.

    A sample is stamped by the interface, which is on the machine's clock.
    """

    real_time = True

    def __init__(self, uri: Uri, decoder: Decoder) -> None:
        self.uri = uri
        check(uri)
        own = decoder.profile.dbc if decoder.profile is not None else ()
        databases = [name for name in uri.options.get("dbc", "").split(",") if name]
        wants = decoder.wants if decoder.profile is not None else lambda name: True
        self.frames = FrameDecoder([*databases, *own], wants)
        decoder.units = self.frames.units

    async def run(self, feed: Feed) -> None:
        """Feed frames; raises Lost where the bus is not there or goes away."""
        bridge = ThreadBridge(feed, _BATCHES)
        feed.one_layout = False

        def read(bus: Any) -> None:
            frame = bus.recv(_PATIENCE)
            batch: list[Any] = []
            while frame is not None and len(batch) < _AT_ONCE:
                batch.append(frame)
                frame = bus.recv(0.0)
            if frame is not None:
                batch.append(frame)
            if batch:
                bridge.call(self._feed, feed, batch)

        async with bus_of(self.uri) as bus:
            feed.connected()
            await repeated_in_thread(partial(read, bus))

    def _feed(self, feed: Feed, batch: list[Any]) -> None:
        for frame in batch:
            if frame.is_error_frame or frame.is_remote_frame:
                continue
            fields = self.frames.fields(frame.arbitration_id, frame.is_extended_id, bytes(frame.data))
            if fields:
                feed.fields({**fields, "time": frame.timestamp} if frame.timestamp > 0 else fields)
            else:
                feed.messages += 1

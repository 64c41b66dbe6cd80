"""A GNSS receiver on a serial line, NMEA 0183: ground speed, position, altitude."""

from __future__ import annotations

from terragrip.errors import InputError
from terragrip.live.feed import Feed, Lost
from terragrip.live.nmea import Sentences
from terragrip.live.thread_bridge import ThreadBridge, repeated_in_thread
from terragrip.live.uri import Uri

_LONGEST = 512  # bytes of a line


class SerialSource:
    """``serial:/dev/ttyUSB0?baud=4800``; ``serial:socket://192.168.1.20:10110`` where receiver or router serve sentences by TCP."""

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        import pynmea2  # noqa: F401  # so that a missing package is reported at once
        import serial  # noqa: F401

        self.uri = uri
        self.baud = round(uri.number("baud", 4800))
        if not uri.path:
            raise InputError("names no device", place=uri.text, hint="write serial:/dev/ttyUSB0")
        scheme, mark = uri.path.partition("://")[:2]
        if mark and scheme != "socket":
            raise InputError(
                f"{scheme}:// is no line",
                place=uri.text,
                hint="write serial:socket://HOST:PORT, or udp://HOST:PORT where sentences come in datagrams",
            )

    async def run(self, feed: Feed) -> None:
        """Feed sentences; raises Lost where the device is not there or goes away."""
        import serial

        bridge, rest, reader = ThreadBridge(feed), b"", Sentences(feed)
        try:
            line = serial.serial_for_url(self.uri.path, self.baud, timeout=0.2)
        except (serial.SerialException, ValueError) as error:
            raise Lost(f"the device: {error}") from error
        feed.connected()

        def read() -> None:
            nonlocal rest
            rest += line.read(max(1, line.in_waiting))
            *whole, rest = rest.split(b"\n")
            if len(rest) > _LONGEST:
                rest = b""
                bridge.call(
                    feed.reject, f"no line in {_LONGEST} bytes: is the receiver's baud rate {self.baud}?"
                )
            for sentence in whole:
                bridge.call(reader.line, sentence)

        try:
            await repeated_in_thread(read)
        except (serial.SerialException, OSError) as error:
            raise Lost(f"the device: {error}") from error
        finally:
            line.close()

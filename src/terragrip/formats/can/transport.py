"""Messages longer than a frame: J1939 transport (BAM and RTS/CTS) and NMEA 2000 fast packets."""

from __future__ import annotations

from dataclasses import dataclass, field

CONNECTION, DATA = 0xEC00, 0xEB00
"""Parameter groups of J1939-21's connection management and data transfer."""
_BAM, _RTS, _ABORT = 32, 16, 255
_FAST_GROUPS = range(0x1F000, 0x20000)


@dataclass
class _Message:
    group: int
    length: int
    parts: dict[int, bytes] = field(default_factory=dict)


@dataclass
class Transport:
    """Puts messages together again; ``broken`` counts those of which a part is missing."""

    broken: int = 0
    _open: dict[tuple[int, int], _Message] = field(default_factory=dict)
    _fast: dict[tuple[int, int], tuple[int, _Message]] = field(default_factory=dict)

    def add(self, group: int, source: int, destination: int, data: bytes) -> tuple[int, bytes] | None:
        """Add a frame of `CONNECTION` or `DATA`; returns group and payload once a message is whole."""
        if len(data) < 8:
            return None
        key = source, destination
        if group == CONNECTION:
            if data[0] in (_BAM, _RTS):
                self.broken += key in self._open
                length = data[1] | data[2] << 8
                self._open[key] = _Message(data[5] | data[6] << 8 | (data[7] & 3) << 16, length)
            elif data[0] == _ABORT:
                self.broken += self._open.pop(key, None) is not None
            return None
        message = self._open.get(key)
        if message is None:
            return None
        message.parts[data[0]] = data[1:8]
        if data[0] * 7 < message.length:
            return None
        del self._open[key]
        return self._whole(message, range(1, -(-message.length // 7) + 1))

    def add_fast(self, group: int, source: int, data: bytes) -> tuple[int, bytes] | None:
        """Add a frame of a fast packet; returns group and payload once a message is whole."""
        if len(data) < 2:
            return None
        key, sequence, number = (group, source), data[0] >> 5, data[0] & 31
        if number == 0:
            self.broken += key in self._fast
            self._fast[key] = sequence, _Message(group, data[1], {0: data[2:]})
        elif key not in self._fast or self._fast[key][0] != sequence:
            return None
        else:
            self._fast[key][1].parts[number] = data[1:]
        message = self._fast[key][1]
        have = 6 + 7 * number
        if have < message.length:
            return None
        del self._fast[key]
        return self._whole(message, range(number + 1))

    def _whole(self, message: _Message, numbers: range) -> tuple[int, bytes] | None:
        if any(number not in message.parts for number in numbers):
            self.broken += 1
            return None
        payload = b"".join(message.parts[number] for number in numbers)[: message.length]
        return message.group, payload


def is_fast(group: int, length: int) -> bool:
    """Whether messages of a group come as fast packets: NMEA 2000's of more than 8 bytes."""
    return group in _FAST_GROUPS and length > 8

"""Messages longer than a frame: J1939 transport (BAM and RTS/CTS) and NMEA 2000 fast packets."""

from __future__ import annotations

from dataclasses import dataclass, field

from terragrip.formats.can.catalog import EXTENDED, Message, group_of, source_of

_CONNECTION, _DATA = 0xEC00, 0xEB00  # parameter groups of J1939-21's connection management and data transfer
_BAM, _RTS, _ABORT = 32, 16, 255
_FAST_GROUPS = range(0x1F000, 0x20000)


def is_part(identifier: int, message: Message | None) -> bool:
    """Whether frames of an identifier, which a catalog has as ``message``, are parts of longer messages.

    Those of J1939's transport are, and of NMEA 2000's groups those of more than 8 bytes.
    """
    if identifier & EXTENDED and group_of(identifier) in (_CONNECTION, _DATA):
        return True
    return message is not None and message.by_group and message.key in _FAST_GROUPS and message.length > 8


@dataclass
class _Open:
    """A message of which parts are lacking; ``sequence`` tells a fast packet from the one before."""

    group: int
    length: int
    parts: dict[int, bytes] = field(default_factory=dict)
    sequence: int = 0


@dataclass
class Transport:
    """Puts messages together again; ``broken`` counts those of which a part is missing."""

    broken: int = 0
    _open: dict[tuple[int, int], _Open] = field(
        default_factory=dict
    )  # by peers, fast packets by group and sender

    def add(self, identifier: int, data: bytes) -> tuple[int, bytes] | None:
        """Add a part (`is_part`); returns the message that it completes, by the identifier that it would have in one frame."""
        group, source = group_of(identifier), source_of(identifier)
        if group in (_CONNECTION, _DATA):
            whole = self._transferred(group, (source, (identifier >> 8) & 0xFF), data)
        else:
            whole = self._fast_packet((group, source), data)
        return None if whole is None else (EXTENDED | whole[0] << 8 | source, whole[1])

    def _transferred(self, group: int, peers: tuple[int, int], data: bytes) -> tuple[int, bytes] | None:
        if len(data) < 8:
            return None
        if group == _CONNECTION:
            if data[0] in (_BAM, _RTS):
                self.broken += peers in self._open
                self._open[peers] = _Open(
                    data[5] | data[6] << 8 | (data[7] & 3) << 16, data[1] | data[2] << 8
                )
            elif data[0] == _ABORT:
                self.broken += self._open.pop(peers, None) is not None
            return None
        message = self._open.get(peers)
        if message is None:
            return None
        message.parts[data[0]] = data[1:8]
        if data[0] * 7 < message.length:
            return None
        del self._open[peers]
        return self._whole(message, range(1, -(-message.length // 7) + 1))

    def _fast_packet(self, key: tuple[int, int], data: bytes) -> tuple[int, bytes] | None:
        if len(data) < 2:
            return None
        sequence, number = data[0] >> 5, data[0] & 31
        if number == 0:
            self.broken += key in self._open
            self._open[key] = _Open(key[0], data[1], {0: data[2:]}, sequence)
        message = self._open.get(key)
        if message is None or message.sequence != sequence:
            return None
        if number:
            message.parts[number] = data[1:]
        if 6 + 7 * number < message.length:
            return None
        del self._open[key]
        return self._whole(message, range(number + 1))

    def _whole(self, message: _Open, numbers: range) -> tuple[int, bytes] | None:
        if any(number not in message.parts for number in numbers):
            self.broken += 1
            return None
        payload = b"".join(message.parts[number] for number in numbers)[: message.length]
        return message.group, payload

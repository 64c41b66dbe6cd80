"""Named fields of a message into samples: stamp [s] and SI values by recording column, as the profile says."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from terragrip.errors import InputError
from terragrip.formats.profile import Profile, Source
from terragrip.recording.schema import LABELS, REFERENCE, TIME, is_channel, unit_of
from terragrip.units import factor_to, quantity

Values = dict[str, float]
Sample = tuple[float | None, Values]
"""Stamp [s] on the source's clock, None where the message bears none; and values."""

_HUGE = 1e300


@dataclass(frozen=True, slots=True)
class _Channel:
    name: str
    read: Callable[[Mapping[str, Any]], float | None]
    delay: float


class Decoder:
    """Turns fields into samples; ``unreadable`` collects channels whose value was no number since it was last cleared.

    Without a profile fields must bear the recording's own names, in SI, with ``time`` in s.
    """

    def __init__(self, profile: Profile | None) -> None:
        self.profile = profile
        self.unreadable: dict[str, str] = {}
        self._known: dict[str, bool] = {}
        self.wanted = frozenset() if profile is None else profile.sources
        self._time, self._zero = TIME, False
        self._first: int | float | None = None
        self._factor = 1.0
        self._channels: list[_Channel] = []
        if profile is not None:
            self._time, self._zero = profile.time.column, profile.time.zero == "first"
            self._factor = factor_to(profile.time.unit, "s")
            self._channels = [
                _Channel(name, self._reader(name, source), source.delay)
                for name, source in profile.channels.items()
                if name not in LABELS
            ]

    @property
    def channels(self) -> tuple[str, ...]:
        """The columns a profile promises; none without one."""
        return tuple(channel.name for channel in self._channels)

    def samples(self, fields: Mapping[str, Any]) -> list[Sample]:
        """The samples of one message: one, or several where channels have delays of their own; none without a value."""
        if self.profile is None:
            return self._plain(fields)
        rows = self.profile.rows
        if rows is not None and fields.get(rows.column) != rows.equals:
            return []
        stamp = self._stamp(fields)
        by_delay: dict[float, Values] = {}
        for channel in self._channels:
            value = channel.read(fields)
            if value is not None:
                by_delay.setdefault(channel.delay, {})[channel.name] = value
        return [(None if stamp is None else stamp - delay, values) for delay, values in by_delay.items()]

    def _plain(self, fields: Mapping[str, Any]) -> list[Sample]:
        values: Values = {}
        known = self._known
        for name, raw in fields.items():
            ours = known.get(name)
            if ours is None:
                ours = known[name] = is_channel(name) and not name.startswith(REFERENCE)
            if ours:
                value = raw if type(raw) is float and -_HUGE < raw < _HUGE else self._number(name, raw)
                if value is not None:
                    values[name] = value
        return [(self._stamp(fields), values)] if values else []

    def _stamp(self, fields: Mapping[str, Any]) -> float | None:
        raw = fields.get(self._time)
        if raw is None:
            return None
        if self._zero and isinstance(raw, int | float):
            if self._first is None:
                self._first = raw
            raw = raw - self._first  # in integers while they are: nanoseconds since 1970 need all 64 bits
        stamp = self._number(TIME, raw)
        return None if stamp is None else stamp * self._factor

    def _number(self, name: str, raw: Any) -> float | None:
        """A finite number, or None: missing where it is None or NaN, noted where it is anything else."""
        if raw is None:
            return None
        if isinstance(raw, bool) or not isinstance(raw, int | float):
            self.unreadable[name] = f"{type(raw).__name__} {str(raw)[:24]!r}"
            return None
        try:
            value = float(raw)
        except OverflowError:
            value = math.inf
        if math.isinf(value):
            self.unreadable[name] = "an infinite number"
            return None
        return None if value != value else value

    def _reader(self, name: str, source: Source) -> Callable[[Mapping[str, Any]], float | None]:
        factor = factor_to(source.unit, unit_of(name) or "1") if source.unit else 1.0
        gain, offset = source.sign * factor * source.scale, source.sign * factor * source.offset
        if source.constant is not None:
            constant = quantity(source.constant, unit_of(name) or "1")
            return lambda fields: constant
        if source.norm_of is not None:
            return self._norm(name, source.norm_of, gain, offset)
        if source.column is None:
            what = "derivative_of" if source.derivative_of else "pitch_of" if source.pitch_of else "roll_of"
            if what == "derivative_of":
                raise InputError(
                    "derivative_of looks ahead, which live samples cannot", place=f"channels.{name}",
                    mend="give a source of the speed itself",
                )  # fmt: skip
            return self._angle(name, source, gain, offset)
        return self._scaled(name, source, gain, offset)

    def _scaled(
        self, name: str, source: Source, gain: float, offset: float
    ) -> Callable[[Mapping[str, Any]], float | None]:
        columns, over, least = source.candidates, source.over, source.over_minimum
        bad = [item if isinstance(item, tuple) else (item, item) for item in source.invalid]
        plain = not bad and over is None

        def read(fields: Mapping[str, Any]) -> float | None:
            raw = next((fields[column] for column in columns if fields.get(column) is not None), None)
            if raw is None:
                return None
            value = self._number(name, raw)
            if plain or value is None:
                return None if value is None else gain * value + offset
            if any(low <= value <= high for low, high in bad):
                return None
            if over is not None:
                divisor = self._number(name, fields.get(over))
                if divisor is None or abs(divisor) < least:
                    return None
                value /= divisor
            return gain * value + offset

        return read

    def _norm(
        self, name: str, columns: tuple[str, ...], gain: float, offset: float
    ) -> Callable[[Mapping[str, Any]], float | None]:
        def read(fields: Mapping[str, Any]) -> float | None:
            parts = [self._number(name, fields.get(column)) for column in columns]
            known = [part for part in parts if part is not None]
            return gain * math.hypot(*known) + offset if len(known) == len(columns) else None

        return read

    def _angle(
        self, name: str, source: Source, gain: float, offset: float
    ) -> Callable[[Mapping[str, Any]], float | None]:
        import numpy as np

        from terragrip.formats.derivation import pitch_of, roll_of

        columns, angle = (source.pitch_of, pitch_of) if source.pitch_of else (source.roll_of, roll_of)

        def read(fields: Mapping[str, Any]) -> float | None:
            parts = [self._number(name, fields.get(column)) for column in columns or ()]
            if any(part is None for part in parts):
                return None
            value = float(angle([np.array([part]) for part in parts])[0])
            return None if value != value else gain * value + offset

        return read

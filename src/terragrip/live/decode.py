"""Named fields of a message into samples: stamp [s] and SI values by recording column, as the profile says."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.estimation.rims import speeds_alone
from terragrip.formats.profile import Profile
from terragrip.formats.profile_parts import Source, matching
from terragrip.live.outputs import Values
from terragrip.recording.schema import LABELS, REFERENCE, TIME, is_channel, unit_of
from terragrip.units import factor_to, quantity

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

Sample = tuple[float | None, Values]
"""Stamp [s] on the source's clock, None where the message has none; and values."""

_HUGE = 1e300
_NAMES = 1000  # of fields, beyond which a sender makes them up
_SPARE = 0.02  # s between a delay and the window that is advised for it


_LAYOUTS = 256  # sets of fields whose plan is kept

Read = Callable[[Mapping[str, Any]], float | None]


@dataclass(frozen=True, slots=True)
class _Step:
    """How a message of one set of fields gives a channel; of several ways the one of lowest ``rank`` counts."""

    channel: str
    delay: float
    rank: tuple[int, int]
    read: Read


class Decoder:
    """Turns fields into samples; ``unreadable`` collects channels whose value was no number since it was last cleared.

    Without a profile fields must have the recording's own names, in SI, with ``time`` in s. ``units``: what the source
    itself states of its fields. Raises InputError where the profile needs what only a whole log can give.
    """

    def __init__(self, profile: Profile | None) -> None:
        self.profile = profile
        self.units: dict[str, str] = {}
        self.unreadable: dict[str, str] = {}
        self._known: dict[str, bool] = {}
        self._time, self._zero = TIME, False
        self._first: int | float | None = None
        self._factor = 1.0
        self._plans: dict[tuple[str, ...], list[_Step]] = {}
        self._best: dict[str, tuple[int, int]] = {}
        self._divisors: dict[str, Any] = {}
        self._sources: dict[str, Source] = {}
        if profile is not None:
            self._time, self._zero = profile.time.column, profile.time.zero == "first"
            self._factor = factor_to(profile.time.unit, "s")
            self._sources = {name: one for name, one in profile.channels.items() if name not in LABELS}
            for name, source in self._sources.items():
                _refuse_looking_ahead(name, source)
                self._divisors |= {one.over: None for one in source.chain if one.over is not None}

    @property
    def channels(self) -> tuple[str, ...]:
        """The columns a profile promises; none without one."""
        return tuple(name for name, source in self._sources.items() if not source.optional)

    def wants(self, name: str) -> bool:
        """Whether the profile names a field."""
        return self.profile is not None and self.profile.wants(name)

    def samples(self, fields: Mapping[str, Any], arrival: float | None = None) -> list[Sample]:
        """The samples of one message: one, or several where channels have delays of their own; none without a value.

        ``arrival`` [s]: its stamp, where it holds none.
        """
        if self.profile is None:
            return self._plain(fields)
        rows = self.profile.rows
        if rows is not None and fields.get(rows.column) != rows.equals:
            return []
        layout = tuple(fields)
        plan = self._plans.get(layout)
        if plan is None:
            plan = self._plan(layout)
        if self._divisors:
            self._divisors |= {name: fields[name] for name in self._divisors if name in fields}
        by_delay: dict[float, Values] = {}
        for step in plan:
            if step.rank > self._best.get(step.channel, step.rank):
                continue  # a better source of this channel has spoken
            value = step.read(fields)
            if value is not None:
                self._best[step.channel] = step.rank
                by_delay.setdefault(step.delay, {})[step.channel] = value
        if not by_delay:
            return []
        stamp = self._stamp(fields)
        if stamp is None:
            stamp = arrival
        return [(None if stamp is None else stamp - delay, values) for delay, values in by_delay.items()]

    def _plan(self, layout: tuple[str, ...]) -> list[_Step]:
        """What messages of these fields give: of each channel's ways the first whose fields are all there."""
        plan = []
        for name, source in self._sources.items():
            result = next(
                (step for k, one in enumerate(source.chain) if (step := self._step(name, k, one, layout))),
                None,
            )
            if result is not None:
                plan.append(result)
        if len(self._plans) < _LAYOUTS:
            self._plans[layout] = plan
        return plan

    def _step(self, name: str, place: int, source: Source, layout: tuple[str, ...]) -> _Step | None:
        if source.constant is not None:
            constant = quantity(source.constant, unit_of(name) or "1")
            return _Step(name, source.delay, (place, 0), lambda fields: constant)
        several = source.norm_of or source.sum_of or source.pitch_of or source.roll_of
        if several is not None:
            columns = [next(iter(matching(column, layout)), None) for column in several]
            if None in columns:
                return None
            return _Step(
                name, source.delay, (place, 0), self._vector(name, source, [str(c) for c in columns])
            )
        for rank, candidate in enumerate(source.candidates):
            column = next(iter(matching(candidate, layout)), None)
            if column is not None:
                return _Step(name, source.delay, (place, rank), self._scaled(name, source, column))
        return None

    def _plain(self, fields: Mapping[str, Any]) -> list[Sample]:
        values: Values = {}
        known = self._known
        for name, raw in fields.items():
            ours = known.get(name)
            if ours is None:
                ours = _is_ours(name) and len(known) < _NAMES
                if len(known) < _NAMES:
                    known[name] = ours
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

    def _gain(self, name: str, source: Source, column: str | None) -> tuple[float, float]:
        """Factor and offset from a field's number to SI: by the profile's unit, else by the one that the source states."""
        unit = source.unit
        if unit is None and source.scale == 1.0 and source.over is None and column is not None:
            unit = self.units.get(column)
        factor = factor_to(unit, unit_of(name) or "1") if unit else 1.0
        return source.gain(factor)

    def _scaled(self, name: str, source: Source, column: str) -> Read:
        gain, offset = self._gain(name, source, column)
        over, least = source.over, source.over_minimum
        bad = [item if isinstance(item, tuple) else (item, item) for item in source.invalid]
        plain = not bad and over is None

        def read(fields: Mapping[str, Any]) -> float | None:
            raw = fields.get(column)
            if raw is None:
                return None
            value = self._number(name, raw)
            if plain or value is None:
                return None if value is None else gain * value + offset
            if any(low <= value <= high for low, high in bad):
                return None
            if over is not None:
                divisor = self._number(name, fields.get(over, self._divisors[over]))
                if divisor is None or abs(divisor) < least:
                    return None
                value /= divisor
            return gain * value + offset

        return read

    def _vector(self, name: str, source: Source, columns: list[str]) -> Read:
        """The size of a vector, a sum, or the pitch or roll of a quaternion."""
        import numpy as np

        from terragrip.formats.derivation import pitch_of, roll_of

        gain, offset = self._gain(name, source, columns[0])

        def read(fields: Mapping[str, Any]) -> float | None:
            parts = [self._number(name, fields.get(column)) for column in columns]
            numbers = [part for part in parts if part is not None]
            if len(numbers) < len(parts):
                return None
            if source.norm_of is not None:
                value = math.sqrt(
                    sum(number * number for number in numbers)
                )  # hypot rounds otherwise than a file's columns
            elif source.sum_of is not None:
                bad = [item if isinstance(item, tuple) else (item, item) for item in source.invalid]
                if any(low <= number <= high for number in numbers for low, high in bad):
                    return None
                value = sum(
                    factor * number for factor, number in zip(source.sum_of.values(), numbers, strict=True)
                )
            else:
                angle = pitch_of if source.pitch_of is not None else roll_of
                value = float(angle([np.array([number]) for number in numbers])[0])
            return None if value != value else gain * value + offset

        return read


def _is_ours(name: str) -> bool:
    """Whether a field is a channel. A sender may call it anything: wheels' names are letters, digits and underscores."""
    return is_channel(name) and not name.startswith(REFERENCE) and name.isascii() and name.isidentifier()


def _refuse_looking_ahead(name: str, source: Source) -> None:
    if all(one.derivative_of is not None for one in source.chain) and not source.optional:
        raise InputError(
            "derivative_of needs future samples, which do not exist live",
            place=f"channels.{name}",
            hint="give a source of the speed itself",
        )


def _refuse_late(profile: Profile, window: float) -> None:
    """A channel whose delay is longer than the window comes when the rows of its instants are gone: always."""
    delays = {
        name: one.delay
        for name, source in profile.channels.items()
        if name not in LABELS
        for one in source.chain
    }
    latest = max(delays, key=lambda name: delays[name], default="")
    if latest and (more := delays[latest] - min(delays.values())) >= window:
        raise InputError(
            f"has a delay of {1000 * delays[latest]:.4g} ms, and rows wait for {1000 * window:.4g} ms: all its samples would be late",
            place=f"channels.{latest}",
            hint=f"give --window {math.ceil(1000 * (more + _SPARE)):d}",
        )


def check_channels(profile: Profile, vehicle: Vehicle, window: float) -> None:
    """Raise InputError where the profile lacks what the filter cannot do without, or a delay is longer than rows wait: ``window`` [s].

    Without any torque slip alone is estimated: of the wheels that have a speed, or of the drive train as one.
    """
    _refuse_late(profile, window)
    if speeds_alone(profile.channels, vehicle):
        return
    needed = ["ground_speed", *(f"wheel_speed_{wheel}" for wheel in vehicle.wheels)]
    lacking = [name for name in needed if name not in profile.channels]
    if lacking:
        raise InputError(
            f"the profile gives no {lacking[0]}",
            place="--profile",
            hint="live estimates need the ground speed and each wheel's speed; without torques wheel_based_speed will do",
        )

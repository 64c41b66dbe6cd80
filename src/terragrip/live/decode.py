"""Named fields of a message into samples: stamp [s] and SI values by recording column, as the profile says."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.rims import speeds_alone
from terragrip.formats.derivation import pitch_of, roll_of
from terragrip.formats.profile import Profile
from terragrip.formats.profile_parts import Source, TimeSource, matching
from terragrip.live.outputs import Values
from terragrip.recording.schema import LABELS, REFERENCE, TIME, is_channel, unit_of
from terragrip.units import factor_to, quantity

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

Sample = tuple[float | None, Values]
"""Stamp [s] on the source's clock, None where the message has none; and values."""

_NAMES = 1000  # of fields, beyond which a sender makes them up
_SPARE = 0.02  # s between a delay and the window that is advised for it
_LAYOUTS = 256  # sets of fields whose plan is kept

Read = Callable[["Decoder", Mapping[str, Any]], float | None]


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
        self._stamps = TimeSource.model_validate({}) if profile is None else profile.time
        self._tick = factor_to(self._stamps.unit, "s")
        self._first: Any = None
        self._plans: dict[tuple[str, ...], list[_Step]] = {}
        self._best: dict[str, tuple[int, int]] = {}
        self._sources: dict[str, Source] = {}
        if profile is not None:
            self._sources = {name: one for name, one in profile.channels.items() if name not in LABELS}
            for name, source in self._sources.items():
                _refuse_looking_ahead(name, source)
        every = (one for source in self._sources.values() for one in source.chain)
        self._divisors: dict[str, Any] = {one.over: None for one in every if one.over is not None}

    @property
    def channels(self) -> tuple[str, ...]:
        """The columns a profile promises; none without one."""
        promised = {} if self.profile is None else self._sources
        return tuple(name for name, source in promised.items() if not source.optional)

    def wants(self, name: str) -> bool:
        """Whether the profile names a field."""
        return self.profile is not None and self.profile.wants(name)

    def samples(self, fields: Mapping[str, Any], arrival: float | None = None) -> list[Sample]:
        """The samples of one message: one, or several where channels have delays of their own; none without a value.

        ``arrival`` [s]: its stamp, where it holds none.
        """
        rows = None if self.profile is None else self.profile.rows
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
            value = step.read(self, fields)
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
        if self.profile is None:
            ours = [name for name in layout if _is_ours(name) and name not in self._sources]
            self._sources |= {
                n: Source.model_validate({"from": n}) for n in ours[: _NAMES - len(self._sources)]
            }
        steps = (self._step(name, source, layout) for name, source in self._sources.items())
        plan = [step for step in steps if step is not None]
        if len(self._plans) < _LAYOUTS:
            self._plans[layout] = plan
        return plan

    def _step(self, name: str, origin: Source, layout: tuple[str, ...]) -> _Step | None:
        for place, source in enumerate(origin.chain):
            for rank, way in enumerate(_ways(source)):
                columns = [column for one in way for column in matching(one, layout)[:1]]
                if len(columns) == len(way):
                    return _Step(name, source.delay, (place, rank), self._reader(name, source, columns))
        return None

    def _stamp(self, fields: Mapping[str, Any]) -> float | None:
        raw = fields.get(self._stamps.column)
        stamp = self._number(TIME, raw)
        if stamp is None:
            return None
        if self._stamps.zero:
            self._first = raw if self._first is None else self._first
            # In integers while they are: nanoseconds since 1970 need all 64 bits.
            stamp = self._number(TIME, raw - self._first)
        return None if stamp is None else stamp * self._tick

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

    def _gain(self, name: str, source: Source, columns: list[str]) -> tuple[float, float]:
        """Factor and offset from a field's number to SI: by the profile's unit, else by the one that the source states."""
        unit, plain = source.unit, source.scale == 1.0 and source.over is None
        if unit is None and plain and columns and self.profile is not None:
            unit = self.units.get(columns[0])
        return source.gain(factor_to(unit, unit_of(name) or "1") if unit else 1.0)

    def _reader(self, name: str, source: Source, columns: list[str]) -> Read:
        """What gives a channel's value of a message that has these fields, of whichever decoder reads it."""
        gain, offset = self._gain(name, source, columns)
        value_of, over = _combination(name, source), source.over
        checked = source.invalid if source.candidates or source.sum_of else ()
        bad = [item if isinstance(item, tuple) else (item, item) for item in checked]

        def read(decoder: Decoder, fields: Mapping[str, Any]) -> float | None:
            numbers = (decoder._number(name, fields.get(column)) for column in columns)
            parts = [number for number in numbers if number is not None]
            if len(parts) < len(columns) or any(low <= part <= high for part in parts for low, high in bad):
                return None
            value = value_of(parts)
            if over is not None:
                divisor = decoder._number(name, fields.get(over, decoder._divisors[over]))
                if divisor is None or abs(divisor) < source.over_minimum:
                    return None
                value /= divisor
            return None if value != value else gain * value + offset

        return read


def _ways(source: Source) -> list[tuple[str, ...]]:
    """The fields, or patterns of them, that a source can be had from: one of several, or some together; none of a constant."""
    together = source.norm_of or source.sum_of or source.pitch_of or source.roll_of
    if together is not None or source.constant is not None:
        return [tuple(together or ())]
    return [(candidate,) for candidate in source.candidates]


def _combination(name: str, source: Source) -> Callable[[list[float]], float]:
    """From the numbers of a source's fields to one: the size of a vector, a sum, the pitch or roll of a quaternion, or the only one."""
    if source.constant is not None:
        constant = quantity(source.constant, unit_of(name) or "1")
        return lambda parts: constant
    if source.norm_of is not None:  # hypot rounds otherwise than a file's columns
        return lambda parts: math.sqrt(sum(part * part for part in parts))
    if source.sum_of is not None:
        factors = tuple(source.sum_of.values())
        return lambda parts: sum(factor * part for factor, part in zip(factors, parts, strict=True))
    if source.candidates:
        return lambda parts: parts[0]
    angle = pitch_of if source.pitch_of is not None else roll_of
    return lambda parts: float(angle([np.array([part]) for part in parts])[0])


def _is_ours(name: str) -> bool:
    """Whether a field is a channel. A sender may call it anything: wheels' names are letters, digits and underscores."""
    return is_channel(name) and not name.startswith(REFERENCE) and name.isascii() and name.isidentifier()


def _refuse_looking_ahead(name: str, source: Source) -> None:
    if all(one.has_window for one in source.chain) and not source.optional:
        raise InputError(
            "a window needs future samples, which do not exist live",
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
    rolling = [f"wheel_speed_{wheel}" for wheel in vehicle.free_wheels]
    lacking = [name for name in needed if name not in (*profile.channels, *rolling)]
    if lacking:
        raise InputError(
            f"the profile gives no {lacking[0]}",
            place="--profile",
            hint="live estimates need the ground speed and each driven wheel's speed; without torques wheel_based_speed will do",
        )

"""A profile: how the columns of a foreign log become those of a recording. A YAML file.

    time: {from: unix_ns, unit: ns, zero: first}
    rows: {column: calib_state, equals: calib}              # optional: only these rows
    channels:
      wheel_speed_left: {from: meas_left_vel, unit: rad/s}
      drive_torque_left: {from: left_current, scale: 2.079, unit: N m, invalid: [0, [900, 1000]], delay: 50 ms}
      ground_speed: {derivative_of: [x, y], unit: m, window: 0.5 s, forward: {yaw: heading, unit: deg}}
      pitch: {pitch_of: [qx, qy, qz, qw]}
      drive_torque_right: {from: right_current, over: meas_right_vel, over_minimum: 0.3, scale: 48, unit: N m}
      soil: {constant: grass}

A value is ``sign * (scale * raw + offset)`` in ``unit``; ``invalid`` values and ranges are judged on the raw one.
With ``over`` the raw value is a quotient of two columns, as a torque is power over speed: missing where the divisor is
smaller in size than ``over_minimum``, and between the updates of a held dividend.

``from`` may list names, of which the first that the log has, with a value, counts; ``*`` in a name stands for any text.
``norm_of`` is the size of a vector of two or three columns; ``derivative_of`` takes a latitude and a longitude too, with
``unit: deg``. ``else`` holds what to do where the log lacks a source: ``{from: gps_speed, else: {derivative_of: [x, y]}}``.
A channel with ``optional: true`` is left out, with a note, where the log lacks it. ``dbc:`` names the DBC files of a CAN
log, from the profile's folder. Profiles that come with Terragrip go by name: `SHIPPED`.
"""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from terragrip.document import Fault, Part, read_yaml, validate
from terragrip.errors import InputError, nearest
from terragrip.formats.payload import Payload
from terragrip.recording import Recording
from terragrip.recording.schema import (
    AXLE_CHANNELS,
    CHANNELS,
    LABELS,
    TIME,
    WHEEL_CHANNELS,
    is_channel,
    unit_of,
)
from terragrip.units import UnitError, factor_to, quantity

Seconds = Annotated[float, BeforeValidator(lambda value: quantity(value, "s"))]
Quaternion = tuple[str, str, str, str]

SHIPPED = ("tractor-isobus", "ros2-4wd", "simulink")
"""Profiles that come with Terragrip: give the name in place of a file."""


class Forward(Part):
    """What tells forward from backward: a yaw column and its unit, or the columns of a quaternion x, y, z, w."""

    yaw: str | None = None
    unit: str = "rad"
    quaternion: Quaternion | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if (self.yaw is None) == (self.quaternion is None):
            raise Fault("needs a yaw or a quaternion", "write e.g. 'forward: {yaw: heading, unit: deg}'")
        unit_factor(self.unit, "rad")
        return self


class Source(Part):
    """Where one channel comes from, and what is done to it."""

    column: str | Annotated[tuple[str, ...], Field(min_length=1)] | None = Field(None, alias="from")
    optional: bool = False
    over: str | None = None
    over_minimum: float = Field(0.0, ge=0.0, allow_inf_nan=False)
    derivative_of: Annotated[tuple[str, ...], Field(min_length=1, max_length=3)] | None = None
    norm_of: Annotated[tuple[str, ...], Field(min_length=2, max_length=3)] | None = None
    pitch_of: Quaternion | None = None
    roll_of: Quaternion | None = None
    constant: str | float | None = None
    unit: str | None = None
    scale: float = Field(1.0, allow_inf_nan=False)
    offset: float = Field(0.0, allow_inf_nan=False)
    sign: Literal[1, -1] = 1
    delay: Seconds = 0.0
    invalid: tuple[float | tuple[float, float], ...] = ()
    window: Seconds = 0.5
    forward: Forward | None = None
    otherwise: Source | None = Field(None, alias="else")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [
            k
            for k in ("column", "derivative_of", "norm_of", "pitch_of", "roll_of", "constant")
            if getattr(self, k) is not None
        ]
        if len(given) != 1:
            hint = "write one of from, derivative_of, norm_of, pitch_of, roll_of, constant"
            raise Fault("needs exactly one source", hint)
        for key in ("window", "forward"):
            if key in self.model_fields_set and self.derivative_of is None:
                raise Fault("serves derivative_of only", "leave it out", (key,))
        if self.over is not None and self.column is None:
            raise Fault("serves from only", "leave it out", ("over",))
        if self.over is not None and self.over_minimum <= 0:
            hint = "write e.g. 'over_minimum: 0.3', in the divisor's unit"
            raise Fault(
                "needs a positive over_minimum, since a quotient over next to nothing is noise",
                hint,
                ("over",),
            )
        if self.over is None and "over_minimum" in self.model_fields_set:
            raise Fault("serves over only", "leave it out", ("over_minimum",))
        if self.forward is not None and len(self.derivative_of or ()) != 2:
            raise Fault("needs derivative_of two columns, x and y", "leave it out", ("forward",))
        if self.window <= 0:
            raise Fault("is not a span of time", "write e.g. '0.5 s'", ("window",))
        return self

    @property
    def is_geographic(self) -> bool:
        """Whether it is the derivative of a latitude and a longitude."""
        angles = ("deg", "degree", "degrees", "°")
        return self.derivative_of is not None and len(self.derivative_of) == 2 and self.unit in angles

    @property
    def chain(self) -> tuple[Source, ...]:
        """Itself, and what may take its place, in turn."""
        return (self,) if self.otherwise is None else (self, *self.otherwise.chain)

    @property
    def candidates(self) -> tuple[str, ...]:
        """The names, or patterns of names, of which the first counts."""
        return (self.column,) if isinstance(self.column, str) else self.column or ()

    @property
    def columns(self) -> tuple[str, ...]:
        """The log's columns that it may read, or patterns of them; those of `otherwise` are its own."""
        heading = () if self.forward is None else (self.forward.yaw, *(self.forward.quaternion or ()))
        every = (
            *self.candidates,
            self.over,
            *(self.derivative_of or ()),
            *(self.norm_of or ()),
            *(self.pitch_of or ()),
            *(self.roll_of or ()),
            *heading,
        )
        return tuple(name for name in every if name is not None)


class TimeSource(Part):
    """The column of the stamps, its unit, and whether time begins with 0 at the first row."""

    column: str = Field(TIME, alias="from")
    unit: str = "s"
    zero: Literal["first"] | None = None

    @field_validator("unit")
    @classmethod
    def _is_a_time(cls, value: str) -> str:
        unit_factor(value, "s")
        return value


class Rows(Part):
    """The rows to keep: those whose ``column`` equals a value."""

    column: str
    equals: str | float | bool


class Profile(Part):
    """How a foreign log becomes a recording; the module's text shows the file."""

    PAGE: ClassVar[str | None] = "formats#in-a-profile"

    name: str = ""
    description: str = ""
    time: TimeSource = Field(default_factory=lambda: TimeSource.model_validate({}))
    rows: Rows | None = None
    payload: Payload | None = None  # of a live source's messages
    dbc: tuple[str, ...] = ()
    channels: dict[str, Source]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a profile file, or take one of `SHIPPED` by name.

        Raises InputError with the file, the key, its line and the fix.
        """
        own = Path(__file__).with_name("profiles") / f"{path}.yaml"
        if os.fspath(path) in SHIPPED and not Path(path).is_file():
            return validate(cls, read_yaml(own))
        name = os.fspath(path)
        if not Path(path).exists() and Path(path).parent == Path() and not Path(path).suffix:
            close = nearest(name, SHIPPED)
            hint = f"did you mean {close!r}?" if close else f"those are {', '.join(SHIPPED)}"
            raise InputError(f"{name!r} is no file, and no profile that comes with Terragrip", hint=hint)
        result = validate(cls, read_yaml(path))
        here = Path(path).parent
        return result.model_copy(update={"dbc": tuple(os.fspath(here / name) for name in result.dbc)})

    @classmethod
    def from_dict(cls, data: dict[str, Any], file: str | None = None) -> Self:
        """Build from a mapping as a profile file holds; raises InputError, which names ``file`` if given."""
        return validate(cls, data, file=file)

    def to_dict(self) -> dict[str, Any]:
        """What `from_dict` takes, ready for JSON."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    @field_validator("dbc", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @field_validator("channels", mode="before")
    @classmethod
    def _short_forms(cls, value: Any) -> Any:
        """``ground_speed: speed`` is short for ``ground_speed: {from: speed}``."""
        if not isinstance(value, dict):
            return value
        return {k: {"from": v} if isinstance(v, str | list) else v for k, v in value.items()}

    @model_validator(mode="after")
    def _known_channels(self) -> Self:
        for name, source in self.channels.items():
            if name == TIME:
                raise Fault(
                    "time is no channel",
                    "write it as 'time: {from: ...}' beside channels",
                    ("channels", name),
                )
            if name not in LABELS and not is_channel(name):
                close = nearest(
                    name, (*CHANNELS, *LABELS, *(f"{q}_fl" for q in (*WHEEL_CHANNELS, *AXLE_CHANNELS)))
                )
                hint = (
                    f"did you mean {close!r}?"
                    if close
                    else "the names are in architecture.md, contracts, e.g. wheel_speed_fl"
                )
                raise Fault("no such channel", hint, ("channels", name))
            for one in source.chain:
                _check_unit(name, one)
        return self

    def wants(self, name: str) -> bool:
        """Whether the profile may read a column of that name."""
        return name in self.sources or any(fnmatch.fnmatchcase(name, p) for p in self._patterns)

    @cached_property
    def _patterns(self) -> tuple[str, ...]:
        return tuple(as_pattern(name) for name in self.sources if "*" in name)

    @cached_property
    def sources(self) -> frozenset[str]:
        """All columns of the log that the profile may read, as it names them."""
        named = {
            column for one in self.channels.values() for source in one.chain for column in source.columns
        }
        return frozenset({self.time.column, *named, *([self.rows.column] if self.rows else [])})

    def apply(self, log: Any, source: str | None = None) -> Recording:
        """Turn a log (a `LogTable`, a DataFrame or a mapping of columns) into a Recording.

        Raises InputError where a column is missing (and names the nearest), where it holds text, where no row
        is left, and for whatever `Recording.from_frame` refuses. ``source`` is the file that errors name.
        """
        from terragrip.formats.conversion import convert

        return convert(self, log, source)


def as_pattern(name: str) -> str:
    """A name with ``*`` as a pattern of `fnmatch`, in which nothing else is special."""
    return "".join(f"[{c}]" if c in "[?" else c for c in name)


def matching(name: str, names: Iterable[str]) -> list[str]:
    """The names that a profile's name stands for: itself, or all that its ``*`` allows."""
    if "*" not in name:
        return [name] if name in names else []
    pattern = as_pattern(name)
    return [result for result in names if fnmatch.fnmatchcase(result, pattern)]


def unit_factor(unit: str, target: str) -> float:
    """Factor from a profile's unit to the schema's; raises Fault, for a validator to place."""
    try:
        return factor_to(unit, target)
    except UnitError as error:
        raise Fault(error.problem, error.hint or "") from error


def _check_unit(name: str, origin: Source) -> None:
    """Raise Fault unless the unit, or the constant with its unit, fits the channel."""
    target = unit_of(name)
    try:
        if origin.unit is not None and target is not None and not origin.is_geographic:
            factor_to(rate_unit(origin.unit) if origin.derivative_of else origin.unit, target)
        if origin.constant is not None and name not in LABELS:
            quantity(origin.constant, target or "1")
    except UnitError as error:
        raise Fault(error.problem, error.hint or "write an SI unit", ("channels", name)) from error


def rate_unit(unit: str) -> str:
    """The unit of the time derivative of what is measured in ``unit``."""
    return f"{unit} s^-1"

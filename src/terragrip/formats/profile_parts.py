"""The parts of a profile: where the time and each channel come from, and which columns of a log a name stands for."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from terragrip.document import Fault, Part
from terragrip.recording.schema import TIME
from terragrip.units import UnitError, factor_to, quantity

Seconds = Annotated[float, BeforeValidator(lambda value: quantity(value, "s"))]


def one_or_several(value: object) -> object:
    """``derivative_of: ticks`` is short for ``derivative_of: [ticks]``."""
    return (value,) if isinstance(value, str) else value


def _with_factors(value: object) -> object:
    """``sum_of: [left, right]`` is short for ``sum_of: {left: 1, right: 1}``."""
    return dict.fromkeys(value, 1.0) if isinstance(value, list | tuple) else value


Quaternion = tuple[str, str, str, str]
MADE_OF = ("derivative_of", "norm_of", "sum_of", "pitch_of", "roll_of")
"""Keys of a `Source` that name the columns which it is computed from."""


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
    derivative_of: (
        Annotated[tuple[str, ...], BeforeValidator(one_or_several), Field(min_length=1, max_length=3)] | None
    ) = None
    norm_of: Annotated[tuple[str, ...], Field(min_length=2, max_length=3)] | None = None
    sum_of: (
        Annotated[
            dict[str, Annotated[float, Field(allow_inf_nan=False)]],
            BeforeValidator(_with_factors),
            Field(min_length=2),
        ]
        | None
    ) = None
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
        if sum(getattr(self, key) is not None for key in ("column", *MADE_OF, "constant")) != 1:
            raise Fault("needs exactly one source", f"write one of from, {', '.join(MADE_OF)}, constant")
        if self.forward is not None and self.derivative_of is None:
            raise Fault("works with derivative_of only", "leave it out", ("forward",))
        if "window" in self.model_fields_set and not self.has_window:
            raise Fault("works with derivative_of, or with from alone", "leave it out", ("window",))
        if self.over is not None and self.column is None:
            raise Fault("serves from only", "leave it out", ("over",))
        if self.over is not None and self.over_minimum <= 0:
            hint = "write e.g. 'over_minimum: 0.3', in the divisor's unit"
            raise Fault(
                "needs a positive over_minimum, since a quotient by nearly zero is noise",
                hint,
                ("over",),
            )
        if self.over is None and "over_minimum" in self.model_fields_set:
            raise Fault("serves over only", "leave it out", ("over_minimum",))
        if self.forward is not None and len(self.derivative_of or ()) != 2:
            raise Fault("needs derivative_of two columns, x and y", "leave it out", ("forward",))
        last = [name.lower().rpartition(".")[2] for name in self.derivative_of or ()]
        if self.is_geographic and "lon" in last[0] and "lat" in last[1] and "lon" not in last[1]:
            raise Fault(
                "names the longitude first",
                "write the latitude first, then the longitude",
                ("derivative_of",),
            )
        if self.scale == 0:
            raise Fault("makes every value 0", "write the factor from the column to its unit", ("scale",))
        if self.window <= 0:
            raise Fault("is not a span of time", "write e.g. '0.5 s'", ("window",))
        return self

    def gain(self, factor: float) -> tuple[float, float]:
        """What a value is multiplied by, and what is then added, where ``factor`` leads from its unit to the channel's."""
        if self.is_geographic:  # the scale is that of the degrees
            return self.sign, self.sign * self.offset
        return self.sign * factor * self.scale, self.sign * factor * self.offset

    @property
    def is_geographic(self) -> bool:
        """Whether it is the derivative of a latitude and a longitude."""
        angles = ("deg", "degree", "degrees", "°")
        return self.derivative_of is not None and len(self.derivative_of) == 2 and self.unit in angles

    @property
    def has_window(self) -> bool:
        """Whether a row of it follows from rows around: a derivative, or the mean of a column over a ``window``."""
        mean = "window" in self.model_fields_set and self.column is not None and self.over is None
        return self.derivative_of is not None or mean

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
        parts = (name for key in MADE_OF for name in getattr(self, key) or ())
        return tuple(name for name in (*self.candidates, self.over, *parts, *heading) if name is not None)


class TimeSource(Part):
    """The column of the stamps, its unit, whether time begins with 0 at the first row, and how dates are written.

    ``nanoseconds``: the column of those beside whole seconds, as ROS writes its stamps.
    """

    column: str = Field(TIME, alias="from")
    nanoseconds: str | None = None
    unit: str = "s"
    zero: Literal["first"] | None = None
    dates: Literal["dd/mm/yyyy", "mm/dd/yyyy"] | None = None

    @field_validator("unit")
    @classmethod
    def _is_a_time(cls, value: str) -> str:
        unit_factor(value, "s")
        return value

    @model_validator(mode="after")
    def _whole_seconds(self) -> Self:
        if self.nanoseconds is not None and unit_factor(self.unit, "s") != 1.0:
            raise Fault("works with whole seconds only", "leave 'unit:' out, or it", ("nanoseconds",))
        return self


_COMMANDED = re.compile(r"(?<![a-z])(cmd|command(s|ed)?|set_?point|desired|target)(?![a-z])", re.IGNORECASE)


class Rows(Part):
    """The rows to keep: those whose ``column`` equals a value."""

    column: str
    equals: str | float | bool


def as_pattern(name: str) -> str:
    """A name with ``*`` as a pattern of `fnmatch`, in which nothing else is special."""
    return "".join(f"[{c}]" if c in "[?" else c for c in name)


def matching(name: str, names: Iterable[str]) -> list[str]:
    """The names that a profile's name stands for: itself, or all that its ``*`` allows.

    ``*`` stands for nothing that was commanded (``/cmd_vel``, ``/joint_commands``): the profile says that word, or it was not meant.
    """
    if "*" not in name:
        return [name] if name in names else []
    pattern = as_pattern(name)
    found = [result for result in names if fnmatch.fnmatchcase(result, pattern)]
    return found if _COMMANDED.search(name) else [result for result in found if not _COMMANDED.search(result)]


def unit_factor(unit: str, target: str) -> float:
    """Factor from a profile's unit to the schema's; raises Fault, for a validator to place."""
    try:
        return factor_to(unit, target)
    except UnitError as error:
        raise Fault(error.problem, error.hint or "") from error


def rate_unit(unit: str) -> str:
    """The unit of the time derivative of what is measured in ``unit``."""
    return f"{unit} s^-1"

"""A profile: the rules that turn the columns of a foreign log into those of a recording. A YAML file.

    time: {from: unix_ns, unit: ns, zero: first}
    rows: {column: calib_state, equals: calib}              # optional: only these rows
    channels:
      wheel_speed_left: {from: meas_left_vel, unit: rad/s}
      drive_torque_left: {from: left_current, scale: 2.079, unit: N m, invalid: [0, [900, 1000]], delay: 50 ms}
      ground_speed: {derivative_of: [x, y], unit: m, window: 0.5 s, forward: {yaw: heading, unit: deg}}
      pitch: {pitch_of: [qx, qy, qz, qw]}
      drive_torque_right: {from: right_current, over: meas_right_vel, over_minimum: 0.3, scale: 48, unit: N m}
      soil: {constant: grass}

A value is ``sign * (scale * raw + offset)`` in ``unit``; ``invalid`` values and ranges apply to the raw one.
With ``over`` the raw value is a quotient of two columns, as a torque is power over speed. It is missing where the divisor is
smaller in size than ``over_minimum``, and between the updates of a held dividend.

``from`` may list names; the first one in the log with a value counts. ``*`` in a name is any text.
``norm_of`` is the size of a vector of two or three columns, ``sum_of`` a sum of columns, each times its factor if factors are given
(``{sum_of: {p_a: 14.3, p_b: -14.3}}``). ``derivative_of`` accepts a latitude and a longitude too, with
``unit: deg``. ``else`` is the source to use where the log lacks the first: ``{from: gps_speed, else: {derivative_of: [x, y]}}``.
A channel with ``optional: true`` is left out, with a note, where the log lacks it. ``dbc:`` names the DBC files of a CAN
log, from the profile's folder. Profiles that come with Terragrip are used by name: `SHIPPED`.
"""

from __future__ import annotations

import fnmatch
import os
import re
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from terragrip.document import Fault, Part, read_yaml, validate
from terragrip.errors import InputError, suggestion
from terragrip.files import path_of
from terragrip.formats.conversion import convert
from terragrip.formats.machines import inside, renamed
from terragrip.formats.payload import Payload
from terragrip.formats.profile_parts import Rows, Source, TimeSource, as_pattern, one_or_several, rate_unit
from terragrip.recording import Recording
from terragrip.recording.frames import names_and_units
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

SHIPPED = ("tractor-isobus", "ros2-4wd", "simulink")
"""Profiles that come with Terragrip: give the name in place of a file."""


class Profile(Part):
    """The rules that turn a foreign log into a recording; the module's docstring shows the file."""

    PAGE: ClassVar[str | None] = "formats#in-a-profile"

    name: str = ""
    description: str = ""
    namespace: str = ""  # of the one of several machines in a log whose columns are meant
    time: TimeSource = Field(default_factory=lambda: TimeSource.model_validate({}))
    rows: Rows | None = None
    payload: Payload | None = None  # of a live source's messages
    dbc: Annotated[tuple[str, ...], BeforeValidator(one_or_several)] = ()
    channels: dict[str, Source]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a profile file, or one of `SHIPPED` by name.

        Raises InputError with the file, the key, its line and the fix.
        """
        path = path_of(path, "give the path of a profile; its content as a dict is for from_dict(...)")
        own = Path(__file__).with_name("profiles") / f"{path}.yaml"
        if path in SHIPPED and not Path(path).is_file():
            return validate(cls, read_yaml(own))
        if not Path(path).exists() and Path(path).parent == Path() and not Path(path).suffix:
            hint = suggestion(path, SHIPPED, f"those are {', '.join(SHIPPED)}")
            raise InputError(f"{path!r} is neither a file nor a profile that comes with Terragrip", hint=hint)
        result = validate(cls, read_yaml(path))
        databases = tuple(os.fspath(Path(path).parent / name) for name in result.dbc)
        return result.model_copy(update={"dbc": databases} if databases else {})

    @classmethod
    def from_dict(cls, data: dict[str, Any], file: str | None = None) -> Self:
        """Build from a mapping with the content of a profile file; raises InputError, which names ``file`` if given."""
        return validate(cls, data, file=file)

    def to_dict(self) -> dict[str, Any]:
        """The profile as `from_dict` accepts it, ready for JSON."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    @model_validator(mode="before")
    @classmethod
    def _inside_its_namespace(cls, data: Any) -> Any:
        space = data.get("namespace") if isinstance(data, dict) else None
        if not isinstance(space, str) or not space.strip("/"):
            return data
        space = "/" + space.strip("/")
        named = {key: data[key] for key in ("time", "rows", "channels") if key in data}
        return {**data, "namespace": space, **renamed(named, partial(inside, space))}

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
                    "time is not a channel",
                    "write it as 'time: {from: ...}' beside channels",
                    ("channels", name),
                )
            if name not in LABELS and not is_channel(name):
                known = (*CHANNELS, *LABELS, *(f"{q}_fl" for q in (*WHEEL_CHANNELS, *AXLE_CHANNELS)))
                names = "the names are in architecture.md, contracts, e.g. wheel_speed_fl"
                raise Fault("no such channel", suggestion(name, known) or names, ("channels", name))
            for one in source.chain:
                _check_unit(name, one)
        return self

    def wants(self, name: str) -> bool:
        """Whether the profile may read a column of this name; of a velocity's x also y, which shows whether x is forward."""
        return any(
            one in self.sources or any(fnmatch.fnmatchcase(one, p) for p in self._patterns)
            for one in (name, re.sub(r"\.linear\.y$", ".linear.x", name))
        )

    @cached_property
    def _patterns(self) -> tuple[str, ...]:
        return tuple(as_pattern(name) for name in self.sources if "*" in name)

    @cached_property
    def sources(self) -> frozenset[str]:
        """All columns of the log that the profile may read, as it names them and without units behind the names."""
        named = {
            column for one in self.channels.values() for source in one.chain for column in source.columns
        }
        named |= {self.time.column, *([self.rows.column] if self.rows else [])}
        named |= {self.time.nanoseconds} if self.time.nanoseconds else set()
        return frozenset(named | {bare for name in named for bare in names_and_units([name])[0]})

    def apply(self, log: Any, source: str | None = None) -> Recording:
        """Turn a log (a `LogTable`, a DataFrame or a mapping of columns) into a Recording.

        Raises InputError where a column is missing (and names the nearest), where it contains text, where no row
        is left, and for anything that `Recording.from_frame` refuses. ``source`` is the file that errors name.
        """
        return convert(self, log, source)


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

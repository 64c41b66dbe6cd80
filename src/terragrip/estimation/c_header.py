"""An estimator as a C header, so that a controller runs the same filter: its settings, and where its values lie.

The structure is read from the kernel's own declarations (`terragrip.h`), so that a member added there is written here. Members that are 0
are left out, as C sets them to 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from terragrip._kernel import ffi
from terragrip.errors import InputError
from terragrip.estimation.columns import column_named
from terragrip.estimation.engine import estimate_slots
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.provenance import settings_of
from terragrip.estimation.settings import sample_slots
from terragrip.vehicle import Vehicle

_INDENT = "    "


def estimator_of(about: Mapping[str, Any], file: str) -> TractionEstimator:
    """The estimator that made a file of estimates, by its origin (`Estimates.read_about`).

    Raises InputError, which names ``file``, where the origin is of an earlier version, or of estimates that the kernel does not make alone:
    slip without torques, the torque of an engine or of a drive train, a turn by positions, smoothed ones; and where two columns' names
    are one in capitals.
    """
    known = settings_of(about, file, "channels", "gap", "standstill_speed")
    hint = "estimate the log again with this version"
    if "vehicle" not in about or "method" not in about:
        raise InputError("does not contain the vehicle and the method", file=file, hint=hint)
    if about.get("smooth"):
        raise InputError(
            "is smoothed, and a controller knows no later samples",
            file=file,
            hint="estimate the log without --smooth",
        )
    if "zero_slip" in about or about.get("driveline") is not None:
        raise InputError(
            "is of slip without torques, or of the torque of a drive train: Terragrip works out more for it than its kernel does",
            file=file,
            hint="give estimates of a log with the torques of the driven wheels",
        )
    if about.get("turn"):
        raise InputError(
            "takes the rate of turn from positions, which its kernel does not read",
            file=file,
            hint="estimate a log with a yaw rate, or without positions",
        )
    vehicle = Vehicle.from_dict(about["vehicle"], file)
    for slots in (sample_slots(vehicle), estimate_slots(vehicle, adaptive=True)):
        if len({name.upper() for name in slots}) < len(slots):
            raise InputError(
                "has columns whose names differ in case only",
                file=file,
                hint="rename a wheel or an axle in the vehicle file",
            )
    return TractionEstimator(
        vehicle,
        str(about["method"]),
        sensors=known["noise"],
        held=known["held"],
        channels=known["channels"],
        gap=known["gap"],
        standstill_speed=known["standstill_speed"],
    )


def c_header(estimator: TractionEstimator, origin: str) -> str:
    """C99 text that declares ``terragrip_settings``, a tg_settings, and the places of the columns in tg_sample and tg_estimate.

    C++ may include it too, and either precision: no warning is given for what C++ before 20, or single precision, does with it.

    ``origin``: a line on where the settings come from.
    """
    engine = estimator.engine
    ins = {name: place for name, place in engine.slots_in.items() if name in estimator.channels}
    lines = [
        f"/* {origin.replace('*', '')}",
        " * Made by `terragrip new controller`; its use: docs/controller.md. */",
        "#ifndef TERRAGRIP_SETTINGS_H",
        "#define TERRAGRIP_SETTINGS_H",
        "#include <math.h>",
        '#include "terragrip.h"',
        "#pragma GCC system_header /* rounding to tg_real, members left out (0) and C++ before 20 give no warnings */",
        "",
        "/* Where in tg_sample.value the sensors' values go, in SI units; NAN: not measured at that instant. */",
        *_places("IN", ins),
        "",
        "/* Where in tg_estimate.value the results are; ..._STD: standard deviations. */",
        *_places("OUT", engine.slots_out),
        "",
        "static const tg_settings terragrip_settings = {",
        *_members(engine.settings(), ffi.typeof("tg_settings"), _INDENT),
        "};",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def _places(prefix: str, slots: Mapping[str, int]) -> Iterator[str]:
    yield "enum {"
    for name, place in slots.items():
        yield f"{_INDENT}{prefix}_{name.upper()} = {place}, /* {column_named(name).unit} */"
    yield f"{_INDENT}{prefix}_COUNT = {len(slots)}"
    yield "};"
    listed = {"NAMES": [f'"{name}"' for name in slots], "PLACES": [str(place) for place in slots.values()]}
    for what, values in listed.items():
        yield f"#define TERRAGRIP_{prefix}_{what} {', '.join(values)}"


def _members(value: Any, structure: Any, indent: str) -> Iterator[str]:
    """Designated initializers of a structure, without those that are 0."""
    for name, field in structure.fields:
        text = list(_initializer(getattr(value, name), field.type, indent))
        if text:
            text[0] = f"{indent}.{name} = {text[0]}"
            text[-1] += ","
            yield from text


def _initializer(value: Any, kind: Any, indent: str) -> Iterator[str]:
    if kind.kind == "struct":
        members = list(_members(value, kind, indent + _INDENT))
        if members:
            yield from ("{", *members, f"{indent}}}")
    elif kind.kind == "array":
        numbers = [_number(one) for one in value]
        while numbers and numbers[-1] == "0":
            del numbers[-1]
        if numbers:
            yield f"{{{', '.join(numbers)}}}"
    elif _number(value) != "0":
        yield _number(value)


def _number(value: float) -> str:
    """In C, such that it is read back to the last bit."""
    if isinstance(value, int) or (value == 0 and math.copysign(1.0, value) > 0):
        return str(int(value))
    if math.isnan(value):
        return "(tg_real)NAN"
    if math.isinf(value):
        return "(tg_real)INFINITY" if value > 0 else "-(tg_real)INFINITY"
    return repr(value)

"""Units: a text such as ``"2 N m"`` becomes a number in SI.

A table of the units that vehicle files and logs use is read here; only a unit outside it wakes pint, whose
registry takes a fifth of a second to build. Angles are dimensionless, so ``N s/rad`` is ``N s``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from numbers import Real

Dimension = tuple[int, int, int, int]  # powers of kg, m, s, A

STANDARD_GRAVITY = 9.80665  # m/s², exact by definition (CGPM 1901)

_ONE: Dimension = (0, 0, 0, 0)
_BASE: dict[str, tuple[float, Dimension]] = {
    "kg": (1.0, (1, 0, 0, 0)), "g": (1e-3, (1, 0, 0, 0)), "t": (1e3, (1, 0, 0, 0)),
    "lb": (0.45359237, (1, 0, 0, 0)), "lbs": (0.45359237, (1, 0, 0, 0)), "lbm": (0.45359237, (1, 0, 0, 0)),
    "m": (1.0, (0, 1, 0, 0)), "km": (1e3, (0, 1, 0, 0)),
    "cm": (1e-2, (0, 1, 0, 0)), "mm": (1e-3, (0, 1, 0, 0)),
    "l": (1e-3, (0, 3, 0, 0)), "L": (1e-3, (0, 3, 0, 0)),
    "in": (0.0254, (0, 1, 0, 0)), "ft": (0.3048, (0, 1, 0, 0)), "mi": (1609.344, (0, 1, 0, 0)),
    "meter": (1.0, (0, 1, 0, 0)), "meters": (1.0, (0, 1, 0, 0)), "metre": (1.0, (0, 1, 0, 0)), "metres": (1.0, (0, 1, 0, 0)),
    "sec": (1.0, (0, 0, 1, 0)), "second": (1.0, (0, 0, 1, 0)), "seconds": (1.0, (0, 0, 1, 0)), "hr": (3600.0, (0, 0, 1, 0)),
    "s": (1.0, (0, 0, 1, 0)), "ms": (1e-3, (0, 0, 1, 0)),
    "us": (1e-6, (0, 0, 1, 0)), "µs": (1e-6, (0, 0, 1, 0)),
    "ns": (1e-9, (0, 0, 1, 0)), "min": (60.0, (0, 0, 1, 0)), "h": (3600.0, (0, 0, 1, 0)),
    "A": (1.0, (0, 0, 0, 1)),
    "V": (1.0, (1, 2, -3, -1)),
    "N": (1.0, (1, 1, -2, 0)),
    "kgf": (STANDARD_GRAVITY, (1, 1, -2, 0)), "kp": (STANDARD_GRAVITY, (1, 1, -2, 0)),
    "lbf": (0.45359237 * STANDARD_GRAVITY, (1, 1, -2, 0)), "oz": (0.45359237 / 16, (1, 0, 0, 0)),
    "ozf": (0.45359237 / 16 * STANDARD_GRAVITY, (1, 1, -2, 0)), "tf": (1e3 * STANDARD_GRAVITY, (1, 1, -2, 0)),
    "mg": (1e-6, (1, 0, 0, 0)), "kip": (453.59237 * STANDARD_GRAVITY, (1, 1, -2, 0)),
    "kips": (453.59237 * STANDARD_GRAVITY, (1, 1, -2, 0)),
    "J": (1.0, (1, 2, -2, 0)),
    "W": (1.0, (1, 2, -3, 0)), "PS": (75 * STANDARD_GRAVITY, (1, 2, -3, 0)),
    "Pa": (1.0, (1, -1, -2, 0)), "kPa": (1e3, (1, -1, -2, 0)), "MPa": (1e6, (1, -1, -2, 0)),
    "hPa": (1e2, (1, -1, -2, 0)), "bar": (1e5, (1, -1, -2, 0)), "mbar": (1e2, (1, -1, -2, 0)),
    "psi": (0.45359237 * STANDARD_GRAVITY / 0.0254**2, (1, -1, -2, 0)),
    "rad": (1.0, _ONE), "deg": (math.pi / 180, _ONE), "degree": (math.pi / 180, _ONE),
    "degrees": (math.pi / 180, _ONE), "°": (math.pi / 180, _ONE), "Grad": (math.pi / 180, _ONE), "rev": (2 * math.pi, _ONE),
    "turn": (2 * math.pi, _ONE), "%": (1e-2, _ONE), "percent": (1e-2, _ONE), "‰": (1e-3, _ONE), "1": (1.0, _ONE),
    "rpm": (2 * math.pi / 60, (0, 0, -1, 0)), "rps": (2 * math.pi, (0, 0, -1, 0)),
    "kmh": (1 / 3.6, (0, 1, -1, 0)), "kph": (1 / 3.6, (0, 1, -1, 0)), "kmph": (1 / 3.6, (0, 1, -1, 0)), "mph": (0.44704, (0, 1, -1, 0)),
    "knot": (1852 / 3600, (0, 1, -1, 0)), "knots": (1852 / 3600, (0, 1, -1, 0)), "kn": (1852 / 3600, (0, 1, -1, 0)),
    "kt": (1852 / 3600, (0, 1, -1, 0)), "kts": (1852 / 3600, (0, 1, -1, 0)),
    "g_0": (STANDARD_GRAVITY, (0, 1, -2, 0)), "g0": (STANDARD_GRAVITY, (0, 1, -2, 0)),
}  # fmt: skip
_PREFIXES = {
    "G": 1e9,
    "M": 1e6,
    "k": 1e3,
    "h": 1e2,
    "da": 10.0,
    "d": 0.1,
    "c": 1e-2,
    "m": 1e-3,
    "µ": 1e-6,
    "u": 1e-6,
    "n": 1e-9,
}
_PREFIXED = {"N": tuple(_PREFIXES), "A": "kmµun", "V": "kmµu", "W": "km", "rad": "dcmµu", "deg": "dcm"}
"""The prefixes of each symbol in everyday units; no MA and MW, which are labels of an axle and of a mean."""
_BASE |= {p + u: (_PREFIXES[p] * _BASE[u][0], _BASE[u][1]) for u, before in _PREFIXED.items() for p in before}
_MOMENT = re.compile(rf"^(?!lbm$)((?:{'|'.join(_PREFIXES)})?N|kgf?|kp|lbf?|ozf?)(mm?|cm|ft|in)$")
"""A force, or a mass for its weight, and the length of its lever, written together: Nm, daNm, kgm, lbft. lbm is a pound of mass."""
_LEVER_FIRST = re.compile(r"^(ft|in)(lb[fs]?|ozf?)$")
_TON = re.compile(r"\btons?\b", re.IGNORECASE)
"""Of 1000 kg, 2000 lb or 2240 lb: pint would silently mean the second."""
_SUPERSCRIPTS = str.maketrans(
    {"²": "^2", "³": "^3", "¹": "^1", "⁻": "^-", "·": "*", "⋅": "*", "×": "*", "μ": "µ"}
)
_TURNS_A_MINUTE = re.compile(
    r"(?:1|rev|r|U|tr|Umdr\.?|ot|obr|giri|vueltas)?\s*/\s*min|min\s*\^?\s*-\s*1|r\.?p\.?m\.?|U\.?p\.?m\.?",
    re.IGNORECASE,
)
"""What speeds of rotation are written in beside rad/s: 1/min is a turn a minute (DIN 1301-2), not a radian; U, tr, giri are turns."""
_OF_TURNS = re.compile(r"\s*(?:(?:da|[a-zA-Zµ])?(?:Hz|hertz)|1\s*/\s*s(?:ec)?|s\s*\^?\s*-\s*1|s\s*⁻¹)\s*")
"""What could be radians or turns a second: DIN 1301-2 writes speeds of rotation in turns as 1/s."""
_GRAVITY = (0, 1, -2, 0)
_OF_GRAVITY = {"g": STANDARD_GRAVITY, "G": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000}
_POWER = re.compile(r"(?<=[a-z°])(-[1-4]|[234])(?![\d.])")
"""``m/s2``, ``m s-1``: an exponent without its sign of a power."""
_TOKEN = re.compile(r"\s*(?:(\*\*|\^)\s*\(?([+-]?\d+)\)?|([*/])|([A-Za-z%‰°µ][A-Za-z0-9_%‰°µ]*|1))")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$", re.DOTALL)
_COMMA = re.compile(r"\s*[+-]?\d+,(?:\d{1,2}|\d{4,})(?:\s*[^\d\s,.][^,]*)?\s*")
"""A decimal comma; three digits behind it may be thousands."""
_HARMLESS = re.compile(r"[A-Za-z0-9_%°µ^*/(). +-]{1,60}$")
_KINDS: dict[Dimension, str] = {
    (1, 0, 0, 0): "a mass", (0, 1, 0, 0): "a length", (0, 0, 1, 0): "a time", (0, 1, -1, 0): "a speed",
    (0, 1, -2, 0): "an acceleration", (1, 1, -2, 0): "a force", (1, 2, -2, 0): "a torque",
    (1, -1, -2, 0): "a pressure", (0, 0, -1, 0): "an angular velocity", (1, 2, 0, 0): "a moment of inertia",
    (1, 1, -1, 0): "a bearing resistance", _ONE: "an angle or plain number", (0, 0, 0, 1): "a current",
    (1, 2, -3, 0): "a power", (0, 3, -1, 0): "a flow", (0, 3, 0, 0): "a volume", (1, 2, -3, -1): "a voltage",
}  # fmt: skip


class UnitError(ValueError):
    """A quantity cannot be read: ``problem`` says why, ``hint`` what to write."""

    def __init__(self, problem: str, hint: str | None = None) -> None:
        self.problem, self.hint = problem, hint
        super().__init__(problem)


@dataclass(frozen=True)
class Unit:
    """A unit: ``factor`` to SI and the powers of kg, m, s and A."""

    factor: float
    dimension: Dimension

    @property
    def kind(self) -> str:
        """What is measured in it, for a message."""
        return _KINDS.get(self.dimension, "another quantity")

    def weighs(self, other: Unit) -> bool:
        """Whether it is one of mass where the ``other`` is one of force."""
        return tuple(a + b for a, b in zip(self.dimension, _GRAVITY, strict=True)) == other.dimension


def parse_unit(text: str) -> Unit:
    """Read a unit such as ``"kg m^2"``, ``"N s/rad"`` or ``"km/h"``; raises UnitError if there is none such.

    Products and quotients are read from the left, as pint does: ``N/m s`` is ``N s/m``.
    """
    unit = _from_table(text)
    return _from_pint(text) if unit is None else unit


def is_common(text: str) -> bool:
    """Whether ``text`` is written in the everyday units of the table, which needs no pint."""
    return _from_table(text) is not None


def may_be_turns(text: str) -> bool:
    """Whether ``text`` leaves open radians or turns a second: Hz, 1/s."""
    return _OF_TURNS.fullmatch(text) is not None


def factor_to(text: str, si_unit: str) -> float:
    """Factor that takes a number in unit ``text`` to ``si_unit``; raises UnitError if they are unlike.

    ``g`` stands for standard gravity where an acceleration is asked for, ``mg`` for a thousandth of it, and a mass for its weight
    where a force is: kg, lb ft. Hz and 1/s are refused for an angular velocity, since they could mean rad/s or revolutions per second,
    and grad for an angle.
    """
    target = parse_unit(si_unit)
    if text.strip() in _OF_GRAVITY and target.dimension == _GRAVITY:
        return _OF_GRAVITY[text.strip()] / target.factor
    if "rad" in si_unit and may_be_turns(text):
        raise UnitError(f"{text.strip()!r} is ambiguous for an angular velocity", "write rad/s, deg/s or rpm")
    if text.strip().partition("/")[0] == "grad":
        raise UnitError(f"{text.strip()!r} is ambiguous", "write deg, or gon")
    if _TON.search(text):
        raise UnitError(f"{text.strip()!r} is ambiguous", "write t (1000 kg), kg or lb")
    unit = parse_unit(text)
    if target.kind in ("a force", "a torque") and unit.weighs(target):
        return unit.factor * STANDARD_GRAVITY / target.factor
    if unit.dimension != target.dimension:
        raise UnitError(
            f"{text.strip()!r} measures {unit.kind}, where {target.kind} is needed",
            f"use a unit such as {si_unit!r}",
        )
    return unit.factor / target.factor


def quantity(value: object, si_unit: str) -> float:
    """Read a number (already in ``si_unit``) or a text with a unit; raises UnitError on anything else."""
    example = f"write e.g. '1.5 {si_unit}'" if si_unit != "1" else "write a number such as 0.02"
    value = str(value) if hasattr(value, "magnitude") else value  # pint
    if isinstance(value, bool) or not isinstance(value, Real | str):
        raise UnitError(f"{_short(value)} is not a number", example)
    if isinstance(value, str):
        match = _NUMBER.match(value)
        if match is None or match[2].startswith(","):
            comma = _COMMA.fullmatch(value)
            fix = f"write it with a point, '{value.strip().replace(',', '.')}'" if comma else example
            raise UnitError(f"{_short(value)} is not a number with a unit", fix)
        number = float(match[1]) * (factor_to(match[2], si_unit) if match[2] else 1.0)
    else:
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise UnitError(f"{_short(value)} is not a finite number", example)
    return number


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _plain(text: str) -> str:
    """A unit without superscripts, with a sign at each power and product (``m.s-2``, ``N-m``)."""
    plain = text.translate(_SUPERSCRIPTS).replace("^-^", "^-").strip()
    if _TURNS_A_MINUTE.fullmatch(plain):
        return "rpm"
    plain = _MOMENT.sub(
        r"\1*\2", _LEVER_FIRST.sub(r"\1*\2", re.sub(r"(?<=[A-Za-z])[.-](?=[A-Za-z])", "*", plain))
    )
    return plain if plain.startswith("g_") else _POWER.sub(r"^\1", plain)


def _from_table(text: str) -> Unit | None:
    """Read ``text`` with the table; None if a symbol or the grammar is beyond it."""
    text = _plain(text)
    factor, powers, sign, last, position = 1.0, [0, 0, 0, 0], 1, None, 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            return None
        position = match.end()
        if match[1]:
            if last is None or abs(int(match[2])) > 9:
                return None
            # The symbol counted once already, so the exponent adds the rest.
            extra = last[2] * (int(match[2]) - 1)
            factor *= last[0] ** extra
            powers = [p + extra * d for p, d in zip(powers, last[1], strict=True)]
            last = None
        elif match[3]:
            if position == len(text) or (last is None and factor == 1.0 and not any(powers)):
                return None
            sign = -1 if match[3] == "/" else 1
        else:
            spelt = match[4] in ("Km", "FT", "Ft", "LB", "Lb") or (
                match[4] not in _BASE and len(match[4]) > 2
            )
            name = match[4].lower() if spelt else match[4]
            if name not in _BASE:
                return None
            size, dimension = _BASE[name]
            factor *= size**sign
            powers = [p + sign * d for p, d in zip(powers, dimension, strict=True)]
            last, sign = (size, dimension, sign), 1
    return Unit(factor, (powers[0], powers[1], powers[2], powers[3])) if text else None


def _from_pint(text: str) -> Unit:
    """Read ``text`` with pint; raises UnitError if pint does not know it either."""
    from tokenize import TokenError

    unknown = UnitError(
        f"{_short(text.strip())} is not a unit", "write units as in 'N m', 'km/h' or 'kg m^2'"
    )
    plain = _plain(text)
    # A number among the symbols is a slip ("139 2 kg"), and its powers would keep pint busy for ever.
    number = r"(?<![A-Za-z_0-9^*(+-])[0-9.]|[0-9)]\s*(\*\*|\^)|(\*\*|\^)\s*\(?\s*[+-]?\d{2}"
    if not _HARMLESS.match(plain) or re.search(number, plain):
        raise unknown
    import pint

    try:
        size = pint.application_registry.parse_expression(plain)
        if isinstance(size, int | float):
            raise unknown
        size = (1.0 * size).to_base_units()
        powers = {str(name): float(power) for name, power in size.dimensionality.items()}
        factor = float(size.magnitude)
    except (
        pint.PintError, ArithmeticError, AssertionError, AttributeError, LookupError, SyntaxError, TokenError,
        TypeError, ValueError,
    ) as error:  # fmt: skip
        raise unknown from error
    wanted = ("[mass]", "[length]", "[time]", "[current]")
    if set(powers) - set(wanted) or any(p != int(p) for p in powers.values()) or not 0 < factor < math.inf:
        raise unknown
    kg, m, s, ampere = (int(powers.get(name, 0)) for name in wanted)
    return Unit(factor, (kg, m, s, ampere))

"""Units: the table agrees with pint, and nonsense is refused with a hint."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.units import _BASE, UnitError, factor_to, parse_unit, quantity

_PINT_NAMES = {
    "t": "tonne",
    "kmh": "km/h",
    "kmph": "km/h",
    "rev": "turn",
    "1": "",
    "°": "degree",
    "Grad": "degree",
    "kp": "kgf",
    "lbm": "lb",
    "PS": "metric_horsepower",
}
MOMENTS = {
    "Nm": 1.0,
    "kNm": 1e3,
    "daNm": 10.0,
    "mNm": 1e-3,
    "MNm": 1e6,
    "hNm": 100.0,
    "cNm": 0.01,
    "Ncm": 0.01,
    "ozfin": 0.007061551814226043,
    "Nmm": 1e-3,
    "kgm": 9.80665,
    "kpm": 9.80665,
    "kgfcm": 0.0980665,
    "lbft": 1.3558179483314,
    "lbfin": 0.1129848290276,
}
"""Force and lever written together (NIST SP 811, appendix B.8)."""
_DIMENSIONS = ("[mass]", "[length]", "[time]", "[current]")


@pytest.mark.parametrize("symbol", sorted(_BASE))
def test_table_agrees_with_pint(symbol: str) -> None:
    expected = pint.application_registry.Quantity(1.0, _PINT_NAMES.get(symbol, symbol)).to_base_units()
    unit = parse_unit(symbol)
    assert unit.factor == pytest.approx(expected.magnitude, rel=1e-12)
    assert unit.dimension == tuple(expected.dimensionality.get(name, 0) for name in _DIMENSIONS)


@pytest.mark.parametrize(
    ("text", "si_unit", "expected"),
    [
        ("139 kg", "kg", 139.0),
        ("2.0 N s/rad", "N s/rad", 2.0),
        ("0.15 kg m^2", "kg m^2", 0.15),
        ("0.15 kg·m²", "kg m^2", 0.15),
        ("36 km/h", "m/s", 10.0),
        ("0.5 deg", "rad", 0.00872664625997),
        ("60 rpm", "rad/s", 6.28318530718),
        ("80kPa", "Pa", 8e4),
        ("-.5e1 m s**-2", "m/s^2", -5.0),
        ("1 g", "m/s^2", 9.80665),
        ("2 kg", "N", 19.6133),
        ("1 lbs", "N", 4.4482216152605),
        ("1 lb-ft", "N m", 1.3558179483314),
        ("1 ft.lb", "N m", 1.3558179483314),
        ("1 kg m", "N m", 9.80665),
        ("1 FT-LB", "N m", 1.3558179483314),
        ("1 ftlb", "N m", 1.3558179483314),
        ("1 G", "m/s^2", 9.80665),
        ("1 lbm", "kg", 0.45359237),
        *((f"1 {unit}", "N m", size) for unit, size in MOMENTS.items()),
        ("90 Grad", "rad", 1.57079632679),
        ("10 kn", "m/s", 5.14444444444),
        ("2 %", "1", 0.02),
        ("1.5", "kg", 1.5),
        ("3 slug", "kg", 43.7817088116191),  # beyond the table: pint
        ("1 furlong/fortnight", "m/s", 0.00016630985642923665),
    ],
)
def test_quantity(text: str, si_unit: str, expected: float) -> None:
    assert quantity(text, si_unit) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    "value", [np.int64(2), np.float32(2), pint.Quantity(200, "cm"), pint.Quantity(2.0, "m")]
)
def test_numbers_of_numpy_and_quantities_of_pint_are_numbers(value: object) -> None:
    """'np.int64(2) is not a number', as a cell of a DataFrame is one."""
    assert quantity(value, "m") == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("value", "si_unit", "problem"),
    [
        ("139 N", "kg", "'N' measures a force, where a mass is needed"),
        ("139 kgg", "kg", "not a unit"),
        ("20 degC", "rad", "not a unit"),
        ("heavy", "kg", "not a number with a unit"),
        ("0,2 m", "m", "not a number with a unit"),
        ("5 Hz", "rad/s", "ambiguous"),
        ("5 mHz", "rad/s", "ambiguous"),
        ("5 1/s", "rad/s", "ambiguous"),
        ("5 s^-1", "rad/s", "ambiguous"),
        ("5 grad", "rad", "ambiguous"),
        ("5 tons", "kg", "ambiguous"),  # 907 kg each by pint, 1000 kg by most
        ("5 kg", "m", "measures a mass"),
        ("5 kg", "N m", "measures a mass"),
        ("1e400 m", "m", "not a finite number"),
        (float("nan"), "m", "not a finite number"),
        (10**400, "m", "not a finite number"),
        ("139 2 kg", "kg", "not a unit"),
        (True, "m", "not a number"),
        (np.True_, "m", "not a number"),
        ([1], "m", "not a number"),
        ("1 m^99999", "m", "not a unit"),
        ("1 9**9**9**9**9", "m", "not a unit"),
    ],
)
def test_refusal(value: object, si_unit: str, problem: str) -> None:
    with pytest.raises(UnitError) as caught:
        quantity(value, si_unit)
    assert problem in caught.value.problem
    assert caught.value.hint


_pieces = (
    "m",
    "s",
    "kg",
    "foo",
    "inch",
    "degC",
    "dB",
    "j",
    "^",
    "**",
    "*",
    "/",
    "2",
    "-1",
    "9",
    "(",
    ")",
    " ",
    "+",
)


@given(st.text(max_size=20) | st.lists(st.sampled_from(_pieces), max_size=7).map("".join))
def test_any_text_is_a_unit_or_refused(text: str) -> None:
    try:
        factor = factor_to(text, "m")
    except UnitError:
        return
    assert factor > 0


def test_everyday_units_leave_pint_asleep() -> None:
    code = (
        "import sys; from terragrip.units import quantity;"
        "quantity('139 kg', 'kg'); quantity('2 N s/rad', 'N s/rad'); sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("text", "fix"), [("0,83 m", "'0.83 m'"), ("-1,5", "'-1.5'"), ("1,234 kg", "'1.5 kg'")]
)
def test_a_decimal_comma_is_refused_with_the_number_by_a_point(text: str, fix: str) -> None:
    with pytest.raises(UnitError) as caught:
        quantity(text, "kg" if "kg" in text else "m")
    assert fix in (caught.value.hint or "")  # three digits behind the comma may be thousands

"""Quantities of the scenario file: numbers in SI, or texts with a unit, within limits."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from terragrip.units import UnitError, quantity


def number_within(unit: str, low: float = 0.0, high: float = 1e6, *, above: bool = False) -> Any:
    """Field metadata: a number or a text with a unit, within limits."""

    def read(value: Any) -> float:
        number = quantity(value, unit)
        if number > high or (number <= low if above else number < low):
            bound = "exceed" if above else "be at least"
            raise UnitError(f"{number:g} is impossible", f"it must {bound} {low:g} and not exceed {high:g}")
        return number

    return BeforeValidator(read)


Mass = Annotated[float, number_within("kg", 0, 1e5, above=True)]
Length = Annotated[float, number_within("m")]
PositiveLength = Annotated[float, number_within("m", above=True)]
Coordinate = Annotated[float, number_within("m", -1e5, 1e5)]
Time = Annotated[float, number_within("s")]
PositiveTime = Annotated[float, number_within("s", above=True)]
Force = Annotated[float, number_within("N")]
Share = Annotated[float, number_within("1", 0, 1)]
Ratio = Annotated[float, number_within("1", 0, 10)]
Number = Annotated[float, number_within("1", 0, 1e9)]
Signed = Annotated[float, number_within("1", -1e9, 1e9)]
Angle = Annotated[float, number_within("rad", -0.6, 0.6)]
Rate = Annotated[float, number_within("1/s", 0, 1000, above=True)]

"""Soils and surfaces from the literature as library entries, each with its source."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from terragrip.errors import InputError
from terragrip.physics.adhesion import PROTOTYPE, brixius_mobility_number, brixius_resistance
from terragrip.soil.library import Soil, SoilLibrary

_BURCKHARDT: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "dry asphalt": (1.2801, 23.99, 0.52),
        "wet asphalt": (0.857, 33.822, 0.347),
        "dry concrete": (1.1973, 25.168, 0.5373),
        "dry cobble": (1.3713, 6.4565, 0.6691),
        "wet cobble": (0.4004, 33.708, 0.1204),
        "snow": (0.1946, 94.129, 0.0646),
        "ice": (0.05, 306.39, 0.0),
    }
)

_PAPER: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "hard": (1.42, 0.975, 0.046),
        "fine": (0.85, 0.90, 0.093),
        "wet": (0.83, 0.76, 0.138),
        "coarse": (0.91, 0.91, 0.088),
        "grass": (0.40, 0.84, 0.15),
    }
)


def paper_soils() -> SoilLibrary:
    """The paper's five soils: a of its Table 1 on the prototype shape; R2 and NRMSE as printed there."""
    source = "Kobelski, Osinenko and Streif 2021, Table 1 (Innok Heros 444, 139 kg)"
    soils = (
        Soil(name, "exponential", {**PROTOTYPE, "a": a}, r2=r2, nrmse=nrmse, source=source)
        for name, (a, r2, nrmse) in _PAPER.items()
    )
    return SoilLibrary({soil.name: soil for soil in soils})


def burckhardt_grounds() -> SoilLibrary:
    """Burckhardt's seven road surfaces (physics.md 5)."""
    soils = (
        Soil(name, "burckhardt", {"c1": c1, "c2": c2, "c3": c3}, source="Burckhardt 1993 (car tyre)")
        for name, (c1, c2, c3) in _BURCKHARDT.items()
    )
    return SoilLibrary({soil.name: soil for soil in soils})


def brixius_soil(
    cone_index: float,
    width: float,
    diameter: float,
    load: float,
    deflection_ratio: float = 0.2,
    name: str | None = None,
) -> Soil:
    """A soil by its cone index [Pa] for a bias-ply tyre (width, diameter [m], load [N]; deflection over section height, ASABE D497: 0.2).

    Raises InputError where a size is not positive.
    """
    try:
        mobility = brixius_mobility_number(cone_index, width, diameter, load, deflection_ratio, 1.0)
    except ValueError as error:
        raise InputError(str(error)) from None
    return Soil(
        name or f"cone index {cone_index / 1000:g} kPa",
        "brixius",
        {"mobility": mobility},
        resistance=(float(brixius_resistance(mobility)), 0.0),
        source=f"Brixius 1987, Bn = {mobility:.3g}",
    )


def literature_soils() -> SoilLibrary:
    """All built-in soils: the paper's five and Burckhardt's seven (Brixius needs a tyre: `brixius_soil`)."""
    return paper_soils().merge(burckhardt_grounds())

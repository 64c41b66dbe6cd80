"""Adhesion-slip curves mu(s): the models of physics.md 5 as small records (name, parameters, value, slope, peak).

Every curve is odd in slip: value(-s) = -value(s). Printed forms hold for s >= 0 only (the paper's eq. 8 gives mu(-0.5) = -199).
A net-traction sensor sees kappa = mu - rho: pass `intercept` = -rho.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from terragrip.arrays import Floats

Function = Callable[[Floats, Mapping[str, Floats]], Floats]

PROTOTYPE: Mapping[str, float] = MappingProxyType({"p": 0.52, "alpha_1": 0.01, "alpha_2": -11.36})
"""Shape of the paper's prototype curve (eq. 8, fitted by its authors to Wuensche 2005)."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a curve: name, unit ("1" = dimensionless), bounds of a fit, a start value, what it means."""

    name: str
    unit: str
    lower: float
    upper: float
    start: float
    meaning: str


@dataclass(frozen=True)
class CurveModel:
    """A family of adhesion-slip curves.

    `positive` and `positive_slope` give mu and dmu/ds for s >= 0; parameters may be arrays that broadcast against slip.
    `fixed` names the parameters that a fit leaves at their start value unless stated otherwise.
    `native_intercept` gives the intercept that the printed form holds itself (Schreiber-Kutzbach), else 0.
    """

    name: str
    parameters: tuple[Parameter, ...]
    positive: Function
    positive_slope: Function
    source: str
    fixed: frozenset[str] = frozenset()
    native_intercept: Callable[[Mapping[str, Floats]], Floats] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in the printed order."""
        return tuple(parameter.name for parameter in self.parameters)

    def complete(self, parameters: Mapping[str, ArrayLike]) -> dict[str, Floats]:
        """All parameters as arrays: those given, the rest at their start values. ValueError on a name that is not the model's."""
        unknown = sorted(set(parameters) - set(self.names))
        if unknown:
            raise ValueError(
                f"curve model {self.name} has no parameter {unknown[0]}; it has {', '.join(self.names)}"
            )
        return {p.name: np.asarray(parameters.get(p.name, p.start), dtype=float) for p in self.parameters}

    def value(
        self, slip: ArrayLike, parameters: Mapping[str, ArrayLike], intercept: ArrayLike = 0.0
    ) -> Floats:
        """mu(s) (or kappa(s) with intercept = -rho) [-]; slip of any shape in [-1, 1], odd extension; NaN stays NaN."""
        s = np.asarray(slip, dtype=float)
        full = self.complete(parameters)
        native = self.native_intercept(full) if self.native_intercept else 0.0
        return np.asarray(
            np.sign(s) * self.positive(np.abs(s), full) + native + np.asarray(intercept, dtype=float)
        )

    def slope(self, slip: ArrayLike, parameters: Mapping[str, ArrayLike]) -> Floats:
        """dmu/ds [-], even in slip."""
        return np.asarray(
            self.positive_slope(np.abs(np.asarray(slip, dtype=float)), self.complete(parameters))
        )

    def peak(self, parameters: Mapping[str, ArrayLike], upper: float = 1.0) -> tuple[float, float]:
        """(slip, mu) of the largest value on 0 <= s <= `upper`: a grid of 2001 slips, then a parabola through the best three."""
        grid = np.linspace(0.0, upper, 2001)
        return _largest(grid, self.value(grid, parameters))


def _largest(grid: Floats, values: Floats) -> tuple[float, float]:
    i = int(np.nanargmax(values))
    if i in (0, len(grid) - 1):
        return float(grid[i]), float(values[i])
    left, middle, right = values[i - 1 : i + 2]
    curvature = left - 2 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float(grid[i] + shift * (grid[1] - grid[0])), float(middle - 0.25 * (left - right) * shift)


def efficiency_peak(
    model: CurveModel, parameters: Mapping[str, ArrayLike], soil_resistance: float, tire_resistance: float
) -> tuple[float, float]:
    """(slip, eta) where the tractive efficiency eta(s) = kappa/(kappa + rho)(1 - s) is largest (paper eq. 7).

    `soil_resistance` rho_s and `tire_resistance` rho_t are constants over slip here. (nan, 0) where nothing is pulled at any slip.
    """
    grid = np.linspace(0.0, 1.0, 2001)[1:]
    kappa = model.value(grid, parameters) - soil_resistance
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = np.where(kappa > 0, kappa / (kappa + soil_resistance + tire_resistance) * (1 - grid), 0.0)
    return _largest(grid, eta) if eta.max() > 0 else (float("nan"), 0.0)


def _exponential(s: Floats, q: Mapping[str, Floats]) -> Floats:
    return np.asarray(
        q["a"] * (1 - q["p"] * np.exp(q["alpha_1"] * s) - (1 - q["p"]) * np.exp(q["alpha_2"] * s))
    )


def _exponential_slope(s: Floats, q: Mapping[str, Floats]) -> Floats:
    first = q["p"] * q["alpha_1"] * np.exp(q["alpha_1"] * s)
    return np.asarray(-q["a"] * (first + (1 - q["p"]) * q["alpha_2"] * np.exp(q["alpha_2"] * s)))


def _saturating(first: str, rate: str, fall: str) -> tuple[Function, Function]:
    """A(1 - e^{-k s}) - d s under the parameter names of one author or another."""

    def value(s: Floats, q: Mapping[str, Floats]) -> Floats:
        return np.asarray(-q[first] * np.expm1(-q[rate] * s) - q[fall] * s)

    def slope(s: Floats, q: Mapping[str, Floats]) -> Floats:
        return np.asarray(q[first] * q[rate] * np.exp(-q[rate] * s) - q[fall])

    return value, slope


def _pacejka(s: Floats, q: Mapping[str, Floats]) -> Floats:
    x = q["B"] * s
    return np.asarray(q["D"] * np.sin(q["C"] * np.arctan(x - q["E"] * (x - np.arctan(x)))))


def _pacejka_slope(s: Floats, q: Mapping[str, Floats]) -> Floats:
    x = q["B"] * s
    inner = x - q["E"] * (x - np.arctan(x))
    inner_slope = q["B"] * (1 - q["E"] * (1 - 1 / (1 + x**2)))
    return np.asarray(q["D"] * np.cos(q["C"] * np.arctan(inner)) * q["C"] / (1 + inner**2) * inner_slope)


def _brixius(s: Floats, q: Mapping[str, Floats]) -> Floats:
    return np.asarray(0.88 * np.expm1(-0.1 * q["mobility"]) * np.expm1(-7.5 * s))


def _brixius_slope(s: Floats, q: Mapping[str, Floats]) -> Floats:
    return np.asarray(-0.88 * np.expm1(-0.1 * q["mobility"]) * 7.5 * np.exp(-7.5 * s))


def _wismer_luth(s: Floats, q: Mapping[str, Floats]) -> Floats:
    return np.asarray(-0.75 * np.expm1(-0.3 * q["wheel_numeric"] * s))


def _wismer_luth_slope(s: Floats, q: Mapping[str, Floats]) -> Floats:
    return np.asarray(0.225 * q["wheel_numeric"] * np.exp(-0.3 * q["wheel_numeric"] * s))


def brixius_mobility_number(
    cone_index: float, width: float, diameter: float, load: float, deflection: float, section_height: float
) -> float:
    """Brixius' mobility number Bn = (CI b d/W)(1 + 5 delta/h)/(1 + 3 b/d) (Brixius 1987; ASABE D497).

    cone_index [Pa], width b, diameter d, tyre deflection delta, section height h [m], load W [N]. ValueError if one is not positive
    (deflection may be 0).
    """
    if min(cone_index, width, diameter, load, section_height) <= 0 or deflection < 0:
        raise ValueError(
            "cone index, width, diameter, load and section height must be positive, deflection not negative"
        )
    shape = (1 + 5 * deflection / section_height) / (1 + 3 * width / diameter)
    return cone_index * width * diameter / load * shape


def brixius_resistance(mobility: ArrayLike, slip: ArrayLike = 0.0) -> Floats:
    """Soil part of Brixius' motion resistance in the paper's split: rho_s = 1/Bn + 0.5 s/sqrt(Bn) (the 0.04 is rho_t)."""
    n = np.asarray(mobility, dtype=float)
    return np.asarray(1 / n + 0.5 * np.abs(np.asarray(slip, dtype=float)) / np.sqrt(n))


def wismer_luth_resistance(wheel_numeric: ArrayLike) -> Floats:
    """Wismer and Luth's motion resistance ratio 1.2/Cn + 0.04, so that value - resistance is their net traction ratio."""
    return np.asarray(1.2 / np.asarray(wheel_numeric, dtype=float) + 0.04)


def effective_parameters(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """What the data can tell of the paper's four parameters: A = a(1-p), k = -alpha_2, d = a p alpha_1 (physics.md 5).

    mu ~ A(1 - e^{-k s}) - d s, with p e^{alpha_1 s} ~ p(1 + alpha_1 s).
    """
    a, p = parameters["a"], parameters["p"]
    return {"A": a * (1 - p), "k": -parameters["alpha_2"], "d": a * p * parameters["alpha_1"]}


_effective = _saturating("A", "k", "d")
_burckhardt = _saturating("c1", "c2", "c3")
_schreiber = _saturating("b", "c", "d")

CURVES: Mapping[str, CurveModel] = MappingProxyType(
    {
        model.name: model
        for model in (
            CurveModel(
                "exponential",
                (
                    Parameter(
                        "a",
                        "1",
                        1e-3,
                        10.0,
                        1.0,
                        "scale of the curve (no maximum: mu_max = 0.476 a for the prototype)",
                    ),
                    Parameter("p", "1", 0.0, 0.99, PROTOTYPE["p"], "share of the slow term"),
                    Parameter("alpha_1", "1", -1.0, 2.0, PROTOTYPE["alpha_1"], "rate of the slow term"),
                    Parameter("alpha_2", "1", -200.0, -0.5, PROTOTYPE["alpha_2"], "rate of the rise"),
                ),
                _exponential,
                _exponential_slope,
                "Kobelski et al. 2021, eq. 8; Osinenko and Streif 2017",
                fixed=frozenset(PROTOTYPE),
            ),
            CurveModel(
                "effective",
                (
                    Parameter("A", "1", 1e-3, 5.0, 0.5, "height of the rise"),
                    Parameter("k", "1", 0.5, 200.0, 10.0, "rate of the rise"),
                    Parameter("d", "1", -2.0, 3.0, 0.0, "fall with slip"),
                ),
                *_effective,
                "identifiable form of eq. 8 (physics.md 5)",
            ),
            CurveModel(
                "burckhardt",
                (
                    Parameter("c1", "1", 1e-3, 5.0, 0.8, "height of the rise"),
                    Parameter("c2", "1", 0.5, 400.0, 20.0, "rate of the rise"),
                    Parameter("c3", "1", -2.0, 3.0, 0.2, "fall with slip"),
                ),
                *_burckhardt,
                "Burckhardt 1993",
            ),
            CurveModel(
                "pacejka",
                (
                    Parameter("B", "1", 0.1, 100.0, 8.0, "stiffness factor"),
                    Parameter("C", "1", 0.5, 2.5, 1.4, "shape factor"),
                    Parameter("D", "1", 1e-3, 5.0, 0.6, "peak value"),
                    Parameter("E", "1", -10.0, 1.0, 0.0, "curvature factor"),
                ),
                _pacejka,
                _pacejka_slope,
                "Pacejka 2006",
            ),
            CurveModel(
                "schreiber_kutzbach",
                (
                    Parameter("a", "1", -1.0, 5.0, 0.5, "net traction where the rise is over"),
                    Parameter("b", "1", 1e-3, 5.0, 0.6, "height of the rise"),
                    Parameter("c", "1", 0.5, 200.0, 10.0, "rate of the rise"),
                    Parameter("d", "1", -2.0, 3.0, 0.1, "fall with slip"),
                ),
                *_schreiber,
                "Schreiber and Kutzbach 2007: kappa = a - b e^{-c s} - d s",
                native_intercept=lambda q: np.asarray(q["a"] - q["b"]),
            ),
            CurveModel(
                "brixius",
                (Parameter("mobility", "1", 1.0, 200.0, 30.0, "mobility number Bn"),),
                _brixius,
                _brixius_slope,
                "Brixius 1987 in the paper's split (rho_t = 0.04)",
            ),
            CurveModel(
                "wismer_luth",
                (Parameter("wheel_numeric", "1", 1.0, 500.0, 40.0, "wheel numeric Cn = CI b d/W"),),
                _wismer_luth,
                _wismer_luth_slope,
                "Wismer and Luth 1973 (gross traction ratio)",
            ),
        )
    }
)
"""The curve models by name."""

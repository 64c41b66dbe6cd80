"""The badge "data fix it" of a fit: condition number, effective parameters, a twin set that draws the same curve, and every doubt of it.

A doubt is a sentence, empty where there is none: by the bins' slips and ends of ranges (`judge`), by intervals (`left_open`), by the
noise of slip (`moved_by_noise`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from terragrip.arrays import Floats
from terragrip.physics.adhesion import CurveModel, effective_parameters

LIMIT = 1e4
"""Condition number (columns scaled to unit change of each parameter's own size) beyond which parameters are not distinguished."""
POOR = 0.5
"""R2 below which a curve explains too little of its bins for them to fix its parameters."""
AT_BOUND = 1e-3
"""Share of a parameter's range that counts as its end."""
VAGUE = 1.0
"""Width of a 95 % interval, over the value, from which the data do not fix it."""
BIASED = 0.1
"""Relative shift of a curve by the noise of slip from which a fit by slip is a hint only."""


@dataclass(frozen=True)
class Identifiability:
    """The badge of a fit.

    `condition`: ratio of the largest to the smallest singular value of the scaled sensitivities d curve/d ln parameter.
    `identifiable`: condition below LIMIT, R2 at least POOR, and no other doubt.
    `effective`: parameters that the data do determine (A, k, d), for the paper's form.
    `twin`: another parameter set, at most `twin_difference` away over the data's slips; None where there is none.
    """

    condition: float
    identifiable: bool
    effective: dict[str, float] | None
    twin: dict[str, float] | None
    twin_difference: float | None
    sentence: str

    @property
    def separable(self) -> bool:
        """Whether the bins' slips distinguish the parameters, however well the curve explains the bins."""
        return self.condition < LIMIT

    def denied(self, doubt: str) -> Identifiability:
        """The same, taken away for a reason."""
        return replace(self, identifiable=False, sentence=doubt)

    def short(self, r2: float | None) -> str:
        """Yes, or no with its number where it has one: the condition number, or `r2` of a curve that explains too little."""
        if self.condition != self.condition:  # of a curve that was not fitted
            return "–"
        if not self.separable:
            return f"no ({self.condition:.1g})"
        if r2 is not None and r2 < POOR:
            return f"no (R2 {r2:.2f})"
        return "yes" if self.identifiable else "no"

    def to_dict(self) -> dict[str, Any]:
        """In the form of soils.json."""
        return {name: value for name, value in asdict(self).items() if name != "twin_difference"}

    @classmethod
    def from_dict(cls, badge: Mapping[str, Any]) -> Self:
        """The inverse of `to_dict`; what is not there is not known."""
        return cls(
            badge.get("condition", np.nan), badge.get("identifiable", False), badge.get("effective"), badge.get("twin"), None,
            badge.get("sentence", ""),
        )  # fmt: skip


def at_bound(model: CurveModel, parameters: Mapping[str, float], free: Sequence[str]) -> list[str]:
    """The free parameters within AT_BOUND of a bound."""
    return [
        p.name
        for p in model.parameters
        if p.name in free
        and min(parameters[p.name] - p.lower, p.upper - parameters[p.name]) <= AT_BOUND * (p.upper - p.lower)
    ]


def left_open(name: str, value: float, interval: tuple[float, float]) -> str:
    """The doubt of a free parameter that its interval leaves open, as where the zero of slip is not known."""
    low, high = interval
    if high - low <= VAGUE * abs(value):
        return ""
    return f"The data leave {name} open, {low:.3g} to {high:.3g}: more slip or a better known radius would fix it."


def moved_by_noise(moved: float) -> str:
    """The doubt of a fit sorted by slip, where its noise moves the curve by a share `moved`."""
    return (
        f"Sorted by slip, its noise moves the curve by {moved:.0%}, so the data do not fix it."
        if moved > BIASED
        else ""
    )


def judge(
    model: CurveModel, parameters: Mapping[str, float], free: Sequence[str], slip: Floats, r2: float
) -> Identifiability:
    """Badge of a fit of `free` parameters on bins at `slip` (bins,), all other parameters fixed; `r2` of the fit on them."""
    if not free:
        effective = effective_parameters(parameters) if model.name == "exponential" else None
        sentence = f"Every parameter is given, so the data fix none: the curve is evaluated, not fitted (R2 {r2:.2f})."
        return Identifiability(1.0, False, effective, None, None, sentence)
    badge = _by_slips(model, parameters, free, slip, r2)
    ended = at_bound(model, parameters, free)
    if not ended:
        return badge
    return badge.denied(f"{', '.join(ended)} stopped at an end of its range, so the data do not fix it.")


def _by_slips(
    model: CurveModel, parameters: Mapping[str, float], free: Sequence[str], slip: Floats, r2: float
) -> Identifiability:
    names = [name for name in free if name != "intercept"]
    columns = [_sensitivity(model, parameters, name, slip) for name in names]
    if "intercept" in free:
        columns.append(np.full(slip.shape, max(abs(float(np.ptp(model.value(slip, parameters)))), 1e-3)))
        names.append("intercept")
    matrix = np.stack(columns, axis=-1)
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    condition = float(values[0] / max(values[-1], values[0] * 1e-16)) if values[0] > 0 else 1e16
    effective = effective_parameters(parameters) if model.name == "exponential" else None
    if condition < LIMIT and r2 < POOR:
        sentence = f"The curve explains little of the bins (R2 {r2:.2f}), so they do not fix {', '.join(names)}: use it as a hint only."
        return Identifiability(condition, False, effective, None, None, sentence)
    if condition < LIMIT:
        sentence = f"The data fix {', '.join(names)} (condition number {condition:.3g})."
        return Identifiability(condition, True, effective, None, None, sentence)
    twin, difference = _twin(model, parameters, names, rows[-1], slip)
    sentence = (
        f"The data do not fix {', '.join(names)} one by one (condition number {condition:.2g}): "
        + ", ".join(f"{n} = {twin[n]:.4g}" for n in names if n in twin)
        + f" draws the same curve to {difference:.1g}."
    )
    return Identifiability(condition, False, effective, twin, difference, sentence)


def _sensitivity(model: CurveModel, parameters: Mapping[str, float], name: str, slip: Floats) -> Floats:
    """d curve/d ln|parameter|; a parameter at 0 is moved by a hundredth of 1."""
    size = max(abs(parameters[name]), 1e-2)
    h = 1e-5 * size
    up, down = {**parameters, name: parameters[name] + h}, {**parameters, name: parameters[name] - h}
    return np.asarray((model.value(slip, up) - model.value(slip, down)) / (2e-5))


def _twin(
    model: CurveModel, parameters: Mapping[str, float], names: Sequence[str], direction: Floats, slip: Floats
) -> tuple[dict[str, float], float]:
    """Walk along the flattest direction in ln(parameter), refitting nothing else, as far as the curve moves by 1e-4 at most."""
    bounds = {p.name: (p.lower, p.upper) for p in model.parameters}
    base = model.value(slip, parameters)
    best, difference = dict(parameters), 0.0
    for length in np.geomspace(1e-3, 3.0, 60):
        for sign in (1.0, -1.0):
            trial = dict(parameters)
            for name, share in zip(names, direction, strict=True):
                if name in bounds:
                    size = max(abs(parameters[name]), 1e-2)
                    moved = parameters[name] + np.sign(parameters[name] or 1.0) * size * np.expm1(
                        sign * length * share
                    )
                    trial[name] = float(np.clip(moved, *bounds[name]))
            off = float(np.max(np.abs(model.value(slip, trial) - base)))
            if 1e-12 < off <= 1e-4:
                best, difference = trial, off
    return best, difference

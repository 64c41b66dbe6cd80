"""Curves for the fit page, which has no model: the models by name, samples of a curve, the handles that it is dragged by."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, Field, FiniteFloat

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES, CurveModel
from terragrip.soil.handles import Handle, handles, moved
from terragrip.soil.least_squares import INTERCEPT
from terragrip.studio.api.files import finite

router = APIRouter(tags=["fit"])

SLIPS = np.linspace(-1.0, 1.0, 401)
"""Slips that curves are sampled at for the pages."""


class CurveRequest(BaseModel):
    """A curve as a page draws it; parameters that are left out have their start values."""

    model: str
    parameters: dict[str, FiniteFloat] = {}
    held: list[str] = Field([], description="Parameters that a drag leaves as they are.")


class MoveRequest(CurveRequest):
    """A curve before one of its handles was dragged, and where to."""

    handle: Literal["zero", "rise", "peak", "level"]
    slip: FiniteFloat
    value: FiniteFloat
    bounds: dict[str, tuple[FiniteFloat, FiniteFloat]] = {}


@router.get("/models")
def models() -> list[dict[str, Any]]:
    """Every curve model: its parameters with unit, bounds and start, which of them a fit holds, its source."""
    return [
        {
            "name": model.name,
            "source": model.source,
            "fixed": sorted(model.fixed),
            "parameters": [
                {"name": p.name, "unit": p.unit, "lower": p.lower, "upper": p.upper, "start": p.start, "meaning": p.meaning}
                for p in model.parameters
            ],
        }
        for model in CURVES.values()
    ]  # fmt: skip


@router.post("/curve")
def curve(wanted: CurveRequest) -> dict[str, Any]:
    """Samples of a curve over slip, its largest value, its slope at zero slip, its handles: the pages draw these and compute no model."""
    return _shown(*_known(wanted), wanted.held)


@router.post("/curve/move")
def move(wanted: MoveRequest) -> dict[str, Any]:
    """The curve whose handle was dragged, as `/curve` gives it, and its parameters; the nearest one where the model cannot follow."""
    model, parameters = _known(wanted)
    goal = Handle(wanted.handle, wanted.slip, wanted.value)
    parameters = moved(model, parameters, goal, wanted.held, wanted.bounds)
    return {"parameters": parameters, **_shown(model, parameters, wanted.held)}


def _known(wanted: CurveRequest) -> tuple[CurveModel, dict[str, float]]:
    """The model, and all of its parameters; raises InputError where there is none of the name."""
    if wanted.model not in CURVES:
        raise InputError(
            f"there is no curve model {wanted.model!r}", hint=f"choose one of {', '.join(CURVES)}"
        )
    model = CURVES[wanted.model]
    if unknown := sorted(set(wanted.parameters) - {*model.names, INTERCEPT}):
        raise InputError(
            f"curve model {model.name} has no parameter {unknown[0]!r}",
            hint=f"it has {', '.join(model.names)}",
        )
    return model, {p.name: p.start for p in model.parameters} | wanted.parameters


def _shown(model: CurveModel, parameters: dict[str, float], held: list[str]) -> dict[str, Any]:
    own = {name: value for name, value in parameters.items() if name != INTERCEPT}
    values = model.value(SLIPS, own, parameters.get(INTERCEPT, 0.0))
    return finite(
        {
            "slip": SLIPS.tolist(),
            "value": values.tolist(),
            "peak": model.peak(own),
            "initial_slope": float(model.slope(0.0, own)),
            "handles": [vars(one) for one in handles(model, parameters, held)],
        }
    )

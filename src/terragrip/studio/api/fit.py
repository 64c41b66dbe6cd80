"""The fit page: curve models, soils of the folder with their points and bins, fits, and saving to a library."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, Field, FiniteFloat

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings, bin_pairs
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here, Studio

router = APIRouter(tags=["fit"])

SHOWN = 4000
"""Points of one soil that a page gets; the fit takes them all."""


class BinChoice(BaseModel):
    """Slip bins, as fractions."""

    width: float = Field(0.01, gt=0, le=0.5)
    lower: float = Field(0.05, ge=-1, le=1)
    upper: float = Field(0.60, ge=-1, le=1)
    minimum: int = Field(10, ge=1)

    def settings(self) -> BinSettings:
        """As the fit takes them; InputError if they hold no bin."""
        try:
            return BinSettings(self.width, self.lower, self.upper, self.minimum)
        except ValueError as error:
            raise InputError(str(error), mend="widen the range") from None


class FitRequest(BaseModel):
    """Fit a model to points that are sent, or to a soil of a file of estimates."""

    model: str
    fixed: dict[str, FiniteFloat] | Literal["free"] | None = None
    intercept: bool = False
    weights: Literal["count"] | None = None
    slip: list[FiniteFloat] = Field(default=[], max_length=200_000)
    adhesion: list[FiniteFloat] = Field(default=[], max_length=200_000)
    path: str | None = Field(None, description="Estimates of the folder, instead of points.")
    soil: str | None = None
    bins: BinChoice = BinChoice()
    bootstrap: int = Field(1000, ge=0, le=5000)


class SaveRequest(BaseModel):
    """Put one soil into a library of the folder."""

    library: str
    name: str = Field(min_length=1, max_length=100)
    model: str
    parameters: dict[str, FiniteFloat]
    interval: dict[str, tuple[FiniteFloat, FiniteFloat]] = {}
    r2: FiniteFloat | None = None
    nrmse: FiniteFloat | None = None
    bins: list[dict[str, FiniteFloat]] = []
    source: str = "studio"
    replace: bool = False


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


@router.get("/literature")
def literature() -> list[dict[str, Any]]:
    """Curves of the literature that are built in."""
    from terragrip.soil.literature import literature_soils

    return [_plain(soil) for soil in literature_soils().values()]


@router.get("/soils")
def soils(studio: Here, path: Named) -> list[dict[str, Any]]:
    """The soils of a library, of estimates (points and bins by soil), or of digitised points."""
    target = studio.folder.file(path)
    if target.suffix.lower() == ".json":
        return [_plain(soil) for soil in SoilLibrary.load(target).values()]
    if target.suffix.lower() == ".parquet":
        return [_shown(name, studio, target) for name in _soils_of(studio, target)]
    from terragrip.soil.digitised import read_points

    return [
        {"name": curve.name, "points": {"slip": curve.slip.tolist(), "adhesion": curve.value.tolist()}, "source": path}
        for curve in read_points(target)
    ]  # fmt: skip


@router.post("/fit")
def fit(studio: Here, wanted: FitRequest) -> dict[str, Any]:
    """Fit a curve; returns what soils.json would hold, and a band of the curve over slip.

    A mean of squares fits bins, as the paper does. Points that are sent (digitised, or bins of a library) count as a bin each.
    """
    run: Any
    if wanted.path is not None:
        pairs = _pairs(studio, studio.folder.file(wanted.path), wanted.soil or "")
        slip, adhesion, run, settings = *pairs, wanted.bins.settings()
    else:
        slip, adhesion = np.array(wanted.slip), np.array(wanted.adhesion)
        if slip.size != adhesion.size:
            raise InputError(f"{slip.size} slips but {adhesion.size} adhesions")
        if slip.size < 2:
            raise InputError("there are fewer than two points", mend="choose a soil, or click points")
        run = np.arange(slip.size)
        settings = _bins_of_points(slip)
    curve = AdhesionCurve(
        wanted.model, wanted.fixed, wanted.intercept, wanted.weights, settings, wanted.bootstrap
    ).fit(slip, adhesion, run)
    found: dict[str, Any] = curve.to_dict()
    grid = np.linspace(0.0, 1.0, 101)
    if curve.samples_ is not None:
        low, high = curve.band(grid)
        found["band"] = {"slip": grid.tolist(), "low": low.tolist(), "high": high.tolist()}
    found["peak"] = curve.peak()
    plain: dict[str, Any] = finite(found)
    return plain


@router.post("/soils/save", status_code=201)
def save(studio: Here, wanted: SaveRequest) -> dict[str, Any]:
    """Put a soil into a library, which is made where there is none."""
    target = studio.folder.new_file(wanted.library, (".json",))
    library = SoilLibrary.load(target) if target.exists() else SoilLibrary({})
    if wanted.model not in CURVES:
        raise InputError(f"there is no curve model {wanted.model!r}")
    try:
        CURVES[wanted.model].complete({k: v for k, v in wanted.parameters.items() if k != "intercept"})
    except ValueError as error:
        raise InputError(str(error)) from None
    soil = Soil(
        wanted.name, wanted.model, wanted.parameters, wanted.interval, wanted.r2, wanted.nrmse, tuple(wanted.bins), source=wanted.source
    )  # fmt: skip
    merged = library.merge(SoilLibrary({soil.name: soil}), "replace" if wanted.replace else "refuse")
    merged.write(target)
    return {"path": wanted.library, "soils": list(merged)}


def _plain(soil: Soil) -> dict[str, Any]:
    plain: dict[str, Any] = finite({"name": soil.name, **soil.to_dict()})
    return plain


def _bins_of_points(slip: np.ndarray[Any, Any]) -> BinSettings:
    """Bins so narrow that each point is one, over all points: a digitised point stands for itself."""
    steps = np.diff(np.unique(slip))
    width = max(float(steps.min()) / 2, 1e-5) if steps.size else 0.01
    lower = float(slip.min()) - width / 2
    return BinSettings(width, lower, max(float(slip.max()) + width, lower + width), 1)


def _soils_of(studio: Studio, target: Path) -> list[str]:
    table = studio.estimates.get(target)
    if "soil" not in table:
        return [""]
    return sorted(set(table["soil"].tolist()))


def _pairs(studio: Studio, target: Path, soil: str) -> tuple[Any, Any, Any]:
    """Slip, adhesion and stretch of one soil's usable rows; an unlabelled log is one soil without a name."""
    from terragrip.soil.estimates import pairs_of

    table = studio.estimates.get(target)
    labelled = "soil" in table and any(table["soil"] != "")
    parts = [
        p
        for p in pairs_of(table, target.stem, None if labelled else "unlabelled")
        if not labelled or p.soil == soil
    ]
    if not parts:
        raise InputError(
            f"no usable samples on {soil or 'unlabelled ground'}",
            file=studio.folder.name(target),
            mend="choose another soil",
        )
    return tuple(
        np.concatenate([getattr(p, name) for p in parts]) for name in ("slip", "adhesion", "stretch")
    )  # type: ignore[return-value]


def _shown(name: str, studio: Studio, target: Path) -> dict[str, Any]:
    """One soil of estimates: its bins, and points thinned evenly."""
    entry: dict[str, Any] = {"name": name or "unlabelled", "soil": name, "path": studio.folder.name(target)}
    try:
        slip, adhesion, stretch = _pairs(studio, target, name)
    except InputError as error:
        return {**entry, "note": error.problem, "points": {"slip": [], "adhesion": []}, "bins": []}
    step = max(len(slip) // SHOWN, 1)
    bins = bin_pairs(slip, adhesion, stretch)
    points = {"slip": slip[::step].round(5).tolist(), "adhesion": adhesion[::step].round(5).tolist()}
    plain: dict[str, Any] = finite({**entry, "points": points, "count": len(slip), "bins": bins.to_list()})
    return plain

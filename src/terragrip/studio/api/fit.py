"""The fit page: soils of the folder with their points and bins, fits, and saving to a library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from fastapi import APIRouter
from numpy.typing import NDArray
from pydantic import BaseModel, Field, FiniteFloat

from terragrip.errors import InputError
from terragrip.soil.bins import PULL, BinSettings, chosen_bins
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import LearnedSoil, bin_parts
from terragrip.soil.library import Soil, SoilLibrary, soil_of
from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here, Studio

router = APIRouter(tags=["fit"])

SHOWN = 4000
"""Points of one soil that a page gets; the fit takes them all."""


class BinChoice(BaseModel):
    """Slip bins, as fractions; by the vehicle's pull unless stated otherwise, as `terragrip soils` has them."""

    width: float | None = Field(None, gt=0, le=0.5)
    lower: float | None = Field(None, ge=-1, le=1)
    upper: float = Field(0.60, ge=-1, le=1)
    minimum: int = Field(10, ge=1)
    by: Literal["pull", "slip"] = "pull"

    def settings(self) -> BinSettings:
        """As the fit takes them; InputError if they hold no bin."""
        try:
            return chosen_bins(self.by, self.width, self.lower, self.upper, minimum=self.minimum)
        except ValueError as error:
            raise InputError(str(error), hint="widen the range") from None


class FitRequest(BaseModel):
    """Fit a model to points that are sent, or to a soil of a file of estimates or of a library."""

    model: str
    fixed: dict[str, FiniteFloat] | Literal["free"] | None = None
    bounds: dict[str, tuple[FiniteFloat, FiniteFloat]] = {}
    intercept: bool = False
    weights: Literal["count"] | None = None
    slip: list[FiniteFloat] = Field(default=[], max_length=200_000)
    adhesion: list[FiniteFloat] = Field(default=[], max_length=200_000)
    path: str | None = Field(None, description="Estimates or a library, instead of points.")
    soil: str | None = None
    bins: BinChoice | None = Field(None, description="None: those of `terragrip soils`.")
    bootstrap: int = Field(1000, ge=0, le=5000)
    start: dict[str, FiniteFloat] | None = Field(
        None, description="Where the fit begins, in place of its own starts."
    )


class SaveRequest(BaseModel):
    """Put one soil into a library of the folder."""

    library: str
    name: str = Field(min_length=1, max_length=100)
    model: str
    parameters: dict[str, FiniteFloat]
    free: list[str] = []
    interval: dict[str, list[FiniteFloat]] = {}
    band: dict[Literal["slip", "low", "high"], list[FiniteFloat]] | None = None
    r2: FiniteFloat | None = None
    nrmse: FiniteFloat | None = None
    bins: list[dict[str, FiniteFloat]] = []
    clusters: int | None = Field(None, ge=1, description="Draws that the interval comes from.")
    common_slip_sd: FiniteFloat | None = Field(
        None, ge=0, description="SD of the error of slip that the bins share."
    )
    identifiability: dict[str, Any] | None = Field(None, description="As `/fit` gives it.")
    notes: list[str] = []
    source: str = "studio"
    replace: bool = False


@router.get("/literature")
def literature() -> list[dict[str, Any]]:
    """Curves of the literature that are built in."""
    from terragrip.soil.literature import literature_soils

    return [_plain(soil) for soil in literature_soils().values()]


@router.get("/soils")
def soils(studio: Here, path: Named, by: Literal["pull", "slip"] = "pull") -> list[dict[str, Any]]:
    """The soils of a library, of estimates (points and bins by soil; bins by pull or by slip), or of digitised points."""
    target = studio.folder.file(path)
    if target.suffix.lower() == ".json":
        return [_plain(soil) for soil in SoilLibrary.load(target).values()]
    if target.suffix.lower() == ".parquet":
        return [_shown(name, studio, target, by) for name in _soils_of(studio, target)]
    from terragrip.soil.digitised import read_points

    return [
        {"name": curve.name, "points": {"slip": curve.slip.tolist(), "adhesion": curve.value.tolist()}, "source": path}
        for curve in read_points(target)
    ]  # fmt: skip


@router.post("/fit")
def fit(studio: Here, wanted: FitRequest) -> dict[str, Any]:
    """Fit a curve; returns what soils.json would hold, and a band of the curve over slip.

    A soil of estimates is fitted as `terragrip soils` does it, by the same bins. Points that are sent (digitised) count as a draw
    each; the bins of a library are as many draws as it was learnt from, and share the error of slip that it keeps.
    """
    if wanted.path is None:
        slip = np.array(wanted.slip)
        curve = _through(wanted, slip, np.array(wanted.adhesion), max(slip.size, 1), 0.0)
    elif (target := studio.folder.file(wanted.path)).suffix.lower() == ".json":
        curve = _refitted(wanted, SoilLibrary.load(target), wanted.path)
    else:
        curve = _learned(studio, target, wanted).curve
    result: dict[str, Any] = curve.to_dict()
    result["peak"] = curve.peak()
    result["at_bound"] = curve.at_bound_
    return finite(result)


@router.post("/soils/save", status_code=201)
def save(studio: Here, wanted: SaveRequest) -> dict[str, Any]:
    """Put a soil into a library, which is made where there is none. A soil that is replaced keeps what was measured beside its curve
    (resistance, spread, roughness), by which a drive is recognised on it.
    """
    target = studio.folder.new_file(wanted.library, (".json",), replace=True)
    entry = wanted.model_dump(exclude={"library", "name", "replace"}, exclude_defaults=True)
    soil = soil_of(wanted.name, {"source": wanted.source, **entry}, wanted.library)
    with studio.own.saving():  # two pages that save at once keep both soils
        library = SoilLibrary.load(target) if target.exists() else SoilLibrary({})
        if wanted.replace and soil.name in library:
            soil = _with_measured(soil, library[soil.name])
        merged = library.merge(SoilLibrary({soil.name: soil}), "replace" if wanted.replace else "refuse")
        merged.write(target)
    return {"path": wanted.library, "soils": list(merged)}


def _with_measured(soil: Soil, old: Soil) -> Soil:
    """A soil's new curve, with what was measured beside the old one."""
    kept = {key: old.fit[key] for key in ("slip_noise", "signature") if key in old.fit}
    return replace(soil, resistance=old.resistance, spread=old.spread, fit={**soil.fit, **kept})


def _plain(soil: Soil) -> dict[str, Any]:
    return finite({"name": soil.name, **soil.to_dict()})


def _refitted(wanted: FitRequest, library: SoilLibrary, path: str) -> AdhesionCurve:
    """A curve through the bins of a library's soil; InputError where there is no such soil, or it has no two bins."""
    if wanted.soil is None or wanted.soil not in library:
        raise InputError(f"has no soil {wanted.soil!r}", file=path, hint="open the library again")
    soil = library[wanted.soil]
    slip, mean = (np.array([one[key] for one in soil.bins]) for key in ("slip", "mean"))
    draws = max(int(soil.fit.get("clusters") or slip.size), 1)
    return _through(wanted, slip, mean, draws, float(soil.fit.get("common_slip_sd") or 0.0))


def _through(
    wanted: FitRequest, slip: NDArray[np.float64], adhesion: NDArray[np.float64], draws: int, slip_sd: float
) -> AdhesionCurve:
    """A curve through points (n,) of slip and adhesion, which came in that many draws, with an error of slip in common whose SD is
    `slip_sd` (a share). Raises InputError if there are no two."""
    if slip.size != adhesion.size:
        raise InputError(f"{slip.size} slips but {adhesion.size} adhesions")
    if slip.size < 2:
        raise InputError("there are fewer than two points", hint="choose a soil, or click points")
    curve = _unfitted(wanted, _bins_of_points(slip)).unfitted(common_slip_sd=slip_sd)
    return curve.fit(slip, adhesion, np.arange(slip.size) % draws)


def _bins_of_points(slip: np.ndarray[Any, Any]) -> BinSettings:
    """Bins so narrow that each point is one, over all points: a digitised point stands for itself."""
    steps = np.diff(np.unique(slip))
    width = max(float(steps.min()) / 2, 1e-5) if steps.size else 0.01
    lower = float(slip.min()) - width / 2
    return BinSettings(width, lower, max(float(slip.max()) + width, lower + width), 1)


def _unfitted(wanted: FitRequest, bins: BinSettings) -> AdhesionCurve:
    return AdhesionCurve(
        wanted.model,
        wanted.fixed,
        wanted.intercept,
        wanted.weights,
        bins,
        wanted.bootstrap,
        bounds=wanted.bounds,
        start=wanted.start,
    )


def _learned(studio: Studio, target: Path, wanted: FitRequest) -> LearnedSoil:
    """One soil of a file of estimates as `terragrip soils` learns it; raises InputError where it cannot be fitted."""
    bins = PULL if wanted.bins is None else wanted.bins.settings()
    gathered = _gathered(studio, target, wanted.soil or "")
    name = gathered.pairs[0].soil
    campaign = gathered.learn(_unfitted(wanted, bins), None if wanted.bins is None else {})
    if name not in campaign.soils:
        raise InputError(f"{name}: {campaign.not_fitted[name]}", file=studio.folder.name(target))
    return campaign.soils[name]


def _soils_of(studio: Studio, target: Path) -> list[str]:
    table = studio.estimates.get(target)
    if "soil" not in table:
        return [""]
    return sorted(set(table["soil"].tolist()))


def _gathered(studio: Studio, target: Path, soil: str) -> GatheredRuns:
    """One soil's usable rows; an unlabelled log is one soil without a name. Raises InputError where there are none."""
    table = studio.estimates.get(target)
    labelled = "soil" in table and any(table["soil"] != "")
    every = GatheredRuns()
    every.add(table, target.stem, None if labelled else "unlabelled", studio.folder.name(target))
    result = every.only(soil if labelled else "unlabelled")
    if not result.pairs:
        raise InputError(
            f"no usable samples on {soil or 'unlabelled ground'}",
            file=studio.folder.name(target),
            hint="choose another soil",
        )
    return result


def _shown(name: str, studio: Studio, target: Path, by: Literal["pull", "slip"]) -> dict[str, Any]:
    """One soil of estimates: the bins that a fit takes (by slip where none can be fitted), and points thinned evenly."""
    entry: dict[str, Any] = {"name": name or "unlabelled", "soil": name, "path": studio.folder.name(target)}
    try:
        parts = _gathered(studio, target, name).pairs
    except InputError as error:
        return {**entry, "note": error.problem, "points": {"slip": [], "adhesion": []}, "bins": []}
    choice = BinChoice(by="slip") if by == "slip" else None
    wanted = FitRequest(model="exponential", path=str(target), soil=name, bins=choice, bootstrap=0)
    try:
        bins, note = _learned(studio, target, wanted).curve.bins_, ""
    except InputError as error:
        bins, note = bin_parts(parts, PULL.papers()), error.problem
    slip, adhesion = (np.concatenate([getattr(part, key) for part in parts]) for key in ("slip", "adhesion"))
    step = max(len(slip) // SHOWN, 1)
    points = {"slip": slip[::step].round(5).tolist(), "adhesion": adhesion[::step].round(5).tolist()}
    return finite({**entry, "points": points, "count": len(slip), "bins": bins.to_list(), "note": note})

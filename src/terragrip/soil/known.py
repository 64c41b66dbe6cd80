"""The soils of a library as finished fits, for the report: nothing is learned again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from terragrip.soil.bins import Bins, BinSettings
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.identifiability import Identifiability
from terragrip.soil.learn import Campaign, LearnedSoil
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.slip_noise import SlipNoise


def known_soils(library: SoilLibrary, names: Iterable[str]) -> Campaign:
    """The library's soils of these names; a name that is not in it is not fitted."""
    wanted = sorted(set(names))
    soils = {name: _known(library[name]) for name in wanted if name in library}
    return Campaign(soils, {n: "the library does not contain it" for n in wanted if n not in library}, ())


def _known(soil: Soil) -> LearnedSoil:
    curve = _fitted(soil)
    paper = soil.fit.get("by_slip")
    by_slip = curve
    if paper:
        its = replace(soil, parameters=paper["parameters"], interval=_pairs(paper.get("interval")), r2=paper["r2"],
                      nrmse=paper.get("nrmse"), bins=tuple(paper.get("bins") or ()),
                      fit={**soil.fit, "settings": paper.get("settings"), "band": paper.get("band")})  # fmt: skip
        by_slip = _fitted(its)
    noise = soil.fit.get("slip_noise")
    freed = None
    if noise:
        freed = SlipNoise(noise["plain"], noise["corrected"], noise["slip_std"], False, "")
    return LearnedSoil(soil, curve, by_slip, None, freed, (), ())


def _fitted(soil: Soil) -> AdhesionCurve:
    """A curve from its stored fit: parameters, intervals, bins and badge, without the bootstrap's draws."""
    fit = soil.fit
    known = {field.name for field in fields(BinSettings)}
    settings = BinSettings(**{k: v for k, v in (fit.get("settings") or {}).items() if k in known})
    curve = AdhesionCurve(soil.model, bins=settings, bootstrap=0)
    curve.free_ = tuple(fit.get("free", ()))
    curve.parameters_, curve.interval_ = dict(soil.parameters), dict(soil.interval)
    curve.r2_ = np.nan if soil.r2 is None else soil.r2
    curve.nrmse_ = np.nan if soil.nrmse is None else soil.nrmse
    curve.samples_, curve.notes_, curve.at_bound_ = None, list(fit.get("notes", ())), []
    curve.stored = soil
    column = {name: np.array([row.get(name, np.nan) for row in soil.bins], dtype=float) for name in _BIN}
    weight = np.where(np.isfinite(column["metres"]), column["metres"], column["count"])[None, :]
    curve.bins_ = Bins(
        settings, column["slip"], column["mean"], column["std"], np.nan_to_num(column["count"]).astype(np.int64),
        weight, weight * column["mean"], weight * column["slip"],
    )  # fmt: skip
    curve.identifiability_ = Identifiability.from_dict(fit.get("identifiability") or {})
    return curve


_BIN = ("slip", "mean", "std", "count", "metres")


def _pairs(interval: Mapping[str, Any] | None) -> dict[str, tuple[float, float]]:
    return {name: (low, high) for name, (low, high) in (interval or {}).items()}

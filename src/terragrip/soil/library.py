"""The soil library: soils by name with curve, interval, bins and provenance; soils.json (architecture.md, contracts)."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terragrip.document import read_json
from terragrip.errors import InputError
from terragrip.files import replacing
from terragrip.physics.adhesion import CURVES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from terragrip.soil.fit import AdhesionCurve

VERSION = 1


@dataclass(frozen=True)
class Soil:
    """One soil: the curve's model and parameters, and their uncertainty.

    `resistance` and `spread`: (mean, SD) of rho_s, and the SD of adhesion about the curve; None where not known.
    `fit`: the rest of a fit from `AdhesionCurve.to_dict` (settings, badge, notes).
    """

    name: str
    model: str
    parameters: Mapping[str, float]
    interval: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    r2: float | None = None
    nrmse: float | None = None
    bins: tuple[Mapping[str, float], ...] = field(default=(), repr=False)
    resistance: tuple[float, float] | None = None
    spread: float | None = None
    source: str = ""
    fit: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def from_curve(
        cls, name: str, curve: AdhesionCurve, source: str = "", resistance: tuple[float, float] | None = None
    ) -> Soil:
        """A soil from a fitted curve."""
        whole = curve.to_dict()
        kept = ("free", "settings", "clusters", "common_slip_sd", "identifiability", "notes", "band")
        rest: dict[str, Any] = {k: whole[k] for k in kept if k in whole}
        used = curve.bins_.used
        weight = curve.bins_.count[used]
        off = curve.bins_.mean[used] - curve.predict(curve.bins_.slip[used])
        spread = float(np.sqrt(np.average(curve.bins_.std[used] ** 2 + off**2, weights=weight)))
        interval = {k: (a, b) for k, (a, b) in whole["interval"].items()}
        return cls(
            name, curve.model, whole["parameters"], interval, curve.r2_, curve.nrmse_, tuple(whole["bins"]), resistance, spread,
            source, rest,
        )  # fmt: skip

    def value(self, slip: ArrayLike) -> NDArray[np.float64]:
        """mu (or kappa, where the fit has an intercept) at slips of any shape."""
        given = {k: v for k, v in self.parameters.items() if k != "intercept"}
        return CURVES[self.model].value(slip, given, self.parameters.get("intercept", 0.0))

    @property
    def reach(self) -> float:
        """The largest slip of the bins: beyond it the curve rests on its form alone. Infinite for a curve without bins."""
        return max(
            (float(one["slip"]) for one in self.bins if None not in (one.get("slip"), one.get("mean"))),
            default=math.inf,
        )

    @property
    def has_band(self) -> bool:
        """Whether `band` is known: written with the fit, or by the interval of its one free parameter."""
        return bool(self.fit.get("band")) or self._ends is not None

    @property
    def _ends(self) -> tuple[str, tuple[float, float]] | None:
        """The one free parameter with its interval."""
        free = list(self.fit.get("free", ()))
        return (free[0], self.interval[free[0]]) if len(free) == 1 and free[0] in self.interval else None

    def band(self, slip: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The 95 % band (low, high) of the curve at slips of any shape: as written with the fit, or by the interval of its one free
        parameter; the curve itself where neither is known."""
        s = np.asarray(slip, dtype=float)
        if written := self.fit.get("band"):
            low, high = (np.interp(np.abs(s), written["slip"], written[key]) for key in ("low", "high"))
            return np.where(s < 0, -high, low), np.where(s < 0, -low, high)
        if self._ends is None:
            return self.value(s), self.value(s)
        name, ends = self._ends
        one, other = (replace(self, parameters={**self.parameters, name: end}).value(s) for end in ends)
        return np.minimum(one, other), np.maximum(one, other)

    def to_dict(self) -> dict[str, Any]:
        """The soil in the form of soils.json; unknown values are null."""
        return {
            "model": self.model,
            "parameters": dict(self.parameters),
            "interval": {k: list(v) for k, v in self.interval.items()},
            "r2": self.r2,
            "nrmse": self.nrmse,
            "bins": [dict(b) for b in self.bins],
            "reach": self.reach if math.isfinite(self.reach) else None,
            "resistance": None
            if self.resistance is None
            else {"mean": self.resistance[0], "std": self.resistance[1]},
            "spread": self.spread,
            "source": self.source,
            **self.fit,
        }


@dataclass(frozen=True)
class SoilLibrary(Mapping[str, Soil]):
    """Soils by name, read from and written to soils.json. A mapping.

    `not_fitted`: why a soil has no curve of its own. `without_curve`: such soils on a usual curve, with what the data tell besides
    (resistance, roughness): for recognition alone.
    """

    soils: Mapping[str, Soil]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    not_fitted: Mapping[str, str] = field(default_factory=dict)
    without_curve: Mapping[str, Soil] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Soil:
        return self.soils[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.soils)

    def __len__(self) -> int:
        return len(self.soils)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SoilLibrary:
        """Read soils.json. InputError: no such file, not JSON, a newer version, two soils of one name, a value that is not a number."""
        file = os.fspath(path)
        try:
            data = read_json(file, "soils", VERSION, "'terragrip soils'", pairs=_refuse_twins)
        except _Twin as twin:
            raise InputError(f"two entries are named {twin}", file=file, hint="rename one") from None
        if not isinstance(data["soils"], dict):
            raise InputError("holds no 'soils'", file=file, hint="give a file written by 'terragrip soils'")
        bare = data.get("without_curve") or {}
        if not isinstance(bare, dict):
            raise InputError("is not a mapping", file=file, place="without_curve")
        soils, without = (
            {name: soil_of(name, entry, file, key) for name, entry in entries.items()}
            for key, entries in (("soils", data["soils"]), ("without_curve", bare))
        )
        return cls(soils, data.get("provenance") or {}, data.get("not_fitted") or {}, without)

    @property
    def recognisable(self) -> dict[str, Soil]:
        """All soils that a drive can be recognised on: those with a curve, then those without one."""
        return {**self.soils, **{k: v for k, v in self.without_curve.items() if k not in self.soils}}

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write soils.json, whole or not at all. InputError if it cannot be written, or a number is NaN or infinite."""
        try:
            text = json.dumps(self.to_dict(), indent=1, allow_nan=False)
        except ValueError as error:
            hint = "leave out unknown numbers (None); they are written as null"
            raise InputError(f"a number of a soil is not one ({error})", file=path, hint=hint) from None
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.write(text + "\n")

    def to_dict(self) -> dict[str, Any]:
        """The library as plain data."""
        return {
            "version": VERSION,
            "soils": {name: soil.to_dict() for name, soil in self.soils.items()},
            "not_fitted": dict(self.not_fitted),
            "without_curve": {name: soil.to_dict() for name, soil in self.without_curve.items()},
            "provenance": dict(self.provenance),
        }

    def to_pandas(self) -> pd.DataFrame:
        """A row for each soil: model, parameters with their 95 % intervals, quality of the fit (`terragrip.soil.views.table_of`)."""
        from terragrip.soil.views import table_of

        return table_of(self.soils)

    def plot(self) -> Figure:
        """The curves with their bins, as a matplotlib figure; raises InputError if there is none, or no matplotlib."""
        from terragrip.soil.views import plot

        return plot(self.soils)

    def _repr_html_(self) -> str:
        from terragrip.soil.views import html_of

        return html_of(self.soils, self.not_fitted)

    def merge(self, other: SoilLibrary, clash: str = "refuse") -> SoilLibrary:
        """The soils of both libraries. `clash`: "refuse" two soils of one name (InputError), "keep" ours, or "replace" by theirs."""
        if clash not in ("refuse", "keep", "replace"):
            raise InputError(f"clash={clash!r} is not a choice", hint="use 'refuse', 'keep' or 'replace'")
        twins = sorted(set(self.soils) & set(other.soils))
        if twins and clash == "refuse":
            raise InputError(
                f"both libraries hold a soil {twins[0]!r}", hint="choose which to keep, or rename one"
            )
        both = {**self.soils, **other.soils} if clash == "replace" else {**other.soils, **self.soils}
        order = [*self.soils, *(name for name in other.soils if name not in self.soils)]
        missed = {k: v for k, v in {**other.not_fitted, **self.not_fitted}.items() if k not in both}
        without = {k: v for k, v in {**other.without_curve, **self.without_curve}.items() if k not in both}
        provenance = {**other.provenance, **self.provenance}
        return SoilLibrary({name: both[name] for name in order}, provenance, missed, without)

    def compare(self, other: SoilLibrary) -> list[dict[str, Any]]:
        """For each soil in both: the largest and the mean difference of mu over slips of 5 % to `to`, 60 % or where the data of either end
        (from half of `to` where that is below 10 %), and whether intervals of one model meet."""
        rows = []
        for name in self.soils:
            if name not in other.soils:
                continue
            mine, theirs = self.soils[name], other.soils[name]
            to = min(0.60, mine.reach, theirs.reach)
            slip = np.linspace(min(0.05, to / 2), to, 111)
            off = theirs.value(slip) - mine.value(slip)
            shared = set(mine.interval) & set(theirs.interval) if mine.model == theirs.model else set()
            meet = {
                k: mine.interval[k][0] <= theirs.interval[k][1]
                and theirs.interval[k][0] <= mine.interval[k][1]
                for k in sorted(shared)
            }
            rows.append(
                {
                    "soil": name,
                    "to": to,
                    "largest": float(np.abs(off).max()),
                    "mean": float(off.mean()),
                    "intervals_meet": meet,
                }
            )
        return rows


class _Twin(Exception):
    pass


def _refuse_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in pairs:
        if key in out:
            raise _Twin(repr(key))
        out[key] = value
    return out


def soil_of(name: str, entry: Any, file: str, under: str = "soils") -> Soil:
    """The soil of an entry in the form of soils.json; InputError, with the file and the place, where a value cannot be read."""
    place = f"{under}.{name}"
    model = entry.get("model") if isinstance(entry, dict) else None
    if not isinstance(model, str) or model not in CURVES:
        raise InputError(
            f"curve model {model!r} is not known",
            file=file,
            place=place,
            hint=f"choose one of {', '.join(CURVES)}",
        )
    parameters = entry.get("parameters")
    if not isinstance(parameters, dict):
        raise InputError("has no parameters", file=file, place=place)
    values = {k: _number(v, file, f"{place}.parameters.{k}") for k, v in parameters.items()}
    try:
        CURVES[model].complete({k: v for k, v in values.items() if k != "intercept"})
    except ValueError as error:
        raise InputError(str(error), file=file, place=place) from None
    interval = {}
    intervals = entry.get("interval") or {}
    if not isinstance(intervals, dict):
        raise InputError("is not a mapping", file=file, place=f"{place}.interval")
    for key, pair in intervals.items():
        where = f"{place}.interval.{key}"
        if not isinstance(pair, list) or len(pair) != 2:
            raise InputError("is not a pair of numbers", file=file, place=where)
        interval[key] = (_number(pair[0], file, where), _number(pair[1], file, where))
    bins = entry.get("bins") or []
    if not isinstance(bins, list) or not all(isinstance(b, dict) for b in bins):
        raise InputError("is not a list of bins", file=file, place=f"{place}.bins")
    for i, row in enumerate(bins):
        for key in ("slip", "mean", *row):
            _number(row.get(key), file, f"{place}.bins[{i}].{key}")
    _refuse_bad_fit(entry, values, file, place)
    resistance = entry.get("resistance")
    known = {one.name for one in fields(Soil)} | {"reach"}
    return Soil(
        name=name,
        model=model,
        parameters=values,
        interval=interval,
        r2=_optional(entry.get("r2"), file, f"{place}.r2"),
        nrmse=_optional(entry.get("nrmse"), file, f"{place}.nrmse"),
        bins=tuple(bins),
        resistance=_pair(resistance, file, f"{place}.resistance"),
        spread=_optional(entry.get("spread"), file, f"{place}.spread"),
        source=str(entry.get("source") or ""),
        fit={k: v for k, v in entry.items() if k not in known},
    )


def _refuse_bad_fit(entry: Mapping[str, Any], values: Mapping[str, float], file: str, place: str) -> None:
    """InputError if the fit beside a curve cannot be read: free parameters, settings, badge, the paper's fit by slip."""
    free = entry.get("free", [])
    if not isinstance(free, list) or not all(isinstance(name, str) and name in values for name in free):
        raise InputError("is not a list of the soil's parameters", file=file, place=f"{place}.free")
    for key in ("settings", "identifiability", "by_slip"):
        if not isinstance(entry.get(key, {}), dict | None):
            raise InputError("is not a mapping", file=file, place=f"{place}.{key}")
    for key in ("common_slip_sd", "clusters"):
        _optional(entry.get(key), file, f"{place}.{key}")
    badge, by_slip = entry.get("identifiability"), entry.get("by_slip")
    if badge:
        _number(badge.get("condition"), file, f"{place}.identifiability.condition")
        if not isinstance(badge.get("identifiable"), bool):
            raise InputError(
                "is neither true nor false", file=file, place=f"{place}.identifiability.identifiable"
            )
    for name, fit in (("band", entry), ("by_slip.band", by_slip or {})):
        _refuse_bad_band(fit.get("band"), file, f"{place}.{name}")
    if by_slip:
        parameters = by_slip.get("parameters")
        if not isinstance(parameters, dict) or not set(values) <= set(parameters):
            raise InputError("has not the soil's parameters", file=file, place=f"{place}.by_slip")
        for key, value in (*parameters.items(), ("r2", by_slip.get("r2"))):
            _number(value, file, f"{place}.by_slip.{key}")


def _refuse_bad_band(band: Any, file: str, place: str) -> None:
    """InputError unless a band is three lists of equal length, its slips in order."""
    if band is None:
        return
    columns: list[Any] = (
        [band.get(name) for name in ("slip", "low", "high")] if isinstance(band, dict) else []
    )
    if not columns or not all(isinstance(one, list) and len(one) == len(columns[0]) > 1 for one in columns):
        raise InputError("is not lists slip, low and high of one length", file=file, place=place)
    for column in columns:
        for value in column:
            _number(value, file, place)
    if sorted(set(columns[0])) != columns[0]:
        raise InputError("its slips are not in order", file=file, place=place)


def _pair(value: Any, file: str, place: str) -> tuple[float, float] | None:
    if value is None:
        return None
    if not isinstance(value, dict):
        raise InputError("is not {mean, std}", file=file, place=place)
    return _number(value.get("mean"), file, f"{place}.mean"), _number(value.get("std"), file, f"{place}.std")


def _optional(value: Any, file: str, place: str) -> float | None:
    return None if value is None else _number(value, file, place)


def _number(value: Any, file: str, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{value!r} is not a number", file=file, place=place, hint="write a finite number")
    return float(value)

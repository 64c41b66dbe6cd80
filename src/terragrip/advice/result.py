"""Advice as records and as advice.json (architecture.md, contracts)."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from terragrip.advice.optimum import Best
from terragrip.errors import InputError
from terragrip.files import replacing

VERSION = 1


@dataclass(frozen=True)
class Action:
    """One action: ``what`` and ``why`` in words; ``gain``: efficiency gained with its 95 % ``interval``, None for a direction."""

    what: str
    why: str
    gain: float | None = None
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Advice:
    """Advice on one soil. ``drive``: the drive in numbers by name, SI; ``reserve``: of each driven wheel, the mean share of the
    ground's grip that is unused, with its interval; ``field``: ha/h and l/ha now and at best, where known; ``missing``: unknown
    quantities and the drive that would determine each; ``curve``: efficiency and net traction over slip with their 95 % bands,
    where slip is advised."""

    soil: str
    best_efficiency: Best | None = None
    best_productivity: Best | None = None
    front: tuple[Mapping[str, float], ...] = ()
    actions: tuple[Action, ...] = ()
    missing: tuple[str, ...] = ()
    drive: Mapping[str, float] = field(default_factory=dict)
    reserve: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    field_work: Mapping[str, float] = field(default_factory=dict)
    limits: tuple[str, ...] = ()
    curve: tuple[Mapping[str, float], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """One soil of advice.json."""
        return {
            "best_efficiency": None if self.best_efficiency is None else _best(self.best_efficiency),
            "best_productivity": None if self.best_productivity is None else _best(self.best_productivity),
            "front": [dict(point) for point in self.front],
            "curve": [dict(point) for point in self.curve],
            "actions": [
                {**asdict(one), "interval": None if one.interval is None else list(one.interval)}
                for one in self.actions
            ],
            "missing": list(self.missing),
            "limits": list(self.limits),
            "drive": dict(self.drive),
            "grip_reserve": {w: {"mean": m, "interval": [lo, hi]} for w, (m, lo, hi) in self.reserve.items()},
            "field_work": dict(self.field_work),
        }


def _best(best: Best) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(best).items()}


def to_dict(advice: Mapping[str, Advice], way: Mapping[str, float]) -> dict[str, Any]:
    """advice.json: the advice on the soil with the longest distance; with several, its name as ``soil`` and all in ``soils``."""
    first = max(advice, key=lambda name: way.get(name, 0.0))
    whole: dict[str, Any] = {"version": VERSION, **advice[first].to_dict()}
    if len(advice) > 1:
        whole |= {"soil": first, "soils": {name: one.to_dict() for name, one in advice.items()}}
    elif first:
        whole["soil"] = first
    return _finite(whole)


def write(advice: Mapping[str, Advice], way: Mapping[str, float], path: str | os.PathLike[str]) -> None:
    """Write advice.json, whole or not at all. Raises InputError if it cannot be written."""
    text = json.dumps(to_dict(advice, way), indent=1, allow_nan=False, ensure_ascii=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def advised_slip(path: str | os.PathLike[str]) -> float:
    """The slip of best efficiency of an advice.json, on the soil with the longest distance. Raises InputError if there is none."""
    try:
        best = json.loads(Path(path).read_text(encoding="utf-8"))["best_efficiency"]
        slip = None if best is None else float(best["slip"])
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror})", file=path, hint="terragrip advise writes it"
        ) from None
    except (ValueError, TypeError, LookupError):
        raise InputError("is not an advice.json", file=path, hint="terragrip advise writes it") from None
    if slip is None:
        raise InputError(
            "advises no slip",
            file=path,
            place="best_efficiency",
            hint="its 'missing' says which drive would show it",
        )
    return slip


def _finite(value: Any) -> Any:
    """The same with null for numbers that JSON cannot represent, others to six digits."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_finite(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def words(advice: Mapping[str, Advice]) -> str:
    """The advice as lines of text."""
    lines: list[str] = []
    for name, one in advice.items():
        if len(advice) > 1:
            lines.append(f"{name}:")
        for title, best in (
            ("best efficiency", one.best_efficiency),
            ("most pull power", one.best_productivity),
        ):
            if best is not None:
                low, high = best.interval
                lines.append(
                    f"  {title}: {best.slip:.1%} slip (95 %: {low:.1%} to {high:.1%}), "
                    f"efficiency {_between(best.efficiency, best.efficiency_interval)}, "
                    f"pull {_between(best.net_traction, best.net_traction_interval)} of the weight"
                )
        lines += _shares(one.drive)
        if one.reserve:
            each = ", ".join(
                f"{w} {m:.0%} ({low:.0%} to {high:.0%})" for w, (m, low, high) in one.reserve.items()
            )
            lines.append(f"  grip in reserve: {each}")
        lines += _field(one.field_work)
        lines += [f"  held back: {sentence}" for sentence in one.limits]
        for action in one.actions:
            gain = ""
            if action.gain is not None and action.interval is not None:
                low, high = action.interval
                gain = f" Gains {100 * action.gain:.1f} points of efficiency ({100 * low:.1f} to {100 * high:.1f})."
            lines.append(f"  do: {action.what}{gain} {action.why}")
        lines += [f"  missing: {sentence}" for sentence in one.missing]
    return "\n".join(lines)


def _between(value: float, interval: tuple[float, float]) -> str:
    return f"{value:.2f} ({interval[0]:.2f} to {interval[1]:.2f})"


def _field(work: Mapping[str, float]) -> list[str]:
    """ha/h, l/h and l/ha as driven, and their values at the best slip."""
    units = {
        "hectares_per_hour": "ha/h", "litres_per_hour": "l/h", "litres_per_hectare_measured": "l/ha measured",
        "litres_per_hectare": "l/ha computed from the pull",
    }  # fmt: skip
    better = {
        "hectares_per_hour": ("hectares_per_hour_at_best", "at the best slip and this wheel speed"),
        "litres_per_hectare": ("litres_per_hectare_same_pull_at_best", "at the best efficiency"),
    }
    said = []
    for key, unit in units.items():
        if key in work:
            other, where = better.get(key, ("", ""))
            said.append(
                f"{work[key]:.3g} {unit}" + (f" ({work[other]:.3g} {where})" if other in work else "")
            )
    return [f"  field work: {', '.join(said)}"] if said else []


def _shares(drive: Mapping[str, float]) -> list[str]:
    """Shares of driving time about the usual band, for a drive with slip alone."""
    if "share_below" not in drive:
        return []
    band = f"{drive['band_low']:.0%} to {drive['band_high']:.0%}"
    below, within, above = (share_words(drive, name) for name in ("below", "within", "above"))
    return [
        f"  slip within the usual {band} in {within} of the driving time, below in {below}, above in {above}; "
        "in parentheses the 95 % interval from the zero of slip"
    ]


def share_words(drive: Mapping[str, float], name: str) -> str:
    """A share of the driving time with its interval."""
    share, low, high = (drive[f"share_{name}{end}"] for end in ("", "_low", "_high"))
    return f"{share:.0%} ({low:.0%} to {high:.0%})"

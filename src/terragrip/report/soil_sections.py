"""Sections of the report on soil curves: both maxima and fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from terragrip.physics.adhesion import CURVES
from terragrip.report.curves import SoilCurves, draw_all_maxima, draw_both_maxima, draw_fits, maxima
from terragrip.report.page import Picture, Section, Table, names, number, percent, stem
from terragrip.soil.bins import BY_PULL, BY_SLIP, BinSettings
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import Campaign
from terragrip.soil.library import Soil
from terragrip.soil.literature import paper_soils

NOTHING: Mapping[str, str] = MappingProxyType({})
FIRST = "hard"
"""The soil that the paper shows alone; else the one with the most bins stands there."""
HINT = " Dotted: a hint only, the data do not fix the curve or give it no interval."
NO_SOILS = "Left out: no sample of these estimates carries a soil label, so there is no curve to fit."
NONE_FITTED = "Left out: no soil could be fitted."


def curves_of_all(
    campaign: Campaign,
    truth: Mapping[str, Soil] | None = None,
    true_pairs: Mapping[str, AdhesionCurve] | None = None,
    true_by_slip: Mapping[str, AdhesionCurve] | None = None,
) -> list[SoilCurves]:
    """The campaign's soils, the one to show first in front, each with what paper and simulation tell of it."""
    paper = paper_soils()
    result = [
        SoilCurves(
            name,
            learned,
            paper.get(name),
            truth.get(name) if truth is not None else None,
            true_pairs.get(name) if true_pairs is not None else None,
            true_by_slip.get(name) if true_by_slip is not None else None,
        )
        for name, learned in campaign.soils.items()
    ]
    return sorted(result, key=lambda one: (one.name != FIRST, not one.sure, -len(one.learned.soil.bins)))


def both_maxima(
    curves: Sequence[SoilCurves], tire_resistance: float, not_fitted: Mapping[str, str] = NOTHING
) -> Section:
    """mu(s) and eta(s) with both maxima: the paper's argument for knowing the curve."""
    title = "Adhesion and efficiency over slip"
    if not curves:
        return Section("maxima", title, omitted=NONE_FITTED if not_fitted else NO_SOILS)
    first = curves[0]
    truth = ", dashed: the simulated truth" if first.truth is not None else ""
    pictures: list[Picture | Table] = [
        Picture(
            f"maxima-{stem(first.name)}",
            draw_both_maxima(first, tire_resistance),
            f"Adhesion µ(s) and tractive efficiency η(s) on {first.name} by the fitted curve{truth}. Most pull and best efficiency "
            "lie at different slips: the curve shows the cost of each." + HINT * (not first.sure),
            f"Adhesion and efficiency over slip on {first.name}, both maxima marked",
        )
    ]
    if len(curves) > 1:
        pictures.append(
            Picture(
                "maxima",
                draw_all_maxima(curves, tire_resistance),
                "µ(s) (left) and η(s) (right) of every soil by its fitted curve; dots and squares mark the maxima."
                + HINT * (not all(one.sure for one in curves)),
                "Adhesion and efficiency over slip of every soil",
            )
        )
    pictures.append(_maxima_table(curves, tire_resistance))
    prose = (
        "η = κ/(κ + ρ) (1 − s), with κ = µ − ρs and ρ = ρs + ρt (paper, eq. 7); ρs is the soil's mean over its samples, "
        f"ρt = {number(tire_resistance)} the tyre's.",
    )
    return Section("maxima", title, prose, tuple(pictures))


def fits(curves: Sequence[SoilCurves], not_fitted: Mapping[str, str]) -> Section:
    """Bins and fits of every soil, and the paper's table with ours and the truth beside it."""
    title = "Adhesion curves of the soils"
    missed = tuple(f"{name}: not fitted, {why}." for name, why in not_fitted.items())
    if not curves:
        return Section(
            "curves",
            title,
            omitted=NO_SOILS if not missed else NONE_FITTED,
            prose=missed,
        )
    first, rest = curves[0], curves[1:]
    text = _sources(curves)
    alike = [
        one
        for one in curves
        if one.truth and one.paper and one.truth.parameters.get("a") == one.paper.parameters["a"]
    ]
    if len(alike) == len(curves):
        text += "; the simulated soils were made with the paper's a, so that both lie on one line"
    how = _preparation(curves) + HINT * (not all(one.sure for one in curves))
    content: list[Picture | Table] = [
        Picture(
            f"fit-{stem(first.name)}",
            draw_fits([first], 1),
            f"Adhesion over slip on {first.name}: {text}. {how}",
            f"Bins and fitted curve on {first.name}",
        )
    ]
    if rest:
        content.append(
            Picture(
                "fits",
                draw_fits(rest),
                f"The same on {names([one.name for one in rest])}: {text}."
                + (
                    " On grass slips above 40 % are too few and left out, as in the paper."
                    if any(c.name == "grass" for c in rest)
                    else ""
                ),
                "Bins and fitted curves of the other soils",
            )
        )
    content += [_quality_table(curves), _scale_table(curves)]
    return Section("curves", title, missed, tuple(content))


def _preparation(curves: Sequence[SoilCurves]) -> str:
    """How samples became bins."""
    kinds = [one.learned.curve.bins_.settings for one in curves]
    kinds += [one.by_slip.bins_.settings for one in curves if one.by_slip is not None]
    by_pull, by_slip = (next((one for one in kinds if one.by == by), None) for by in (BY_PULL, BY_SLIP))
    sentence = "Samples on a transition or under an event are left out."
    if by_pull is not None:
        sentence += (
            f" By pull, in bins of {_range(by_pull)}: each sample goes into the bin whose slip the mean curve gives for the pull, "
            f"so that a bin holds weak and strong ground alike; bins of less than {by_pull.metres:g} m or {by_pull.runs} runs are joined. "
            "Slips beyond them are met where the ground gives way, not by a steady pull: there the curve is the prototype's shape, and the "
            "bins by slip show what was met."
        )
    if by_slip is not None:
        sentence += (
            f" By slip, the paper's way, in bins of {_range(by_slip)}: each sample by its own slip, at least {by_slip.minimum} samples "
            "a bin."
        )
    return sentence


def _range(bins: BinSettings) -> str:
    return f"{100 * bins.width:g} % slip from {100 * bins.lower:g} % to {100 * bins.upper:g} %"


def _quality_table(curves: Sequence[SoilCurves]) -> Table:
    """NRMSE and R² of the fits: the paper's, ours, ours the paper's way, and the same fit on true pairs."""
    true, both, paper = _true(curves), _both(curves), _paper(curves)
    rows = []
    for one in curves:
        row = [one.name]
        for key in ("nrmse", "r2"):
            row += [number(getattr(one.paper, key, None))] * paper + [number(getattr(one.learned.soil, key))]
            row += [number(getattr(one.by_slip, f"{key}_", None))] * both
            row += [number(getattr(one.true_pairs, f"{key}_", None))] * true
        runs = len({part.run for part in one.learned.pairs})
        rows.append((*row, str(len(one.learned.soil.bins)), str(runs) if runs else "–"))
    ours = ("ours, by pull", "ours, by slip") if both else ("ours",)
    head = [
        f"{what}: {who}"
        for what in ("NRMSE", "R²")
        for who in (*(["paper"] * paper), *ours, *(["true pairs"] * true))
    ]
    ending = ' "True pairs": the same fit as ours on the simulation\'s own slip and adhesion.' if true else ""
    return Table(
        "Quality of the fits on bin means"
        + ", as in the paper's Table 1 (its figures come from the field, its bins are by slip)" * paper
        + f".{ending}",
        ("soil", *head, "bins", "runs"),
        tuple(rows),
    )


def _scale_table(curves: Sequence[SoilCurves]) -> Table:
    """The scale a: paper, ours with interval, ours the paper's way, both of true pairs, of the truth."""
    true, both, paper = _true(curves), _both(curves), _paper(curves)
    rows = []
    for one in curves:
        row = [
            one.name,
            *[_scale(one.paper)] * paper,
            _scale(one.learned.soil),
            _interval(one.learned.soil.interval.get("a")),
        ]
        if both:
            row += [
                _fitted_scale(one.by_slip),
                _interval(one.by_slip.interval_.get("a") if one.by_slip else None),
            ]
        if true:
            row += [
                _fitted_scale(one.true_pairs),
                *([_fitted_scale(one.true_by_slip)] * both),
                _scale(one.truth),
            ]
        rows.append(tuple(row))
    head = [
        "soil",
        *["paper"] * paper,
        *(("ours, by pull", "95 %", "ours, by slip", "95 %") if both else ("ours", "95 %")),
    ]
    if true:
        head += ["true pairs, by pull", "true pairs, by slip", "truth"] if both else ["true pairs", "truth"]
    full = float(CURVES["exponential"].value(1.0, {"a": 1.0}))
    sentence = f"The scale a of the prototype curve (µ at full slip is {full:.3f} a)."
    if both:
        sentence += (
            " By pull: bins of the vehicle's pull, each a fair sample of the ground. By slip: the paper's bins; "
            "those of high slip gather the weak spots."
        )
    if true:
        sentence += " The truth is what the soil was made with, the mean over its ground; true pairs show what the sorting alone does."
    return Table(sentence, tuple(head), tuple(rows))


def _true(curves: Sequence[SoilCurves]) -> bool:
    return any(one.true_pairs is not None for one in curves)


def _paper(curves: Sequence[SoilCurves]) -> bool:
    """Whether any soil is one of the paper's: a machine elsewhere has no use for its columns."""
    return any(one.paper is not None for one in curves)


def _both(curves: Sequence[SoilCurves]) -> bool:
    """Whether the paper's fit stands beside another."""
    return any(one.by_slip is not None for one in curves)


def _fitted_scale(curve: AdhesionCurve | None) -> str:
    return number(curve.parameters_.get("a") if curve is not None else None)


def _maxima_table(curves: Sequence[SoilCurves], tire_resistance: float) -> Table:
    true = any(one.truth is not None for one in curves)
    rows = []
    for one in curves:
        row = [one.name]
        for soil in (one.learned.soil, *([one.truth] if true else [])):
            if soil is None:
                row += ["–"] * 2
                continue
            peaks = maxima(soil, tire_resistance)
            row += [
                f"{number(height, 2)} at {percent(at, 0)}"
                + ", a hint" * (soil is not one.truth and not one.sure)
                + ", beyond the data" * (soil is not one.truth and one.sure and at > one.reach)
                if at == at
                else "–"
                for at, height in (peaks.adhesion, peaks.efficiency)
            ]
        resistance = one.learned.soil.resistance
        rows.append((*row, number(resistance[0] if resistance else None)))
    return Table(
        "The largest adhesion and the largest tractive efficiency of each soil, and the slips where they lie. Beyond the data a curve "
        "rests on its form alone.",
        (
            "soil",
            "largest µ",
            "largest η",
            *(("true largest µ", "true largest η") if true else ()),
            "mean ρs",
        ),
        tuple(rows),
    )


def _sources(curves: Sequence[SoilCurves]) -> str:
    both = _both(curves)
    notes = ["mean and SD of each bin" + " by pull and by slip" * both]
    notes += [
        "the fit" + " to those by pull" * both + " with its 95 % interval, pale and dotted beyond the data"
    ] + ["the paper's fit by slip"] * both
    for field, what in (
        ("paper", "the paper's curve"),
        ("truth", "the simulated truth"),
    ):
        notes += [what] * any(getattr(one, field) is not None for one in curves)
    return names(notes)


def _scale(soil: Soil | None) -> str:
    return number(soil.parameters.get("a") if soil is not None else None)


def _interval(pair: tuple[float, float] | None) -> str:
    return "–" if pair is None else f"{number(pair[0])} to {number(pair[1])}"

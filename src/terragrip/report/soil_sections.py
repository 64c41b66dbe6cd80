"""Sections of the report on soil curves: both maxima, fits, how far to trust them, what to drive next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from terragrip.physics.adhesion import CURVES
from terragrip.report.curves import SoilCurves, draw_all_maxima, draw_both_maxima, draw_fits, maxima
from terragrip.report.page import Picture, Section, Table, names, number, percent
from terragrip.soil.bins import BY_PULL
from terragrip.soil.fit import FREE, AdhesionCurve
from terragrip.soil.identifiability import Identifiability
from terragrip.soil.learn import APART, Campaign, scales_apart
from terragrip.soil.library import Soil
from terragrip.soil.literature import paper_soils
from terragrip.soil.missing import in_words

NOTHING: Mapping[str, str] = MappingProxyType({})
FIRST = "hard"
"""The soil that the paper shows alone; else the one with the most bins stands there."""
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
    return sorted(result, key=lambda one: (one.name != FIRST, -len(one.learned.soil.bins)))


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
            f"maxima-{_stem(first.name)}",
            draw_both_maxima(first, tire_resistance),
            f"Adhesion µ(s) and tractive efficiency η(s) on {first.name} by the fitted curve{truth}. Most pull and best efficiency "
            "lie at different slips: the curve says what each costs.",
            f"Adhesion and efficiency over slip on {first.name}, both maxima marked",
        )
    ]
    if len(curves) > 1:
        pictures.append(
            Picture(
                "maxima",
                draw_all_maxima(curves, tire_resistance),
                "µ(s) (left) and η(s) (right) of every soil by its fitted curve; dots and squares mark the maxima.",
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
    text = _voices(curves)
    alike = [
        one
        for one in curves
        if one.truth and one.paper and one.truth.parameters.get("a") == one.paper.parameters["a"]
    ]
    if len(alike) == len(curves):
        text += "; the simulated soils were made with the paper's a, so that both lie on one line"
    how = _preparation(curves)
    content: list[Picture | Table] = [
        Picture(
            f"fit-{_stem(first.name)}",
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


def trust(curves: Sequence[SoilCurves], not_fitted: Mapping[str, str] = NOTHING) -> Section:
    """What the data fix and what not, whether the form follows them, what slip noise and varying ground do."""
    title = "How far the curves can be trusted"
    if not curves:
        return Section("trust", title, omitted=NONE_FITTED if not_fitted else NO_SOILS)
    rows = tuple(_trust_row(one) for one in curves)
    table = Table(
        "Each fit's badge: do the data fix what was fitted (condition number; beyond 10 000 they do not), does its form follow them "
        "(whole runs left out), how noisy the slip estimate is (median SD), and the fitted parameters as that "
        "noise leaves them and freed of it (by pull the freed count).",
        ("soil", "data fix the fit", "form follows", "slip SD", "parameter, with slip noise → freed"),
        rows,
    )
    words = [f"{one.name}: {note}" for one in curves for note in one.learned.curve.notes_]
    apart = [one.name for one in curves if scales_apart(one.learned)]
    if apart:
        words.append(
            f"On {names(apart)} the scale by pull and the paper's by slip differ by over {percent(APART, 0)}: bins of slip gather "
            "weak spots and the noise of slip."
        )
    words += [
        f"{one.name}: {one.learned.verdict.sentence}"
        for one in curves
        if one.learned.verdict is not None and not one.learned.verdict.follows
    ]
    return Section("trust", title, (_free_shape(curves[0]), *words), (table, *_ranking(curves)))


def what_is_missing(curves: Sequence[SoilCurves], not_fitted: Mapping[str, str] = NOTHING) -> Section:
    """Which slips lack data, and which pull and speed fill them."""
    title = "What to drive next"
    if not curves:
        return Section("missing", title, omitted=NONE_FITTED if not_fitted else NO_SOILS)
    if not any(one.learned.pairs for one in curves):
        return Section(
            "missing",
            title,
            omitted="Left out: the curves are the library's; 'terragrip soils' says what to drive next.",
        )
    rows = tuple(
        (
            one.name,
            f"{percent(gap.slip[0], 0)} to {percent(gap.slip[1], 0)}",
            f"{number(max(gap.pull[0], 0), 0)} to {number(max(gap.pull[1], 0), 0)} N",
            f"{number(gap.speed, 1)} m/s",
            f"{number(max(gap.seconds, 1), 0)} s",
            "yes" if gap.reachable else "no: the curve falls there",
        )
        for one in curves
        for gap in one.learned.gaps
    )
    if not rows:
        return Section("missing", title, (_nothing_missing(curves),))
    words = tuple(
        sentence for one in curves if one.learned.gaps for sentence in in_words(one.name, one.learned.gaps)
    )
    table = Table(
        "Slips without enough samples, and the drawbar pull at which the soil's own curve puts the vehicle there on level ground.",
        ("soil", "slips without data", "drawbar pull", "wheel speed", "at least", "a steady pull holds it"),
        rows,
    )
    return Section("missing", title, words, (table,))


def _nothing_missing(curves: Sequence[SoilCurves]) -> str:
    """What full bins say, and what they do not: a count of samples, not how well a curve explains them."""
    sentence = "Every slip bin of every soil holds enough samples."
    poor = [
        f"{one.name} (R² {number(one.learned.soil.r2, 2)})"
        for one in curves
        if not one.learned.curve.identifiability_.identifiable
    ]
    if poor:
        sentence += f" Yet the data do not fix the curve of {names(poor)}: more of the same does not help there, see What to trust."
    return sentence


def _preparation(curves: Sequence[SoilCurves]) -> str:
    """How samples became bins."""
    settings = curves[0].learned.curve.bins_.settings
    sentence = (
        f"Bins of {percent(settings.width, 0)} slip from {percent(settings.lower, 0)} to {percent(settings.upper, 0)}; "
        "samples on a transition or under an event are left out."
    )
    if any(one.learned.curve.bins_.settings.by == BY_PULL for one in curves):
        sentence += (
            " By pull: each sample goes into the bin whose slip the mean curve gives for the vehicle's pull, so that a bin holds weak and "
            f"strong ground alike; bins of less than {settings.metres:g} m or {settings.runs} runs are joined. Slips "
            "beyond them are met where the ground gives way, not by a steady pull: there the curve is the prototype's shape, and the bins "
            "by slip show what was met."
        )
    return f"{sentence} By slip, the paper's way: each sample by its own slip, at least {settings.minimum} samples a bin."


def _quality_table(curves: Sequence[SoilCurves]) -> Table:
    """NRMSE and R² of the fits: the paper's, ours, ours the paper's way, and the same fit on true pairs."""
    true, both = _true(curves), _both(curves)
    rows = []
    for one in curves:
        row = [one.name]
        for key in ("nrmse", "r2"):
            row += [number(getattr(one.paper, key, None)), number(getattr(one.learned.soil, key))]
            row += [number(getattr(one.by_slip, f"{key}_", None))] * both
            row += [number(getattr(one.true_pairs, f"{key}_", None))] * true
        runs = len({part.run for part in one.learned.pairs})
        rows.append((*row, str(len(one.learned.soil.bins)), str(runs) if runs else "–"))
    ours = ("ours, by pull", "ours, by slip") if both else ("ours",)
    head = [
        f"{what}: {who}" for what in ("NRMSE", "R²") for who in ("paper", *ours, *(["true pairs"] * true))
    ]
    ending = ' "True pairs": the same fit as ours on the simulation\'s own slip and adhesion.' if true else ""
    return Table(
        "Quality of the fits on bin means, as in the paper's Table 1 (its figures come from the field, its bins are by slip)."
        + ending,
        ("soil", *head, "bins", "runs"),
        tuple(rows),
    )


def _scale_table(curves: Sequence[SoilCurves]) -> Table:
    """The scale a: paper, ours with interval, ours the paper's way, both of true pairs, of the truth."""
    true, both = _true(curves), _both(curves)
    rows = []
    for one in curves:
        row = [
            one.name,
            _scale(one.paper),
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
        "paper",
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
                f"{number(height, 2)} at {percent(at, 0)}" if at == at else "–"
                for at, height in (peaks.adhesion, peaks.efficiency)
            ]
        resistance = one.learned.soil.resistance
        rows.append((*row, number(resistance[0] if resistance else None)))
    return Table(
        "The largest adhesion and the largest tractive efficiency of each soil, and the slips where they lie.",
        (
            "soil",
            "largest µ",
            "largest η",
            *(("true largest µ", "true largest η") if true else ()),
            "mean ρs",
        ),
        tuple(rows),
    )


def _trust_row(one: SoilCurves) -> tuple[str, ...]:
    badge, noise, verdict = one.learned.curve.identifiability_, one.learned.slip_noise, one.learned.verdict
    corrected = "–"
    if noise is not None:
        corrected = ", ".join(
            f"{name} {number(noise.plain[name])} → {number(noise.corrected[name])}" for name in noise.plain
        ) + (" (matters)" if noise.matters else "")
    return (
        one.name,
        _badge(badge, one.learned.soil.r2),
        "–" if verdict is None else "yes" if verdict.follows else f"no: take {verdict.proposal}",
        number(noise.slip_std if noise else None),
        corrected,
    )


def _badge(badge: Identifiability, r2: float | None) -> str:
    """Whether the data fix the fit, with what says so: the condition number, or R2 where the curve explains too little."""
    if badge.condition != badge.condition:  # a curve that was not fitted
        return "–"
    if badge.separable and not badge.identifiable:
        return f"no (R² {number(r2, 2)})"
    return f"{'yes' if badge.identifiable else 'no'} ({badge.condition:.3g})"


def _ranking(curves: Sequence[SoilCurves]) -> list[Table]:
    """Errors of every form of curve on runs left out, by soil; no table where no soil has enough bins to compare."""
    rankings = {one.name: one.learned.verdict.ranking for one in curves if one.learned.verdict is not None}
    forms = sorted({score.form for ranking in rankings.values() for score in ranking})
    rows = []
    for name, ranking in rankings.items():
        errors = {score.form: number(score.error, 4) for score in ranking}
        rows.append((name, ranking[0].form, *(errors.get(form, "–") for form in forms)))
    caption = "Root-mean-square error of each form of curve on the bin means of runs left out of its fit; the smallest is the best."
    return [Table(caption, ("soil", "best form", *forms), tuple(rows))] if rows else []


def _free_shape(one: SoilCurves) -> str:
    """What a fit of all four parameters could tell of this soil: the badge's own sentence."""
    from terragrip.errors import InputError

    try:
        free = AdhesionCurve("exponential", FREE, bootstrap=0).fit_bins(one.learned.curve.bins_)
    except InputError:
        return (
            "The fits hold the prototype's shape and fit its scale: there are too few bins to ask for more."
        )
    badge = free.identifiability_
    effective = badge.effective or {}
    fixed = ", ".join(f"{name} = {number(value)}" for name, value in effective.items())
    return (
        f"The fits hold the prototype's shape and fit its scale. Were all four parameters free on {one.name}: {badge.sentence} "
        f"What stays fixed: {fixed} in µ ≈ A (1 − e^(−k s)) − d s."
    )


def _voices(curves: Sequence[SoilCurves]) -> str:
    both = _both(curves)
    notes = ["mean and SD of each bin" + " by pull and by slip" * both]
    notes += ["the fit" + " to those by pull" * both + " with its 95 % interval"] + [
        "the paper's fit by slip"
    ] * both
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


def _stem(name: str) -> str:
    """A soil's name as a part of a file name and an id."""
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)

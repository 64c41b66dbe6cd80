"""Sections of the report on how far the soil curves can be trusted, and what to drive next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from terragrip.report.curves import SoilCurves
from terragrip.report.page import Section, Table, names, number, percent
from terragrip.report.soil_sections import NO_SOILS, NONE_FITTED, NOTHING
from terragrip.soil.fit import FREE, AdhesionCurve
from terragrip.soil.learn import APART, scales_apart
from terragrip.soil.missing import in_words


def trust(curves: Sequence[SoilCurves], not_fitted: Mapping[str, str] = NOTHING) -> Section:
    """What the data determine and what they do not, whether the form of the curve fits them, what slip noise and varying ground do."""
    title = "How far the curves can be trusted"
    if not curves:
        return Section("trust", title, omitted=NONE_FITTED if not_fitted else NO_SOILS)
    rows = tuple(_trust_row(one) for one in curves)
    table = Table(
        "Each fit's badge: do the data determine the fitted parameters (condition number below 10 000), does its form follow them "
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
            omitted="Left out: the curves are the library's; 'terragrip soils' shows what to drive next.",
        )
    rows = tuple(
        (
            one.name,
            f"{percent(gap.slip[0], 0)} to {percent(gap.slip[1], 0)}",
            f"{' to '.join(dict.fromkeys(number(max(pull, 0), 0) for pull in gap.pull))} N",
            f"{number(gap.speed, 1)} m/s",
            f"{number(max(gap.seconds, 1), 0)} s",
            "yes" if gap.reachable else "no: the curve is flat or falls there",
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
    """What full bins mean, and what they do not: a count of samples, not how well a curve explains them."""
    sentence = "Every slip bin of every soil has enough samples."
    poor = [
        f"{one.name} (R² {number(one.learned.soil.r2, 2)})"
        for one in curves
        if not one.learned.curve.identifiability_.identifiable
    ]
    if poor:
        sentence += f" Yet the data do not fix the curve of {names(poor)}: more of the same does not help there, see What to trust."
    return sentence


def _trust_row(one: SoilCurves) -> tuple[str, ...]:
    badge, noise, verdict = one.learned.curve.identifiability_, one.learned.slip_noise, one.learned.verdict
    corrected = "–"
    if noise is not None:
        corrected = ", ".join(
            f"{name} {number(noise.plain[name])} → {number(noise.corrected[name])}" for name in noise.plain
        ) + (" (matters)" if noise.matters else "")
    return (
        one.name,
        badge.short(one.learned.soil.r2),
        "–" if verdict is None else "yes" if verdict.follows else f"no: use {verdict.proposal}",
        number(noise.slip_std if noise else None),
        corrected,
    )


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
        return "The fits hold the prototype's shape and fit its scale: there are too few bins for more."
    badge = free.identifiability_
    effective = badge.effective or {}
    fixed = ", ".join(f"{name} = {number(value)}" for name, value in effective.items())
    return (
        f"The fits hold the prototype's shape and fit its scale. Were all four parameters free on {one.name}: {badge.sentence} "
        f"What stays fixed: {fixed} in µ ≈ A (1 − e^(−k s)) − d s."
    )

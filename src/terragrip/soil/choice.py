"""Which form can follow the data: cross-validation over runs, and a verdict on the requested form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BY_PULL, Bins
from terragrip.soil.least_squares import INTERCEPT, solve, starts

FORMS: Mapping[str, tuple[str, bool]] = {
    "exponential": ("exponential", False),
    "effective": ("effective", False),
    "pacejka": ("pacejka", False),
    "exponential with intercept": ("exponential", True),
    "effective with intercept": ("effective", True),
}
"""The candidates by label: (model, with intercept). Burckhardt's form is the effective one; Schreiber-Kutzbach's the last."""

MARGIN = 0.25
"""A form is called unfit where another's cross-validated error is lower by this share, beyond the folds' spread."""


LEAST_BINS = 4
"""Fewest used bins that a comparison makes sense of: the one-parameter forms and those with an intercept."""


@dataclass(frozen=True)
class FormScore:
    """Cross-validated root-mean-square error of bin means [-], its standard error over folds, and the parameters it fits."""

    form: str
    error: float
    standard_error: float
    parameters: int


@dataclass(frozen=True)
class FormVerdict:
    """Ranking of forms, best first; `follows`: the requested form can follow the data; `proposal`: a better form, or None."""

    asked: str
    ranking: tuple[FormScore, ...]
    follows: bool
    proposal: str | None
    sentence: str


def compare_forms(
    bins: Bins, asked: str = "exponential", folds: int = 5, candidates: Sequence[str] | None = None
) -> FormVerdict:
    """Leave whole clusters (runs) out in turn, fit each form on the rest, judge it on the bin means of those left out.

    With fewer than 2 clusters the folds are alternate bins instead, and the sentence reports it. A form is a candidate where the used bins
    exceed its parameters by two or more: a fold that loses a bin must still leave one more than the form can fit exactly. The sentence
    names the forms left out. Raises InputError on an unknown form, with fewer than LEAST_BINS used bins, or too few for the requested form.
    """
    names = tuple(candidates or FORMS)
    if asked not in FORMS:
        raise InputError(f"no curve form {asked!r}", hint=f"choose one of {', '.join(FORMS)}")
    if asked not in names:
        names = (asked, *names)
    levels = int(np.count_nonzero(bins.used))
    compared = [name for name in names if len(_parameters(name)[1]) <= levels - 2]
    if levels < LEAST_BINS or asked not in compared:
        raise InputError(f"{levels} slip bins are too few to compare forms", hint="drive at more slips")
    splits = list(_run_folds(bins, folds) or _bin_folds(bins, folds))
    by_run = bins.clusters >= 2
    scores = sorted(
        (_score(name, splits) for name in compared), key=lambda score: (score.error, score.parameters)
    )
    mine = next(score for score in scores if score.form == asked)
    best = scores[0]
    spread = np.hypot(mine.standard_error, best.standard_error)
    follows = mine.error <= max((1 + MARGIN) * best.error, best.error + spread)
    way = "leaving runs out" if by_run else "leaving bins out (one run only)"
    if follows:
        sentence = f"The {asked} form follows the data ({way}: error {mine.error:.3g}, the best form {best.form} {best.error:.3g})."
    else:
        sentence = (
            f"The {asked} form cannot follow these data: {way}, its error is {mine.error:.3g} against {best.error:.3g} "
            f"of the {best.form} form: {_how(best.form)}."
        )
    if len(compared) < len(names):
        sentence += f" {levels} slip bins cannot distinguish forms of more than {levels - 2} parameters."
    return FormVerdict(asked, tuple(scores), follows, None if follows else best.form, sentence)


def _how(form: str) -> str:
    model, intercept = FORMS[form]
    return f"use --model {model}" if not intercept else f"in Python AdhesionCurve('{model}', intercept=True)"


Split = tuple[Floats, Floats, Floats, Floats, Floats, Floats]


def _run_folds(bins: Bins, folds: int) -> list[Split]:
    """(slip, mean, weight) of the training and the test bins, by folds of clusters."""
    alive = np.flatnonzero(bins.cluster_count.sum(axis=1) > 0)
    if alive.size < 2:
        return []
    fold = np.arange(alive.size) % min(folds, alive.size)
    return [_split(bins, alive[fold != k], alive[fold == k]) for k in range(int(fold.max()) + 1)]


def _split(bins: Bins, train: NDArray[np.int64], test: NDArray[np.int64]) -> Split:
    parts: list[Floats] = []
    least, by_pull = bins.settings.least, bins.settings.by == BY_PULL
    # by pull a bin is as wide as its minimum requires: a fold keeps less than that of it
    for rows, needed in (
        (train, least / 2 if by_pull else least),
        (test, least / 10 if by_pull else least / 2),
    ):
        times = np.zeros((1, len(bins.cluster_count)))
        times[0, rows] = 1.0
        slip, mean, enough = bins.drawn(times, needed)
        parts += [slip[0], mean[0], enough[0].astype(float)]
    return tuple(parts)  # type: ignore[return-value]


def _bin_folds(bins: Bins, folds: int) -> list[Split]:
    used = np.flatnonzero(bins.used)
    fold = np.arange(used.size) % folds
    out: list[Split] = []
    for k in range(folds):
        train, test = np.zeros(len(bins.used)), np.zeros(len(bins.used))
        train[used[fold != k]], test[used[fold == k]] = 1.0, 1.0
        slip, mean = np.where(bins.used, bins.slip, 0.1), np.where(bins.used, bins.mean, 0.0)
        out.append((slip, mean, train, slip, mean, test))
    return out


def _parameters(form: str) -> tuple[dict[str, float], list[str]]:
    """(held, free): the values of a form's fixed parameters, and the names of the fitted ones."""
    name, intercept = FORMS[form]
    model = CURVES[name]
    held = {p.name: p.start for p in model.parameters if p.name in model.fixed}
    return held, [n for n in model.names if n not in held] + ([INTERCEPT] if intercept else [])


def _score(form: str, splits: Sequence[Split]) -> FormScore:
    """Cross-validated error of a form: the starts of all folds are solved at once."""
    model = CURVES[FORMS[form][0]]
    held, free = _parameters(form)
    kept = [fold for fold in splits if np.count_nonzero(fold[2]) >= len(free) and fold[5].any()]
    if not kept:
        raise InputError("the runs are too unlike to compare forms on one left out", hint="drive more runs")
    begin = [starts(model, free, np.where(weight > 0, mean, np.nan)) for _, mean, weight, *_ in kept]
    slip, mean, weight = (
        np.concatenate([np.tile(fold[k], (len(b), 1)) for fold, b in zip(kept, begin, strict=True)])
        for k in range(3)
    )
    x, cost = solve(model, free, held, slip, mean, weight, np.concatenate(begin))
    x, cost = x.reshape(len(kept), -1, len(free)), cost.reshape(len(kept), -1)
    best = x[np.arange(len(kept)), np.argmin(cost, axis=1)]
    errors = []
    for fitted, (*_, test_slip, test_mean, test_weight) in zip(best, kept, strict=True):
        result = {**held, **dict(zip(free, fitted, strict=True))}
        drop = result.pop(INTERCEPT, 0.0)
        off = (model.value(test_slip, result, drop) - test_mean)[test_weight > 0]
        errors.append(float(np.sqrt(np.mean(off**2))))
    error = float(np.mean(errors))
    return FormScore(form, error, float(np.std(errors) / np.sqrt(len(errors))), len(free))

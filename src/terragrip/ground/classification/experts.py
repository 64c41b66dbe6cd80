"""Which sets of sensors a classifier can judge from: an expert for each, trained on the windows that hold them."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats, Ints
from terragrip.errors import InputError
from terragrip.ground.classification.channels import BODY
from terragrip.ground.classification.expert import Examples, Expert, train
from terragrip.ground.classification.features import (
    GROUND,
    SPEED,
    TORQUE,
    families_needed,
    of_one_wheel,
)
from terragrip.ground.classification.roles import roles_of
from terragrip.ground.classification.standardization import centre_of, scale_about
from terragrip.ground.classification.training_set import TrainingSet, measured_families

FEWEST_WINDOWS = 10  # a class

_NEARLY_ALL = 0.9  # share of a class's windows
_BODY = frozenset(BODY)
_STAND_IN_FOLDS = 3
_MANY = 600  # windows a class, of which one family alone is learnt from every third


def train_experts(
    training: TrainingSet, classes: npt.NDArray[np.generic], seed: int
) -> tuple[list[Expert], list[str]]:
    """An expert for each set of sensors in which every class has windows enough, the most features first; and notes.

    Raises InputError if there is no such set.
    """
    measured = measured_families(training.names, training.features)
    sets = _sensor_sets(training, measured)
    result = _trained(training, training.folds, sets, measured, seed)
    within = training.by_recording and not result  # too little is left of a ground with a recording held out
    if within:
        result = _trained(training, training.parts, sets, measured, seed)
    if not result:
        raise _nothing_to_learn(training, classes, measured)
    notes = []
    if within or not training.by_recording:
        one = "one recording that is long enough" if within else "one recording"
        notes.append(
            f"A ground has only {one}: probabilities are learned within runs, and too high on new ones."
        )
    unused = frozenset(measured).difference(*(expert.families for expert in result))
    if unused:
        notes.append(f"Not measured on every ground, so not used: {', '.join(sorted(unused))}.")
    lost = {n for e in result for n in _candidates(training.names, e.families)}.difference(
        *(e.features for e in result)
    )
    if lost:
        of = ", ".join(sorted(frozenset[str]().union(*map(families_needed, lost))))
        notes.append(f"Not measured on every ground, so not used: {len(lost)} features of {of}.")
    return sorted(result, key=lambda e: (-len(e.features), sorted(e.families))), notes


def _trained(
    training: TrainingSet,
    folds: Ints,
    sets: Sequence[frozenset[str]],
    measured: dict[str, Bools],
    seed: int,
) -> list[Expert]:
    """The experts that hold out the windows of one of ``folds`` (n,) at a time."""
    result: list[Expert] = []
    classes = int(training.codes.max()) + 1
    for families in sets:
        rows = np.flatnonzero(np.all([measured[f] for f in families], axis=0))
        if result:  # stand-ins for the first are kept cheap
            folds = folds % _STAND_IN_FOLDS
            if len(families) == 1 and len(rows) > _MANY * classes:
                rows = rows[::3]
        codes = training.codes[rows]
        if not _can_be_held_out(codes, folds[rows], classes):
            continue
        fitting = _candidates(training.names, families)
        features = training.features[rows][:, [training.names.index(name) for name in fitting]]
        shared = _on_every_ground(features, codes)
        names, features = tuple(n for n, ok in zip(fitting, shared, strict=True) if ok), features[:, shared]
        judged = features[:, roles_of(names).machine]
        if not np.isfinite(scale_about(centre_of(judged), judged)).any():
            continue  # none differs from window to window
        _, renumbered = np.unique(folds[rows], return_inverse=True)
        windows = Examples(features, codes, training.groups[rows], training.starts[rows], renumbered)
        result.append(train(families, names, windows, threads=min(4, os.cpu_count() or 1), seed=seed))
    return result


def _candidates(names: Sequence[str], families: frozenset[str]) -> list[str]:
    """The features of a set of sensors; of wheels' speeds and efforts alone also those of single wheels."""
    single = {SPEED, TORQUE} <= families and not families & _BODY
    return [n for n in names if families_needed(n) <= families and (single or not of_one_wheel(n))]


def _on_every_ground(features: Floats, codes: Ints) -> Bools:
    """Which ``features`` (n, features) are measured in nearly all windows of every class.

    One that some ground lacks would mark that ground by its absence.
    """
    there = np.isfinite(features)
    shares = [there[codes == code].mean(axis=0) for code in np.unique(codes)]
    return np.asarray(np.min(shares, axis=0) >= _NEARLY_ALL)


def _nothing_to_learn(
    training: TrainingSet, classes: npt.NDArray[np.generic], measured: dict[str, Bools]
) -> InputError:
    """Why there is no expert."""
    windows = {f: np.bincount(training.codes[rows], minlength=len(classes)) for f, rows in measured.items()}
    best = max(windows, key=lambda family: int(windows[family].min()))
    rarest = int(windows[best].argmin())
    fewest = int(windows[best][rarest])
    if not fewest and np.bincount(training.codes)[rarest] >= FEWEST_WINDOWS:
        problem = "there is no sensor that was measured through whole windows on every ground"
        hint = f"give recordings with the same channels, longer than a window ({classes[rarest]!s} has none with {best})"
    elif fewest < FEWEST_WINDOWS:
        problem = f"there is no sensor with {FEWEST_WINDOWS} windows of every ground"
        hint = f"give more or longer recordings ({classes[rarest]!s} has {fewest} windows)"
    else:
        problem, hint = (
            "nothing measured differs from window to window",
            "give recordings of a vehicle that drives",
        )
    return InputError(problem, place="recordings", hint=hint)


def _sensor_sets(training: TrainingSet, measured: dict[str, Bools]) -> list[frozenset[str]]:
    """Sets of sensors that a recording is likely to hold: all, those of every ground, all but one kind, one alone."""
    there = frozenset(f for f, rows in measured.items() if rows.any())
    everywhere = frozenset(
        f for f in there if all(measured[f][training.codes == c].any() for c in np.unique(training.codes))
    )
    drive, body = there - _BODY, there & _BODY
    but_one = [there - {f} for f in (TORQUE, GROUND, *sorted(body))]
    sets = [
        there,
        everywhere,
        *but_one,
        drive,
        drive - {GROUND},
        body,
        *(frozenset({f}) for f in sorted(there)),
    ]
    return list(dict.fromkeys(s for s in sets if s))


def _can_be_held_out(codes: Ints, folds: Ints, classes: int) -> bool:
    """Whether every class has windows enough, also with any one fold held out."""
    there = np.unique(folds)
    if len(there) < 2 or np.bincount(codes, minlength=classes).min() < FEWEST_WINDOWS:
        return False
    return all(np.bincount(codes[folds != fold], minlength=classes).min() > 1 for fold in there)

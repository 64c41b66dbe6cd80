"""Which sets of sensors a classifier can judge from: an expert for each, trained on the windows that hold them."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.ground.classification.expert import Examples, Expert, train
from terragrip.ground.classification.features import (
    ACCELERATION,
    GROUND,
    SPEED,
    TORQUE,
    TURN,
    families_needed,
    of_one_wheel,
)
from terragrip.ground.classification.training_set import TrainingSet, measured_families

FEWEST_WINDOWS = 10  # a class

_BODY = frozenset({ACCELERATION, TURN})
_STAND_IN_FOLDS = 3
_MANY = 600  # windows a class, of which one family alone is learnt from every third


def train_experts(
    training: TrainingSet, classes: npt.NDArray[np.generic], seed: int
) -> tuple[list[Expert], list[str]]:
    """An expert for each set of sensors in which every class has windows enough, the most features first; and notes.

    Raises InputError if there is no such set.
    """
    measured = measured_families(training.names, training.features)
    found: list[Expert] = []
    for families in _sensor_sets(training, measured):
        columns = _columns(training.names, families)
        names = tuple(training.names[k] for k in columns)
        rows = np.flatnonzero(np.all([measured[f] for f in families], axis=0))
        folds = training.folds
        if found:  # stand-ins for the first are kept cheap
            folds = folds % _STAND_IN_FOLDS
            if len(families) == 1 and len(rows) > _MANY * len(classes):
                rows = rows[::3]
        if _can_be_held_out(training.codes[rows], folds[rows], len(classes)):
            _, renumbered = np.unique(folds[rows], return_inverse=True)
            windows = Examples(
                training.features[rows][:, columns],
                training.codes[rows],
                training.groups[rows],
                training.starts[rows],
                renumbered,
            )
            found.append(train(families, names, windows, threads=min(4, os.cpu_count() or 1), seed=seed))
    if not found:
        counts = np.bincount(training.codes, minlength=len(classes))
        rarest = int(counts.argmin())
        problem = f"there is no sensor with {FEWEST_WINDOWS} windows of every ground"
        mend = f"give more or longer recordings ({classes[rarest]!s} has {counts[rarest]} windows)"
        raise InputError(problem, place="recordings", mend=mend)
    unused = frozenset(measured).difference(*(expert.families for expert in found))
    notes = [f"Not measured on every ground, so not used: {', '.join(sorted(unused))}."] if unused else []
    return sorted(found, key=lambda e: (-len(e.features), sorted(e.families))), notes


def _columns(names: Sequence[str], families: frozenset[str]) -> list[int]:
    """The features of a set of sensors; of wheels' speeds and efforts alone also those of single wheels."""
    fits = [k for k, name in enumerate(names) if families_needed(name) <= families]
    single = {SPEED, TORQUE} <= families and not families & _BODY
    return [k for k in fits if single or not of_one_wheel(names[k])]


def _sensor_sets(training: TrainingSet, measured: dict[str, npt.NDArray[np.bool_]]) -> list[frozenset[str]]:
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


def _can_be_held_out(codes: npt.NDArray[np.intp], folds: npt.NDArray[np.intp], classes: int) -> bool:
    """Whether every class has windows enough, also with any one fold held out."""
    there = np.unique(folds)
    if len(there) < 2 or np.bincount(codes, minlength=classes).min() < FEWEST_WINDOWS:
        return False
    return all(np.bincount(codes[folds != fold], minlength=classes).min() > 1 for fold in there)

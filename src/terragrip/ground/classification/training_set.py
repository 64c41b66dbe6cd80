"""Windows to train on: as many of each ground, cut from whole recordings, with folds that keep recordings together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.ground.classification.channels import BODY, FAMILIES, Signals, shortest_period
from terragrip.ground.classification.features import Layout, families_needed, features_of, of_one_wheel
from terragrip.ground.classification.wheel_features import Table
from terragrip.ground.classification.windows import window_starts

Codes = Ints

_FOLDS = 5
_FINEST, _COARSEST = 1 / 8, 1 / 2  # of a window: the step between training windows
_SPARE = 8  # times the windows wanted that are cut at most
_SLOWEST = 2.0  # samples a window that a family must have
PRESENT = 0.5
"""Share of a family's own features that makes it measured."""


@dataclass(frozen=True)
class TrainingSet:
    """Features (n, features) by name, with the class code, the recording and the start [s] (n,) of each window.

    ``folds`` (n,) to hold out: of whole recordings where there are two of every class (``by_recording``), else ``parts`` (n,),
    stretches of recordings.
    """

    names: tuple[str, ...]
    features: Floats
    codes: Codes
    groups: Codes
    starts: Floats
    folds: Codes
    parts: Codes
    by_recording: bool


def layout_of(signals: Sequence[Signals], window: float) -> tuple[Layout, tuple[str, ...]]:
    """Sample period and usual size of each family over all recordings, and the families too slow for the window."""
    period, size, slow = {}, {}, []
    for family in FAMILIES:
        having = [s for s in signals if s.families.get(family)]
        periods = [shortest_period(s.families[family]) for s in having]
        if not having:
            continue
        usual = float(np.median(periods))
        if window < _SLOWEST * usual:
            slow.append(family)
            continue
        period[family] = usual
        body = family in BODY
        sizes = [
            np.sqrt(
                np.mean(
                    [c.values.var() if body else (c.values**2).mean() for c in s.families[family].values()]
                )
            )
            for s in having
        ]
        moving = [s for s in sizes if s > 0]
        size[family] = float(np.median(moving)) if moving else 1.0
    return Layout(window, period, size), tuple(slow)


def collect(
    signals: Sequence[Signals], codes: Codes, layout: Layout, most: int, random: np.random.Generator
) -> TrainingSet:
    """Cut and describe windows: up to ``most`` of each class, the closer together the less there is of it.

    Where there are more, every recording gives as many as it can: one long drive does not represent its ground.
    """
    spans = np.array([max(s.end - s.start, layout.window) for s in signals])
    total = np.bincount(codes, weights=spans)
    coarsest = np.maximum(_COARSEST * layout.window, total / (_SPARE * most))
    step = np.clip(total / most, _FINEST * layout.window, coarsest)
    tables, sources = [], []
    starts_of = []
    for k, recorded in enumerate(signals):
        starts = window_starts(recorded.start, recorded.end, layout.window, float(step[codes[k]]))
        tables.append(features_of(recorded, starts, layout))
        sources.append(np.full(len(starts), k))
        starts_of.append(starts - recorded.start)
    source, begin = np.concatenate(sources), np.concatenate(starts_of)
    names = tuple(dict.fromkeys(name for table in tables for name in table))
    features = np.concatenate([matrix(t, names, len(s)) for t, s in zip(tables, sources, strict=True)])
    keep = _balanced(codes[source], source, most, random)
    source, begin, features = source[keep], begin[keep], features[keep]
    held_out, by_recording = deal(codes, np.bincount(source, minlength=len(codes)), random)
    parts = np.minimum((begin / spans[source] * _FOLDS).astype(int), _FOLDS - 1)
    folds = held_out[source] if by_recording else parts
    return TrainingSet(names, features, codes[source], source, begin, folds, parts, by_recording)


def matrix(table: Table, names: Sequence[str], rows: int) -> Floats:
    """The features (rows, names) of a table, NaN where it lacks one."""
    missing = np.full(rows, np.nan)
    return np.array([table.get(name, missing) for name in names]).T if len(names) else np.empty((rows, 0))


def measured_families(names: Sequence[str], features: Floats, least: float = PRESENT) -> dict[str, Bools]:
    """Which windows (n,) each sensor family was measured in: by the ``least`` share of its own features."""
    known = np.isfinite(features)
    return {f: known[:, columns].mean(axis=1) >= least for f, columns in _own_columns(tuple(names)).items()}


@lru_cache(maxsize=8)
def _own_columns(names: tuple[str, ...]) -> dict[str, list[int]]:
    """The columns of the features that rest on one family alone, by family."""
    own: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        needed = families_needed(name)
        if len(needed) == 1 and not of_one_wheel(name):
            own.setdefault(next(iter(needed)), []).append(k)
    return own


def deal(codes: Codes, windows: Codes, random: np.random.Generator) -> tuple[Codes, bool]:
    """Fold (recordings,) of each recording, every class spread over all folds; False where a class has but one."""
    fewest = int(np.bincount(codes).min())
    count = min(_FOLDS, fewest)
    folds = np.zeros(len(codes), dtype=np.intp)
    if count < 2:
        return folds, False
    for code in np.unique(codes):
        mine = np.flatnonzero(codes == code)
        mine = mine[np.lexsort((random.random(len(mine)), -windows[mine]))]
        held = np.zeros(count)
        for recording in mine:  # the longest first, each to the emptiest fold
            fold = int(held.argmin())
            folds[recording] = fold
            held[fold] += max(windows[recording], 1)
    return folds, True


def _balanced(codes: Codes, source: Codes, most: int, random: np.random.Generator) -> Codes:
    kept = []
    rarity = 1.0 / np.bincount(source)[source]
    for code in np.unique(codes):
        mine = np.flatnonzero(codes == code)
        if len(mine) > most:
            chance = rarity[mine] / rarity[mine].sum()
            mine = random.choice(mine, most, replace=False, p=chance)
        kept.append(mine)
    return np.sort(np.concatenate(kept))

"""What a ground classifier has learnt, and how it judges the windows of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.ground.classification.channels import Columns, Signals, shortest_period, signals_of, wheels_of
from terragrip.ground.classification.comparable import without
from terragrip.ground.classification.expert import Expert
from terragrip.ground.classification.features import Layout, dense, features_of
from terragrip.ground.classification.neighbours import nearby_mean, smoothed
from terragrip.ground.classification.training_set import PRESENT, matrix, measured_families
from terragrip.ground.classification.windows import window_starts

_WHOLE = 0.9  # share of a family's own features that makes it measured as it was in training


class Judgement(NamedTuple):
    """Of each window the start [s] (n,), the probability (n, classes) of each class, and the novelty (n,)."""

    starts: Floats
    probabilities: Floats
    novelty: Floats


@dataclass(frozen=True)
class Learnt:
    """The classes, the features' names, the experts from most features to fewest, what recordings look like, the update
    periods [s] of channels that are logged with repeats, sentences for the user, beginnings of columns that
    are left out, and the names of the wheels (none in files of before 28 November 2026)."""

    classes: npt.NDArray[np.generic]
    features: tuple[str, ...]
    experts: tuple[Expert, ...]
    layout: Layout
    held: Mapping[str, float]
    notes: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()

    def windows(self, table: Columns, step: float | None) -> Floats:
        """Starts (n,) [s] of a table's windows, ``step`` [s] apart; None: one window."""
        return self._starts(self._signals(table), step)

    def judge(self, table: Columns, step: float | None, smooth: float) -> Judgement:
        """Judge a table's windows; neighbours within a time ``smooth`` [s] share their evidence.

        Raises InputError on a table with a wheel that no recording in training had.
        """
        signals = self._signals(table)
        strangers = [wheel for wheel in wheels_of([signals]) if wheel not in self.wheels]
        if self.wheels and strangers:
            problem = f"has wheels that were not learned: {', '.join(strangers)} (learned: {', '.join(self.wheels)})"
            hint = "a classifier is of one vehicle; name the wheels as in training, or train one for this vehicle"
            raise InputError(problem, file=table.name, hint=hint)
        starts = self._starts(signals, step)
        features = matrix(features_of(signals, starts, self.layout), self.features, len(starts))
        chances, novelty = self._ask(features, starts, smooth)
        return Judgement(starts, smoothed(chances, starts, smooth / 2), novelty)

    def too_slow(self, table: Columns) -> list[str]:
        """A sentence on each sensor family of a table that has too few samples in a window to be judged by what was learned."""
        return [
            f"{family}: sampled every {shortest_period(channels):.2g} s, learned every {self.layout.period[family]:.2g} s, not used."
            for family, channels in self._signals(table).families.items()
            if family in self.layout.period and not dense(family, channels, self.layout)
        ]

    def _signals(self, table: Columns) -> Signals:
        return signals_of(without(table, self.left_out), self.held)

    def _starts(self, signals: Signals, step: float | None) -> Floats:
        window = self.layout.window
        return window_starts(signals.start, signals.end, window, window if step is None else step)

    def _ask(self, features: Floats, starts: Floats, smooth: float) -> tuple[Floats, Floats]:
        """Send each window to the expert that uses most of what it holds."""
        chances = np.full((len(features), len(self.classes)), 1.0 / len(self.classes))
        novelty = np.full(len(features), np.nan)
        open_rows = np.ones(len(features), dtype=bool)
        nowhere = np.zeros(len(features), dtype=bool)
        # Whole sensors first: a missing axis makes all features of a body sensor look strange.
        for least in (_WHOLE, PRESENT):
            measured = measured_families(self.features, features, least)
            for expert in self.experts:
                fits = open_rows & np.all([measured.get(f, nowhere) for f in expert.families], axis=0)
                if fits.any():
                    columns = [self._column[name] for name in expert.features]
                    chances[fits], strange = expert.judge(features[fits][:, columns])
                    if smooth:  # neighbours that the same expert judged
                        strange = nearby_mean(strange, starts[fits], smooth / 2)
                    novelty[fits] = expert.strangeness.novelty(strange, smooth)
                    open_rows &= ~fits
            if not open_rows.any():
                break
        return chances, novelty

    @cached_property
    def _column(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.features)}

"""Features on one scale, weighed by how far grounds differ in them beside runs on one ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Bools, Floats, Ints

_LIMIT = 3.5  # standard deviations: what lies further out gives no more evidence
_FARTHEST = 100.0  # standard deviations: beyond any vehicle, and finite
_TRUST = 0.5  # power of the ratio of variances


@dataclass(frozen=True)
class Standardization:
    """Centre, scale and weight (features,) of each feature."""

    centre: Floats
    scale: Floats
    weight: Floats

    @classmethod
    def fit(cls, features: Floats, codes: Ints, groups: Ints) -> Standardization:
        """Learn from ``features`` (n, features; NaN = not measured), class codes (n,) and recording numbers (n,).

        A feature that differs from run to run on one ground as much as between grounds tells little about a run
        never seen; its weight is the root of the ratio of the two variances.
        """
        centre = centre_of(features)
        scale = scale_about(centre, features)
        points = scaled(features, centre, scale)
        runs, of_run = np.unique(groups, return_inverse=True)
        means = np.stack([points[of_run == r].mean(axis=0) for r in range(len(runs))])
        within = np.mean((points - means[of_run]) ** 2, axis=0)
        class_of = np.array([codes[of_run == r][0] for r in range(len(runs))])
        by_class = [means[class_of == c] for c in np.unique(class_of)]
        between_runs = np.mean([m.var(axis=0) for m in by_class], axis=0)
        between_classes = np.var([m.mean(axis=0) for m in by_class], axis=0)
        weight = (between_classes / (between_runs + 0.3 * within + 1e-3)) ** _TRUST
        size_of = np.sqrt((weight**2).mean())
        return cls(centre, scale, weight / size_of if size_of > 0 else np.ones_like(weight))

    def apply(self, features: Floats) -> Floats:
        """Features (n, features) on one scale; what is not measured lies at the centre."""
        return scaled(features, self.centre, self.scale) * self.weight

    def distance(self, features: Floats) -> Floats:
        """Root mean square (n,) of the SDs between the measured ``features`` (n, features) and the centre, unlimited."""
        measured = np.isfinite(features)
        away = np.where(measured, np.minimum(np.abs(features - self.centre) / self.scale, _FARTHEST), 0.0)
        return np.asarray(np.sqrt((away**2).sum(axis=1) / np.maximum(measured.sum(axis=1), 1)))


def centre_of(features: Floats) -> Floats:
    """Mean (features,) of the measured values of ``features`` (n, features; NaN = not measured); 0 where there are none."""
    measured = np.isfinite(features)
    return np.asarray(np.where(measured, features, 0.0).sum(axis=0) / _count(measured))


def scale_about(centre: Floats, features: Floats) -> Floats:
    """SD (features,) of the measured values about ``centre`` (features,); infinite for a constant, which shows nothing."""
    measured = np.isfinite(features)
    scale = np.sqrt((np.where(measured, features - centre, 0.0) ** 2).sum(axis=0) / _count(measured))
    return np.where(scale > 1e-9 * (1.0 + np.abs(centre)), scale, np.inf)


def scaled(features: Floats, centre: Floats, scale: Floats) -> Floats:
    """Features (n, features) in standard deviations, within limits; what was not measured lies at the centre."""
    points = np.clip((features - centre) / scale, -_LIMIT, _LIMIT)
    return np.where(np.isfinite(points), points, 0.0)


def _count(measured: Bools) -> Ints:
    return np.maximum(measured.sum(axis=0), 1)

"""What the sensors show, given how the vehicle is driven: for each ground a linear law, and one covariance about all laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats, Ints, Singles
from terragrip.ground.classification.chances import doubting_log, softmax
from terragrip.ground.classification.standardization import centre_of, scale_about, scaled

_RIDGE = 30.0  # windows: a law stays near that of all grounds where it has few
_FLOOR = 0.05  # of a feature's variance
_INDEPENDENT = 4.0  # features: together they give as much evidence as so many independent ones


@dataclass(frozen=True)
class MotionLaw:
    """Of each ground, the effects (features that the ground has a part in) as a quadratic in the motion (features that are the driver's).

    ``centre`` and ``scale`` (motion + effects,) of the features, the motion first; ``whitening`` (effects, effects) makes the
    covariance about the laws the unit matrix; ``laws`` (classes, terms, effects) are whitened.

    Discriminant analysis whose class means depend on covariates: what is compared is p(effects | motion, ground), so a motion
    that was never driven on a ground does not speak against it.
    """

    centre: Floats
    scale: Floats
    whitening: Singles
    laws: Singles

    @classmethod
    def fit(cls, motion: Floats, effects: Floats, codes: Ints) -> MotionLaw:
        """Fit to ``motion`` (n, m) and ``effects`` (n, e), NaN = not measured, with class ``codes`` (n,) 0..K-1."""
        features = np.hstack([motion, effects])
        centre = centre_of(features)
        scale = scale_about(centre, features)
        m = motion.shape[1]
        terms, values = _terms(motion, centre[:m], scale[:m]), scaled(effects, centre[m:], scale[m:])
        common = _regression(terms, values)
        rest = values - terms @ common
        laws, covariance = [], np.zeros((values.shape[1],) * 2)
        classes = int(codes.max()) + 1
        for code in range(classes):
            mine = codes == code
            own = _regression(terms[mine], rest[mine])
            about = rest[mine] - terms[mine] @ own
            laws.append(common + own)
            covariance += about.T @ about / (len(about) * classes)
        # The fewer windows there are to a feature, the less weight the covariance has.
        covariance += (_FLOOR + len(covariance) / len(codes)) * np.eye(len(covariance))
        whitening = np.linalg.inv(np.linalg.cholesky(covariance)).T
        return cls(
            centre, scale, whitening.astype(np.float32), (np.stack(laws) @ whitening).astype(np.float32)
        )

    def decide(self, motion: Floats, effects: Floats) -> Floats:
        """Log probabilities (n, classes), no class being ruled out, of windows with this motion (n, m) and these effects (n, e)."""
        m = motion.shape[1]
        terms = _terms(motion, self.centre[:m], self.scale[:m]).astype(np.float32)
        values = scaled(effects, self.centre[m:], self.scale[m:]).astype(np.float32) @ self.whitening
        square = np.stack(
            [((values - terms @ law) ** 2).sum(axis=1, dtype=float) for law in self.laws], axis=1
        )
        logs = -0.5 * min(_INDEPENDENT / effects.shape[1], 1.0) * square
        return doubting_log(softmax(logs))


def _terms(motion: Floats, centre: Floats, scale: Floats) -> Floats:
    """Constant, linear and square terms (n, 1 + 2 m)."""
    points = scaled(motion, centre, scale)
    return np.column_stack([np.ones(len(points)), points, points**2])


def _regression(terms: Floats, values: Floats) -> Floats:
    return np.asarray(np.linalg.solve(terms.T @ terms + _RIDGE * np.eye(terms.shape[1]), terms.T @ values))

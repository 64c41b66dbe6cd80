"""Terragrip: what the ground does under the wheels, from signals that a machine already has.

The public names load on first use, so that ``import terragrip`` stays quick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from terragrip.lazy import lazily

__version__ = "0.1.0"

if TYPE_CHECKING:
    from terragrip.errors import InputError as InputError
    from terragrip.estimation import Estimates as Estimates
    from terragrip.estimation import TractionEstimator as TractionEstimator
    from terragrip.estimation import calibrate as calibrate
    from terragrip.estimation import estimate as estimate
    from terragrip.formats import Profile as Profile
    from terragrip.formats import read as read
    from terragrip.from_log import estimate_file as estimate_file
    from terragrip.ground.classification.classifier import GroundClassifier as GroundClassifier
    from terragrip.recording import Recording as Recording
    from terragrip.simulation import simulate as simulate
    from terragrip.soil.fit import AdhesionCurve as AdhesionCurve
    from terragrip.vehicle import Vehicle as Vehicle

_HOME = {
    "Vehicle": "terragrip.vehicle",
    "Recording": "terragrip.recording",
    "Profile": "terragrip.formats",
    "read": "terragrip.formats",
    "Estimates": "terragrip.estimation",
    "TractionEstimator": "terragrip.estimation",
    "estimate": "terragrip.estimation",
    "estimate_file": "terragrip.from_log",
    "calibrate": "terragrip.estimation",
    "simulate": "terragrip.simulation",
    "AdhesionCurve": "terragrip.soil.fit",
    "GroundClassifier": "terragrip.ground.classification.classifier",
    "InputError": "terragrip.errors",
}

__all__ = ["__version__", *_HOME]
__getattr__ = lazily(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

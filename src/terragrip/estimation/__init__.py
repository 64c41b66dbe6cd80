"""Traction estimates from measured signals: one sample at a time, or a whole recording.

The names load on first use: consistency measures and the reference filters need no compiled kernel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from terragrip.lazy import lazily

if TYPE_CHECKING:
    from terragrip.estimation.batch import RunOptions as RunOptions
    from terragrip.estimation.batch import estimate as estimate
    from terragrip.estimation.batch import estimated as estimated
    from terragrip.estimation.calibration import Calibration as Calibration
    from terragrip.estimation.calibration import calibrate as calibrate
    from terragrip.estimation.calibration import identify_torque_scale as identify_torque_scale
    from terragrip.estimation.estimates import Estimates as Estimates
    from terragrip.estimation.estimator import Estimate as Estimate
    from terragrip.estimation.estimator import TractionEstimator as TractionEstimator
    from terragrip.estimation.methods import DEFAULT as DEFAULT
    from terragrip.estimation.methods import METHODS as METHODS
    from terragrip.estimation.methods import Method as Method

_HOME = {
    "estimate": ".batch",
    "estimated": ".batch",
    "RunOptions": ".batch",
    "Estimates": ".estimates",
    "Estimate": ".estimator",
    "TractionEstimator": ".estimator",
    "DEFAULT": ".methods",
    "METHODS": ".methods",
    "Method": ".methods",
    "Calibration": ".calibration",
    "calibrate": ".calibration",
    "identify_torque_scale": ".calibration",
}

__all__ = list(_HOME)
__getattr__ = lazily(__name__, _HOME)

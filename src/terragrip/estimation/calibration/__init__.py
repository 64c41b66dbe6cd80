"""Calibration of a vehicle from its own logs."""

from __future__ import annotations

from terragrip.estimation.calibration.procedure import calibrate as calibrate
from terragrip.estimation.calibration.result import Calibration as Calibration
from terragrip.estimation.calibration.result import Evidence as Evidence
from terragrip.estimation.calibration.result import Quantity as Quantity
from terragrip.estimation.calibration.result import Unknown as Unknown
from terragrip.estimation.calibration.torque_scale import identify_torque_scale as identify_torque_scale

__all__ = ["Calibration", "Evidence", "Quantity", "Unknown", "calibrate", "identify_torque_scale"]

"""The oracle: a fixed-noise filter that knows the true gains and offsets and, afterwards, its best noise.

No user can have it. It says how much of the remaining error is the price of not knowing.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip._kernel import ffi, lib
from terragrip.estimation import TractionEstimator
from terragrip.estimation.consistency import agreement
from terragrip.estimation.engine import Engine
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult
from terragrip.vehicle import Vehicle

ADHESION_SCALES = tuple(10.0 ** np.arange(-1.5, 2.01, 0.5))
RESISTANCE_SCALES = (0.03, 0.3, 3.0, 30.0)
"""Factors on the default process noise of adhesion and of soil resistance: every pair is tried."""


@dataclass(frozen=True)
class Oracle:
    """The best R² of `wheel`'s adhesion, and the factors that gave it."""

    r2: float
    adhesion_scale: float
    resistance_scale: float


def oracle(result: SimulationResult, wheel: str, rows: NDArray[np.bool_]) -> Oracle:
    """Try every pair of scales with the true calibration; `rows` are those that count."""
    vehicle = knowing(result)
    truth = result.truth[f"true_adhesion_{wheel}"].to_numpy()
    out = []
    for adhesion, resistance in itertools.product(ADHESION_SCALES, RESISTANCE_SCALES):
        estimate = _adhesion(result.recording, vehicle, wheel, adhesion, resistance)
        out.append(Oracle(agreement(truth, estimate, rows).r2, adhesion, resistance))
    return max(out, key=lambda item: item.r2)


def knowing(result: SimulationResult) -> Vehicle:
    """The vehicle with the simulation's true gains, offsets and radii as its calibration."""
    data = result.vehicle.to_dict()
    data["calibration"] = result.true_parameters["calibration"]
    return Vehicle.from_dict(data)


def _adhesion(
    recording: Recording, vehicle: Vehicle, wheel: str, adhesion: float, resistance: float
) -> NDArray[np.float64]:
    """Adhesion of `wheel` by the method kalman with its process noise scaled."""
    estimator = TractionEstimator.for_recording(recording, vehicle, "kalman")
    settings = ffi.new("tg_settings *")
    if lib.tg_estimator_settings(estimator.engine.handle, settings) != lib.TG_OK:
        raise SystemExit("the kernel does not give its settings")
    n = settings.machine.wheels
    for i in range(n):
        settings.tuning.walk[n + 1 + i] *= adhesion
    settings.tuning.walk[2 * n + 1] *= resistance
    estimator._engine = Engine(settings, estimator.engine.slots_in, estimator.engine.slots_out)
    return np.asarray(estimator.update_block(recording)[f"adhesion_{wheel}"])

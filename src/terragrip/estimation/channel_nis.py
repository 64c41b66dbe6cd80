"""The normalised innovation squared of each channel: which sensor's noise is stated wrongly, and where the model does not follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip._kernel import lib
from terragrip.estimation.estimator import TractionEstimator
from terragrip.estimation.forward import finished, prepared, table_of
from terragrip.estimation.methods import DEFAULT
from terragrip.estimation.provenance import notes_of
from terragrip.recording import Recording
from terragrip.recording.alignment import recording_of

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.vehicle import Vehicle

PREFIX = "nis_"


def estimate_with_channel_nis(
    recording: Recording | Any,
    vehicle: Vehicle,
    method: str = DEFAULT,
    *,
    sensors: Mapping[str, float] | None = None,
) -> Estimates:
    """As :func:`~terragrip.estimation.batch.estimate`, with a column ``nis_<channel>`` for each channel that updates the estimate.

    It is the innovation squared over its variance as the filter expects it, R weighted as the row's ``nis`` has it (Bar-Shalom, Li,
    Kirubarajan 2001, section 5.4): chi-square with one degree of freedom where noise and model are right, its mean 1. NaN in rows where
    the channel was not measured: a wheel speed held between its updates and a reckoned ground speed are no measurements. Of logs without
    torque, a rim's is given the ground speed of the same row. Raises InputError as `estimate` does.
    """
    log = recording_of(recording)
    estimator = TractionEstimator.for_recording(log, vehicle, method, sensors=sensors)
    places = _places(estimator.engine.slots_in)
    estimator.engine.slots_out.update(places)
    time, columns = prepared(estimator, log)
    out = table_of(estimator.columns, len(time))
    event = np.empty(len(time), dtype=np.uint8)
    estimator.engine.run(time, columns, out, event)
    return finished(estimator, log, out, event, notes_of(estimator, log), smooth=False)


def _places(slots_in: Mapping[str, int]) -> dict[str, int]:
    """The place in tg_estimate.value of each channel's NIS: wheel speeds, ground speed, the accelerometer."""
    wheels = {n: s - lib.TG_WHEEL_SPEED for n, s in slots_in.items() if n.startswith("wheel_")}
    places = {**wheels, "ground_speed": len(wheels), "acceleration_x": len(wheels) + 1}
    return {f"{PREFIX}{name}": lib.TG_OUT_CHANNEL_NIS + k for name, k in places.items() if name in slots_in}

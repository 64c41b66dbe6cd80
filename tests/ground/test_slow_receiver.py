"""A vehicle digs in and its receiver reads twice a second, with noise: the warning does not wait until the filter has followed."""

from __future__ import annotations

import numpy as np

from terragrip.estimation import estimate
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, families
from terragrip.simulation.families import Kind


def stopped(result: SimulationResult) -> float:
    """When all driven wheels first slip by 95 % for half a second [s]."""
    truth, rate = result.truth, 10
    driven = [w for w, on in zip(result.vehicle.wheels, result.vehicle.driven, strict=True) if on]
    spins = np.min([truth[f"true_slip_{w}"].to_numpy() for w in driven], axis=0) > 0.95
    lasting = np.convolve(spins, np.ones(rate // 2), "valid") == rate // 2
    return float(truth["time"].to_numpy()[np.argmax(lasting)])


def lead(kind: Kind, seed: int) -> float:
    """From the first row of a warning, or of `stuck`, to that instant [s]; without any, 2 s too late."""
    result = families.draw(Kind(kind.mass, kind.curve, "coarse"), seed, rate=10.0, task="digging")
    channels = {k: v for k, v in result.recording.channels.items() if k != "drawbar_force"}
    rows = np.logical_or.reduce([np.isfinite(v) for v in channels.values()])
    table = estimate(Recording(result.recording.time, channels).select(rows), result.vehicle)
    end = stopped(result)
    flagged = (
        np.isin(table["event"], ["immobilization", "stuck"]) & (table.time > end - 6) & (table.time < end + 2)
    )
    return end - float(table.time[np.argmax(flagged)]) if flagged.any() else -2.0


def test_the_warning_does_not_wait_for_what_the_filter_has_not_followed() -> None:
    leads = [lead(kind, seed) for kind, seed in families.machines("development", 6, 92000)]
    assert np.median(leads) > 0.8

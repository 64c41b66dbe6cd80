"""A simulated machine whose bus tells engine torque and speed instead of its wheels' torques, through a driveline with drawn losses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip import Vehicle
from terragrip.recording import Recording
from terragrip.simulation.simulate import SimulationResult

Floats = npt.NDArray[np.float64]

EFFICIENCY, EFFICIENCY_STD = 0.87, 0.04
ACCESSORIES, ACCESSORIES_STD = 0.04, 0.02  # of the rated power
TORQUE_STD = 0.02  # of the reference torque
RATED = 220.0  # rad/s
GEAR_STEP = 1.22


@dataclass(frozen=True)
class StockMachine:
    """What its user has: ``recording`` and ``vehicle``; and the truth: ``adhesion`` (n,), ``resistance`` (n,), ``moving`` (n,)."""

    recording: Recording
    vehicle: Vehicle
    adhesion: Floats
    resistance: Floats
    moving: npt.NDArray[np.bool_]


def stock_machine(drive: SimulationResult, seed: int, *, period: float = 0.1) -> StockMachine:
    """A drive as the bus of a stock machine tells it every ``period`` [s].

    The wheels' true torques go back through gears (engine speed between three quarters and all of its rated one) and losses drawn from the
    spreads that the vehicle file states; torque is logged in steps of 1 % of the reference torque.
    """
    rng = np.random.default_rng((seed, 17))
    rows = np.unique(np.searchsorted(drive.recording.time, np.arange(0, drive.recording.time[-1], period)))
    truth, vehicle = drive.truth.iloc[rows], drive.vehicle
    driven = [w for w, on in zip(vehicle.wheels, vehicle.driven, strict=True) if on]
    radii = dict(zip(vehicle.wheels, vehicle.wheel_radius, strict=True))
    torque, speed, load = (
        np.stack([truth[f"true_{name}_{w}"].to_numpy() for w in driven], axis=1)
        for name in ("drive_torque", "wheel_speed", "vertical_load")
    )
    rim = speed @ [radii[w] for w in driven] / len(driven)
    power = np.sum(torque * speed, axis=1)
    rated_power = 1.3 * float(np.quantile(np.abs(power), 0.99)) / EFFICIENCY + 1.0
    reference = rated_power / RATED
    efficiency = float(np.clip(EFFICIENCY + EFFICIENCY_STD * rng.standard_normal(), 0.7, 0.98))
    accessories = rated_power * max(ACCESSORIES + ACCESSORIES_STD * rng.standard_normal(), 0.0)
    offset = TORQUE_STD * reference * rng.standard_normal()
    omega = np.abs(rim) / float(np.mean([radii[w] for w in driven]))
    gear = np.ceil(np.log(np.maximum(omega, 1e-3)) / np.log(GEAR_STEP))
    engine = np.where(omega > 0.05, RATED * omega / GEAR_STEP**gear, 90.0)
    taken = np.where(power > 0, power / efficiency, power * efficiency)
    flywheel = (taken + accessories) / engine + offset
    channels: dict[str, Any] = {
        "ground_speed": _kept(drive, "ground_speed", rows),
        "wheel_based_speed": np.round(rim / 0.001) * 0.001,
        "engine_speed": np.round(engine / 0.0131) * 0.0131,
        "engine_torque_share": np.round(flywheel / reference + 0.08, 2),
        "engine_friction_share": np.full(len(rows), 0.08),
    }
    for name in ("drawbar_force", "acceleration_x", "pitch"):
        if name in drive.recording.channels:
            channels[name] = _kept(drive, name, rows)
    data = vehicle.to_dict()
    data["driveline"] = {
        "efficiency": EFFICIENCY,
        "efficiency_std": EFFICIENCY_STD,
        "accessory_power": ACCESSORIES * rated_power,
        "accessory_power_std": ACCESSORIES_STD * rated_power,
        "engine_torque_std": TORQUE_STD * reference,
        "reference_torque": reference,
    }
    adhesion = np.stack([truth[f"true_adhesion_{w}"].to_numpy() for w in driven], axis=1)
    mean = (adhesion * load).sum(axis=1) / load.sum(axis=1)
    moving = ~truth["standstill"].to_numpy() & ~truth["stuck"].to_numpy()
    recording = Recording(
        drive.recording.time[rows], channels, {"soil": drive.recording.labels["soil"][rows]}
    )
    return StockMachine(
        recording, Vehicle.from_dict(data), mean, truth["true_soil_resistance"].to_numpy(), moving
    )


def _kept(drive: SimulationResult, name: str, rows: Any) -> Floats:
    """The last reading before each row: the bus tells what it has."""
    values = drive.recording.channels[name]
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[last[rows]]

"""From a run of the second plant to what terragrip.simulation.simulate gives: recording, truth, vehicle, true parameters."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from second_plant.plant import Run
from terragrip.physics.efficiency import net_traction, tractive_efficiency
from terragrip.physics.slip import slip
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, faults
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.sensors import draw_errors, located, measure
from terragrip.simulation.simulate import one_table, true_parameters
from terragrip.simulation.truth import STANDSTILL_SPEED, stuck
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

Floats = NDArray[np.float64]


def result_of(run: Run, scenario: Scenario, vehicle: Vehicle, seed: int) -> SimulationResult:
    """What the scenario's sensors read of the run, and the truth at those instants."""

    def sources(sensor: str) -> dict[str, Floats]:
        return signals(sensor, run, vehicle)

    errors = draw_errors(scenario.sensors, sources, vehicle.wheels, seed)
    series = measure(scenario.sensors, run["time"], sources, vehicle.wheels, errors, seed)
    series = faults.apply(
        scenario.faults, [located(scenario, one) for one in series], float(run["time"][-1]), seed
    )
    time, channels = one_table(series)
    truth = truth_at(time, run, vehicle)
    recording = Recording(
        time=time,
        channels=channels,
        labels={"soil": truth["soil"].to_numpy(dtype=object)},
        source=f"second plant {scenario.name}, seed {seed}",
    )
    parameters = true_parameters(vehicle, errors, run.radius)
    return SimulationResult(recording, truth, vehicle, parameters, scenario, seed)


def signals(sensor: str, run: Run, vehicle: Vehicle) -> dict[str, Floats]:
    """True values (n,) of a sensor's channels, in the recording's units and signs; none of what this plant does not have."""
    if sensor in ("wheel_speed", "drive_torque"):
        column = run["wheel_speed" if sensor == "wheel_speed" else "torque"]
        return {f"{sensor}_{wheel}": column[:, i] for i, wheel in enumerate(vehicle.wheels)}
    singles = {
        "ground_speed": {"ground_speed": "speed"},
        "drawbar_force": {"drawbar_force": "pull"},
        "acceleration": {f"acceleration_{axis}": f"specific_{axis}" for axis in "xyz"},
        "angular_velocity": {f"angular_velocity_{axis}": f"rate_{axis}" for axis in "xyz"},
        "pitch": {"pitch": "pitch"},
    }
    return {channel: run[name] for channel, name in singles[sensor].items()}


def truth_at(time: Floats, run: Run, vehicle: Vehicle) -> pd.DataFrame:
    """The truth (columns as terragrip.simulation.truth.truth_frame) at instants (k,), linear between the run's rows.

    ``true_adhesion_<w>``: the soil's tangential force over the wheel's normal force. ``true_soil_resistance``: what the soil
    holds all wheels back with, over m g cosθ, θ the body's pitch. ``true_slope``: what gravity and gradients add, by the balance
    along the body.
    """

    def at(values: Floats) -> Floats:
        return np.interp(time, run["time"], values)

    weight = vehicle.mass * STANDARD_GRAVITY
    pulling = run["adhesion"] * run["load"]
    resisting = run["resistance"].sum(axis=1)
    left = pulling.sum(axis=1) - resisting - run["pull"] - vehicle.mass * run["acceleration"]
    slope = np.arcsin(np.clip(left / weight, -1, 1))
    resistance = resisting / (weight * np.cos(run["pitch"]))
    columns: dict[str, NDArray[np.generic]] = {
        "time": time,
        "true_ground_speed": at(run["speed"]),
        "true_acceleration": at(run["acceleration"]),
        "true_distance": at(run["travel"]),
        "true_slope": at(slope),
        "true_drawbar_force": at(run["pull"]),
        "true_assist_force": np.zeros(len(time)),
        "true_soil_resistance": at(resistance),
    }
    for k, axle in enumerate(vehicle.axle_names):
        columns[f"true_vertical_load_{axle}"] = at(run["load"][:, vehicle.wheel_axle == k].sum(axis=1))
    for i, wheel in enumerate(vehicle.wheels):
        adhesion = at(run["adhesion"][:, i])
        speed, hub = at(run["wheel_speed"][:, i]), at(run["hub_speed"][:, i])
        wheel_slip = slip(speed, hub, run.radius[i], standstill_speed=STANDSTILL_SPEED)
        columns[f"true_adhesion_{wheel}"] = adhesion
        columns[f"true_slip_{wheel}"] = wheel_slip
        columns[f"true_net_traction_{wheel}"] = net_traction(adhesion, columns["true_soil_resistance"])
        columns[f"true_efficiency_{wheel}"] = tractive_efficiency(
            adhesion, columns["true_soil_resistance"], vehicle.tire_rolling_resistance, wheel_slip
        )
        columns[f"true_vertical_load_{wheel}"] = at(run["load"][:, i])
        columns[f"true_wheel_speed_{wheel}"] = speed
        columns[f"true_drive_torque_{wheel}"] = at(run["torque"][:, i])
        columns[f"true_sinkage_{wheel}"] = at(run["sinkage"][:, i])
    rows = np.clip(np.searchsorted(run["time"], time + 1e-9) - 1, 0, len(run.rows) - 1)
    rim = np.abs(run["wheel_speed"] * run.radius).max(axis=1)
    columns["soil"] = np.where(run["last_soil"][rows] > 0.5, "second", "first").astype(object)
    columns["transition"] = ((run["last_soil"] > 0) & (run["last_soil"] < 1))[rows]
    columns["stuck"] = stuck(run)[rows]  # type: ignore[arg-type]  # a Run has what it reads of a Trace
    columns["push"] = at(run["pull"]) < -5.0
    columns["standstill"] = np.maximum(rim, np.abs(run["speed"]))[rows] < STANDSTILL_SPEED
    columns["motors_off"] = run["off"][rows] > 0
    columns["driver"] = np.full(len(time), "normal", dtype=object)
    return pd.DataFrame(columns)

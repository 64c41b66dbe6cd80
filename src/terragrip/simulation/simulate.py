"""From a scenario to a recording and its truth."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.recording import Recording
from terragrip.simulation import faults, plant, terrain
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.sensors import Errors, Series, draw_errors, located, measure, signals
from terragrip.simulation.trace import Trace
from terragrip.simulation.truth import soil_labels, truth_frame
from terragrip.vehicle import Vehicle

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class SimulationResult:
    """A simulated drive.

    ``recording``: the readings of the sensors. ``truth``: a row for each of its rows (columns: :func:`truth_frame`).
    ``vehicle``: as its user would write it, without the errors. ``true_parameters``: ``gain`` and ``offset`` of every
    channel (reading = gain x true + offset), ``wheel_radius`` by wheel [m], and ``calibration``, the block that would
    correct them in a vehicle file. ``scenario`` and ``seed`` make it again.
    """

    recording: Recording
    truth: pd.DataFrame
    vehicle: Vehicle
    true_parameters: dict[str, Any]
    scenario: Scenario
    seed: int

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write recording.parquet, truth.parquet, vehicle.yaml and true_parameters.json; raises InputError if it cannot."""
        import json

        from terragrip.files import made_folder, replacing

        target = made_folder(folder)
        with replacing(target / "recording.parquet") as temporary:
            self.recording.to_pandas().to_parquet(temporary, index=False)
        with replacing(target / "truth.parquet") as temporary:
            self.truth.to_parquet(temporary, index=False)
        with replacing(target / "true_parameters.json") as temporary:
            temporary.write_text(json.dumps(self.true_parameters, indent=2) + "\n", encoding="utf-8")
        self.vehicle.save(target / "vehicle.yaml")


def simulate(
    scenario: Scenario | str | os.PathLike[str], seed: int | None = None, *, machine_seed: int | None = None
) -> SimulationResult:
    """Simulate a scenario (an object, the name of one, or a file).

    ``seed`` (default: the scenario's) fixes ground, noise and faults; ``machine_seed`` (default: the same) fixes the
    machine's errors: many runs can share one machine. The same seeds give the same bits. Raises InputError on an
    unusable scenario.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario.load(scenario)
    seed = scenario.seed if seed is None else seed
    if min(seed, machine_seed or 0) < 0:
        raise InputError(f"the seed {min(seed, machine_seed or 0)} is negative", hint="give 0 or more")
    machine_seed = seed if machine_seed is None else machine_seed
    vehicle = scenario.nominal_vehicle()
    plant.check_layout(vehicle)
    radius = true_radius(scenario, vehicle, machine_seed)
    trace = _drive(scenario, vehicle, radius, seed)
    known = cache(lambda name: signals(name, trace))
    errors = draw_errors(scenario.sensors, known, vehicle.wheels, machine_seed)
    series = measure(scenario.sensors, trace["time"], known, vehicle.wheels, errors, seed)
    series = faults.apply(
        scenario.faults, [located(scenario, one) for one in series], float(trace["time"][-1]), seed
    )
    time, channels = one_table(series)
    seen = trace.at(time)
    recording = Recording(
        time=time,
        channels=channels,
        labels={"soil": soil_labels(seen)["soil"].astype(object)},
        source=f"simulation {scenario.name}, seed {seed}",
    )
    parameters = true_parameters(vehicle, errors, radius)
    return SimulationResult(recording, truth_frame(seen, trace), vehicle, parameters, scenario, seed)


def true_radius(scenario: Scenario, vehicle: Vehicle, seed: int) -> Floats:
    """Each wheel's true radius (wheels,) [m]: the file's with the drawn error of the scenario."""
    error = scenario.robot.wheel_radius_sd * stream(seed, "wheel radius").standard_normal()
    return vehicle.wheel_radius * (1.0 + error)


def _drive(scenario: Scenario, vehicle: Vehicle, radius: Floats, seed: int) -> Trace:
    ground = terrain.build(scenario, vehicle, seed)
    machine = plant.make_plant(scenario, vehicle, radius, ground)
    stride = round(1.0 / (scenario.log_rate * scenario.step))
    rows = plant.run(machine, scenario.duration, scenario.step, stride)
    return Trace(rows, vehicle, radius, ground, scenario.robot.wheel_mass, len(scenario.tools))


def one_table(series: list[Series]) -> tuple[Floats, dict[str, Floats]]:
    """The union of all instants (n,) and every channel on it, NaN where it was not measured."""
    measured = []
    for one in series:
        some = np.zeros(len(one.time), dtype=bool)
        for values in one.values.values():
            some |= np.isfinite(values)
        measured.append(some)
    if not any(some.any() for some in measured):
        raise InputError(
            "no sensor reads anything", place="faults", hint="leave some samples outside the gaps"
        )
    time = np.unique(np.concatenate([one.time[some] for one, some in zip(series, measured, strict=True)]))
    channels: dict[str, Floats] = {}
    for one, some in zip(series, measured, strict=True):
        rows = np.searchsorted(time, one.time[some])
        for name, values in one.values.items():
            channels[name] = np.full(len(time), np.nan)
            channels[name][rows] = values[some]
    return time, channels


def true_parameters(vehicle: Vehicle, errors: Errors, radius: Floats) -> dict[str, Any]:
    """A result's values of its machine: gains, offsets, radii (wheels,) and the calibration that would correct them."""
    wheels = vehicle.wheels
    torque = {w: c for w in wheels if (c := f"drive_torque_{w}") in errors.gain}
    calibration: dict[str, Any] = {
        "drive_torque_gain": {w: errors.gain[c] for w, c in torque.items()},
        "drive_torque_offset": {w: errors.offset[c] for w, c in torque.items()},
        "drawbar_offset": errors.offset.get("drawbar_force", 0.0),
        "acceleration_bias_x": errors.offset.get("acceleration_x", 0.0),
        "pitch_offset": errors.offset.get("pitch", 0.0),
        "wheel_radius": {w: float(r) for w, r in zip(wheels, radius, strict=True)},
    }
    return {
        "gain": errors.gain,
        "offset": errors.offset,
        "wheel_radius": calibration["wheel_radius"],
        "calibration": calibration,
    }

"""Whether 95 % intervals hold what they claim, on simulated drives (development seeds) with ordinary sensor errors.

The vehicle is the user's, not the machine's: torque gains 2 % off, a drawbar offset, a biased accelerometer, unknown slope.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from terragrip.estimation import estimate
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, simulate
from terragrip.simulation.families import draw, machines
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("unchecked")

SEEDS = (1002, 1010)
WHEELS = ("fl", "fr", "rl", "rr")
QUANTITIES = tuple([f"{kind}_{w}" for kind in ("adhesion", "slip") for w in WHEELS] + ["soil_resistance"])
SENSED = ("acceleration_x", "acceleration_y", "acceleration_z", "pitch")


@cache
def drive(scenario: str, seed: int) -> SimulationResult:
    return simulate(scenario, seed)


def without(recording: Recording, channels: tuple[str, ...]) -> Recording:
    kept = {name: values for name, values in recording.channels.items() if name not in channels}
    return replace(recording, channels=kept)


@cache
def held(scenario: str, missing: tuple[str, ...] = ()) -> dict[str, dict[str, NDArray[np.bool_]]]:
    """By quantity and soil: whether each interval holds the truth, while moving and with nobody pushing."""
    out: dict[str, dict[str, list[NDArray[np.bool_]]]] = {name: {} for name in QUANTITIES}
    for seed in SEEDS:
        result = drive(scenario, seed)
        truth, estimates = result.truth, estimate(without(result.recording, missing), result.vehicle)
        counts = (np.abs(truth["true_ground_speed"]) > 0.05) & (np.abs(truth["true_assist_force"]) < 1)
        for name in QUANTITIES:
            error = estimates[name] - truth[f"true_{name}"].to_numpy()
            inside = np.abs(error) <= 1.96 * estimates[f"{name}_std"]
            for soil in ("hard", "fine", "wet", "coarse", "grass"):
                rows = counts.to_numpy() & (truth["soil"] == soil).to_numpy() & np.isfinite(error)
                out[name].setdefault(soil, []).append(inside[rows])
    return {n: {soil: np.concatenate(parts) for soil, parts in by.items()} for n, by in out.items()}


@pytest.mark.parametrize("scenario", ["accuracy-clean", "accuracy-faults"])
@pytest.mark.parametrize("missing", [(), SENSED[:3], SENSED], ids=["all", "no accelerometer", "nor pitch"])
def test_intervals_hold_the_truth(scenario: str, missing: tuple[str, ...]) -> None:
    for kind in ("adhesion", "slip", "soil_resistance"):
        own = [by for name, by in held(scenario, missing).items() if name.startswith(kind)]
        share = float(np.mean(np.concatenate([part for by in own for part in by.values()])))
        # Adhesion is held in more rows than need be: here the soil differs from wheel to wheel within the length that
        # counts as unseen load (decision 0115). So is resistance: without an accelerometer the slope's prior is most of its spread,
        # and where nothing tells the slope, a resistance that changes from soil to soil might as well be hills (0149).
        wide = kind == "adhesion" or (missing != () and kind == "soil_resistance")
        assert 0.90 <= share <= (0.9995 if wide else 0.99), kind


@pytest.mark.parametrize("scenario", ["accuracy-clean", "accuracy-faults"])
def test_intervals_hold_the_truth_on_rough_ground_and_on_smooth(scenario: str) -> None:
    """Rough ground moves load between the wheels and the body over them, which no channel here measures."""
    for name, by_soil in held(scenario).items():
        for soil, inside in by_soil.items():
            assert np.mean(inside) > 0.85, (name, soil)


def test_intervals_hold_over_machines() -> None:
    """Random development machines of 5 kg to 12 t whose wheels' loads vary by 2 to 8 %, unknown to anyone. How wide the intervals
    are beside an oracle's: benchmarks/bench_families.py."""
    inside: dict[str, list[NDArray[np.bool_]]] = {}
    for kind, seed in machines("development", 6):
        result = draw(kind, seed, rate=50.0)
        truth, estimates = result.truth, estimate(result.recording, result.vehicle)
        speed = np.abs(truth["true_ground_speed"].to_numpy())
        moving = speed > min(0.05, 0.1 * float(np.median(speed[speed > 0.01])))
        driven = [w for w, driven in zip(result.vehicle.wheels, result.vehicle.driven, strict=True) if driven]
        for name in [f"{q}_{w}" for q in ("adhesion", "slip", "net_traction") for w in driven] + [
            "soil_resistance"
        ]:
            error = estimates[name] - truth[f"true_{name}"].to_numpy()
            rows = moving & np.isfinite(error)
            half = 1.96 * estimates[f"{name}_std"][rows]
            quantity = name if name == "soil_resistance" else name.rpartition("_")[0]
            inside.setdefault(quantity, []).append(np.abs(error[rows]) <= half)
    for quantity, parts in inside.items():
        assert 0.90 <= np.mean(np.concatenate(parts)) <= 0.99, quantity


def test_what_the_accelerometer_reads_too_much_moves_resistance_but_not_speed() -> None:
    """The slope is found from the motion: bias and slope are then one error, which the ground speed does not feel."""
    result = drive("accuracy-clean", SEEDS[0])
    spread = {}
    for bias in (0.001, 0.3):
        data = result.vehicle.to_dict()
        data["uncertainty"]["acceleration_bias"] = bias
        estimates = estimate(result.recording, Vehicle.from_dict(data))
        rows = estimates["time"] > 20.0
        spread[bias] = {
            name: float(np.median(estimates[f"{name}_std"][rows]))
            for name in ("ground_speed", "soil_resistance")
        }
    assert spread[0.3]["soil_resistance"] == pytest.approx(0.3 / 9.81, rel=0.1)
    assert spread[0.3]["ground_speed"] < 1.05 * spread[0.001]["ground_speed"]

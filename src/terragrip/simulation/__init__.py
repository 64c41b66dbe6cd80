"""Simulation: a robot, its tools, its ground and its sensors, with the truth beside the recording."""

from terragrip.simulation.campaign import simulate_campaign
from terragrip.simulation.library import scenario_names, set_names, set_runs
from terragrip.simulation.scenario import Scenario
from terragrip.simulation.simulate import SimulationResult, simulate

__all__ = [
    "Scenario",
    "SimulationResult",
    "scenario_names",
    "set_names",
    "set_runs",
    "simulate",
    "simulate_campaign",
]

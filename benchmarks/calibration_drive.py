"""The drives that the accuracy benchmark calibrates from: one machine, other ground than the scored drive."""

from __future__ import annotations

from terragrip.estimation.calibration import Calibration, calibrate
from terragrip.simulation import Scenario, simulate
from terragrip.vehicle import Vehicle

GROUND = 50_000
"""Added to a seed, so that calibration and scored drive never share ground or noise."""

FREE_PASS = {
    "name": "free-pass",
    "vehicle": "innok-heros-444",
    "route": {"segments": [{"soil": "hard", "length": 45}], "slope": {"sd": "0.6 deg", "length": 8}},
    "tools": [],
    # at rest with the motors off, then nothing to pull, there and then at another speed
    "speed": [[0, "off"], [10, 0], [11, 0.5], [45, 0.5], [46, 0.8], [70, 0.8], [71, 0], [72, "off"]],
    "duration": 75,
}


def calibrate_machine(seed: int, sensors: str) -> Calibration:
    """Calibrate the machine of `seed` with the sensor set `sensors` from a free pass and a drive with loads.

    The user's part in it: to switch the motors off at rest, to drive once without a tool, and once with
    loads that come and go over several soils.
    """
    free = simulate(
        Scenario.from_dict({**FREE_PASS, "sensors": {"use": sensors}}), seed + GROUND, machine_seed=seed
    )
    loaded = simulate(
        Scenario.from_dict({"extends": "accuracy-clean", "name": "loaded", "sensors": {"use": sensors}}),
        seed + 2 * GROUND,
        machine_seed=seed,
    )
    file = free.vehicle.to_dict()
    file["uncertainty"]["vertical_load"] = 0.0  # the simulated axles carry what the file says
    return calibrate([free.recording, loaded.recording], Vehicle.from_dict(file))

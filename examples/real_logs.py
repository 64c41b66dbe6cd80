"""What Terragrip says of two machines' real logs, as the tables of docs/real-logs.md.

    python examples/real_logs.py [--data ../shared/data] [--method kalman] [--smooth] [--scale]

Wheels are looked at where their own speed is freshly measured. Rows count as straight driving where the vehicle is
faster than a limit, its ground speed was measured in the last half second, its sides turn alike and nothing is flagged.
The hub of a side goes at v ∓ yaw rate · track/2: ``hub slip`` is the slip with that speed.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from terragrip.estimation import Estimates, estimate
from terragrip.estimation.engine import EVENTS
from terragrip.formats import read
from terragrip.recording import Recording, held_periods, without_held
from terragrip.vehicle import Vehicle

HERE = Path(__file__).resolve().parent
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Machine:
    """A folder of logs, the example files for them, and from which speed [m/s] a row counts as driving."""

    name: str
    logs: str
    fast: float
    left: tuple[str, ...]
    right: tuple[str, ...]


MACHINES = (
    Machine("alostar_4wd", "alostar_4wd/*.txt", 0.1, ("fl", "rl"), ("fr", "rr")),
    Machine("drive_warthog", "drive_warthog/raw20hz/*.csv.gz", 0.6, ("left",), ("right",)),
)


@dataclass(frozen=True)
class Verdict:
    """Figures of one log, medians over rows of straight driving; ``nis`` is per channel over all moving rows,
    ``nis_straight`` over all rows whose sides turn alike; ``straight`` counts rows and wheels.

    ``on_the_spot`` is the median slip, by the estimator, where the sides turn against each other.
    """

    log: str
    seconds: float
    held: dict[str, float]
    nis: float
    nis_straight: float
    standing: float
    straight: int
    slip: float
    hub_slip: float
    slip_std: float
    adhesion: float
    adhesion_std: float
    resistance: float
    resistance_std: float
    on_the_spot: float


def vehicle_of(machine: Machine) -> Vehicle:
    """The machine's example vehicle."""
    return Vehicle.load(HERE / machine.name / "vehicle.yaml")


def logs_of(machine: Machine, data: Path) -> list[Path]:
    """The machine's logs under the folder of shared data."""
    return sorted(data.glob(machine.logs))


def judge(machine: Machine, recording: Recording, vehicle: Vehicle, estimates: Estimates) -> Verdict:
    """The figures of one log."""
    fresh = without_held(recording)
    measured = {w: np.isfinite(fresh[f"wheel_speed_{w}"]) for w in vehicle.wheels}
    rim = {w: vehicle.wheel_radius[0] * _last(recording[f"wheel_speed_{w}"]) for w in vehicle.wheels}
    left, right = (np.mean([rim[w] for w in side], axis=0) for side in (machine.left, machine.right))
    speed, calm = estimates["ground_speed"], estimates.event_codes == 0
    turning = np.abs(left - right) / np.maximum(np.abs(left + right), 1e-9)
    stamps = np.where(np.isfinite(fresh["ground_speed"]), recording.time, np.nan)
    seen = recording.time - _last(stamps) < 0.5  # s: the ground speed is a measured one
    straight = calm & seen & (np.abs(speed) > machine.fast) & (turning < 0.1)
    spot = (turning > 1) & (np.abs(left - right) > 0.2)
    turn = _last(recording.channels.get("angular_velocity_z", np.zeros(len(recording))))
    half = np.nan_to_num(turn) * (vehicle.track or 0.0) / 2
    hub = {w: speed + (half if w in machine.right else -half) for w in vehicle.wheels}

    def middle(values: dict[str, Floats], rows: Bools) -> float:
        """Median over the rows at which a wheel's own speed is measured, all wheels together."""
        pooled = np.concatenate([values[w][rows & measured[w]] for w in vehicle.wheels])
        return float(np.nanmedian(pooled)) if np.isfinite(pooled).any() else np.nan

    def of(quantity: str) -> dict[str, Floats]:
        return {w: estimates[quantity.format(w)] for w in vehicle.wheels}

    def ratio(rows: Bools) -> float:
        return float(np.nansum(estimates["nis"][rows]) / np.nansum(estimates["channels"][rows]))

    # Torques of the wheels come at different instants, so what one gets too much another gets too little.
    together: Floats = np.mean([estimates[f"adhesion_{w}"] for w in vehicle.wheels], axis=0)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # rows at rest are not looked at
        hub_slip = {w: 1 - hub[w] / (vehicle.wheel_radius[0] * of("wheel_speed_{}")[w]) for w in hub}
    return Verdict(
        log=Path(recording.source or "").name.split(".")[0],
        seconds=float(recording.time[-1] - recording.time[0]),
        held={name: 1 / period for name, period in held_periods(recording).items()},
        nis=ratio(~np.isin(estimates.event_codes, [EVENTS.index("standstill"), EVENTS.index("gap")])),
        nis_straight=ratio(turning < 0.1),
        standing=float(np.mean(estimates.event_codes == EVENTS.index("standstill"))),
        straight=sum(int((straight & measured[w]).sum()) for w in vehicle.wheels),
        slip=middle(of("slip_{}"), straight),
        hub_slip=middle(hub_slip, straight),
        slip_std=middle(of("slip_{}_std"), straight),
        adhesion=middle({w: np.asarray(together) for w in vehicle.wheels}, straight),
        adhesion_std=middle(of("adhesion_{}_std"), straight),
        resistance=middle(of("soil_resistance"), straight),
        resistance_std=middle(of("soil_resistance_std"), straight),
        on_the_spot=middle(of("slip_{}"), spot),
    )


def _last(values: Floats) -> Floats:
    """The last measured value at every row (n,), NaN before the first."""
    known = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(known >= 0, values[known], np.nan)


def verdicts(machine: Machine, data: Path, method: str, smooth: bool = False) -> list[Verdict]:
    """The figures of all logs of a machine."""
    vehicle, profile = vehicle_of(machine), HERE / machine.name / "profile.yaml"
    found = []
    for path in logs_of(machine, data):
        recording = read(path, profile)
        found.append(judge(machine, recording, vehicle, estimate(recording, vehicle, method, smooth=smooth)))
    return found


def table(found: list[Verdict]) -> str:
    """The figures as a Markdown table."""
    head = (
        "| log | s | at rest | NIS moving | NIS straight | straight rows "
        "| slip | hub slip | ± | adhesion | resistance | slip on the spot |"
    )
    rows = [
        f"| {v.log} | {v.seconds:.0f} | {100 * v.standing:.0f} % | {v.nis:.2f} | {v.nis_straight:.2f} | {v.straight} | {v.slip:.3f} | "
        f"{v.hub_slip:.3f} | {v.slip_std:.3f} | {v.adhesion:.3f} ± {v.adhesion_std:.3f} | "
        f"{v.resistance:.3f} ± {v.resistance_std:.3f} | {v.on_the_spot:.2f} |"
        for v in found
    ]
    return "\n".join([head, "|" + "---|" * 12, *rows])


def torque_scale(data: Path) -> str:
    """The Warthog's torque scale by the force balance, for the mass that its vehicle file supposes."""
    from terragrip.estimation.calibration.torque_scale import identify_torque_scale

    machine = MACHINES[1]
    vehicle = vehicle_of(machine)
    logs = [read(path, HERE / machine.name / "profile.yaml") for path in logs_of(machine, data)]
    found = identify_torque_scale(logs, vehicle)
    low, high = found.interval
    return (
        f"torque scale {found.value:.2f} (95 % {low:.2f} to {high:.2f}) at {vehicle.mass:g} kg, "
        f"{found.samples} samples: scale times mass is {found.value * vehicle.mass:.0f} kg "
        f"({low * vehicle.mass:.0f} to {high * vehicle.mass:.0f})"
    )


def main() -> None:
    """Print the tables."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--data", type=Path, default=HERE.parents[1] / "shared" / "data")
    arguments.add_argument("--method", default="kalman")
    arguments.add_argument("--smooth", action="store_true", help="run the logs backwards too")
    arguments.add_argument("--scale", action="store_true", help="the Warthog's torque scale too")
    given = arguments.parse_args()
    for machine in MACHINES:
        print(
            f"{machine.name}, method {given.method}\n\n{table(verdicts(machine, given.data, given.method, given.smooth))}\n"
        )
    if given.scale:
        print(torque_scale(given.data))


if __name__ == "__main__":
    main()

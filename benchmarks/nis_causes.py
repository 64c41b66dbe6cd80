"""Why the NIS of a channel of a measured log is not 1: what experiments on that log show, and the cause that they name.

For each mean outside what is good: what the typical row has (median over that of chi-square, so that a few rows do not count), the share
of the sum that a twentieth of the rows carries, the mean with this channel's noise halved and doubled, without accelerometer, without
yaw rate, and how far the wheels' adhesions walk together: the square of their sum's steps over the sum of their squares, which the model
takes to be 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from terragrip.estimation import Estimates
from terragrip.estimation.channel_nis import PREFIX, estimate_with_channel_nis
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

KINDS = {"wheel speeds": ("wheel_",), "ground speed": ("ground_",), "accelerometer": ("acceleration_",)}
MEDIAN = 0.455
"""Of chi-square with one degree of freedom."""
FEW = 0.05
"""Of the rows."""
TOGETHER = 0.2
"""Below this the wheels' adhesions go against each other."""
NEAR = 0.5
"""Share of the way (as a logarithm) to 1 that an experiment must make to name a cause."""


@dataclass(frozen=True)
class Shown:
    """What experiments show of one channel kind of one log; NaN where one does not apply."""

    mean: float
    typical: float
    carried: float
    halved: float
    doubled: float
    no_acceleration: float
    no_yaw: float
    together: float
    stale: bool

    @property
    def cause(self) -> str:
        """The cause that the experiments name, the most direct one first."""
        if self.together < TOGETHER and self.stale is False:
            return "sides go against each other: the wheels' adhesions walk apart, their sum does not"
        if self.stale and self.mean < 1 and self.typical < 0.2 * self.mean:
            return "a torque or pose that is held counts as noise in every row since; the few fresh rows carry the rest"
        for value, words in (
            (
                self.no_acceleration,
                "accelerometer and derived speed contradict each other: its window flattens starts and stops",
            ),
            (self.no_yaw, "turns: the yaw rate is not what the sides do"),
            (self.doubled, "noise understated, or errors that last"),
            (self.halved, "noise overstated: scatter and manoeuvre look alike"),
        ):
            if np.isfinite(value) and abs(np.log(value)) < (1 - NEAR) * abs(np.log(self.mean)):
                return words
        if self.carried > 0.5:
            return "few rows carry it: shocks, stops and starts"
        return "none of these experiments moves it half way to 1"


def values(estimates: Estimates, kind: str) -> Floats:
    """NIS of a kind of channel in the rows that move and carry no event, all its channels together."""
    names = [n for n in estimates if n.removeprefix(PREFIX).startswith(KINDS[kind]) and n.startswith(PREFIX)]
    rows = estimates.event_codes == 0
    parts = [estimates[n][rows & np.isfinite(estimates[n])] for n in names]
    return np.concatenate([*parts, np.empty(0)])


def together(estimates: Estimates) -> float:
    """Square of the steps of the adhesions' sum over the sum of their squares, moving rows; NaN of one wheel, or without adhesion."""
    names = [f"adhesion_{w}" for w in estimates.wheels]
    if len(names) < 2 or not all(n in estimates for n in names):
        return float("nan")
    steps = np.diff([estimates[n] for n in names], axis=1)
    moving = estimates.event_codes == 0
    steps = steps[:, moving[1:] & moving[:-1] & np.isfinite(steps).all(axis=0)]
    return float(np.mean(steps.sum(axis=0) ** 2) / np.mean((steps**2).sum(axis=0)))


def experiments(recording: Recording, vehicle: Vehicle, estimates: Estimates, kind: str) -> Shown:
    """Try the changes on one log, for one kind of channel."""
    noise = estimates.about["settings"]["noise"]
    starts = tuple(part.rstrip("_") for part in KINDS[kind])
    own = {n: sd for n, sd in noise.items() if n.startswith(starts) and n in recording.channels}

    def mean(log: Recording, factor: float = 1.0) -> float:
        changed = {n: factor * sd for n, sd in own.items() if n in log.channels}
        return float(np.mean(values(estimate_with_channel_nis(log, vehicle, sensors=changed), kind)))

    def without(name: str) -> float:
        if name not in recording.channels or name.startswith(starts):
            return float("nan")
        return mean(replace(recording, channels={n: v for n, v in recording.channels.items() if n != name}))

    now = values(estimates, kind)
    largest = np.sort(now)[-max(int(FEW * len(now)), 1) :]
    return Shown(
        float(np.mean(now)),
        float(np.median(now)) / MEDIAN,
        float(largest.sum() / now.sum()),
        mean(recording, 0.5),
        mean(recording, 2.0),
        without("acceleration_x"),
        without("angular_velocity_z"),
        together(estimates),
        any(n.startswith(("drive_torque", "wheel_speed")) for n in estimates.about["settings"]["held"]),
    )


def table(
    rows: list[tuple[str, str, Recording, Vehicle, Estimates, str]], cell: Callable[[float], str]
) -> str:
    """The rows (data, log, recording, vehicle, estimates, kind) as a table; ``cell`` writes a number."""
    head = ("data", "log", "channel", "NIS", "typical row", "a twentieth carries", "noise halved", "doubled", "no accelerometer",
            "no yaw rate", "adhesions together", "cause")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for data, log, recording, vehicle, estimates, kind in rows:
        shown = experiments(recording, vehicle, estimates, kind)
        figures = (shown.halved, shown.doubled, shown.no_acceleration, shown.no_yaw, shown.together)
        lines.append(
            f"| {data} | {log} | {kind} | {shown.mean:.2f} | {shown.typical:.2f} | {shown.carried:.0%} | "
            f"{' | '.join(map(cell, figures))} | {shown.cause} |"
        )
    return "\n".join(lines)

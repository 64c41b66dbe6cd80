"""Windows of one drive, laid one after another with gaps between: does anything carry over a gap, and do windows that meet agree?

Where one window begins as the one before it ends, by both rims, they are neighbours in the drive, and the ground speed should go on
too. Windows with a warning or `stuck` are counted as they lie in the log, and with each window estimated alone, by the noise of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.estimation import Estimates, estimate
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

GAP = 2.0
"""s: rows farther apart lie in two windows."""
ALIKE, TURNS = 0.05, 1.0
"""rad/s: rims of neighbours agree so far; and turn by more on the mean."""
WATCHED = ("immobilization", "stuck")


@dataclass(frozen=True)
class Windows:
    """Of one log: how many windows; how many of them meet, the jumps of mean rim speed and ground speed there [m/s] (n,); and which
    windows hold a warning or `stuck`, in the log and alone."""

    count: int
    rim_jumps: npt.NDArray[np.float64]
    ground_jumps: npt.NDArray[np.float64]
    in_log: frozenset[int]
    alone: frozenset[int]


def windows_of(recording: Recording, vehicle: Vehicle, estimates: Estimates) -> Windows:
    """What the windows of a log of speeds show."""
    starts = np.flatnonzero(np.diff(recording.time, prepend=-np.inf) > GAP)
    window = np.searchsorted(starts, np.arange(len(recording.time)), "right") - 1
    ends = np.append(starts[1:], len(recording.time)) - 1
    rims = np.stack([recording[f"wheel_speed_{w}"] for w in vehicle.wheels], axis=1)
    before, after = rims[ends[:-1]], rims[starts[1:]]
    meet = (np.abs(after - before) < ALIKE).all(axis=1) & (np.abs(before).mean(axis=1) > TURNS)
    jumps = np.abs(np.mean((after - before) * vehicle.wheel_radius, axis=1))[meet]
    ground = recording["ground_speed"]
    noise = {n: sd for n, sd in estimates.about["settings"]["noise"].items() if n in recording.channels}
    alone = frozenset(
        k
        for k in range(len(starts))
        if _warns(estimate(recording.select(window == k), vehicle, sensors=noise))[:-1].any()
    )
    warns = _warns(estimates)
    warns[ends] = False  # the row before a gap is `gap` in the log
    in_log = frozenset(int(k) for k in np.unique(window[warns]))
    return Windows(len(starts), jumps, np.abs(ground[starts[1:]] - ground[ends[:-1]])[meet], in_log, alone)


def _warns(estimates: Estimates) -> npt.NDArray[np.bool_]:
    return np.isin(estimates["event"], WATCHED)


def table(logs: list[tuple[str, str, Windows]]) -> str:
    """The logs (data, log, windows) as a table."""
    head = ("data", "log", "windows", "that meet", "rims jump, median (m/s)", "ground speed jumps, median", "95 %",
            "windows with a warning or `stuck`", "alone", "in the log only")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for data, log, w in logs:
        ground = f"{np.median(w.ground_jumps):.2f} | {np.percentile(w.ground_jumps, 95):.2f}"
        lines.append(
            f"| {data} | {log} | {w.count} | {len(w.ground_jumps)} | {np.median(w.rim_jumps):.2f} | {ground} | "
            f"{len(w.in_log)} | {len(w.alone)} | {len(w.in_log - w.alone)} |"
        )
    return "\n".join(lines)

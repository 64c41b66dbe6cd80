"""Why the NIS of a channel of a measured log is not 1: what experiments on that log show, and the cause that they name.

For each mean outside the good range: the typical row (median over that of chi-square, so that a few rows do not count), the share
of the sum that a twentieth of the rows carries, the mean with this channel's noise halved and doubled, without accelerometer, without
yaw rate, with a hundredth of the soil resistance's walk, with one fixed Q (method kalman), with the accelerometer's shocks counted once
and remembered ten times as long, over the rows whose rims are steady, and over the others; the correlation of successive innovations,
0 if they are white; and how far the wheels' adhesions vary together: the square of their sum's steps over the sum of their squares,
which the model takes to be 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip._kernel import lib
from terragrip.estimation import Estimates
from terragrip.estimation import estimator as estimator_module
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
ALIKE = 0.5
"""Above this successive innovations are not white."""
LARGEST = 4.0
"""SDs: an innovation beyond counts as this where successive ones are compared."""
AROUND, STEADY = 0.5, 0.1
"""Steady rims: from so many seconds before to so many after, and over the rows beside, they stay within this share of their speed."""
GAP = 2.0
"""s: rows farther apart are not compared."""
LEAST = 20
"""Rows of a mean."""


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
    calm_resistance: float
    fixed: float
    calm_shocks: float
    steady: float
    changing: float
    alike: float
    together: float
    stale: bool

    def near(self, value: float) -> bool:
        """Whether an experiment's mean has made its share of the way to 1."""
        return bool(np.isfinite(value) and abs(np.log(value)) < (1 - NEAR) * abs(np.log(self.mean)))

    def beyond(self, value: float) -> bool:
        """The same, or gone past 1."""
        most = (1 - NEAR) * np.log(self.mean)
        return bool(np.isfinite(value) and (np.log(value) < most if most > 0 else np.log(value) > most))

    @property
    def cause(self) -> str:
        """The cause that the experiments name, the most direct one first."""
        lasting = "smoothed before it was logged" if self.mean < 1 else "errors that last"
        for holds, words in (
            (
                self.stale and self.mean < 1 and self.typical < 0.2 * self.mean,
                "a held torque or pose counts as noise in every row since its sample; the few fresh rows carry the rest",
            ),
            (
                self.near(self.calm_resistance),
                "the model lets soil resistance vary, by the bank's scale even more in turns and starts; here it does not",
            ),
            (
                not self.stale and self.together < TOGETHER,
                "the sides work against each other: the wheels' adhesions diverge, their sum does not",
            ),
            (
                self.near(self.no_acceleration),
                "accelerometer and derived speed contradict each other: its window flattens starts and stops",
            ),
            (self.near(self.no_yaw), "turns: the yaw rate does not match the speeds of the sides"),
            (self.alike > ALIKE, f"{lasting}: successive innovations are correlated"),
            (self.mean > 1 and self.beyond(self.steady), "changing rim speeds: starts, stops and turns after a new command carry it"),
            (
                self.mean < 1 and self.steady < self.mean and self.near(self.changing),
                "process noise as large as starts and stops need: steady rows are below 1, the others near 1",
            ),
            (self.near(self.doubled), "noise understated"),
            (self.near(self.halved), "noise overstated: scatter and manoeuvre look alike"),
            (self.near(self.calm_shocks), "shocks at starts and bumps count twice, and for seconds afterwards"),
            (self.beyond(self.fixed), "the bank's scale: it is that of the turns and starts nearby"),
            (self.carried > 0.5, "few rows carry it: shocks, stops and starts"),
        ):  # fmt: skip
            if holds:
                return words
        return "none of these experiments moves it half way to 1"


def values(estimates: Estimates, kind: str, which: npt.NDArray[np.bool_] | None = None) -> Floats:
    """NIS of a kind of channel in the rows that move and carry no event, and of them ``which`` (n,), all its channels together."""
    names = [n for n in estimates if n.removeprefix(PREFIX).startswith(KINDS[kind]) and n.startswith(PREFIX)]
    rows = (estimates.event_codes == 0) & (True if which is None else which)
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


def alike(recording: Recording, estimates: Estimates, kind: str) -> float:
    """Correlation of successive innovations of moving rows over their SDs, all channels of a kind together; NaN where they cannot be had.

    An innovation has the sign of what the channel is beyond the row's estimate, which lies between prediction and measurement.
    """
    if len(recording.time) != len(estimates.time):
        return float("nan")
    before, after = [np.empty(0)], [np.empty(0)]
    for name in (n.removeprefix(PREFIX) for n in estimates if n.startswith(PREFIX)):
        if not name.startswith(KINDS[kind]) or name not in estimates or name not in recording.channels:
            continue
        nis = estimates[PREFIX + name]
        rows = np.flatnonzero((estimates.event_codes == 0) & np.isfinite(nis))
        white = np.sign(recording[name] - estimates[name])[rows] * np.minimum(np.sqrt(nis[rows]), LARGEST)
        one_drive = np.diff(recording.time[rows]) < GAP
        before.append(white[:-1][one_drive])
        after.append(white[1:][one_drive])
    left, right = np.concatenate(before), np.concatenate(after)
    return float(np.corrcoef(left, right)[0, 1]) if len(left) >= LEAST else float("nan")


def rims_are_steady(estimates: Estimates) -> npt.NDArray[np.bool_]:
    """Rows around which no rim's speed changes by more than its share (n,)."""
    time = estimates.time
    rows = zip(
        np.minimum(np.searchsorted(time, time - AROUND), np.maximum(np.arange(len(time)) - 1, 0)),
        np.maximum(
            np.searchsorted(time, time + AROUND, "right"), np.minimum(np.arange(len(time)) + 2, len(time))
        ),
        strict=True,
    )
    rims = np.abs(np.stack([estimates[f"wheel_speed_{w}"] for w in estimates.wheels], axis=1))
    spans = [(rims[i:j].min(axis=0), rims[i:j].max(axis=0)) for i, j in rows]
    return np.array([(high - low <= STEADY * high).all() for low, high in spans])


@contextmanager
def tuned(**factors: float) -> Iterator[None]:
    """Estimators are made with these tuned numbers (tg_tuned) times their factors."""
    as_set = estimator_module.settings_of

    def changed(*arguments: Any, **named: Any) -> Any:
        settings = as_set(*arguments, **named)
        for name, factor in factors.items():
            setattr(settings.tuned, name, factor * getattr(settings.tuned, name))
        lib.tg_tune_walks(settings)
        return settings

    estimator_module.settings_of = changed
    try:
        yield
    finally:
        estimator_module.settings_of = as_set


def experiments(recording: Recording, vehicle: Vehicle, estimates: Estimates, kind: str) -> Shown:
    """Try the changes on one log, for one kind of channel."""
    noise = estimates.about["settings"]["noise"]
    starts = tuple(part.rstrip("_") for part in KINDS[kind])
    own = {n: sd for n, sd in noise.items() if n.startswith(starts) and n in recording.channels}
    filtered = f"adhesion_{estimates.wheels[0]}" in estimates

    def mean(log: Recording, factor: float = 1.0, **options: Any) -> float:
        changed = {n: factor * sd for n, sd in own.items() if n in log.channels}
        return float(
            np.mean(values(estimate_with_channel_nis(log, vehicle, sensors=changed, **options), kind))
        )

    def without(name: str) -> float:
        if name not in recording.channels or name.startswith(starts):
            return float("nan")
        return mean(replace(recording, channels={n: v for n, v in recording.channels.items() if n != name}))

    def with_tuned(applies: bool, **factors: float) -> float:
        with tuned(**factors):
            return mean(recording) if applies else float("nan")

    now = values(estimates, kind)
    largest = np.sort(now)[-max(int(FEW * len(now)), 1) :]
    calm = rims_are_steady(estimates)
    steady, changing = values(estimates, kind, calm), values(estimates, kind, ~calm)
    held = estimates.about["settings"]["held"]
    return Shown(
        mean=float(np.mean(now)),
        typical=float(np.median(now)) / MEDIAN,
        carried=float(largest.sum() / now.sum()),
        halved=mean(recording, 0.5),
        doubled=mean(recording, 2.0),
        no_acceleration=without("acceleration_x"),
        no_yaw=without("angular_velocity_z"),
        calm_resistance=with_tuned(filtered, resistance_walk=0.01),
        fixed=mean(recording, method="kalman") if filtered else float("nan"),
        calm_shocks=with_tuned(kind == "accelerometer", shock_samples=0.5, shock_memory=10.0),
        steady=float(np.mean(steady)) if len(steady) >= LEAST else float("nan"),
        changing=float(np.mean(changing)) if len(changing) >= LEAST else float("nan"),
        alike=alike(recording, estimates, kind),
        together=together(estimates),
        stale=any(n.startswith(("drive_torque", "wheel_speed")) for n in held),
    )


def table(
    rows: list[tuple[str, str, Recording, Vehicle, Estimates, str]], cell: Callable[[float], str]
) -> str:
    """The rows (data, log, recording, vehicle, estimates, kind) as a table; ``cell`` writes a number."""
    head = ("data", "log", "channel", "NIS", "typical row", "largest twentieth", "noise halved", "doubled", "no accelerometer",
            "no yaw rate", "calm resistance", "fixed Q", "calm shocks", "rims steady", "rims change", "correlation",
            "sum of adhesions", "cause")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for data, log, recording, vehicle, estimates, kind in rows:
        shown = experiments(recording, vehicle, estimates, kind)
        figures = (
            shown.halved, shown.doubled, shown.no_acceleration, shown.no_yaw, shown.calm_resistance, shown.fixed,
            shown.calm_shocks, shown.steady, shown.changing, shown.alike, shown.together,
        )  # fmt: skip
        lines.append(
            f"| {data} | {log} | {kind} | {shown.mean:.2f} | {shown.typical:.2f} | {shown.carried:.0%} | "
            f"{' | '.join(map(cell, figures))} | {shown.cause} |"
        )
    return "\n".join(lines)

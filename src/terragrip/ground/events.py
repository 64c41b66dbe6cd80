"""What happened on a drive, and why: spells of the estimates' ``event`` column, each with one sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import Estimates
from terragrip.estimation.engine import EVENTS, watch_limits

Array = NDArray[np.float64]

CLOSE = 0.3
"""s: spells of one kind that lie closer are one event."""


@dataclass(frozen=True)
class Event:
    """Something that happened: ``kind`` (a text of :data:`~terragrip.estimation.engine.EVENTS`), ``start`` and ``end`` [s],
    ``why``: one sentence."""

    kind: str
    start: float
    end: float
    why: str

    def to_dict(self) -> dict[str, str | float]:
        """As ground.json holds it."""
        return {"kind": self.kind, "start": self.start, "end": self.end, "why": self.why}


def events(estimates: Estimates) -> tuple[Event, ...]:
    """All events of a table of estimates, in order of their start; of an empty table none.

    The estimator flags them while driving (docs/events.md); here each gets its reason, from the values at the time.
    """
    found = []
    for kind, rows in _spells(estimates):
        time = estimates.time[rows]
        found.append(Event(kind, float(time[0]), float(time[-1]), _WHY[kind](estimates, rows)))
    return tuple(sorted(found, key=lambda event: event.start))


def _spells(estimates: Estimates) -> list[tuple[str, NDArray[np.intp]]]:
    """Kind and rows of each spell; spells of one kind closer than CLOSE are one."""
    found = []
    for code, kind in enumerate(EVENTS):
        rows = np.flatnonzero(estimates.event_codes == code)
        if kind and len(rows):
            apart = (np.diff(estimates.time[rows]) > CLOSE) & (np.diff(rows) > 1)
            found += [(kind, part) for part in np.split(rows, np.flatnonzero(apart) + 1)]
    return found


def _mean(estimates: Estimates, quantity: str, rows: NDArray[np.intp]) -> Array:
    """Mean of a quantity over the wheels (rows,)."""
    return np.mean([estimates[f"{quantity}_{wheel}"][rows] for wheel in estimates.wheels], axis=0)


def _immobilization(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    limits, first = watch_limits(), rows[:1]
    before = _second_before(estimates, rows[0])
    slip, was = _mean(estimates, "slip", first)[0], np.nanmean(_mean(estimates, "slip", before))
    grip, had = _mean(estimates, "adhesion", first)[0], np.nanmean(_mean(estimates, "adhesion", before))
    speed, went = estimates["ground_speed"][rows[0]], np.nanmean(estimates["ground_speed"][before])
    rim = _rim_change(estimates, before, rows[0])
    return (
        f"The wheels begin to dig: within a second slip went from {was:.0%} to {slip:.0%} and ground speed from "
        f"{abs(went):.2f} to {abs(speed):.2f} m/s while the wheels {rim}, and adhesion went from {had:.2f} to {grip:.2f}: "
        f"the warning comes when slip above {limits['slip']:.0%} and well above its usual level rises for "
        f"{limits['duration']:g} s and brings less than "
        f"{limits['grip']:.0%} of the adhesion that the ground before gave at such slip, or rises beyond "
        f"{limits['high_slip']:.0%}."
    )


def _second_before(estimates: Estimates, row: np.intp) -> NDArray[np.intp]:
    """Rows about a second before a row, where there is nothing that early the first."""
    time = estimates.time
    last = int(np.searchsorted(time, time[row] - 0.8))
    first = int(np.searchsorted(time, time[row] - 1.2))
    moving = np.arange(first, max(last, first + 1))
    known = moving[np.isfinite(_mean(estimates, "slip", moving))]
    return known if len(known) else np.array([row])


def _rim_change(estimates: Estimates, before: NDArray[np.intp], row: np.intp) -> str:
    was = float(np.nanmean(np.abs(_mean(estimates, "wheel_speed", before))))
    now = float(np.abs(_mean(estimates, "wheel_speed", np.array([row]))[0]))
    if abs(now - was) < 0.1 * was:
        return f"kept turning at {now:.2f} rad/s"
    return f"{'slowed' if now < was else 'sped up'} from {was:.2f} to {now:.2f} rad/s"


def _stuck(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    limits = watch_limits()
    speed = float(np.nanmedian(np.abs(estimates["ground_speed"][rows])))
    turning = float(np.nanmedian(np.abs(_mean(estimates, "wheel_speed", rows))))
    adhesion = float(np.nanmedian(_mean(estimates, "adhesion", rows)))
    return (
        f"The wheels turn at {turning:.2f} rad/s and the vehicle moves at {speed:.2f} m/s, with adhesion at {adhesion:.2f} "
        f"from the drive torques: stuck where ground speed stays below {limits['stuck_travel']:.0%} of the wheels' rim speed, "
        f"free again above {limits['free_travel']:.0%}."
    )


def _push(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    limits = watch_limits()
    adhesion = float(np.nanmedian(_mean(estimates, "adhesion", rows)))
    resistance = float(np.nanmin(estimates["soil_resistance"][rows]))
    return (
        f"The wheels pull (adhesion {adhesion:.2f} from the drive torques) and yet something pushes from behind, as a tool that "
        f"runs up does: the drawbar force is negative by more than {limits['push']:.1%} of the weight, or the soil resistance, "
        f"down to {resistance:.2f}, is less than none."
    )


def _standstill(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    speed = estimates.about.get("settings", {}).get("standstill_speed") or watch_limits()["standstill_speed"]
    return (
        f"Neither the wheels' rims nor the vehicle moved faster than about {speed:g} m/s: slip and efficiency are undefined, "
        "adhesion and soil resistance are held."
    )


def _gap(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    gap = estimates.about.get("settings", {}).get("gap") or watch_limits()["gap"]
    return (
        f"No wheel speed or ground speed came for more than {gap:g} s, or none had come yet: the motion starts anew, "
        "what was known of the ground is kept with a wider spread."
    )


def _outlier(estimates: Estimates, rows: NDArray[np.intp]) -> str:
    nis, taken = estimates["nis"][rows], estimates["channels"][rows]
    worst = int(np.nanargmax(nis)) if np.isfinite(nis).any() else 0
    return (
        f"A value lay far from what the filter, or the channel's own past, led to expect (at {estimates.time[rows[worst]]:.2f} s "
        f"the squared innovation is {nis[worst]:.0f}, {taken[worst]:.0f} are usual): it was taken with little weight."
    )


_WHY: dict[str, Callable[[Estimates, NDArray[np.intp]], str]] = {
    "immobilization": _immobilization,
    "stuck": _stuck,
    "push": _push,
    "standstill": _standstill,
    "gap": _gap,
    "outlier": _outlier,
}

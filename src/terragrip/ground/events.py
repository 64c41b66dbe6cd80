"""What happened on a drive, and why: spells of the estimates' ``event`` column, each with one sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.estimation import Estimates
from terragrip.estimation.engine import EVENTS, digging_score, watch_limits
from terragrip.estimation.reference.immobilization import ASYMMETRY, GRIP, SIGNS, SLIP, Watch, rows_of

Array = NDArray[np.float64]

CLOSE = 0.3
"""s: spells of one kind that lie closer are one event."""

RECALL = 60.0
"""s before a warning from which its signs are worked out again: what is usual goes back 20 s."""
LEAST_GAIN = 0.5
"""Of the score: what adds less is no reason."""


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
    speed, went = estimates["ground_speed"][rows[0]], np.nanmean(estimates["ground_speed"][before])
    rim = _rim_change(estimates, before, rows[0])
    told = _leading_signs(estimates, int(rows[0]))
    return (
        f"The wheels begin to dig: within a second slip went from {was:.0%} to {slip:.0%} and ground speed from "
        f"{abs(went):.2f} to {abs(speed):.2f} m/s while the wheels {rim}{told}; the warning comes when the signs' "
        f"score, of how much they look like the 3 s before a full stop in simulated drives, is above {limits['warn']:g} over "
        f"{limits['memory']:g} s, and slip beyond {limits['high_slip']:.0%} adds to it by itself."
    )


def _leading_signs(estimates: Estimates, row: int) -> str:
    """What adds most to the score of a warning that starts at ``row``: each group of signs against what is usual."""
    if "vehicle" not in estimates.about:
        return ""
    first = int(np.searchsorted(estimates.time, estimates.time[row] - RECALL))
    watch, part = Watch(watch_limits()), slice(first, row + 1)
    measured = np.ones(len(estimates), bool)
    for seen in rows_of(estimates, measured, part):
        watch.take(seen)
    if not watch.signs.seen:
        return ""
    signs, means = dict(zip(SIGNS, watch.signs.features(), strict=True)), watch.signs.mean
    usual = float(means[SLIP, -1])
    ratio, grip = (float(np.exp(means[k, 1] - means[k, -1])) for k in (ASYMMETRY, GRIP))
    groups = {
        f"slip is {100 * (signs['slip_calm'] - usual):.0f} points above its usual {usual:.0%}, {signs['slip_unusual']:.1f} times its "
        "usual wandering": {"slip": usual, "slip_calm": usual, "slip_rise": 0.0, "slip_unusual": 0.0},
        f"the leading wheels' adhesion over the trailing ones' is {ratio:.0%} of the usual": {
            name: 0.0 for name in SIGNS if name.startswith("asymmetry")
        },
        f"adhesion is {grip:.0%} of what the ground before would give at such slip": {
            name: 0.0 for name in SIGNS if name.startswith(("grip", "adhesion", "resistance"))
        },
    }
    score = digging_score(list(signs.values()))
    gains = {text: score - digging_score(list((signs | calm).values())) for text, calm in groups.items()}
    leading = [text for text in sorted(gains, key=lambda text: -gains[text]) if gains[text] > LEAST_GAIN]
    return ", because " + ", and ".join(leading[:2]) if leading else ""


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
        f"from the drive torques: stuck where ground speed stays below {limits['stuck_travel']:.0%} of the wheels' rim speed "
        f"for {limits['stuck_duration']:g} s, free again above {limits['free_travel']:.0%}."
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

"""The events of a drive and their reasons: spells of the estimates' ``event`` column, each with one sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats, Ints
from terragrip.estimation import Estimates
from terragrip.estimation.columns import driven_of, wheels_with
from terragrip.estimation.engine import EVENTS, SIGNS
from terragrip.estimation.settings import WITHOUT_TORQUE, watch_limits
from terragrip.ground.span import Span

CLOSE = 0.3
"""s: spells of one kind that lie closer are one event."""

LEAST_POINTS = 0.3
"""Of a sign: fewer are no reason."""


@dataclass(frozen=True)
class Event(Span):
    """An event: ``kind`` (a text of :data:`~terragrip.estimation.engine.EVENTS`), ``start`` and ``end`` [s],
    ``why``: one sentence."""

    kind: str
    start: float
    end: float
    why: str = ""


def events(estimates: Estimates) -> tuple[Event, ...]:
    """All events of a table of estimates, in order of their start; none for an empty table.

    The estimator flags them while driving (docs/events.md); here each gets its reason, from the values at the time.
    """
    result = []
    for kind, rows in _spells(estimates):
        time = estimates.time[rows]
        result.append(Event(kind, float(time[0]), float(time[-1]), _WHY[kind](estimates, rows)))
    return tuple(sorted(result, key=lambda event: event.start))


def _spells(estimates: Estimates) -> list[tuple[str, Ints]]:
    """Kind and rows of each spell; spells of one kind closer than CLOSE are one."""
    result = []
    for code, kind in enumerate(EVENTS):
        rows = np.flatnonzero(estimates.event_codes == code)
        if kind and len(rows):
            apart = (np.diff(estimates.time[rows]) > CLOSE) & (np.diff(rows) > 1)
            result += [(kind, part) for part in np.split(rows, np.flatnonzero(apart) + 1)]
    return result


def _mean(estimates: Estimates, quantity: str, rows: Ints) -> Floats:
    """Mean of a quantity over the driven wheels (rows,)."""
    wheels = driven_of(estimates.wheels, estimates.about)
    return np.mean([estimates[f"{quantity}_{wheel}"][rows] for wheel in wheels], axis=0)


def _immobilization(estimates: Estimates, rows: Ints) -> str:
    """From the kernel's own signs and thresholds: columns ``warning``, ``warning_<sign>`` and tg_watch_settings."""
    limits, row = watch_limits(), rows[0]
    slip, speed = _mean(estimates, "slip", rows[:1])[0], abs(estimates["ground_speed"][row])
    text = f"The wheels begin to dig: mean slip of the wheels is {slip:.0%}, at {speed:.2f} m/s"
    if "warning" not in estimates:
        return text + "."
    known = {sign: f"warning_{sign}" for sign in SIGNS if f"warning_{sign}" in estimates}
    warns = limits["warn"] * (1.0 if estimates.has_adhesion else WITHOUT_TORQUE)
    points = dict.fromkeys(SIGNS, 0.0) | {sign: float(estimates[name][row]) for sign, name in known.items()}
    one_point = {"rise": limits["change"], "leading": limits["change"], "resistance": limits["resistance"]}
    change = {sign: points[sign] * least for sign, least in one_point.items()}
    most = max(points.values())
    sentence = {
        "rise": f"slip of the worst wheels rose by {change['rise']:.0%} or more",
        "high_slip": f"it is above {limits['high_slip']:.0%}",
        "leading": f"the leading wheels' adhesion against the trailing ones' fell by {change['leading']:.2f} or more below its usual",
        "resistance": f"soil resistance rose by {change['resistance']:.2f} or more",
    }
    reasons = [
        f"{sentence[sign]} ({points[sign]:.1f} points{', the most that count' if points[sign] >= limits['most'] == most else ''})"
        for sign in sorted(sentence, key=lambda sign: -points[sign])
        if points[sign] > LEAST_POINTS
    ]
    off = f", less {-points['command']:.1f} for speed gained" if points["command"] < -LEAST_POINTS else ""
    return (
        f"{text}, its usual {estimates['warning_usual_slip'][row]:.0%}; {', '.join(reasons) or 'the signs of just before'}{off}; "
        f"their sum, low-passed, is {estimates['warning'][row]:.1f} and warns above {warns:.2g}."
    )


def _stuck(estimates: Estimates, rows: Ints) -> str:
    limits = watch_limits()
    speed = float(np.nanmedian(np.abs(estimates["ground_speed"][rows])))
    turn = "turn"
    if wheels_with("wheel_speed", estimates.columns):  # a drive train without a known radius has none
        turning = float(np.nanmedian(np.abs(_mean(estimates, "wheel_speed", rows))))
        turn = f"turn at {turning:.2f} rad/s"
    by_torque = ""
    adhesions = _mean(estimates, "adhesion", rows) if estimates.has_adhesion else np.full(1, np.nan)
    if np.isfinite(adhesions).any():  # an engine's torque is not known in every row
        adhesion = float(np.nanmedian(adhesions))
        by_torque = f", with adhesion at {adhesion:.2f} from the drive torques"
    return (
        f"The wheels {turn} and the vehicle moves at {speed:.2f} m/s{by_torque}: "
        f"stuck where ground speed stays below {limits['stuck_travel']:.0%} of the wheels' rim speed "
        f"for {limits['stuck_duration']:g} s, free again above {limits['free_travel']:.0%}."
    )


def _push(estimates: Estimates, rows: Ints) -> str:
    limits = watch_limits()
    adhesion = float(np.nanmedian(_mean(estimates, "adhesion", rows)))
    resistance, std = (estimates[name][rows] for name in ("soil_resistance", "soil_resistance_std"))
    shows = f"the drawbar force is negative by more than {limits['push']:.1%} of the weight"
    if np.nanmin(resistance + 2 * std) < 0:
        shows = f"the soil resistance, down to {np.nanmin(resistance):.2f}, is negative by more than two standard deviations"
    return (
        f"The wheels pull (adhesion {adhesion:.2f} from the drive torques) but something pushes from behind, such as a tool that "
        f"runs up: {shows}."
    )


def _standstill(estimates: Estimates, rows: Ints) -> str:
    speed = estimates.about.get("settings", {}).get("standstill_speed") or watch_limits()["standstill_speed"]
    return (
        f"Neither the wheels' rims nor the vehicle moved faster than about {speed:.2g} m/s: slip and efficiency are undefined, "
        "adhesion and soil resistance are held."
    )


def _gap(estimates: Estimates, rows: Ints) -> str:
    gap = estimates.about.get("settings", {}).get("gap") or watch_limits()["gap"]
    if "soil_resistance" in estimates.columns and np.isnan(estimates["soil_resistance"][rows]).all():
        return (
            f"A wheel's speed, a drive torque or the drawbar force did not come for more than {gap:g} s, or had not come yet: adhesion, "
            "net traction, efficiency and soil resistance are unknown, and so is the slip of a wheel without a speed."
        )
    goes_on = (estimates["channels"][rows] > 0) & np.isfinite(_mean(estimates, "slip", rows))
    if estimates.has_adhesion and np.mean(goes_on) > 0.5:
        return (
            f"The wheels' speeds came, but no ground speed for more than {gap:g} s: speed and slip are reckoned from the wheels and "
            "the slips so far, with wide intervals; spinning and being stuck are not seen, and adhesion goes on from the torques."
        )
    return (
        f"No wheel speed or ground speed came for more than {gap:g} s, or none had come yet: the motion starts again; "
        "what was known of the ground is kept with a wider spread."
    )


def _outlier(estimates: Estimates, rows: Ints) -> str:
    nis, channels = estimates["nis"][rows], estimates["channels"][rows]
    worst = int(np.nanargmax(nis)) if np.isfinite(nis).any() else 0
    return (
        f"A value lay far from what the filter, or the channel's own past, led to expect (at {estimates.time[rows[worst]]:.2f} s "
        f"the squared innovation is {nis[worst]:.0f}, {channels[worst]:.0f} are usual): it was used with little weight."
    )


def _restart(estimates: Estimates, rows: Ints) -> str:
    return (
        f"A filter step gave numbers that are not finite (at {estimates.time[rows[0]]:.2f} s): it restarted from the priors; what it had "
        "learned of adhesion and soil resistance is lost."
    )


_WHY: dict[str, Callable[[Estimates, Ints], str]] = {
    "immobilization": _immobilization,
    "stuck": _stuck,
    "push": _push,
    "standstill": _standstill,
    "gap": _gap,
    "outlier": _outlier,
    "restart": _restart,
}

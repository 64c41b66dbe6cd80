"""The summary of a table of estimates as text."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from terragrip.estimation.engine import EVENTS

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


def summary(estimates: Estimates) -> str:
    """Rows, duration, defects met, consistency, medians with their spreads, and notes; lines of text."""
    lines = [*_extent(estimates), *_defects(estimates), *_consistency(estimates), *_medians(estimates)]
    return "\n".join([*lines, *(f"Note: {note}" for note in estimates.notes)])


def _extent(estimates: Estimates) -> list[str]:
    time = estimates.time
    duration = float(time[-1] - time[0])
    length = float(np.nanmax(estimates["distance"])) if "distance" in estimates else 0.0
    smooth = ", smoothed" if estimates.about.get("smooth") else ""
    return [
        f"{len(estimates)} rows, {duration:.1f} s, {length:.1f} m, {len(estimates.wheels)} wheels, "
        f"method {estimates.method or 'unknown'}{smooth}"
    ]


def _defects(estimates: Estimates) -> list[str]:
    codes = estimates.event_codes
    lines = []
    held = estimates.about.get("settings", {}).get("held", {})
    if held:
        shown = ", ".join(f"{name} ({1 / period:.3g} Hz)" for name, period in held.items())
        lines.append(f"Held channels, taken as missing between their updates: {shown}")
    counts = []
    for code, event in enumerate(EVENTS):
        rows = codes == code
        if event and rows.any():
            starts = int(np.count_nonzero(rows[1:] & ~rows[:-1]) + rows[0])
            counts.append(f"{event} {starts} ({int(rows.sum())} rows)")
    lines.append(f"Events: {', '.join(counts) if counts else 'none'}")
    return lines


def _consistency(estimates: Estimates) -> list[str]:
    if "nis" not in estimates or "channels" not in estimates:
        return []
    taken = float(np.nansum(estimates["channels"]))
    if taken == 0:
        return []
    ratio = float(np.nansum(estimates["nis"])) / taken
    verdict = (
        "as expected"
        if 0.7 < ratio < 1.4
        else "spreads may be too wide"
        if ratio < 1
        else "spreads may be too narrow"
    )
    return [f"Normalised innovation squared a channel: {ratio:.2f}, expected 1 ({verdict})"]


def _medians(estimates: Estimates) -> list[str]:
    moving = estimates.event_codes == 0
    if not moving.any():
        return ["No row without an event."]
    wheels = estimates.wheels
    rows = [("ground speed", "ground_speed", " m/s"), ("soil resistance", "soil_resistance", "")]
    for quantity, column in (("adhesion", "adhesion"), ("slip", "slip"), ("efficiency", "efficiency")):
        rows += [(f"{quantity} {wheel}", f"{column}_{wheel}", "") for wheel in wheels]
    lines = ["Medians (± 1 standard deviation) while moving:"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may be all NaN
        for title, column, unit in rows:
            value = np.nanmedian(estimates[column][moving])
            spread = np.nanmedian(estimates[f"{column}_std"][moving])
            lines.append(f"  {title:<18} {value:8.3f} ± {spread:.3f}{unit}")
    return lines

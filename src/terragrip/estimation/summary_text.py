"""The summary of estimates on one screen: what was driven, medians with intervals by label, what is assumed, what to do next."""

from __future__ import annotations

import warnings
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from terragrip.estimation.columns import driven_of
from terragrip.estimation.consistency import NORMAL_95
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.provenance import measures
from terragrip.note_pages import with_page

if TYPE_CHECKING:
    from terragrip.estimation.summary import Tally

Columns = dict[str, npt.NDArray[Any]]

_EXPECTED = (0.7, 1.4)  # of the normalised innovation squared a channel
_MOST_LABELS = 8  # rows of the table
_DOUBTFUL = (
    "check ",
    "Check ",
    "may be in ",
    "may not be in ",
    "written as hhmmss",
    "write 'sign: -1'",
    "converted from km/h",
    "in reverse turns",
    "are wrong there",
)


def summary_text(tally: Tally, notes: tuple[str, ...], output: str | None) -> str:
    """The lines of a summary; ``output``: the file of the estimates."""
    columns = tally.columns
    lines = [_driven(tally), _events(tally)]
    if len(columns.get("label", ())):
        lines += [*_by_label(tally, columns), *_by_wheel(tally, columns)]
    else:
        lines.append("There is no row without an event: no medians.")
    lines += [*_consistency(tally), *_assumed(tally)]
    lines += [f"Note: {with_page(note)}" for note in notes]
    return "\n".join([*lines, f"Next: {_next(tally, notes, output)}"])


def _driven(tally: Tally) -> str:
    smooth = ", smoothed" if tally.about.get("smooth") else ""
    machine = tally.about.get("vehicle", {}).get("name") or "the vehicle"
    wheels = (
        "its drive as one wheel"
        if tally.wheels == ("drive",) or "driveline" in tally.about
        else f"{len(tally.wheels)} wheel{'s' * (len(tally.wheels) != 1)}"
    )
    return (
        f"{machine} ({wheels}): {tally.distance:.1f} m in {_time(tally.duration)}, {_time(sum(tally.moving.values()))} of it moving "
        f"without an event; {tally.rows} rows, method {tally.about.get('method', 'unknown')}{smooth}"
    )


def _time(seconds: float) -> str:
    """Seconds below ten minutes, else minutes."""
    return f"{seconds:.1f} s" if seconds < 600 else f"{seconds / 60:.1f} min"


def _events(tally: Tally) -> str:
    met = [
        f"{event} {tally.event_starts[code]} ({tally.event_rows[code]} rows)"
        for code, event in enumerate(EVENTS)
        if event and tally.event_rows[code]
    ]
    return f"Events: {', '.join(met)} (docs: events)" if met else "Events: none"


def _by_label(tally: Tally, columns: Columns) -> list[str]:
    """A table: a row a label (at most some, the longest driven), a column a quantity, the mean over the driven wheels."""
    shown = [
        name for name in ("ground_speed", *_by_each(tally), "soil_resistance") if _names(tally, name, columns)
    ]
    labels = sorted((name for name in tally.moving if name), key=lambda name: -tally.moving[name])
    rows = [("all", np.ones(len(columns["label"]), dtype=bool), sum(tally.moving.values()))]
    if len(labels) == 1 and not tally.moving.get(""):
        rows = [(f"all: {labels[0]}", *rows[0][1:])]
    elif labels:
        rows += [(name, columns["label"] == name, tally.moving[name]) for name in labels[:_MOST_LABELS]]
        rows += [("no label", columns["label"] == "", tally.moving[""])] if tally.moving.get("") else []
    width = max(12, *(len(name) + 2 for name, _, _ in rows))
    wheels = "" if len(tally.wheels) < 2 else ", the mean over the driven wheels"
    lines = [f"Medians ± half the 95 % interval{wheels}:"]
    units = {"ground_speed": "speed m/s"}
    head = "".join(units.get(name, name.replace("_", " ")).rjust(17) for name in shown)
    lines.append("  " + "".ljust(width) + "time".rjust(9) + head)
    for name, chosen, lasted in rows:
        cells = "".join(
            _mean_cell(columns, _names(tally, quantity, columns), chosen).rjust(17) for quantity in shown
        )
        lines.append("  " + name.ljust(width) + _time(lasted).rjust(9) + cells)
    if len(labels) > _MOST_LABELS:
        lines.append(f"  and {len(labels) - _MOST_LABELS} more labels")
    return lines


def _by_wheel(tally: Tally, columns: Columns) -> list[str]:
    """A table of the wheels, where there are several: a row a quantity."""
    if len(tally.wheels) < 2:
        return []
    lines = ["  " + "by wheel".ljust(12) + "".join(wheel.rjust(17) for wheel in tally.wheels)]
    every = np.ones(len(columns["label"]), dtype=bool)
    for quantity in _by_each(tally):
        if f"{quantity}_{tally.wheels[0]}" in columns:
            cells = "".join(
                _mean_cell(columns, [f"{quantity}_{wheel}"], every).rjust(17) for wheel in tally.wheels
            )
            lines.append("  " + quantity.ljust(12) + cells)
    return lines


def _by_each(tally: Tally) -> tuple[str, ...]:
    """What is shown of each wheel: an efficiency where the pull is measured, or the vehicle file says how large it may be."""
    stated = _uncertainty(tally).get("drawbar_force") is not None
    return (
        ("slip", "adhesion", "efficiency")
        if stated or measures(tally.about, "drawbar_force")
        else ("slip", "adhesion")
    )


def _uncertainty(tally: Tally) -> dict[str, float | None]:
    return tally.about.get("vehicle", {}).get("uncertainty") or {}


def _names(tally: Tally, quantity: str, columns: Columns) -> list[str]:
    """Columns of a quantity: the vehicle's, else those of the driven wheels."""
    if quantity in ("ground_speed", "soil_resistance"):
        return [quantity] if quantity in columns else []
    return [f"{quantity}_{w}" for w in driven_of(tally.wheels, tally.about) if f"{quantity}_{w}" in columns]


def _mean_cell(columns: Columns, names: list[str], chosen: npt.NDArray[np.bool_]) -> str:
    """Mean over columns of their medians and of their median standard deviations, over the chosen rows; an efficiency only where its
    interval does not hold all that it can be."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may be all NaN, or no row chosen
        value = np.mean([np.nanmedian(columns[name][chosen]) for name in names])
        spread = np.mean([np.nanmedian(columns[f"{name}_std"][chosen]) for name in names])
    if names[0].startswith("efficiency_") and NORMAL_95 * spread > 0.5:
        return "not known"
    return f"{value:.3f} ± {NORMAL_95 * spread:.3f}" if np.isfinite(value) else "-"


def _consistency(tally: Tally) -> list[str]:
    if not tally.channels:
        return []
    ratio, (low, high) = tally.nis / tally.channels, _EXPECTED
    verdict = "as expected"
    if not low < ratio < high:
        way = "high" if ratio < 1 else "low"
        verdict = f"the noise may be set too {way}; docs: vehicle#noise-of-the-sensors"
    return [f"Normalised innovation squared a channel: {ratio:.2f}, expected 1 ({verdict})"]


def _assumed(tally: Tally) -> list[str]:
    """What the estimates rest on that the log does not show."""
    vehicle, assumptions = tally.about.get("vehicle", {}), []
    other = (
        ("drawbar_force",) if measures(tally.about, "drawbar_force") else ("drawbar_gain", "drawbar_offset")
    )
    given = {name: value for name, value in _uncertainty(tally).items() if value and name not in other}
    if given:
        assumptions.append(
            "considered as unknown "
            + ", ".join(f"{name} ±{_short(name, value)}" for name, value in given.items())
        )
    elif tally.about.get("method") != "slip-only":
        assumptions.append(
            "no constant is considered as unknown, so the intervals cover the sensors' noise alone ('uncertainty' in the vehicle file)"
        )
    if vehicle and not vehicle.get("calibration"):
        assumptions.append("the vehicle is not calibrated")
    held = tally.about.get("settings", {}).get("held", {})
    if held:
        assumptions.append(
            "repeated values are missing ones, of "
            + ", ".join(f"{n} ({1 / p:.3g} Hz)" for n, p in held.items())
        )
    return [f"Assumed: {'; '.join(assumptions)}."] if assumptions else []


def _short(name: str, value: float) -> str:
    """A considered spread with its unit."""
    if name in ("slope", "pitch_offset"):
        return f"{np.rad2deg(value):.2g} deg"
    unit = {
        "drive_torque_offset": " N m",
        "drawbar_offset": " N",
        "drawbar_force": " N",
        "hitch_load_offset": " N",
        "acceleration_bias": " m/s²",
        "tire_rolling_resistance": "",
    }
    shown = value if name in unit else 100 * value
    return f"{float(f'{shown:.2g}'):g}{unit.get(name, ' %')}"


def _next(tally: Tally, notes: tuple[str, ...], output: str | None) -> str:
    """What to do next, one sentence."""
    file = output or "ESTIMATES"
    if any(doubt in note for note in notes for doubt in _DOUBTFUL):
        return "correct the units and signs that the notes question in a profile, and estimate again ('terragrip inspect LOG')."
    if not tally.sample or not len(tally.columns["label"]):
        return "see what the log contains ('terragrip inspect LOG')."
    if tally.about.get("method") == "slip-only":
        calibrated = tally.about.get("vehicle", {}).get("calibration")
        light = "" if calibrated else "'terragrip calibrate' on a pass without load makes slip absolute; "
        return f"{light}'terragrip report {file} -o report.html' shows slip over time and place."
    if not file.endswith(".parquet") and output is not None:
        return f"estimate again into a Parquet file ('-o {PurePath(file).with_suffix('.parquet')}') for the commands that go on from it."
    labels = [name for name in tally.moving if name]
    if labels:
        return f"'terragrip soils {file} -o soils.json' learns a curve of each soil, best from five drives or more."
    return f"'terragrip ground {file} -o ground.json' finds where the ground changes; 'terragrip report {file} -o report.html' shows all."

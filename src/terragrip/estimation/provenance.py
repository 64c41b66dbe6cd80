"""What a table of estimates was made from, as its metadata hold it, and the sentences that go with it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.consistency import NORMAL_95
from terragrip.estimation.methods import SLIP_ONLY
from terragrip.note_pages import is_of_scale
from terragrip.recording import unit_warnings
from terragrip.recording.brake import braked
from terragrip.recording.checks import NOTHING_TOWED
from terragrip.recording.clock import clock_text

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.recording import Recording

_PUSHED = (
    0.05  # of the rows without another event than a push: twice what 95 % intervals may miss on one side
)
_FEWEST = 20  # rows


def about_recording(recording: Recording) -> dict[str, Any]:
    """The log of a table: source and SHA-256, the clock time of its first row (``start``) and of its time 0 (``time_zero``) where
    it has them, and the profile that it was read by (a list, of several)."""
    about: dict[str, Any] = {"source": recording.source, "sha256": recording.sha256}
    zero = recording.clock_zero
    if zero is not None:
        about |= {"start": clock_text(zero + float(recording.time[0])), "time_zero": clock_text(zero)}
    if recording.profiles:
        profiles = [dict(profile) for profile in recording.profiles]
        about["profile"] = profiles[0] if len(profiles) == 1 else profiles
    return about


def about_run(estimator: TractionEstimator, recording: dict[str, Any], *, smooth: bool) -> dict[str, Any]:
    """What the table was made from, ready for JSON."""
    from terragrip import __version__

    about = {
        "version": __version__,
        "method": estimator.method,
        "smooth": smooth,
        "vehicle": estimator.vehicle.to_dict(),
        "recording": recording,
        "settings": {
            "noise": estimator.noise,
            "held": estimator.held,
            "gap": estimator.thresholds.gap,
            "standstill_speed": estimator.engine.standstill_speed,
            "channels": sorted(estimator.channels),
        },
    }
    if estimator.turn is not None:
        about["turn"] = "positions"
    if estimator.slip_reference is not None:
        about["zero_slip"] = {wheel: asdict(zero) for wheel, zero in estimator.slip_reference.zero.items()}
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain


def settings_of(
    about: Mapping[str, Any], file: str | os.PathLike[str], *needed: str, place: str | None = None
) -> dict[str, Any]:
    """The settings that `about_run` wrote, to estimate by again; raises InputError where those ``needed`` are not all there and sound."""
    known, hint = about.get("settings"), "estimate the log again with this version"
    if not isinstance(known, dict) or not {"noise", "held"} <= set(known):
        raise InputError("contains no settings", file=file, place=place, hint=hint)
    for name in ("noise", "held", *needed, *({"cycle"} & set(known))):
        value = known.get(name, "nothing")
        if name == "channels":
            sound = isinstance(value, list) and all(isinstance(one, str) for one in value)
        elif name in ("noise", "held"):
            sound = isinstance(value, dict) and all(map(_is_number, value.values()))
        else:
            sound = value is None or _is_number(value)
        if not sound:
            raise InputError(f"has {str(value)[:40]} as its {name}", file=file, place=place, hint=hint)
    return known


def measures(about: Mapping[str, Any], channel: str) -> bool:
    """Whether a channel is in the log of estimates with this origin; True where it does not say what is."""
    channels = about.get("settings", {}).get("channels")
    return not channels or channel in channels


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def notes_of(estimator: TractionEstimator, recording: Recording) -> tuple[str, ...]:
    """Sentences of the reader, on units that are likely wrong, and on what the estimator had to assume."""
    notes = [*recording.notes, *unit_warnings(recording, estimator.vehicle)]
    braking = float(braked(recording).mean())
    if braking > 0 and estimator.method != SLIP_ONLY.name:
        notes.append(
            f"A brake acts in {100 * braking:.2g} % of the log: there adhesion follows the motion alone, and a wheel's own is not known."
        )
    guessed = [name for name in estimator.guessed if name in recording.channels]
    if guessed:
        shown = ", ".join(f"{name} ({estimator.noise[name]:.3g})" for name in guessed)
        notes.append(f"The noise of {shown} is a guess from the vehicle's size: give it under 'sensors'.")
    rolling = () if estimator.rims else estimator.vehicle.rolling_wheels(estimator.channels)
    if rolling:
        notes.append(
            f"No speed of {', '.join(rolling)} in the log: taken to roll with the ground, with a slip of 0."
        )
    if estimator.slip_reference is not None or estimator.vehicle.uncertainty.drawbar_force is not None:
        notes = [note for note in notes if note != NOTHING_TOWED]
    if estimator.slip_reference is not None:
        notes += estimator.slip_reference.notes
    return tuple(dict.fromkeys(notes))


def with_push_note(parts: Iterator[Estimates]) -> Iterator[Estimates]:
    """The parts of a log's estimates, the last with a sentence where the intervals of soil resistance are below 0 too often: no ground
    pushes a vehicle. None where a unit, a scale or a sign is named already, from which that follows."""
    below = rows = 0
    last: Estimates | None = None
    for part in parts:
        if last is not None:
            yield last
        last = part
        if "soil_resistance" in part:
            free = part["soil_resistance"] + NORMAL_95 * part["soil_resistance_std"]
            free = free[((part.event_codes == 0) | part.during("push")) & np.isfinite(free)]
            below, rows = below + int(np.sum(free < 0)), rows + len(free)
    if last is not None:
        share = f"{below / max(rows, 1):.0%} of the rows without another event than a push"
        note = (
            f"soil_resistance and its interval are below 0 in {share}, but no ground pushes a vehicle: check the torques (sign, scale, "
            "zero, what a driver subtracts for friction), drawbar_force, mass and tire_rolling_resistance; a slope downhill, or another "
            "machine that pushes, does this, too, where nothing measures it."
        )
        is_new = below >= max(_FEWEST, _PUSHED * rows) and not any(map(is_of_scale, last.notes))
        yield replace(last, notes=(*last.notes, note)) if is_new else last

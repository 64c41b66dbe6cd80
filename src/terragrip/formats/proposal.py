"""A profile to begin with, written out as YAML with its doubts beside it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from terragrip.formats.recognition import Proposal
from terragrip.formats.table import LogTable
from terragrip.recording import Recording
from terragrip.recording.schema import wheel_names_in

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*$")
_LIKE_YAML = {"yes", "no", "on", "off", "true", "false", "null", "y", "n"}


def missing_channels(proposals: Mapping[str, Proposal], has_time: bool) -> list[str]:
    """What no column was found for, and what follows, as sentences."""
    said = [] if has_time else ["No time column was found: it is needed, in seconds that run forward."]
    wheels = [w for w in wheel_names_in(proposals) if f"wheel_speed_{w}" in proposals]
    if not wheels:
        said.append("No wheel speed was found: nothing can be estimated without.")
    if "ground_speed" not in proposals:
        said.append(
            "No ground speed was found: there is no slip and no resistance without; positions will do."
        )
    said += [
        f"No drive torque was found for wheel {wheel}: its axle must be undriven."
        for wheel in wheels
        if f"drive_torque_{wheel}" not in proposals
    ]
    if "drawbar_force" not in proposals:
        said.append("No drawbar force was found: the vehicle is taken to tow nothing.")
    if "acceleration_x" not in proposals:
        said.append(
            "No acceleration_x was found: soil resistance is estimated from speed alone, more slowly."
        )
    if "pitch" not in proposals:
        said.append("No pitch was found: the ground is taken as level, and a slope reads as soil resistance.")
    return said


def is_ready(recording: Recording) -> bool:
    """Whether the recording has what estimates need of it: with speeds alone there is slip."""
    return "ground_speed" in recording and (bool(recording.wheels) or "wheel_based_speed" in recording)


def profile_text(
    file: str,
    stamp: tuple[str, str] | None,
    proposals: Mapping[str, Proposal],
    table: LogTable,
    time: npt.NDArray[np.float64] | None,
) -> str:
    """A profile as YAML: loads as it stands, with a question mark at every line that was guessed."""
    lines = [f"# Proposed by 'terragrip inspect' for {file}. Check every line; '?' marks a doubt."]
    if stamp is None:
        lines.append("# time: {from: ???, unit: s}   # needed: no column looked like time")
    else:
        column, unit = stamp
        dated = table.columns[column].dtype.kind == "M"
        entry: dict[str, object] = (
            {"from": column} if dated or unit == "s" else {"from": column, "unit": unit}
        )
        since_1970 = time is not None and len(time) > 0 and (dated or _is_large(table.columns[column], unit))
        lines.append(f"time: {_flow(entry | ({'zero': 'first'} if since_1970 else {}))}")
    lines.append("channels:" if proposals else "channels: {}")
    for channel in sorted(proposals, key=_order):
        proposal = proposals[channel]
        doubt = f"   # ? {proposal.doubt}" if proposal.doubt else ""
        lines.append(f"  {channel}: {_flow(proposal.entry)}{doubt}")
    if not wheel_names_in(proposals):
        lines.append("  # wheel_speed_fl: {from: ???, unit: rad/s}   # needed: one for each wheel")
    if "ground_speed" not in proposals:
        lines.append("  # ground_speed: {from: ???, unit: m/s}   # needed: or derivative_of two positions")
    if not any(channel.startswith("drive_torque_") for channel in proposals):
        lines.append("  # drive_torque_fl: {from: ???, unit: N m}   # needed for each driven wheel")
    return "\n".join(lines) + "\n"


def _order(channel: str) -> tuple[int, str]:
    first = ("wheel_speed_", "drive_torque_", "ground_speed", "drawbar_force")
    return next((k for k, prefix in enumerate(first) if channel.startswith(prefix)), len(first)), channel


def _is_large(column: npt.NDArray[np.generic], unit: str) -> bool:
    scale = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}.get(unit, 1.0)
    return bool(abs(float(column[0])) * scale > 1e8)


def _flow(entry: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {_scalar(value)}" for key, value in entry.items()) + "}"


def _scalar(value: object) -> str:
    if isinstance(value, Mapping):
        return _flow(value)
    if isinstance(value, list):
        return "[" + ", ".join(_scalar(item) for item in value) + "]"
    text = str(value)
    if not isinstance(value, str) or re.fullmatch(r"[\d.]+ s", text):
        return text
    known_unit = re.fullmatch(r"[A-Za-z]+([/ ][A-Za-z]+(\^\d)?)?", text) is not None
    safe = (_PLAIN.match(text) or known_unit) and text.lower() not in _LIKE_YAML
    return text if safe else json.dumps(text, ensure_ascii=False)

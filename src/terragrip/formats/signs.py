"""Signs in proposals: what the checks of a recording say of a log as the proposed profile reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.recognition import Proposals
from terragrip.recording import Recording
from terragrip.recording.plausibility import wrong_signs
from terragrip.recording.schema import split_channel
from terragrip.vehicle import Vehicle

_FAST = 0.3  # of what a twentieth of the drive exceeds
_MOSTLY = 0.75  # of such rows
_WHICH = ": 'sign: -1', for it or for that one?"
_FORCES = ("drive_torque_", "drawbar_force")


def add_signs(proposals: Proposals, recording: Recording, vehicle: Vehicle | None = None) -> None:
    """Give ``sign: -1`` to proposals whose channels the motion shows to be of the opposite sign, and a doubt where it does not decide.

    ``recording``: the log as a profile of these proposals reads it. A ``vehicle`` counts only where it has these wheels, and no number of
    their proposals is left to the user: its forces need torques in N m.
    """
    of_wheels = {c: p for c, p in proposals.items() if c.startswith(("wheel_speed_", "drive_torque_"))}
    known = () if vehicle is None else vehicle.wheels
    fits = all(not p.give and (split_channel(c) or ("", ""))[1] in known for c, p in of_wheels.items())
    machine = vehicle if fits else None
    turned: set[str] = set()
    while True:  # speeds first, then the torques and turns that are judged by them, one by one
        notes = wrong_signs(recording, machine)
        named = {c: note for note in notes for c in note.channels if c in proposals and c not in turned}
        for channel, note in named.items():
            proposals[channel] = (
                _turned(proposals[channel], note.shown)
                if note.sure
                else _doubted(proposals[channel], note.shown + _WHICH * (not note.shown.endswith("?")))
            )
        turned |= named.keys()
        if not named:
            break
        opposite = {c: -recording[c] for c, note in named.items() if note.sure}
        recording = recording.with_channels(**opposite)
    for channel, (share, is_large) in _negative(recording).items():
        speed = channel.replace("drive_torque_", "wheel_speed_")
        if channel in turned or channel not in proposals:
            continue
        if is_large and share > _MOSTLY:
            text = "is negative in most of the drive: 'sign: -1'?"
            proposals[channel] = _doubted(proposals[channel], text)
        elif speed in turned and "sign" in proposals[speed].entry and share > 1 - _MOSTLY:
            text = "its wheel's speed counts backward: 'sign: -1' here, too?"
            proposals[channel] = _doubted(proposals[channel], text)


def _turned(proposal: Proposal, shown: str) -> Proposal:
    return replace(
        proposal,
        entry={**proposal.entry, "sign": -1},
        evidence=(*proposal.evidence, f"with 'sign: -1': {shown}"),
    )


def _doubted(proposal: Proposal, doubt: str) -> Proposal:
    doubts = "; ".join(filter(None, (proposal.doubt, doubt)))
    return replace(proposal, confidence=round(0.5 * proposal.confidence, 2), doubt=doubts)


def _negative(recording: Recording) -> dict[str, tuple[float, bool]]:
    """Of torques and forces, in a drive that goes forward, which share is negative of the values that are large, and whether a torque is
    large beside the others': free wheels have offsets."""
    speed = recording.channels.get("ground_speed", np.zeros(len(recording)))
    sizes = {
        name: float(np.nanquantile(np.abs(values), 0.95))
        for name, values in recording.channels.items()
        if name.startswith(_FORCES) and np.isfinite(values).any()
    }
    if not np.nansum(speed) > 0:
        return {}
    most = max((size for name, size in sizes.items() if name != "drawbar_force"), default=0.0)
    result = {}
    for name, size in sizes.items():
        values = recording.channels[name]
        large = np.abs(values) > _FAST * size
        share = float(np.sum(values[large] < 0)) / max(int(large.sum()), 1)
        result[name] = (share, name == "drawbar_force" or size > _FAST * most)
    return result

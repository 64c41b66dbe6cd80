"""A log as the page shows it before anything is chosen: its columns with small pictures, and what each channel may be made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terragrip.formats.channel_proposal import Proposal
    from terragrip.formats.inspection import Inspection
    from terragrip.formats.outline import Outline

TITLES = {
    "wheel_speed": "turning speed",
    "drive_torque": "drive torque, at the wheel",
    "ground_speed": "speed over ground",
    "wheel_based_speed": "speed of the drive train, the wheels as one",
    "drawbar_force": "pull at the hitch, backward positive",
    "hitch_load": "vertical load on the hitch, down positive",
    "brake": "brake, 0 released to 1 pressed",
    "mass": "mass of the whole machine, where it changes",
    "acceleration_x": "acceleration forward",
    "pitch": "pitch, nose up positive",
    "roll": "roll",
    "angular_velocity_z": "rate of turn, to the left positive",
    "latitude": "latitude",
    "longitude": "longitude",
    "soil": "name of the soil (text)",
}
"""The channels that are chosen by hand, in words; the others of a proposal keep their names."""


@dataclass(frozen=True)
class LogPreview:
    """A log at a glance: its `inspection`, and the `outlines` of its columns."""

    inspection: Inspection
    outlines: dict[str, Outline]

    def columns(self) -> list[dict[str, Any]]:
        """Every column, for a choice: name, kind, unit (the file's, else as its name ends), numbers, outline."""
        from terragrip.formats.vocabulary import GENERAL

        return [
            {
                "name": one.name,
                "kind": one.kind,
                "unit": one.unit or (GENERAL.read(one.name).unit if one.kind == "number" else None),
                "missing": one.missing_share,
                "minimum": one.minimum,
                "median": one.median,
                "maximum": one.maximum,
                "examples": one.examples,
                "outline": self.outlines.get(one.name),
            }
            for one in self.inspection.columns
        ]

    def channels(
        self, wheels: tuple[str, ...], kept: dict[str, dict[str, Any]] | None = None
    ) -> list[dict[str, Any]]:
        """Every channel that may be chosen, with its proposals, the likeliest first; ``wheels`` beside those that were found.

        ``kept``: channels of a profile; a wheel or axle that it calls otherwise than the log has the profile's name.
        """
        from terragrip.recording.schema import split_channel, unit_of, wheel_names_in

        proposals = self.inspection.proposals
        kept = kept or {}
        part = {name: (split_channel(name) or ("", ""))[1] for name in (*proposals, *kept)}
        own, sources = {part[name] for name in kept}, [entry.get("from") for entry in kept.values()]
        renamed = {
            part[name]
            for name, one in proposals.items()
            if "from" in one.entry and one.entry["from"] in sources
        } - {*own, ""}
        proposals = {name: one for name, one in proposals.items() if part[name] not in renamed}
        named = dict.fromkeys((*wheel_names_in((*proposals, *kept)), *wheels))
        names = [f"{quantity}_{w}" for quantity in ("wheel_speed", "drive_torque") for w in named]
        names += [name for name in TITLES if name not in ("wheel_speed", "drive_torque", "soil")]
        names += [name for name in (*proposals, *kept) if name not in names and name != "soil"]
        result = []
        for name in (*dict.fromkeys(names), "soil"):
            quantity, wheel = split_channel(name) or (name, "")
            result.append(
                {
                    "name": name,
                    "title": TITLES.get(quantity, quantity.replace("_", " ")),
                    "wheel": wheel,
                    "unit": unit_of(name),
                    "proposals": _ranked(proposals.get(name)),
                }
            )
        return result

    def time(self) -> dict[str, Any] | None:
        """The time's column, as a profile has it; None where no column looks like time."""
        import yaml

        found: dict[str, Any] | None = yaml.safe_load(self.inspection.profile).get("time")
        return found


def preview(path: Path) -> LogPreview:
    """A log at a glance. Raises InputError where it cannot be read."""
    from terragrip.formats import inspect
    from terragrip.formats.outline import outlines

    return LogPreview(inspect(path), outlines(path))


def _ranked(best: Proposal | None) -> list[dict[str, Any]]:
    if best is None:
        return []
    return [
        {
            "entry": one.entry,
            "columns": one.columns,
            "unit": one.unit,
            "confidence": one.confidence,
            "evidence": one.evidence,
            "doubt": one.doubt,
            "give": one.give,
        }
        for one in (best, *best.others)
    ]

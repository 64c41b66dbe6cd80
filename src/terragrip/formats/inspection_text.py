"""An Inspection as text to read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from terragrip.note_pages import with_page
from terragrip.recording.schema import wheel_names_in
from terragrip.text import aligned

if TYPE_CHECKING:
    from terragrip.formats.channel_proposal import Proposal
    from terragrip.formats.inspection import ColumnSummary, Inspection, TimeSummary

_HEAD = ("column", "unit", "count", "missing", "rate", "held", "noise", "min", "5 %", "median", "95 %", "max")


def text_of(inspection: Inspection) -> str:
    """The report: file, time base, columns, channels recognised and missing, remarks, the proposed profile."""
    parts = [f"{inspection.file}: {inspection.rows} rows, {len(inspection.columns)} columns"]
    if inspection.time is not None:
        parts.append(_time_text(inspection.time))
    parts.append("\n".join(aligned([_HEAD, *(_row(column) for column in inspection.columns)])))
    if inspection.recognised:
        result = [_proposal_text(channel, own) for channel, own in inspection.proposals.items()]
        parts.append("Recognised, with confidence and evidence\n" + "\n".join(result))
    if inspection.missing:
        parts.append("Missing\n" + "\n".join(f"  {with_page(sentence)}" for sentence in inspection.missing))
    if inspection.warnings:
        parts.append("Remarks\n" + "\n".join(f"  {with_page(sentence)}" for sentence in inspection.warnings))
    if inspection.fitting:
        named = " or ".join(f"--profile {name}" for name in inspection.fitting)
        parts.append(f"A profile that comes with Terragrip fits: {named}")
    if inspection.nearly:
        parts.append("\n".join(inspection.nearly))
    if inspection.refused:
        parts.append(f"{inspection.file} {inspection.refused}.")
    if inspection.ready and inspection.unfit:
        parts.append(f"The log cannot be estimated as it is: {inspection.unfit}.")
    elif inspection.ready:
        parts.append("The log can be estimated as it is read here.")
    as_read = all(columns == (channel,) for channel, columns in inspection.recognised.items())
    if not inspection.ready or not as_read:
        more = ", which reads more of it" * (inspection.ready and not inspection.unfit)
        parts.append(
            f"Proposed profile{more} (save it, check it, pass it with --profile)\n\n{inspection.profile}"
        )
    return "\n\n".join(parts).rstrip() + "\n"


def summary_of(inspections: Sequence[Inspection]) -> str:
    """Several logs: a line for each, and for each layout of columns what is proposed for it."""
    rows: list[tuple[str, ...]] = [("log", "rows", "s", "wheels", "ground speed", "torque", "")]
    layouts: dict[tuple[str, ...], list[Inspection]] = {}
    for one in inspections:
        wheels = ", ".join(
            wheel_names_in(c for c in one.recognised if c.startswith("wheel_speed_"))
        ) or "as one" * ("wheel_based_speed" in one.recognised)
        ground = ", ".join(one.recognised.get("ground_speed", ()))
        state = (
            ("not this vehicle's" if one.unfit else "ready")
            if one.ready
            else " or ".join(one.fitting) or ("no wheels" if one.refused else "needs a profile")
        )
        torque = str(sum(channel.startswith("drive_torque_") for channel in one.recognised) or "")
        length = "" if one.time is None else _number(one.time.duration)
        rows.append((one.file, str(one.rows), length, wheels, ground, torque, state))
        layouts.setdefault(tuple(column.name for column in one.columns), []).append(one)
    parts = ["\n".join(aligned(rows))]
    for alike in layouts.values():
        first = alike[0]
        others = f" and {len(alike) - 1} more with the same columns" if len(alike) > 1 else ""
        result = [_proposal_text(channel, own) for channel, own in first.proposals.items()]
        parts.append("\n".join([f"{first.file}{others}", *result]))
        parts += ["\n".join(first.nearly)] if first.nearly else []
        if not first.ready and not first.fitting:
            parts.append(first.profile.rstrip() if not first.refused else f"{first.file} {first.refused}.")
    return "\n\n".join(parts).rstrip() + "\n"


def _proposal_text(channel: str, proposal: Proposal) -> str:
    """A proposal on one line: where from, how sure, why, what else it might be."""
    mark = "? " * proposal.is_doubtful
    unit = f" [{proposal.unit}]" if proposal.unit else ""
    why = "; ".join(
        [
            *proposal.evidence,
            *[f"but {proposal.doubt}"] * bool(proposal.doubt and proposal.doubt not in proposal.evidence),
            *[proposal.give] * bool(proposal.give),
        ]
    )
    others = f"; else {', '.join(proposal.alternatives)}" if proposal.alternatives else ""
    return (
        f"  {mark}{channel} <- {', '.join(proposal.columns)}{unit}  {proposal.confidence:.2f}  {why}{others}"
    )


def _time_text(time: TimeSummary) -> str:
    lines = [
        f"Time: {time.column} [{time.unit}], {_number(time.duration)} s; rows are {_number(time.spacing_50)} s apart "
        f"(5 % {_number(time.spacing_05)}, 95 % {_number(time.spacing_95)})"
    ]
    if time.gap_count:
        longest = ", ".join(f"{_number(length)} s at {_number(start)} s" for start, length in time.gaps)
        lines.append(f"  gaps: {time.gap_count}, the longest {longest}")
    faults = ((time.repeated, "repeat"), (time.backward, "go back"), (time.missing, "are missing"))
    lines += [f"  {count} stamps {what}" for count, what in faults if count]
    return "\n".join(lines)


def _row(column: ColumnSummary) -> tuple[str, ...]:
    missing = f"{100 * column.missing_share:.3g} %" if column.missing_share else ""
    head = (column.name, column.unit or "", str(column.count), missing)
    if column.kind != "number":
        return (*head, column.kind, "", "", ", ".join(column.examples)[:40], "", "", "", "")
    rate = "" if column.rate is None else f"{column.rate:.3g} Hz"
    held = "" if column.held_period is None else f"{column.held_period:.3g} s"
    sizes = (column.minimum, column.quantile_05, column.median, column.quantile_95, column.maximum)
    return (*head, rate, held, _number(column.noise), *_apart(sizes))


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _apart(sizes: Sequence[float | None]) -> list[str]:
    """Minimum to maximum in four digits, or as many as a hundredth of their range needs (latitudes of one field)."""
    known = [size for size in sizes if size is not None]
    span = max(known, default=0.0) - min(known, default=0.0)
    digits = 4 if span == 0 else max(4, math.ceil(math.log10(max(map(abs, known)) / span)) + 2)
    return ["" if size is None else f"{size:.{digits}g}" for size in sizes]

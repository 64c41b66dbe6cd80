"""An Inspection as text to read."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from terragrip.formats.inspect import ColumnSummary, Inspection, TimeSummary

_HEAD = ("column", "unit", "count", "missing", "rate", "held", "noise", "min", "5 %", "median", "95 %", "max")


def text_of(inspection: Inspection) -> str:
    """The report: file, time base, columns, channels recognised and missing, remarks, the proposed profile."""
    parts = [f"{inspection.file}: {inspection.rows} rows, {len(inspection.columns)} columns"]
    if inspection.time is not None:
        parts.append(_time_text(inspection.time))
    parts.append(_table([_HEAD, *(_row(column) for column in inspection.columns)]))
    if inspection.recognised:
        found = [f"  {channel} <- {', '.join(columns)}" for channel, columns in inspection.recognised.items()]
        parts.append("Recognised\n" + "\n".join(found))
    if inspection.missing:
        parts.append("Missing\n" + "\n".join(f"  {sentence}" for sentence in inspection.missing))
    if inspection.warnings:
        parts.append("Remarks\n" + "\n".join(f"  {sentence}" for sentence in inspection.warnings))
    if inspection.fitting:
        named = " or ".join(f"--profile {name}" for name in inspection.fitting)
        parts.append(f"A profile that comes with Terragrip fits: {named}")
    if inspection.ready:
        parts.append("The log can be estimated as it is read here.")
    else:
        parts.append("Proposed profile (save it, check it, pass it with --profile)\n\n" + inspection.profile)
    return "\n\n".join(parts).rstrip() + "\n"


def _time_text(time: TimeSummary) -> str:
    lines = [
        f"Time: {time.column} [{time.unit}], {_number(time.duration)} s; rows are {_number(time.spacing_50)} s apart "
        f"(5 % {_number(time.spacing_05)}, 95 % {_number(time.spacing_95)})"
    ]
    if time.gap_count:
        longest = ", ".join(f"{_number(length)} s at {_number(start)} s" for start, length in time.gaps)
        lines.append(f"  gaps: {time.gap_count}, the longest {longest}")
    faults = ((time.repeated, "repeat"), (time.backward, "run back"), (time.missing, "are missing"))
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
    return (*head, rate, held, _number(column.noise), *(_number(size) for size in sizes))


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _table(rows: list[tuple[str, ...]]) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )

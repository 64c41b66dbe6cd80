"""Tables as HTML for notebooks: plain, escaped, readable in light and dark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """A table; the first cell of a row is its heading, numbers of a row stand to the right."""
    cells = "".join(f"<th>{escape(str(cell))}</th>" for cell in head)
    lines = "".join(
        f"<tr><th style='text-align:left'>{escape(str(row[0]))}</th>"
        + "".join(f"<td style='text-align:right'>{escape(str(cell))}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    above = f"<caption style='text-align:left'>{escape(caption)}</caption>" if caption else ""
    return f"<table>{above}<thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table>"


def html_notes(notes: Iterable[str]) -> str:
    """Sentences as a list; nothing where there are none."""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f"<ul>{items}</ul>" if items else ""


def figure_of(value: float | None, std: float | None = None, digits: int = 3) -> str:
    """A number, with its standard deviation where there is one; a missing one is a dash."""
    if value is None or value != value:
        return "–"
    text = f"{value:.{digits}f}"
    return text if std is None or std != std else f"{text} ± {std:.{digits}f}"

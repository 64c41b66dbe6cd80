"""A report page as PDF, set by Typst from the page's own parts: with an outline, tags for screen readers, and fonts that come along.

matplotlib's DejaVu Sans is embedded, so the PDF reads alike on a machine without fonts (docs/report.md).
"""

from __future__ import annotations

import json
import re
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from terragrip.errors import InputError
from terragrip.files import replacing
from terragrip.report.page import Page, Picture, Section, Table

EXTRA = "pip install 'terragrip[report]'"
STANDARD: Literal["ua-1"] = "ua-1"
"""PDF/UA-1 (ISO 14289-1): tagged, with language, title and an alternative text of each figure; Typst refuses to write what is not."""
WIDTH = 691.0
"""Points of a figure of 9.6 inches, which fills the sheet's width."""


def pdf_possible() -> bool:
    """Whether the package that prints is installed."""
    from importlib.util import find_spec

    return find_spec("typst") is not None


def write_pdf(page: Page, path: Path) -> Path:
    """Print `page` to `path`, whole or not at all. Raises InputError without the package, or where it cannot be written."""
    try:
        import typst
    except ImportError:
        raise InputError("typst is not installed, so there is no PDF", hint=EXTRA) from None
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "page.typ").write_bytes((files("terragrip.report") / "templates" / "page.typ").read_bytes())
        (root / "page.json").write_text(json.dumps(_plain(page, root)), encoding="utf-8")
        printed = typst.compile(
            str(root / "page.typ"),
            root=folder,
            font_paths=[_fonts()],
            ignore_system_fonts=True,
            pdf_standards=STANDARD,
        )
    with replacing(path) as temporary:
        temporary.write_bytes(printed)
    return path


def _plain(page: Page, root: Path) -> dict[str, Any]:
    """The page as plain data; its figures become files in `root`."""
    return {
        "title": page.title + (" (simulated)" if page.simulated else ""),
        "lead": page.lead,
        "simulated": page.simulated,
        "keywords": ["traction", "slip", *(["simulated"] * page.simulated)],
        "headlines": [
            {"value": one.value, "label": one.label, "beside": one.beside} for one in page.headlines
        ],
        "sections": [_section(one, root) for one in page.shown],
        "left_out": [{"title": one.title, "why": one.omitted} for one in page.left_out],
        "facts": [list(fact) for fact in page.facts],
    }


def _section(section: Section, root: Path) -> dict[str, Any]:
    content = [_figure(one, root) if isinstance(one, Picture) else _table(one) for one in section.content]
    return {
        "title": section.title,
        "prose": list(section.prose),
        "content": content,
    }


def _figure(picture: Picture, root: Path) -> dict[str, Any]:
    file = f"{len(list(root.glob('*.svg')))}.svg"
    (root / file).write_text(picture.svg, encoding="utf-8")
    width = re.search(r'\bwidth="([\d.]+)pt"', picture.svg)
    return {
        "file": file,
        "alt": picture.alt,
        "caption": picture.caption,
        "share": float(width[1]) / WIDTH if width else 1.0,
    }


def _table(table: Table) -> dict[str, Any]:
    return {
        "caption": table.caption,
        "header": list(table.header),
        "rows": [list(row) for row in table.rows],
        "prose": sorted(table.prose),
        "strong": sorted(table.strong),
    }


def _fonts() -> str:
    """The folder of matplotlib's own fonts."""
    import matplotlib as mpl

    return str(Path(mpl.get_data_path()) / "fonts" / "ttf")

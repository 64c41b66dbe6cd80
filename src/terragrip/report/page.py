"""A report page: sections of prose, figures and tables, rendered to one HTML file that loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from terragrip.errors import missing_package
from terragrip.files import made_folder, replacing
from terragrip.report.style import in_page, on_paper


@dataclass(frozen=True)
class Picture:
    """A figure: `name` (file stem), `svg` (document), `caption`, and `alt` (for readers who cannot see it)."""

    name: str
    svg: str
    caption: str
    alt: str


SENTENCE = 40
"""Characters from which on a cell holds words, not a figure with its interval."""


@dataclass(frozen=True)
class Table:
    """A table of finished text cells; `strong` are the indices of rows to set off."""

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    strong: frozenset[int] = frozenset()

    @property
    def prose(self) -> frozenset[int]:
        """The columns, counted from 0, that hold sentences: they are read from the left, figures stand to the right."""
        columns = range(len(self.header))
        return frozenset(i for i in columns if any(len(row[i]) > SENTENCE for row in self.rows))


@dataclass(frozen=True)
class Section:
    """A part of the report. `omitted` says why there is nothing to show; then the rest is empty."""

    anchor: str
    title: str
    prose: tuple[str, ...] = ()
    content: tuple[Picture | Table, ...] = ()
    omitted: str | None = None


@dataclass(frozen=True)
class Headline:
    """A figure to see first: the number, what it is, and what stands beside it."""

    value: str
    label: str
    beside: str = ""


@dataclass(frozen=True)
class Page:
    """A whole report. `simulated` puts that word where nobody can miss it."""

    title: str
    lead: str
    sections: tuple[Section, ...]
    headlines: tuple[Headline, ...] = ()
    simulated: bool = False
    facts: tuple[tuple[str, str], ...] = field(default=())

    @property
    def shown(self) -> tuple[Section, ...]:
        """The sections that have something to show."""
        return tuple(one for one in self.sections if not one.omitted)

    @property
    def left_out(self) -> tuple[Section, ...]:
        """The sections that have nothing to show: together behind the others, each with the reason."""
        return tuple(one for one in self.sections if one.omitted)


def render(page: Page) -> str:
    """The page as one HTML document, styles and figures inside.

    Raises InputError without Jinja2.
    """
    try:
        import jinja2
    except ImportError:
        raise missing_package("jinja2", "report") from None
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("terragrip.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    css = environment.loader.get_source(environment, "page.css")[0] if environment.loader else ""
    return environment.get_template("page.html").render(
        page=page,
        css=css,
        inline=lambda picture: in_page(picture.svg, picture.alt, picture.name),
    )


def write_page(page: Page, folder: Path) -> Path:
    """Write `folder`/index.html and `folder`/figures/*.svg, each whole or not at all; the page's path."""
    pictures = [item for section in page.sections for item in section.content if isinstance(item, Picture)]
    for picture in pictures:
        write_whole(folder / "figures" / f"{picture.name}.svg", on_paper(picture.svg))
    target = folder / "index.html"
    write_whole(target, render(page))
    return target


def write_whole(path: Path, text: str) -> None:
    """Write `text` to `path` through a temporary file and a rename, making folders as needed.

    Raises InputError when the place cannot be written (a read-only folder, a full disk).
    """
    made_folder(path.parent)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def number(value: float | None, digits: int = 3) -> str:
    """A number as the report prints it: `digits` decimals, a true minus sign, a dash where there is none."""
    if value is None or value != value:
        return "–"
    return f"{value:.{digits}f}".replace("-", "−")


def percent(share: float | None, digits: int = 1) -> str:
    """A share of one as per cent."""
    return "–" if share is None or share != share else f"{number(100 * share, digits)} %"


def names(words: Sequence[str]) -> str:
    """Words in a row: "a, b and c"."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1] if words else ""


def stem(name: str) -> str:
    """A soil's or a run's name as a part of a file's name and of an id."""
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)


def require_drawing() -> None:
    """Tell before the long work, not after it, that drawing is not possible. Raises InputError."""
    from importlib.util import find_spec

    missing = [name for name in ("matplotlib", "jinja2") if find_spec(name) is None]
    if missing:
        raise missing_package(missing[0], "report")

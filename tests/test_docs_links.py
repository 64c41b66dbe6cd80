"""Links of the documentation lead somewhere: files, headings, and the decisions that code and pages name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DECISIONS = ROOT / "docs" / "decisions"
PAGES = sorted(
    [*ROOT.glob("docs/*.md"), *DECISIONS.glob("*.md"), ROOT / "README.md", ROOT / "benchmarks" / "README.md"]
)
SOURCES = {".py", ".c", ".h", ".md", ".yaml", ".toml", ".ts", ".css", ".html"}

LINK = re.compile(r"\]\(([^)\s]+)\)")
NAMED = re.compile(r"(?:[Dd]ecisions? |decisions/)(\d{4}(?:(?:,| and|, and) \d{4})*)")
PATH = re.compile(r"decisions/(\d{4}-[\w-]+\.md)")


def prose_of(page: str) -> str:
    """A page without its code: blocks between fences, indented blocks are rare enough to hold no links."""
    return re.sub(r"`[^`\n]+`", "", re.sub(r"^```.*?^```", "", page, flags=re.DOTALL | re.MULTILINE))


def anchors_of(page: str) -> set[str]:
    """The anchors GitHub gives to a page's headings: lower case, no punctuation, hyphens for spaces, -1 for a twin."""
    anchors: set[str] = set()
    for heading in re.findall(
        r"^#{1,6} (.+?)\s*$", re.sub(r"^```.*?^```", "", page, flags=re.DOTALL | re.MULTILINE), re.MULTILINE
    ):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = base = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        twins = 0
        while slug in anchors:
            twins += 1
            slug = f"{base}-{twins}"
        anchors.add(slug)
    return anchors


def broken_links(page: Path) -> list[str]:
    """Relative links of a page whose file or heading does not exist."""
    broken = []
    for link in LINK.findall(prose_of(page.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors_of(target.read_text(encoding="utf-8"))):
            broken.append(link)
    return broken


def named_decisions() -> dict[str, list[str]]:
    """Decisions named in code, tests, benchmarks and pages, by number or by file name: where each is named."""
    named: dict[str, list[str]] = {}
    roots = [ROOT / name for name in ("src", "kernel", "tests", "benchmarks", "docs", "web/src", "examples")]
    files = [path for root in roots for path in root.rglob("*") if path.suffix in SOURCES]
    for path in [*files, *ROOT.glob("*.py"), *ROOT.glob("*.md"), *ROOT.glob("*.toml"), ROOT / "Makefile"]:
        text = path.read_text(encoding="utf-8")
        for numbers in NAMED.findall(text):
            for number in re.findall(r"\d{4}", numbers):
                named.setdefault(number, []).append(str(path.relative_to(ROOT)))
        for name in PATH.findall(text):
            named.setdefault(name, []).append(str(path.relative_to(ROOT)))
    return named


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken_links(page) == []


def test_every_decision_that_is_named_exists() -> None:
    files = {path.name for path in DECISIONS.glob("[0-9]*.md")}
    there = files | {name[:4] for name in files}
    missing = {name: places for name, places in named_decisions().items() if name not in there}
    assert missing == {}


def test_the_index_lists_each_decision_once_with_its_title() -> None:
    index = (DECISIONS / "README.md").read_text(encoding="utf-8")
    for path in sorted(DECISIONS.glob("[0-9]*.md")):
        title = path.read_text(encoding="utf-8").partition("\n")[0]
        number = path.name[:4]
        assert title.startswith(f"# {number} "), f"{path.name} begins with '{title}', not with '# {number} '"
        row = f"| [{number}]({path.name}) | {title.removeprefix(f'# {number} ')} |"
        assert index.count(row) == 1, f"docs/decisions/README.md lacks the row '{row} ...'"


def test_a_broken_link_and_a_broken_heading_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Top\n[a](page.md) [b](page.md#the-way) [c](#top) [d](https://example.org/x)\n## The `way`\n"
        "[e](gone.md) [f](page.md#gone) `[g](code.md)`\n```\n# no heading\n[h](code.md)\n```\n[i](#no-heading)\n",
        encoding="utf-8",
    )
    assert broken_links(page) == ["gone.md", "page.md#gone", "#no-heading"]


PAGE_OF_AN_ERROR = re.compile(r"""(?:\bpage ?=|PAGE: ClassVar\[str \| None\] =) ?"([\w-]+)(?:#([\w-]+))?\"""")


def test_every_page_that_an_error_names_exists() -> None:
    named = {
        (path.name, *found)
        for path in (ROOT / "src").rglob("*.py")
        for found in PAGE_OF_AN_ERROR.findall(path.read_text(encoding="utf-8"))
    }
    assert {("vehicle.py", "vehicle", "all-keys"), ("errors.py", "install", "")} <= named
    for source, page, heading in named:
        path = ROOT / "docs" / f"{page}.md"
        assert path.is_file(), f"{source} names docs/{page}.md"
        assert not heading or heading in anchors_of(path.read_text("utf-8")), (
            f"{source} names {page}#{heading}"
        )

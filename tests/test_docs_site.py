"""The documentation site builds without a warning, needs no network, finds words, and its reference is the code's."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "site"))

import make  # noqa: E402

import terragrip as tg  # noqa: E402
from terragrip.cli.entry import program  # noqa: E402
from terragrip.recording.schema import AXLE_CHANNELS, CHANNELS, WHEEL_CHANNELS  # noqa: E402


def test_every_page_has_one_place_in_the_contents() -> None:
    named = [name for names in make.contents().values() for name in names]
    written = {path.stem for path in (ROOT / "docs").glob("*.md")} - {"README"}
    assert sorted(named) == sorted(written | set(make.GENERATED) | {"decisions/README"})


@pytest.mark.long  # its links: test_docs_links.py; its contents: above
def test_the_site_is_whole_loads_nothing_from_elsewhere_and_finds_words(tmp_path: Path) -> None:
    """Sphinx ends by an error where a link leads nowhere or a page has no place."""
    site = tmp_path / "html"
    done = subprocess.run(
        [sys.executable, str(ROOT / "docs/site/make.py"), "-o", str(site)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pages = {path.stem for path in (ROOT / "docs").glob("*.md")}
    assert pages <= {path.stem for path in site.glob("*.html")}
    loaded = re.compile(
        r"<(?:script|img|iframe|link)\b[^>]*(?:src|href)=\"(?:https?:)?//|@import|url\(['\"]?https?:"
    )
    outside = [
        p.name
        for kind in ("*.html", "*.css")
        for p in site.rglob(kind)
        if loaded.search(p.read_text("utf-8"))
    ]
    assert outside == []
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    assert "immobil" in index, "the search's index is a script, which a page opened from a file may load"


def test_every_command_and_option_is_on_the_page_of_commands() -> None:
    page = make.GENERATED["commands"]()
    for name, command in program().commands.items():
        section = page.partition(f"## terragrip {name}\n")[2].partition("\n## ")[0]
        inner = getattr(command, "commands", {}).values()
        for parameter in [
            p for one in (command, *inner) for p in one.params if p.param_type_name == "option"
        ]:
            assert parameter.opts[-1] in section, f"{name}: {parameter.opts}"


def test_every_public_name_is_on_the_page_of_python() -> None:
    page = make.GENERATED["python"]()
    for name in set(tg.__all__) - {"__version__"}:
        assert f"## tg.{name}\n" in page
    assert "### tg.TractionEstimator.update\n" in page
    assert "- `smooth`: run the recording backwards too" in page


def test_every_function_of_the_header_is_on_the_page_of_c() -> None:
    header = (ROOT / "kernel/include/terragrip.h").read_text(encoding="utf-8").partition("/* cdef end */")[0]
    page = make.GENERATED["c"]()
    names = set(re.findall(r"^(?:tg_\w+|size_t) \*?(tg_\w+)\(", header, re.MULTILINE))
    assert len(names) > 20
    assert {name for name in names if f"{name}(" not in page} == set()


def test_every_channel_has_its_sign_and_every_key_its_meaning() -> None:
    page = make.GENERATED["channels"]()
    assert all(f"| `{name}" in page for name in (*CHANNELS, *WHEEL_CHANNELS, *AXLE_CHANNELS))
    assert "`derivative_of`" in make.GENERATED["profile-keys"]()


def test_every_column_of_estimates_is_described() -> None:
    rows = [
        line.split("|")
        for line in make.GENERATED["estimates-columns"]().splitlines()
        if line.startswith("| `")
    ]
    assert len(rows) > 20
    assert [row[1].strip() for row in rows if not row[3].strip()] == []

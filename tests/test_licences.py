"""Everything that Terragrip stands on may be shipped with it; a licence that forbids it, or that nobody knows, is found."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "site")]

import build_pages  # noqa: E402
import licences  # noqa: E402


def test_nothing_that_it_stands_on_forbids_shipping() -> None:
    every = licences.packages()
    assert {"numpy", "maplibre-gl", "uplot"} <= {one.name for one in every}
    assert [f"{one.name} {one.problem}: {one.licence}" for one in every if one.problem] == []


@pytest.mark.parametrize(
    ("licence", "shipped", "fits"),
    [
        ("MIT", True, True),
        ("EPL-2.0 OR BSD-3-Clause", True, True),
        ("LGPL-3.0-only", False, True),
        ("LGPL-3.0-only", True, False),
        ("GPL-3.0-or-later", False, False),
        ("GNU General Public License v3 (GPLv3)", False, False),
        ("MIT AND GPL-2.0-only", False, False),
        ("AGPL-3.0", False, False),
        ("CC-BY-NC-4.0", False, False),
        ("", False, False),
    ],
)
def test_a_licence_is_judged_by_what_it_permits(licence: str, shipped: bool, fits: bool) -> None:
    assert (licences.Package("x", "1", licence, shipped).problem is None) == fits


def test_the_pages_carry_the_licence_texts_of_what_is_in_them(tmp_path: Path) -> None:
    inside = tmp_path / "node_modules" / "chart"
    inside.mkdir(parents=True)
    (inside / "LICENSE.md").write_text("Copyright somebody")
    packages = {
        "": {},
        "node_modules/chart": {"version": "1.2", "license": "MIT"},
        "node_modules/tool": {"version": "3", "license": "MIT", "dev": True},
    }
    (tmp_path / "package-lock.json").write_text(json.dumps({"packages": packages}))
    text = build_pages.notices(tmp_path)
    assert "chart 1.2: MIT" in text
    assert "Copyright somebody" in text
    assert "tool" not in text

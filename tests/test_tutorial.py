"""Every tutorial of docs/ works as it stands: every block, in order, in an empty folder."""

from __future__ import annotations

import glob
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from terragrip.cli import main

PAGES = sorted((Path(__file__).parents[1] / "docs").glob("tutorial*.md"))
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, int, str]]:
    """Language, line and text of each code block."""
    text = page.read_text(encoding="utf-8")
    return [(match[1], text.count("\n", 0, match.start(2)) + 1, match[2]) for match in BLOCK.finditer(text)]


def run_commands(text: str) -> None:
    for line in text.splitlines():
        program, *words = shlex.split(line)
        assert program == "terragrip", line
        expanded = [name for word in words for name in (sorted(glob.glob(word)) if "*" in word else [word])]
        assert main([*expanded, *(["--quiet"] if words[0] != "inspect" else [])]) == 0, line


def write_file(text: str) -> None:
    """A YAML block names its file in its first line, a comment."""
    name, _, _ = text.removeprefix("# ").partition("\n")
    assert re.fullmatch(r"[\w-]+\.yaml", name), text
    Path(name).write_text(text, encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_is_one_that_the_test_runs(page: Path) -> None:
    assert {language for language, _, _ in blocks(page)} <= {"python", "sh", "yaml"}


@pytest.mark.usefixtures("undrawn")  # test_demo.py and report/test_command.py draw the figures
@pytest.mark.parametrize(
    "page",
    # the simulated runs of tutorial.md take a minute; its commands and names are tried in test_docs_blocks.py
    [pytest.param(page, marks=pytest.mark.long if page.stem == "tutorial" else ()) for page in PAGES],
    ids=lambda page: page.stem,
)
def test_a_tutorial_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for language, line, text in blocks(page):
        if language == "sh":
            run_commands(text)
        elif language == "yaml":
            write_file(text)
        else:
            exec(compile("\n" * (line - 1) + text, str(page), "exec"), names)

"""docs/tutorial.md works as it stands: every block, in order, in an empty folder."""

from __future__ import annotations

import glob
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from terragrip.cli import main

PAGE = Path(__file__).parents[1] / "docs/tutorial.md"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks() -> list[tuple[str, int, str]]:
    """Language, line and text of each code block."""
    text = PAGE.read_text(encoding="utf-8")
    return [(match[1], text.count("\n", 0, match.start(2)) + 1, match[2]) for match in BLOCK.finditer(text)]


def run_commands(text: str) -> None:
    for line in text.splitlines():
        program, *words = shlex.split(line)
        assert program == "terragrip", line
        expanded = [name for word in words for name in (sorted(glob.glob(word)) if "*" in word else [word])]
        assert main([*expanded, *(["--quiet"] if words[0] != "inspect" else [])]) == 0, line


def test_every_block_is_one_that_the_test_runs() -> None:
    assert {language for language, _, _ in blocks()} == {"python", "sh"}


def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for language, line, text in blocks():
        if language == "sh":
            run_commands(text)
        else:
            exec(compile("\n" * (line - 1) + text, str(PAGE), "exec"), names)
    assert (tmp_path / "soils.json").exists()

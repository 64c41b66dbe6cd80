"""The scripts of the example notebooks become cells that compile; `make notebooks` executes them."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nbclient", reason="notebooks are executed by terragrip[dev]")
EXAMPLES = Path(__file__).parents[1] / "examples"


def example() -> Any:
    spec = importlib.util.spec_from_file_location("notebooks", EXAMPLES / "notebooks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("script", sorted((EXAMPLES / "notebooks").glob("*.py")), ids=lambda p: p.stem)
def test_a_notebook_is_whole_python_and_reads_shared_data_alone(script: Path) -> None:
    cells = example().cells_of(script.read_text(encoding="utf-8"))
    assert [kind for kind, _ in cells[:2]] == ["markdown", "code"]
    for kind, text in cells:
        if kind == "code":
            compile(text, script.name, "exec")
    assert "http" not in "".join(text for kind, text in cells if kind == "code")

"""Every command of docs/worked-examples.md runs on the measured logs, and says what the page says of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.long  # its commands: test_docs_blocks.py; a measured field hour: test_measured_ways.py
def test_the_commands_of_the_page_run(shared, tmp_path: Path, monkeypatch, capsys) -> None:
    pytest.importorskip("geopandas", reason="needs terragrip[geo]")
    import geopandas

    from terragrip.cli import main

    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import worked_examples

    shared("data/pathfinder_rover")
    data = shared("data/tractor_t7").parent
    monkeypatch.chdir(tmp_path)
    commands = worked_examples.commands(data)
    assert len(commands) == 11
    for words in commands:
        assert main(words) == 0, capsys.readouterr().err
    advice = json.loads((tmp_path / "t7-advice.json").read_text())
    assert advice["field_work"]["litres_per_hour"] == pytest.approx(
        14, abs=1
    )  # rows that drive, by hand from the log: 14.4
    assert advice["best_efficiency"] is None
    cells = geopandas.read_file(tmp_path / "t7.gpkg", layer="cells")
    field = cells[cells["headland"] < 0.5]
    assert field["slip"].median() == pytest.approx(
        0.079, abs=0.012
    )  # .079 while working, by hand (PROVENANCE)
    assert (tmp_path / "rover.png").stat().st_size > 10_000
    assert "48 s of driving" in capsys.readouterr().out

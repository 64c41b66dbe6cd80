"""Machines of other layouts than a four-wheel robot run through every command: estimate, soils, ground, map, advise, report."""

from __future__ import annotations

import json
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "estimation"))  # for stock_tractor.py

import terragrip as tg
from stock_tractor import stock_machine
from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.recording import Recording
from terragrip.simulation.families import Kind, draw

LAYOUTS = {
    "two-wheel drive": ("tractor", 2, [2, 2], [False, True]),
    "two-wheel drive by engine torque": ("tractor", 8, [2, 2], [False, True]),
    "four-wheel drive by engine torque": ("tractor", 0, [2, 2], [True, True]),
    "six wheels": ("robot", 2, [2, 2, 2], [True, True, True]),
    "skid steer": ("robot", 3, [2], [True]),
}
QUANTITIES = ("adhesion", "slip", "net_traction", "efficiency")


@cache
def machine_of(layout: str) -> tuple[Recording, tg.Vehicle]:
    """A drive of the layout on a straight track to the north-east."""
    mass, seed, wheels, driven = LAYOUTS[layout]
    drive = draw(Kind(mass, "saturating", "even"), seed, rate=20.0, duration=120.0)
    axles = drive.vehicle.axles.values()
    assert [len(axle.wheels) for axle in axles] == wheels
    assert [axle.driven for axle in axles] == driven
    recording, vehicle = drive.recording, drive.vehicle
    way = drive.truth["true_distance"].to_numpy()
    if "engine" in layout:
        stock = stock_machine(drive, seed)
        recording, vehicle = stock.recording, stock.vehicle
        way = np.interp(recording.time, drive.recording.time, way)
    return recording.with_channels(latitude=45 + way * 6.4e-6, longitude=12 + way * 9e-6), vehicle


@pytest.mark.usefixtures("undrawn")
def test_every_command_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The robots of other tests have two driven wheels, and an axle that is not driven comes with the engine's torque."""
    run_every_command("two-wheel drive by engine torque", tmp_path, capsys)


@pytest.mark.long
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_command_works_and_draws(
    layout: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_every_command(layout, tmp_path, capsys)


def run_every_command(layout: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("geopandas", reason="needs terragrip[geo]")
    import geopandas

    recording, vehicle = machine_of(layout)
    log, file, out = tmp_path / "log.parquet", tmp_path / "vehicle.yaml", tmp_path / "estimates.parquet"
    recording.to_pandas().to_parquet(log, index=False)
    vehicle.save(file)
    soils, ground, field, page = (
        tmp_path / n for n in ("soils.json", "ground.json", "map.gpkg", "report.html")
    )
    for words in (
        ["estimate", log, "--vehicle", file, "-o", out],
        ["soils", out, "-o", soils],
        ["ground", out, "-o", ground],
        ["map", out, "-o", field],
        ["advise", out, "--vehicle", file, "-o", tmp_path / "advice.json"],
        ["report", out, "-o", page],
        ["convert", out, "-o", tmp_path / "estimates.csv"],
    ):
        code = main([str(word) for word in words])
        said = capsys.readouterr()
        assert code == 0, f"{words[0]}: {said.err}"
        if words[0] == "soils":  # a mild drive tells no curve of some soils, and says so
            fitted = json.loads(soils.read_text())["soils"]
            assert all(name in fitted or f"{name}: not fitted" in said.out for name in set(recording["soil"]))
    estimates = Estimates.read(out)
    shown = ("driven",) if "engine" in layout else vehicle.wheels
    assert estimates.wheels == shown
    for wheel in shown:
        for quantity in QUANTITIES:
            assert np.isfinite(estimates[f"{quantity}_{wheel}"]).mean() > 0.3
    assert json.loads(ground.read_text())["sections"]
    advice = json.loads((tmp_path / "advice.json").read_text())
    best = advice["best_efficiency"]
    assert advice["missing"] if best is None else best["interval"][0] <= best["slip"] <= best["interval"][1]
    cells = geopandas.read_file(field, layer="cells")
    for quantity in ("slip", "soil_resistance"):
        assert cells[quantity].notna().mean() > 0.3
    assert page.stat().st_size > 10_000

"""The demo on the two benchmark runs: files, scores, honesty, and what is left after an interrupt."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.estimation import DEFAULT, METHODS, Estimates
from terragrip.report.demo import DemoResult, run_demo
from terragrip.report.scores import TRUTH
from terragrip.simulation import Scenario, SimulationResult, simulate
from terragrip.simulation.campaign import run_seed
from terragrip.vehicle import Vehicle

SEED = 7
ENDS = {"multi1": 60.0, "multi2": 300.0}  # s; of multi2 after the spell in which it is stuck


def shorter(name: str, seed: int) -> SimulationResult:
    """A run of the campaign as the demo simulates it, the benchmarks' first minutes only."""
    scenario = Scenario.load(name)
    scenario = scenario.model_copy(
        update={"duration": min(scenario.duration, ENDS.get(name, scenario.duration))}
    )
    return simulate(scenario, run_seed(seed, name), machine_seed=seed)


@pytest.fixture(scope="module", name="demo")
def demo_fixture(
    tmp_path_factory: pytest.TempPathFactory, undrawn_in_file: None, one_form: None
) -> tuple[DemoResult, Path, list[tuple[int, int, str]]]:
    """The demo of multi1, multi2 and one short run, calibrated by a quarter of the usual runs, and what its progress said. Each kind of its
    figures is drawn by the tests of its section in tests/report."""
    folder = tmp_path_factory.mktemp("demo")
    progress: list[tuple[int, int, str]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terragrip.report.campaign._simulated", shorter)
        patch.setattr("terragrip.report.campaign.CALIBRATED_BY", ("-06",))
        result = run_demo(folder, SEED, 2, lambda *step: progress.append(step), runs=("fine-03",))
    return result, folder, progress


def test_every_file_is_there_and_nothing_else(
    demo: tuple[DemoResult, Path, list[tuple[int, int, str]]],
) -> None:
    result, folder, _ = demo
    assert result.page == folder / "index.html"
    assert {path.name for path in result.estimates} == {"fine-03.parquet", "multi1.parquet", "multi2.parquet"}
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "index.html",
        "report.pdf",
        "figures",
        "estimates",
        "recordings",
        "scores.json",
        "soils.json",
        "ground.json",
        "vehicle.yaml",
    }
    assert not [path for path in folder.rglob("*") if path.name.startswith(".")]
    for path in result.estimates:
        table = Estimates.read(path)
        assert len(table) > 1000
        assert table.method == DEFAULT
    assert Vehicle.load(folder / "vehicle.yaml").calibration.drive_torque_gain


def test_the_studio_shows_recordings_and_ground_of_the_demo(
    demo: tuple[DemoResult, Path, list[tuple[int, int, str]]],
) -> None:
    pytest.importorskip("fastapi", reason="the studio needs terragrip[studio]")
    from fastapi.testclient import TestClient

    from terragrip.studio.app import create_app

    with TestClient(create_app(demo[1]), base_url="http://127.0.0.1:8750") as client:
        about = client.get("/api/drive", params={"path": "estimates/multi2.parquet"}).json()
    assert about["recording"] == "recordings/multi2.parquet"
    assert "drawbar_force" in about["measured"]
    ground = json.loads((demo[1] / "ground.json").read_text(encoding="utf-8"))
    assert about["ground"]["sections"] == [one for one in ground["sections"] if one["run"] == "multi2"]


def test_scores_hold_every_method_beside_the_papers_figures(
    demo: tuple[DemoResult, Path, list[tuple[int, int, str]]],
) -> None:
    scores = json.loads((demo[1] / "scores.json").read_text(encoding="utf-8"))
    assert scores["simulated"] is True
    assert scores["paper"] == {"r2": 0.445, "r2_without_outlier": 0.848, "nrmse_without_outlier": 0.09}
    table = pd.DataFrame(scores["comparisons"])
    kinds = {(run, method) for run in ("multi1", "multi2") for method in METHODS}
    for against in ("sensor", "truth"):
        for quantity in ("adhesion", "net_traction"):
            part = table[(table.against == against) & (table.quantity == quantity)]
            ceiling = {(run, TRUTH) for run in ("multi1", "multi2")} if against == "sensor" else set()
            assert set(zip(part.run, part.method, strict=True)) == kinds | ceiling
    main = next(
        c
        for c in scores["comparisons"]
        if (c["run"], c["method"], c["quantity"], c["against"]) == ("multi2", DEFAULT, "adhesion", "truth")
    )
    # the spell in which the vehicle is stuck is there to be left out, and it is a few seconds of 300
    left_out = main["whole"]["count"] - main["without_outlier"]["count"]
    assert 0 < left_out < 0.05 * main["whole"]["count"]
    # a sound estimate of the simulated adhesion, far from the floor of 0 that a constant would score
    assert main["without_outlier"]["r2"] > 0.8


def test_the_page_says_simulated_and_loads_nothing(
    demo: tuple[DemoResult, Path, list[tuple[int, int, str]]],
) -> None:
    html = demo[0].page.read_text(encoding="utf-8")
    assert "simulated data" in html
    assert "0.848" in html
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#)""", html)
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", html, re.DOTALL)
    assert len(captions) == 21
    assert sum("imulated" in caption for caption in captions) >= 9
    # the paper's figure of both paths, simulated
    assert any(caption.startswith("Simulated paths of multi1 and multi2") for caption in captions)
    assert html.index("<h2>Summary</h2>") < html.index("<h2>Traction in multi2</h2>")


def test_progress_counts_every_step_once(demo: tuple[DemoResult, Path, list[tuple[int, int, str]]]) -> None:
    progress = demo[2]
    total = progress[0][1]
    assert [done for done, _, _ in progress] == list(range(1, total + 1))
    assert {"multi1", "multi2", "fine-03"} <= {what for _, _, what in progress}


@pytest.mark.long  # of a command that writes many files: test_cli_output.py
def test_an_interrupt_leaves_whole_files_only(tmp_path: Path) -> None:
    def stop(done: int, total: int, what: str) -> None:
        if what == "multi1":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_demo(tmp_path, SEED, 2, stop, runs=())
    assert not (tmp_path / "index.html").exists()
    for path in (tmp_path / "estimates").iterdir():
        assert not path.name.startswith(".")
        assert len(Estimates.read(path)) > 1000


def test_a_folder_that_cannot_be_made_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x", encoding="utf-8")

    def never(*_: object) -> None:
        raise AssertionError("work was done before the folder was tried")

    with pytest.raises(InputError, match="cannot be made"):
        run_demo(tmp_path / "file" / "out", SEED, 1, never)

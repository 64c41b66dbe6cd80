"""Notes name the page that explains them, and the page and its heading are there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.note_pages import PAGES, with_page

ROOT = Path(__file__).resolve().parents[1]
SOURCE = " ".join(
    re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8"))
    for path in (ROOT / "src/terragrip").rglob("*.py")
    if path.name != "note_pages.py"
)


def _anchors(page: str) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", (ROOT / f"docs/{page}.md").read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize(("words", "page"), PAGES)
def test_the_words_are_some_notes_and_the_heading_exists(words: str, page: str) -> None:
    name, _, heading = page.partition("#")
    assert words in SOURCE, "no message holds these words any more"
    assert heading in _anchors(name)


def test_every_page_that_an_error_names_exists() -> None:
    named = re.findall(
        r"""page = ?"([a-z-]+)#([a-z0-9-]+)"|page="([a-z-]+)#([a-z0-9-]+)"|"(vehicle|formats|install)#([a-z0-9-]+)\"""",
        SOURCE,
    )
    pairs = {(a or c or e, b or d or f) for a, b, c, d, e, f in named}
    assert len(pairs) >= 3
    assert [(page, heading) for page, heading in sorted(pairs) if heading not in _anchors(page)] == []


def test_a_note_that_names_its_page_is_left_alone() -> None:
    note = "acceleration_z rests at 1: the accelerations may be in g. (docs: formats)"
    assert with_page(note) == note
    assert with_page("Nothing known.") == "Nothing known."


def test_the_summary_of_an_estimate_names_pages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = tg.simulate("fine-10", seed=2)
    drive.vehicle.save(tmp_path / "v.yaml")
    table = drive.recording.to_pandas().drop(columns="drawbar_force").assign(extra=1.0)
    table.to_csv(tmp_path / "log.csv", index=False)
    log, vehicle = str(tmp_path / "log.csv"), str(tmp_path / "v.yaml")
    assert main(["estimate", log, "--vehicle", vehicle, "-o", str(tmp_path / "e.parquet")]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Note: ")]
    assert any(
        line.endswith("if nothing is towed. (docs: vehicle#signals-that-are-missing)") for line in notes
    )
    assert any("extra" in line and line.endswith("(docs: formats#in-a-profile)") for line in notes)


def test_a_driven_wheel_without_a_speed_is_refused_with_the_way_out(tmp_path: Path) -> None:
    machine = _tractor(tmp_path)
    time = np.arange(0.0, 5.0, 0.1)
    names = ("wheel_speed_rl", "drive_torque_rl", "drive_torque_rr", "ground_speed")
    log = tg.Recording(time, {name: np.ones(len(time)) for name in names})
    with pytest.raises(
        tg.InputError, match=r"wheel_speed_rr.*name them alike.*vehicle#signals-that-are-missing"
    ):
        tg.estimate(log, machine)


def _tractor(folder: Path) -> tg.Vehicle:
    path = folder / "tractor.yaml"
    assert main(["new", "vehicle", "--class", "tractor-2wd", "-q", "-o", str(path)]) == 0
    return tg.Vehicle.load(path)


def test_a_drive_trains_speed_beside_wheel_torques_changes_nothing() -> None:
    """A stranger's log of a tractor had both, and was refused for a sensor that nobody had named."""
    drive = tg.simulate("fine-10", seed=3)
    both = {**drive.recording.channels, "wheel_based_speed": drive.recording.channels["ground_speed"] * 1.1}
    alone = tg.estimate(drive.recording, drive.vehicle)
    with_it = tg.estimate(tg.Recording(drive.recording.time, both), drive.vehicle)
    np.testing.assert_array_equal(with_it["slip_rl"], alone["slip_rl"])


def test_what_would_help_every_wheel_is_said_once() -> None:
    """Of four wheels that slip alike throughout one has a radius of its own: the remedy stands in the first note alone."""
    time = np.arange(0.0, 120.0, 0.1)
    speed = 2.0 + 0.3 * np.sin(time / 9)
    drive = tg.simulate("fine-10", seed=1)
    radius = drive.vehicle.wheel_radius
    rims = {f"wheel_speed_{w}": 1.15 * speed / r for w, r in zip(drive.vehicle.wheels, radius, strict=True)}
    rims["wheel_speed_fr"] *= 1.01
    notes = tg.estimate(tg.Recording(time, rims | {"ground_speed": speed}), drive.vehicle).notes
    assert sum("Zero-slip radius of wheels fl, rl, rr in this log" in note for note in notes) == 1
    assert sum("Zero-slip radius of wheel fr in this log" in note for note in notes) == 1
    assert sum("record 40 s without load" in note for note in notes) == 1

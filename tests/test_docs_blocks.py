"""Code on the pages of docs/ is right: each command line is one that the program takes, each Python block runs.

Those of README, vehicle, export, soils and ground-classifier run here, tutorials as a whole in tests/test_tutorial.py, the format of
docs/formats.md in tests/formats/test_registry.py.
"""

from __future__ import annotations

import re
import shlex
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import typer
import yaml

import terragrip as tg
from terragrip.cli.entry import program
from terragrip.formats.profile import Profile, Source
from terragrip.soil.library import SoilLibrary

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md"])
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PROGRAM = re.compile(r"^(?: {4})?(?:\$ )?(?:\.venv/bin/)?terragrip ([a-z-]+(?: .*)?)$")


def command_lines(page: Path) -> list[str]:
    """What follows `terragrip` in a page's blocks, continued lines joined; shapes of calls ([--x], ...) are none."""
    text = re.sub(r" *\\\n *", " ", page.read_text(encoding="utf-8"))
    found = [match[1] for line in text.splitlines() if (match := PROGRAM.match(line))]
    return [words for words in found if not re.search(r"\.\.\.|\[-|\[LOG| \| ", words)]


def parse(words: list[str]) -> None:
    """Parse without running; raises click's own error on a command or an option that there is not."""
    command = program()
    path = "terragrip"
    while hasattr(command, "commands"):
        path, name, words = f"{path} {words[0]}", words[0], words[1:]
        assert name in command.commands, f"no command {name!r}"
        command = command.commands[name]
    command.make_context(path, words)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_the_python_of_a_page_imports_is_there(page: Path) -> None:
    for language, text in FENCED.findall(page.read_text(encoding="utf-8")):
        if language == "python":
            for line in re.findall(r"^(?:from terragrip\S* )?import .*$", text, re.MULTILINE):
                exec(line, {})
            for name in re.findall(r"\btg\.(\w+)", text):
                assert hasattr(tg, name), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_program_takes_every_command_line_of_a_page(page: Path) -> None:
    for line in command_lines(page):
        words = shlex.split(line, comments=True)
        try:
            parse(words)
        except typer.Exit:  # --list and the like end the program while it parses
            continue
        except Exception as error:  # noqa: BLE001 - whatever click raises is the page's fault
            pytest.fail(f"{page.name}: terragrip {line}: {getattr(error, 'message', error)}")


def test_there_are_command_lines_and_a_wrong_option_is_found() -> None:
    assert sum(len(command_lines(page)) for page in PAGES) > 40
    with pytest.raises(Exception, match="--vehicel"):
        parse(["estimate", "a.csv", "--vehicel", "v.yaml", "-o", "x.parquet"])


def python_blocks(page: Path) -> list[str]:
    return [
        text for language, text in FENCED.findall(page.read_text(encoding="utf-8")) if language == "python"
    ]


@pytest.mark.parametrize("page", [p for p in PAGES if python_blocks(p)], ids=lambda page: page.stem)
def test_every_python_block_compiles(page: Path) -> None:
    for text in python_blocks(page):
        compile(text, str(page), "exec")


RUN_HERE = {"README", "vehicle", "export", "ground-classifier", "soils"}
RUN_ELSEWHERE = {page.stem for page in ROOT.glob("docs/tutorial*.md")} | {"formats"}


def test_every_page_with_python_is_run_by_some_test() -> None:
    """test_tutorial.py takes every docs/tutorial*.md; of docs/formats.md it is the reader for a format of one's own."""
    assert {page.stem for page in PAGES if python_blocks(page)} == RUN_HERE | RUN_ELSEWHERE


def test_the_profiles_and_vehicles_on_the_pages_load(tmp_path: Path) -> None:
    blocks = [
        (page, textwrap.dedent(text))
        for page in PAGES
        for text in re.findall(
            r"(?:^ {4}.*\n|^ *\n(?= {4}))+", page.read_text(encoding="utf-8"), re.MULTILINE
        )
        if re.search(r"^ {4}channels:$", text, re.MULTILINE)
    ]
    assert len(blocks) >= 2
    for _, text in blocks:
        assert Profile.from_dict(yaml.safe_load(text)).channels
    keys = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    fields = {field.alias or name for name, field in Source.model_fields.items()}
    assert {key for key in fields if f"`{key}`" not in keys} == set()


def run_blocks(page: str, **names: Any) -> dict[str, Any]:
    """Run a page's Python blocks one after another in the present folder; what they and ``names`` define."""
    for text in python_blocks(ROOT / f"docs/{page}.md"):
        exec(compile(text, page, "exec"), names)
    return names


def test_the_block_of_the_export_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    drive = tg.simulate("fine-10", seed=1)
    table = drive.recording.to_pandas().iloc[:3000]
    instants = pd.Timestamp("2019-06-12 08:00:00", tz="UTC") + pd.to_timedelta(table["time"], unit="s")
    table.assign(time=instants.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")).to_csv("log.csv", index=False)
    estimates = tg.estimate(tg.read("log.csv"), drive.vehicle)
    frame = run_blocks("export", estimates=estimates)["frame"]
    assert frame.attrs["units"]["wheel_speed_fl"] == "rad/s"
    inside = frame.loc["2019-06-12 08:00":"2019-06-12 08:05", "slip_fl"]  # type: ignore[misc]
    assert len(inside) == len(frame)


def test_the_block_of_the_ground_classifier_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(2)
    time = np.arange(0, 60, 0.02)
    for name, rough in {
        "asphalt_1": 0.2,
        "asphalt_2": 0.2,
        "snow_1": 1.5,
        "snow_2": 1.5,
        "monday": 1.5,
    }.items():
        shake = {f"a{axis}": rough * rng.standard_normal(time.size) for axis in "xyz"}
        wheels = {f"rpm_{side}": 60 + rough * rng.standard_normal(time.size) for side in ("left", "right")}
        pd.DataFrame({"t": time, "v": 1.2, **wheels, **shake}).to_csv(f"{name}.csv", index=False)
    Path("robot.yaml").write_text(
        "time: {from: t}\nchannels:\n  ground_speed: {from: v}\n"
        + "".join(f"  wheel_speed_{s}: {{from: rpm_{s}, unit: rpm}}\n" for s in ("left", "right"))
        + "".join(f"  acceleration_{a}: {{from: a{a}}}\n" for a in "xyz")
    )
    names = run_blocks("ground-classifier")
    assert (names["grounds"].predict([names["drive"]]) == "snow").mean() > 0.8


def test_the_block_of_the_soils_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_blocks("soils")
    (soil,) = SoilLibrary.load("cone.json").values()
    assert soil.model == "brixius"


def test_the_blocks_of_readme_and_of_the_vehicle_file_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    drive = tg.simulate("fine-10", seed=1)
    drive.vehicle.save("robot.yaml")
    table = drive.recording.to_pandas()
    table.to_csv("log.csv", index=False)
    names: dict[str, Any] = {"sample": table.iloc[0].to_dict()}
    for page in (ROOT / "README.md", ROOT / "docs/vehicle.md"):
        for text in python_blocks(page):
            exec(compile(text, str(page), "exec"), names)
    assert names["out"]["time"] == table["time"][0]
    assert tg.Vehicle.load("tractor.yaml").mass == pytest.approx(6200)

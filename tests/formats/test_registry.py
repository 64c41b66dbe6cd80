"""Formats by name: the example of docs/formats.md, installed as a package is, is read as ours are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.formats import inspect
from terragrip.formats.registry import format_of, formats, is_bag

DOCS = Path(__file__).parents[2] / "docs" / "formats.md"


def install(folder: Path, entry: str, content: str) -> None:
    """A package with one module and one entry point, as pip leaves it."""
    (folder / "plainlog.py").write_text(content)
    about = folder / "plainlog-1.0.dist-info"
    about.mkdir(exist_ok=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: plainlog\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[terragrip.formats]\n{entry}\n")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "plainlog", raising=False)
    formats.cache_clear()
    yield tmp_path
    formats.cache_clear()


def example() -> tuple[str, str]:
    """The entry point and the module of the docs."""
    text = DOCS.read_text()
    entry = re.search(r'^plainlog = "(plainlog:\w+)"$', text, re.MULTILINE)
    module = re.search(r"```python\n(\"\"\"plainlog.*?)```", text, re.DOTALL)
    assert entry is not None
    assert module is not None
    return f"plainlog = {entry[1]}", module[1]


def test_the_example_of_the_docs_is_read_everywhere(folder: Path) -> None:
    install(folder, *example())
    time = np.arange(0, 60, 0.1)
    lines = [
        f"{name} {t:.2f} {v}"
        for t in time
        for name, v in (("ground_speed", 1.2), ("wheel_speed_l", 6.0 + 0.1 * t))
    ]
    log = folder / "drive.anything"
    log.write_text("PLAINLOG\n" + "\n".join([*lines, "what is this"]) + "\n")
    assert format_of(log).title == "plain log"
    recording = tg.read(log)
    assert np.allclose(recording["wheel_speed_l"], 6.0 + 0.1 * time)
    assert np.allclose(recording["ground_speed"], 1.2)
    assert "1 lines cannot be read and were left out." in recording.notes
    assert inspect(log).ready
    (folder / "drive.plain").write_text("nothing tells\n")
    assert format_of(folder / "drive.plain").name == "plainlog"  # by its suffix


@pytest.mark.parametrize(
    ("entry", "content", "problem"),
    [
        (
            "csv = plainlog:FORMAT",
            example()[1].replace('"plainlog", "plain log"', '"csv", "plain log"'),
            "is there already",
        ),
        ("plainlog = plainlog:GONE", example()[1], "cannot be loaded"),
        ("plainlog = plainlog:read", example()[1], "plainlog:read is not a Format"),
    ],
)
def test_a_format_that_cannot_be_registered_is_named(
    folder: Path, entry: str, content: str, problem: str
) -> None:
    install(folder, entry, content)
    (folder / "log.csv").write_text("time,ground_speed,wheel_speed_l\n0,1,5\n1,1,5\n")
    with pytest.raises(InputError, match=rf"format \w+: .*{problem}.*; update or remove the package"):
        tg.read(folder / "log.csv")


def test_every_format_of_ours_has_a_name_and_a_title() -> None:
    assert set(formats()) == {
        "csv", "parquet", "blf", "asc", "trc", "candump", "frames", "mdf", "ros1", "ros2", "mcap", "matlab", "nmea", "vbo",
    }  # fmt: skip
    assert len({one.title for one in formats().values()}) == len(formats())


@pytest.mark.parametrize(
    ("names", "bag"),
    [
        (("metadata.yaml", "run_0.mcap", "notes.csv"), True),
        (("run_0.db3",), True),
        (("run_0.mcap", "run_1.mcap", "notes.txt"), True),
        (("run.mcap", "other.csv"), False),
        (("other.csv",), False),
    ],
)
def test_a_day_of_logs_one_of_which_is_a_bags_file_is_no_bag(
    tmp_path: Path, names: tuple[str, ...], bag: bool
) -> None:
    """`inspect` and `estimate` took the one for the whole folder, and said nothing of the others."""
    for name in names:
        (tmp_path / name).write_bytes(b"")
    assert is_bag(tmp_path) is bag

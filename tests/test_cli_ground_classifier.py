"""``terragrip ground-classifier``: train on labelled logs, tell the grounds of others, refuse what cannot be learnt from."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from terragrip.cli import main

sys.path.insert(0, str(Path(__file__).parent / "ground" / "classification"))
from classifier_drives import BODY, drive

pytestmark = pytest.mark.usefixtures("small_forests")

GROUNDS = ("hard", "loose")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three labelled drives of two grounds, wheels only, one of each not learnt from, and the classifier of them."""
    folder = tmp_path_factory.mktemp("drives")
    rows = []
    for ground in GROUNDS:
        for seed in range(4):
            table = drive(ground, seed, 20.0).drop(columns=BODY).dropna()
            table.to_csv(folder / f"{ground}{seed}.csv", index=False)
            if seed:
                rows.append({"file": f"{ground}{seed}.csv", "label": ground})
    pd.DataFrame(rows).to_csv(folder / "labels.csv", index=False)
    learn = ["ground-classifier", "train", "--labels", str(folder / "labels.csv")]
    assert main([*learn, "-o", str(folder / "grounds.npz")]) == 0
    return folder


def test_drives_never_seen_are_told_in_a_table_of_windows(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = [str(folder / f"{ground}0.csv") for ground in GROUNDS]
    words = ["ground-classifier", "predict", *logs, "-c", str(folder / "grounds.npz"), "--rejection", "0"]
    assert main([*words, "-o", str(tmp_path / "windows.csv")]) == 0
    assert "hard0.csv: 11 windows; hard" in capsys.readouterr().out
    windows = pd.read_csv(tmp_path / "windows.csv")
    named = ["file", "start", "end", "ground", "novelty", "probability_hard", "probability_loose"]
    assert list(windows.columns) == named
    np.testing.assert_allclose(windows["end"] - windows["start"], 1.7)
    np.testing.assert_allclose(windows[["probability_hard", "probability_loose"]].sum(axis=1), 1.0, atol=1e-5)
    assert (windows["ground"] + "0.csv" == windows["file"]).mean() > 0.9
    assert main([*words, "--step", "0.5", "-q", "-o", str(tmp_path / "windows.parquet")]) == 0
    closer = pd.read_parquet(tmp_path / "windows.parquet")
    first = closer[closer["file"] == "hard0.csv"]["start"]
    np.testing.assert_allclose(np.diff(first), 0.5)


def test_another_log_of_the_drive_adds_its_sensors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A body sensor logged in a file of its own, named by the table's third column and by --with."""
    rows = []
    for ground in GROUNDS:
        for seed in range(3):
            table = drive(ground, seed, 20.0)
            wheels = [c for c in table if c not in BODY]
            table[wheels].dropna().to_csv(tmp_path / f"{ground}{seed}.csv", index=False)
            table[["time", *BODY]].dropna().to_csv(tmp_path / f"body_{ground}{seed}.csv", index=False)
            rows.append({"file": f"{ground}{seed}.csv", "label": ground, "with": f"body_{ground}{seed}.csv"})
    pd.DataFrame(rows).to_csv(tmp_path / "labels.csv", index=False)
    words = ["ground-classifier", "train", "--labels", str(tmp_path / "labels.csv")]
    assert main([*words, "-q", "-o", str(tmp_path / "grounds.npz")]) == 0
    from terragrip import GroundClassifier

    learnt = GroundClassifier.load(tmp_path / "grounds.npz")
    assert learnt.sensors_[0] == ("acceleration", "angular velocity", "torque", "wheel speed")
    tell = ["ground-classifier", "predict", str(tmp_path / "loose0.csv"), "-c", str(tmp_path / "grounds.npz")]
    with_body = ["--with", str(tmp_path / "body_loose0.csv")]
    assert main([*tell, "-q", "-o", str(tmp_path / "alone.csv")]) == 0
    assert main([*tell, *with_body, "-q", "-o", str(tmp_path / "both.csv")]) == 0
    alone, both = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("alone", "both"))
    assert len(alone) == len(both)
    assert not np.allclose(alone["novelty"], both["novelty"])
    capsys.readouterr()
    seldom = pd.read_csv(tmp_path / "loose0.csv").iloc[
        ::5
    ]  # the body sensor alone is judged, and the rest is named
    seldom.to_csv(tmp_path / "loose0.csv", index=False)
    assert main([*tell, *with_body, "-o", str(tmp_path / "slow.csv")]) == 0
    assert "wheel speed: sampled every" in capsys.readouterr().out


def test_labels_may_be_a_column_of_the_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A drive over both grounds; what is not labelled, or for less than a window, is not learnt from."""
    logs = []
    for seed in range(3):
        parts = []
        for k, (ground, label) in enumerate((("hard", "hard"), ("loose", ""), ("loose", "loose"))):
            part = drive(ground, seed, 15.0).drop(columns=BODY).dropna()
            parts.append(part.assign(time=part["time"] + 20 * k, soil=label))
        parts[-1].loc[parts[-1].index[-4:], "soil"] = "gravel"
        table = pd.concat(parts)
        table.to_csv(tmp_path / f"drive{seed}.csv", index=False)
        logs.append(str(tmp_path / f"drive{seed}.csv"))
    assert main(["ground-classifier", "train", *logs, "-o", str(tmp_path / "grounds.npz")]) == 0
    assert "hard (3 drives), loose (3 drives)" in capsys.readouterr().out
    table.rename(columns={"soil": "terrain"}).to_csv(tmp_path / "other.csv", index=False)
    assert (
        main(["ground-classifier", "train", str(tmp_path / "other.csv"), "-o", str(tmp_path / "g.npz")]) == 2
    )
    assert "column soil: is missing; name the column with --column" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("table", "more", "expected"),
    [
        ("file,label\nhard1.csv,hard\nhard2.csv,hard\n", [], "there is one ground only, hard"),
        ("file,label\nhard1.csv,hard\nlose1.csv,loose\n", [], "row 3: there is no run"),
        ("file,label\nhard1.csv,hard\nloose1.csv,\n", [], "row 3: the label is empty"),
        ("file,label\nhard1.csv,hard\nhard1.csv,loose\n", [], "row 3: hard1.csv is labelled in row 2 too"),
        ("file,ground\nhard1.csv,hard\n", [], "line 1: has no column label"),
        ("file,label\nhard1.csv,hard,dry\n", [], "row 2: has 3 cells for 2 columns"),
        ("file,label\n", [], "holds no run"),
        ("file;label\nhard1.csv;unknown\nloose1.csv;loose\n", [], "'unknown' cannot be learned as a ground"),
        ("file,label\nhard1.csv,hard\nloose1.csv,loose\n", ["--window", "0.2"], "shorter than two samples"),
        (
            "file,label\nhard1.csv,hard\nloose1.csv,loose\n",
            ["--window", "-1"],
            "window: -1.0 is out of range",
        ),
        ("file,label\nhard1.csv,hard\nlabels.csv,loose\n", [], "labels.csv: column time"),
    ],
)
def test_what_cannot_be_learnt_from_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], table: str, more: list[str], expected: str
) -> None:
    labels = folder / "wrong.csv"
    labels.write_text(table, encoding="utf-8")
    words = ["ground-classifier", "train", "--labels", str(labels), *more, "-o", str(folder / "no.npz")]
    assert main(words) == 2
    line = capsys.readouterr().err
    assert expected in line
    assert line.count("\n") == 1
    assert not (folder / "no.npz").exists()


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("hard1.csv,hard\nlose2.csv,loose\n", "row 3: 'lose2.csv' names no run; did you mean loose2.csv?"),
        ("hard1.csv,hard\n", "holds no label for"),
    ],
)
def test_a_label_that_names_no_given_log_is_refused_and_a_log_without_one(
    folder: Path, capsys: pytest.CaptureFixture[str], rows: str, expected: str
) -> None:
    labels = folder / "wrong.csv"
    labels.write_text(f"file,label\n{rows}", encoding="utf-8")
    logs = [str(folder / "hard1.csv"), str(folder / "loose2.csv")]
    words = ["ground-classifier", "train", *logs, "--labels", str(labels), "-o", str(folder / "no.npz")]
    assert main(words) == 2
    assert expected in capsys.readouterr().err


def test_a_log_without_a_learnt_sensor_or_too_short_and_a_foreign_classifier_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.arange(0, 20, 0.1)
    pd.DataFrame({"time": time, "acceleration_x": np.sin(time)}).to_csv(tmp_path / "body.csv", index=False)
    tell = ["ground-classifier", "predict", str(tmp_path / "body.csv"), "-o", str(tmp_path / "w.csv")]
    assert main([*tell, "-c", str(folder / "grounds.npz")]) == 2
    assert "body.csv: has none of the learned sensors" in capsys.readouterr().err
    pd.read_csv(folder / "hard1.csv").head(5).to_csv(tmp_path / "body.csv", index=False)
    assert main([*tell, "-c", str(folder / "grounds.npz")]) == 2
    assert "too short for a window" in capsys.readouterr().err
    pd.read_csv(folder / "hard1.csv").iloc[::4].to_csv(tmp_path / "body.csv", index=False)
    assert main([*tell, "-c", str(folder / "grounds.npz")]) == 2
    assert "sampled every 0.62 s, learned every 0.15 s, not used" in capsys.readouterr().err
    (tmp_path / "foreign.npz").write_bytes(b"PK")
    assert main([*tell, "-c", str(tmp_path / "foreign.npz")]) == 2
    assert "foreign.npz" in capsys.readouterr().err
    assert not (tmp_path / "w.csv").exists()

"""``terragrip soils``: a library from estimates, and every input that is none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.recording.checks import NOTHING_TOWED
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("one_form")

ROWS = 3000
VEHICLE: dict[str, Any] = {
    "name": "robot",
    "mass": "139 kg",
    "wheelbase": "0.64 m",
    "center_of_gravity_height": "0.3 m",
    "hitch_height": "0.25 m",
    "axles": {
        "front": {"mass": "54 kg", "wheels": ["fl", "fr"]},
        "rear": {"mass": "85 kg", "wheels": ["rl", "rr"]},
    },
    "wheel": {"radius": "0.2 m", "inertia": "0.27 kg m^2"},
    "tire_rolling_resistance": 0.03,
}

Write = Callable[..., Path]
Fails = Callable[..., str]


def estimates(
    seed: int, a: float = 0.85, soil: str = "fine", slip: tuple[float, float] = (0.0, 0.55)
) -> Estimates:
    """A drive of 30 m whose wheels slip by `slip`, low to high; `soil` "" = no labels."""
    rng = np.random.default_rng(seed)
    columns = {
        "distance": np.linspace(0, 30, ROWS),
        "soil_resistance": np.full(ROWS, 0.08),
        "ground_speed": np.full(ROWS, 0.6),
    }
    a *= 1 + 0.03 * rng.standard_normal()
    s = slip[0] + (slip[1] - slip[0]) * (0.5 - 0.5 * np.cos(columns["distance"] / 2))
    for wheel in ("fl", "fr", "rl", "rr"):
        mu = CURVES["exponential"].value(s, {"a": a}) + 0.02 * rng.standard_normal(ROWS)
        columns |= {f"slip_{wheel}": s, f"slip_{wheel}_std": np.full(ROWS, 0.005), f"adhesion_{wheel}": mu}
    labels = {"soil": np.full(ROWS, soil, dtype=object)} if soil else {}
    about = {"method": "kalman", "vehicle": Vehicle.from_dict(VEHICLE).to_dict()}
    return Estimates(np.arange(ROWS) * 0.01, columns, np.zeros(ROWS, dtype=np.uint8), labels, about)


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a table of estimates and returns its file."""

    def make(name: str, **drive: Any) -> Path:
        path = tmp_path / f"{name}.parquet"
        estimates(**{"seed": sum(map(ord, name)), **drive}).write(path)
        return path

    return make


@pytest.fixture
def fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Fails:
    """Return a function that runs the command, expects exit 2 and one line, and returns the line."""

    def run(*words: Any) -> str:
        output = tmp_path / "out.json"
        assert main(["soils", *map(str, words), "-o", str(output)]) == 2
        lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
        assert len(lines) == 1, lines
        assert not output.exists()
        return lines[0]

    return run


def learn(output: Path, *words: Any) -> dict[str, Any]:
    assert main(["soils", *map(str, words), "-o", str(output)]) == 0
    result: dict[str, Any] = json.loads(output.read_text(encoding="utf-8"))
    return result


def test_two_soils_of_six_runs(write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [write(f"fine{i}") for i in range(6)] + [write(f"hard{i}", a=1.42, soil="hard") for i in range(6)]
    library = learn(tmp_path / "soils.json", *files)
    assert set(library["soils"]) == {"fine", "hard"}
    for name, truth in (("fine", 0.85), ("hard", 1.42)):
        soil = library["soils"][name]
        assert soil["parameters"]["a"] == pytest.approx(truth, rel=0.05)
        low, high = soil["interval"]["a"]
        assert low < soil["parameters"]["a"] < high
        assert soil["r2"] > 0.97
    text = capsys.readouterr().out
    for sentence in ("fine", "no data between", "Written to"):
        assert sentence in text


def test_quiet_says_nothing(write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    learn(tmp_path / "soils.json", write("a"), "--quiet")
    output = capsys.readouterr()
    assert output.out + output.err == ""


def test_literature_is_added(write: Write, tmp_path: Path) -> None:
    library = learn(tmp_path / "soils.json", write("a"), "--literature", "--quiet")
    assert len(library["soils"]) > 8


def test_free_shape_weights_and_other_bins(write: Write, tmp_path: Path) -> None:
    files = [write(f"r{i}") for i in range(5)]
    library = learn(
        tmp_path / "soils.json", *files, "--free", "--weights", "--width", 0.02, "--upper", 0.5, "--quiet"
    )
    soil = library["soils"]["fine"]
    assert soil["settings"]["width"] == 0.02
    assert soil["settings"]["upper"] == 0.5
    assert not soil["identifiability"]["identifiable"]
    assert set(soil["interval"]) == {"A", "k", "d"}


def test_the_papers_bins_alone_or_beside_those_by_pull(write: Write, tmp_path: Path) -> None:
    files = [write(f"r{i}") for i in range(5)]
    both = learn(tmp_path / "both.json", *files, "--metres", 2, "--quiet")["soils"]["fine"]
    paper = learn(tmp_path / "paper.json", *files, "--by", "slip", "--quiet")["soils"]["fine"]
    assert both["settings"]["by"] == "pull"
    assert both["settings"]["metres"] == 2
    assert min(row["metres"] for row in both["bins"]) >= 2
    assert paper["settings"]["by"] == "slip"
    assert both["by_slip"]["parameters"] == paper["parameters"]
    assert both["by_slip"]["bins"] == paper["bins"]


@pytest.mark.parametrize(("option", "value"), [("--by", "colour"), ("--metres", 0), ("--runs", 0)])
def test_bins_that_are_none(write: Write, fails: Fails, option: str, value: object) -> None:
    assert "--by, --metres, --runs" in fails(write("one"), option, value)


def test_no_labels(write: Write, fails: Fails, tmp_path: Path) -> None:
    file = write("bare", soil="")
    assert "no sample has a soil label" in fails(file)
    assert set(learn(tmp_path / "named.json", file, "--soil", "field", "--quiet")["soils"]) == {"field"}


@pytest.mark.parametrize(
    ("slip", "word"),
    [((-0.5, -0.06), "0 slip bins"), ((0.0, 0.004), "0 slip bins")],
)
def test_a_soil_that_cannot_be_fitted_is_stated_not_drawn(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str], slip: tuple[float, float], word: str
) -> None:
    library = learn(tmp_path / "soils.json", write("poor", slip=slip))
    assert library["soils"] == {}
    assert word in library["not_fitted"]["fine"]
    assert "fine: not fitted" in capsys.readouterr().out


def test_small_slips_by_an_uncertain_radius_are_learned_and_not_called_fixed(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The vehicle file says nothing of the radius, so 2 % of slip may be its error."""
    soil = learn(tmp_path / "soils.json", write("light", slip=(0.0, 0.04)))["soils"]["fine"]
    low, high = soil["interval"]["a"]
    assert low < 0.85 < high
    assert not soil["identifiability"]["identifiable"]
    assert "The data leave a open" in capsys.readouterr().out


def test_merge_replaces_its_twin_and_keeps_the_others(write: Write, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    learn(old, write("hard", a=1.42, soil="hard"), write("fine", a=0.5), "--quiet")
    new = learn(tmp_path / "new.json", write("again", a=0.9), "--merge", old, "--quiet")
    assert set(new["soils"]) == {"hard", "fine"}
    assert new["soils"]["fine"]["parameters"]["a"] == pytest.approx(0.9, rel=0.1)
    assert new["soils"]["hard"] == json.loads(old.read_text())["soils"]["hard"]


def spoiled(change: Callable[[dict[str, Any]], Any]) -> str:
    library = {"version": 1, "soils": {"hard": {"model": "exponential", "parameters": {"a": 1.4}}}}
    change(library)
    return json.dumps(library)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (spoiled(lambda x: x.update(version=99)), "is of version 99"),
        (spoiled(lambda x: x["soils"]["hard"].update(model="cubic")), "curve model 'cubic' is not known"),
        (spoiled(lambda x: x["soils"]["hard"]["parameters"].update(a="much")), "'much' is not a number"),
        (spoiled(lambda x: x["soils"]["hard"]["parameters"].update(a=float("nan"))), "nan is not a number"),
        (spoiled(lambda x: x["soils"]["hard"]["parameters"].update(b=1.0)), "has no parameter b"),
        (spoiled(lambda x: x["soils"]["hard"].update(bins=[{"slip": "?"}])), "'?' is not a number"),
        (spoiled(lambda x: x.pop("soils")), "holds no 'soils'"),
        ('{"soils": {"hard": {}, "hard": {}}}', "two entries are named 'hard'"),
        ("not json", "not JSON"),
        ("", "not JSON"),
        ("[]", "holds no 'soils'"),
    ],
)
def test_a_library_that_is_none(write: Write, fails: Fails, tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "library.json"
    path.write_text(text, encoding="utf-8")
    line = fails(write("a"), "--merge", path)
    assert expected in line
    assert "library.json" in line


def test_files_that_are_no_estimates(write: Write, fails: Fails, tmp_path: Path) -> None:
    import pandas as pd

    table = tmp_path / "table.parquet"
    pd.DataFrame({"time": [0.0, 1.0], "x": [1.0, 2.0]}).to_parquet(table)
    text = tmp_path / "text.parquet"
    text.write_text("time,slip\n0,0.1\n")
    damaged = tmp_path / "damaged.parquet"
    damaged.write_bytes(write("whole").read_bytes()[:4000])
    for path in (table, text, damaged, tmp_path / "absent.parquet", tmp_path):
        assert path.name in fails(path)


def test_a_file_twice(write: Write, fails: Fails) -> None:
    file = write("a")
    assert "is given twice" in fails(file, file.parent / "." / file.name)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--model", "cubic"), "no curve model 'cubic'"),
        (("--width", "0"), "no bins"),
        (("--lower", "0.5", "--upper", "0.4"), "no bins"),
        (("--minimum", "0"), "no bins"),
        (("--width", "nan"), "no bins"),
        (("--merge", "absent.json"), "absent.json"),
    ],
)
def test_calls_that_make_no_sense(write: Write, fails: Fails, words: tuple[str, ...], expected: str) -> None:
    assert expected in fails(write("a"), *words)


def test_output_that_would_overwrite_an_input(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write("a")
    before = file.read_bytes()
    assert main(["soils", str(file), "-o", str(file)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert file.read_bytes() == before


def test_digitised_points_become_soils_beside_learned_ones(
    write: Write, fails: Fails, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    s = np.linspace(2, 58, 29)
    mu = [CURVES["exponential"].value(s / 100, {"a": a}) for a in (0.6, 1.1)]
    rows = "\n".join(f"{x:.2f};{y:.4f};{x:.2f};{z:.4f}" for x, y, z in zip(s, *mu, strict=True))
    points = tmp_path / "points.csv"
    points.write_text(f"clay;;stubble;\nX;Y;X;Y\n{rows}\n")
    result = learn(tmp_path / "soils.json", write("a"), points)["soils"]
    assert set(result) == {"fine", "clay", "stubble"}
    assert result["clay"]["parameters"]["a"] == pytest.approx(0.6, rel=1e-3)
    assert result["stubble"]["parameters"]["a"] == pytest.approx(1.1, rel=1e-3)
    assert result["clay"]["interval"] == {}
    assert "points.csv" in result["clay"]["source"]
    assert "data fix it" in capsys.readouterr().out
    points.write_text("slip;mu\n0.1;x\n0.2;0.3\n")
    assert "is not a number" in fails(write("b"), points)


def test_libraries_are_joined_twins_refused_and_others_compared(
    write: Write, fails: Fails, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fine, hard = tmp_path / "fine.json", tmp_path / "hard.json"
    learn(fine, *(write(f"f{i}") for i in range(5)), "--quiet")
    learn(hard, *(write(f"h{i}", a=1.42, soil="hard") for i in range(5)), "--quiet")
    both = tmp_path / "both.json"
    assert set(learn(both, fine, hard, "--quiet")["soils"]) == {"fine", "hard"}
    sentence = fails(fine, both)
    assert "'fine'" in sentence
    assert "both.json" in sentence
    capsys.readouterr()
    learn(tmp_path / "again.json", *(write(f"g{i}", a=0.95) for i in range(5)), "--compare", both)
    line = next(text for text in capsys.readouterr().out.splitlines() if text.startswith("  fine: "))
    assert float(line.split()[1]) == pytest.approx(
        0.1 * 0.43, abs=0.02
    )  # a is 0.1 larger, g is 0.43 in the mean
    assert "intervals of a" in line
    learn(tmp_path / "x.json", fine, "--compare", hard)
    assert "None of these soils" in capsys.readouterr().out


def test_a_soil_is_named_for_points_and_a_name_that_names_nothing_is_refused(
    tmp_path: Path, fails: Fails
) -> None:
    points = tmp_path / "points.csv"
    rows = [(s, 0.7 * (1 - np.exp(-9 * s))) for s in np.linspace(0.06, 0.5, 12)]
    points.write_text("slip,mu\n" + "\n".join(f"{s:.4f},{m:.4f}" for s, m in rows))
    result = learn(tmp_path / "soils.json", points, "--soil", "clay")["soils"]
    assert list(result) == ["clay"]
    assert "only libraries" in fails(tmp_path / "soils.json", "--soil", "clay")
    points.write_text("clay,,stubble,\nX,Y,X,Y\n" + "\n".join(f"{s},{m},{s},{m}" for s, m in rows))
    assert "holds 2 curves" in fails(points, "--soil", "clay")


def test_data_do_not_fix_a_curve_that_explains_little_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points, draws = tmp_path / "points.csv", np.random.default_rng(1000)
    mu = CURVES["exponential"].value(np.linspace(0.06, 0.55, 25), {"a": 0.85})
    rows = [
        (s, m + 0.08 * draws.standard_normal()) for s, m in zip(np.linspace(0.06, 0.55, 25), mu, strict=True)
    ]
    points.write_text("slip,mu\n" + "\n".join(f"{s:.4f},{m:.4f}" for s, m in rows))
    result = learn(tmp_path / "soils.json", points, "--soil", "clay")["soils"]["clay"]
    assert 0 < result["r2"] < 0.5
    assert result["identifiability"]["identifiable"] is False
    assert any("explains little of the bins" in note for note in result["notes"])
    output = capsys.readouterr().out
    assert f"no (R2 {result['r2']:.2f})" in output


def test_what_a_log_contradicted_is_said_of_its_soils(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It stood in the estimates' summary alone, which nobody sees of a batch."""
    note = "drive_torque_fl (0) never changes while the vehicle drives: the sensor is dead, or the column is wrong, or its motor is off."
    usual = NOTHING_TOWED
    paths = [tmp_path / f"run{k}.parquet" for k in range(7)]
    for k, path in enumerate(paths):
        replace(estimates(k), notes=(usual, note) if k else (usual,)).write(path)
    learn(tmp_path / "soils.json", *paths)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines if note in line] == [f"run{k}" for k in range(1, 6)]
    assert any("1 more run has such notes" in line for line in lines)
    assert not any(usual in line for line in lines)


def test_the_table_says_no_where_the_library_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scale that stops at the end of its range: the condition number and R2 alone would say yes."""
    points = tmp_path / "points.csv"
    slip = np.linspace(0.06, 0.55, 25)
    mu = CURVES["exponential"].value(slip, {"a": 10.3})
    points.write_text("slip,mu\n" + "\n".join(f"{s:.4f},{m:.4f}" for s, m in zip(slip, mu, strict=True)))
    badge = learn(tmp_path / "soils.json", points, "--soil", "clay")["soils"]["clay"]["identifiability"]
    assert badge["identifiable"] is False
    assert "stopped at an end" in badge["sentence"]
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("clay "))
    assert row.rstrip().endswith("no")


def test_digitised_points_begin_where_bins_by_slip_do(tmp_path: Path) -> None:
    """They have no pull, so the usual way does not lower their first slip; --lower does."""
    slip = np.linspace(0.01, 0.5, 50)
    mu = CURVES["exponential"].value(slip, {"a": 0.9})
    rows = "".join(f"{s},{m}\n" for s, m in zip(slip, mu, strict=True))
    (tmp_path / "points.csv").write_text("slip,mu\n" + rows)
    for options, lowest in (((), 0.05), (("--lower", 0.02), 0.02)):
        soils = learn(
            tmp_path / "soils.json", tmp_path / "points.csv", "--soil", "field", *options, "--quiet"
        )
        settings = soils["soils"]["field"]["settings"]
        assert settings["lower"] == lowest
        assert settings["by"] == "slip"

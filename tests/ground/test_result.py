"""ground.json, confusion and reliability."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from ground_drives import FINE, GRASS, drive
from terragrip.errors import InputError
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.changes import Change
from terragrip.ground.result import Timeline, read, write

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from ground_scores import calibration_error, confusion, merged, reliability


@pytest.fixture(scope="module")
def grounds(library):
    return [
        analyse(
            drive(k, [("grass", GRASS, 30), ("fine", FINE, 30)]), library, f"run{k}", Settings(online=k == 2)
        )[0]
        for k in (1, 2)
    ]


def test_it_is_read_as_it_was_written(grounds, tmp_path):
    write(grounds, tmp_path / "ground.json", {"library": "soils.json"})
    data = json.loads((tmp_path / "ground.json").read_text())
    assert {"changes", "sections", "events"} <= set(data)
    assert {row["run"] for row in data["sections"]} == {"run1", "run2"}
    assert {"time", "std", "probability"} <= set(data["changes"][0])
    contract = {
        "start",
        "end",
        "soil",
        "probabilities",
        "slip_mean",
        "slip_std",
        "adhesion_mean",
        "adhesion_std",
    }
    assert contract <= set(data["sections"][0])
    again = read(tmp_path / "ground.json")
    for one, other in zip(grounds, again, strict=True):
        assert (one.run, one.changes, one.sections, one.soils, one.notes) == (
            other.run, other.changes, other.sections, other.soils, other.notes,
        )  # fmt: skip
        np.testing.assert_allclose(one.timeline.probabilities, other.timeline.probabilities, atol=5e-5)
        np.testing.assert_array_equal(one.timeline.label, other.timeline.label)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 2}, "is of version 2"),
        ({"version": "x"}, "is of version x"),
        ({"runs": [{}]}, "is damaged"),
        ({"sections": [{"run": "run1", "colour": 1}]}, "is damaged"),
        ({"runs": None}, "is damaged"),
    ],
)
def test_a_newer_or_damaged_file_is_one_line(grounds, tmp_path, change, words):
    path = tmp_path / "ground.json"
    write(grounds, path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=words) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "{}", "\x00"])
def test_what_is_no_ground_is_refused(tmp_path, text):
    (tmp_path / "g.json").write_text(text)
    with pytest.raises(InputError, match=r"g\.json"):
        read(tmp_path / "g.json")


def timeline(stated, right, soils=("a", "b", "unknown")):
    """Blocks whose first soil has the probability `stated`, labelled by it where `right`."""
    n = len(stated)
    table = np.column_stack([stated, 0.6 * (1 - stated), 0.4 * (1 - stated)])
    label = np.where(right, soils[0], soils[1]).astype(object)
    return Timeline(np.arange(n) / 2, soils, table, np.ones(n, dtype=bool), label)


def test_reliability_finds_honest_and_boastful_probabilities():
    rng = np.random.default_rng(0)
    stated = rng.uniform(0.5, 1.0, 20_000)
    honest = reliability([timeline(stated, rng.random(20_000) < stated)])
    boastful = reliability([timeline(stated, rng.random(20_000) < stated - 0.2)])
    assert calibration_error(honest) < 0.02
    assert calibration_error(boastful) == pytest.approx(0.2, abs=0.02)
    assert sum(b.count for b in honest) == 20_000


def test_confusion_counts_and_merging_adds_up():
    one = timeline(np.array([0.9, 0.9, 0.1, 0.9]), np.array([True, True, False, False]))
    one.label[1] = ""
    result = confusion([one])
    assert (result.labels, result.soils) == (("a", "b"), ("a", "b"))
    np.testing.assert_array_equal(result.counts, [[1, 0], [1, 1]])
    assert result.right == pytest.approx(2 / 3)
    both = merged(one, {"a": "ab", "b": "ab"})
    assert both.names == ("ab", "unknown")
    np.testing.assert_allclose(both.probabilities[:, 0], one.probabilities[:, :2].sum(axis=1))
    assert confusion([both]).right == 1.0
    assert np.isnan(confusion([]).right)


def test_a_change_of_an_older_file_keeps_when_it_was_reported():
    old = {"time": 4.0, "std": 0.5, "probability": 0.9, "told": 6.5}
    assert Change.from_dict(old).to_dict() == {"time": 4.0, "std": 0.5, "probability": 0.9, "reported": 6.5}

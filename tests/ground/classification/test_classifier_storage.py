"""A stored classifier says the same as before; what is no stored classifier is refused in one line."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from classifier_drives import BODY, drive, drives
from terragrip import GroundClassifier, InputError

pytestmark = pytest.mark.usefixtures("small_forests")

TABLES, LABELS = drives(range(1000, 1002), seconds=15.0)
SHOWN = [drive("hard", 1010, 10.0), drive("rails", 1010, 10.0), drive("wet", 1010, 10.0).drop(columns=BODY)]


@pytest.fixture(scope="module")
def classifier() -> GroundClassifier:
    return GroundClassifier(max_windows=40, rejection=0.05, step=0.9).fit(TABLES, LABELS)


@pytest.fixture(scope="module")
def content(classifier: GroundClassifier, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("stored") / "grounds"
    classifier.save(path)
    assert [p.name for p in path.parent.iterdir()] == [
        "grounds"
    ]  # the name as given, and nothing left beside it
    return path.read_bytes()


def test_loaded_it_says_exactly_the_same(
    classifier: GroundClassifier, content: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "grounds.npz"
    path.write_bytes(content)
    loaded = GroundClassifier.load(path)
    assert np.array_equal(loaded.predict_proba(SHOWN), classifier.predict_proba(SHOWN))
    assert np.array_equal(loaded.novelty(SHOWN), classifier.novelty(SHOWN))
    assert loaded.predict(SHOWN).tolist() == classifier.predict(SHOWN).tolist()
    assert loaded.get_params() == classifier.get_params()
    assert loaded.classes_.tolist() == classifier.classes_.tolist()
    assert loaded.sensors_ == classifier.sensors_
    again = tmp_path / "again.npz"
    loaded.save(again)
    assert np.array_equal(GroundClassifier.load(again).predict_proba(SHOWN), classifier.predict_proba(SHOWN))


def test_the_file_holds_numbers_and_text_only(content: bytes) -> None:
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        assert all(archive[name].dtype.kind in "fiu" for name in archive.files)


def test_a_stored_classifier_needs_no_scikit_learn(content: bytes, tmp_path: Path) -> None:
    path, log = tmp_path / "grounds.npz", tmp_path / "log.parquet"
    path.write_bytes(content)
    SHOWN[0].to_parquet(log)
    program = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import pandas as pd, terragrip as tg\n"
        f"found = tg.GroundClassifier.load({str(path)!r})\n"
        f"table = pd.read_parquet({str(log)!r})\n"
        "print(','.join(found.predict([table])))\n"
        "try:\n    tg.GroundClassifier().fit([table, table], ['a', 'b'])\n"
        "except tg.InputError as error:\n    print(error)\n"
    )
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=600, check=True
    )
    first, second = output.stdout.splitlines()
    assert first.split(",") == GroundClassifier.load(path).predict(SHOWN[:1]).tolist()
    assert "pip install 'terragrip[ground]'" in second


@settings(max_examples=60)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_says_the_same(
    classifier: GroundClassifier,
    content: bytes,
    tmp_path_factory: pytest.TempPathFactory,
    data: st.DataObject,
) -> None:
    """Cut short, overwritten or lengthened anywhere: never another answer, never another error."""
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    at = data.draw(st.integers(0, len(content) - 1))
    kind = data.draw(st.sampled_from(["cut", "overwritten", "inserted"]))
    noise = data.draw(st.binary(min_size=1, max_size=20))
    rest = {"cut": b"", "overwritten": noise + content[at + len(noise) :], "inserted": noise + content[at:]}[
        kind
    ]
    path.write_bytes(content[:at] + rest)
    try:
        loaded = GroundClassifier.load(path)
    except InputError as error:
        text = str(error)
    else:
        text = f"{path} is whole"
        assert np.array_equal(loaded.predict_proba(SHOWN), classifier.predict_proba(SHOWN))
    assert str(path) in text
    assert "\n" not in text


def rewritten(content: bytes, path: Path, **changes: object) -> Path:
    """The file with other entries in its header (None: the entry is left out)."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = dict(archive)
    header = json.loads(bytes(arrays["header"])) | changes
    header = {name: value for name, value in header.items() if value is not None}
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    with path.open("wb") as stream:
        np.savez_compressed(stream, **arrays)
    return path


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"version": 2}, "version 2"),
        ({"version": 5}, "version 5"),
        ({"version": "x"}, "version 'x'"),
        ({"format": "a cake"}, "not a ground classifier"),
        ({"classes": ["hard"]}, "damaged"),
        ({"classes": ["a", "b"]}, "damaged"),
        ({"experts": []}, "damaged"),
        ({"experts": None}, "damaged"),
        ({"features": ["x"]}, "damaged"),
        ({"parameters": {"window": -3}}, "window|damaged"),
        ({"parameters": {"colour": 3}}, "damaged"),
        ({"layout": {"window": 1.7, "period": {"torque": -1}, "size": {}}}, "damaged"),
        ({"held": [1]}, "damaged"),
    ],
)
def test_a_header_that_does_not_fit_is_refused(
    content: bytes, tmp_path: Path, changes: dict[str, object], expected: str
) -> None:
    with pytest.raises(InputError, match=expected) as refused:
        GroundClassifier.load(rewritten(content, tmp_path / "other.npz", **changes))
    assert "other.npz" in str(refused.value)


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "foreign"
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as zipped:
        zipped.writestr("a.txt", "hello")
    numbers = io.BytesIO()
    np.savez(numbers, a=np.arange(3))
    table = io.BytesIO()
    pd.DataFrame({"a": [1]}).to_parquet(table)
    array = io.BytesIO()
    np.save(array, np.array([{"an": "object"}], dtype=object), allow_pickle=True)
    for content in (
        b"",
        b"no",
        archive.getvalue(),
        numbers.getvalue(),
        table.getvalue(),
        array.getvalue(),
        b"\x80\x04.",
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"not a ground classifier|damaged") as refused:
            GroundClassifier.load(path)
        assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="no such file"):
        GroundClassifier.load(tmp_path / "nothing")


def test_it_is_not_saved_before_it_is_fitted_nor_where_it_cannot_be(
    classifier: GroundClassifier, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="call fit"):
        GroundClassifier().save(tmp_path / "x")
    with pytest.raises(InputError, match="cannot be written"):
        classifier.save(tmp_path / "no folder" / "x")
    assert not list(tmp_path.iterdir())

"""Columns reach Arrow, and come back, as pyarrow itself would make them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.estimation.arrow import choices, codes_of, floats, texts, values_of


@given(st.lists(st.floats()))
def test_floats(values):
    assert floats(np.array(values)).equals(pa.array(values, type=pa.float64())) or any(np.isnan(values))
    assert np.array_equal(floats(np.array(values)).to_numpy(), values, equal_nan=True)


def test_floats_of_a_stride():
    assert floats(np.arange(10.0)[::3]).to_pylist() == [0.0, 3.0, 6.0, 9.0]


@given(st.lists(st.none() | st.text(st.characters(exclude_categories=["Cs"]), max_size=5)))
def test_texts(values):
    result = texts(values)
    result.validate(full=True)
    assert result.equals(pa.array(values, type=pa.string()))


@pytest.mark.parametrize("codes", [[], [2, 0, 1, 0]])
def test_choices(codes):
    assert choices(np.array(codes, dtype=np.uint8), ("", "stuck", "größer")).to_pylist() == [
        ("", "stuck", "größer")[code] for code in codes
    ]


@pytest.mark.parametrize(
    "parts",
    [
        [["a", None, "b"], ["a"]],
        [[1.0, 2.0], [3.0]],
        [[1.0, 2.0]],
        [[1.0, None]],
        [[1, 2]],
        [[True, False]],
        [pa.array(["x", "y", None]).slice(1)],
        [pa.array([1.0, 2.0, 3.0]).slice(1)],
        [pa.array([0, 1], type=pa.timestamp("ns"))],
        [pa.array([], type=pa.string())],
        [pa.array([], type=pa.float64())],
    ],
)
def test_values_come_back(parts):
    column = pa.chunked_array([pa.array(part) for part in parts])
    got, wanted = values_of(column), column.to_numpy()
    assert got.dtype == wanted.dtype
    np.testing.assert_array_equal(got, wanted)


def test_codes_come_back():
    names, codes = codes_of(
        pa.chunked_array([pa.array(["stuck", "", "stuck"]), pa.array([None], type=pa.string())])
    )
    assert [names[code] for code in codes] == ["stuck", "", "stuck", None]


def test_none_of_them_loads_pandas():
    code = (
        "import sys, numpy as np, pyarrow as pa;"
        "from terragrip.estimation.arrow import choices, codes_of, floats, texts, values_of;"
        "of = lambda column: pa.chunked_array([column]); values_of(of(floats(np.ones(3))));"
        "values_of(of(texts(['a', None]))); codes_of(of(choices(np.zeros(2, np.uint8), [''])));"
        "sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

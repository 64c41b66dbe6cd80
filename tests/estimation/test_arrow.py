"""Columns reach Arrow as pyarrow itself would make them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.estimation.arrow import choices, floats, texts


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


def test_none_of_them_loads_pandas():
    code = (
        "import sys, numpy as np; from terragrip.estimation.arrow import choices, floats, texts;"
        "floats(np.ones(3)); texts(['a', None]); choices(np.zeros(2, np.uint8), ['']); sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

"""Formulas in column names: numpy's numbers, what is unknown stays unknown, nothing but arithmetic is let through."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.studio.formulas import LONGEST, evaluate, names, parsed

TIME = np.arange(8) * 0.5
COLUMNS = {
    "a": np.array([1.0, -2.0, np.nan, 4.0, 0.0, 6.0, 7.0, 8.0]),
    "b": np.array([2.0, 2.0, 2.0, np.nan, 0.0, -3.0, 0.5, 1.0]),
}


def value(text: str) -> np.ndarray:
    return evaluate(text, TIME, COLUMNS.__getitem__)


A, B = COLUMNS["a"], COLUMNS["b"]
NAN = np.isnan(A) | np.isnan(B)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a - b", A - B),
        ("-a**2 * b + 3", -(A**2) * B + 3),
        ("a / b", np.where(B == 0, np.nan, A / np.where(B == 0, 1, B))),
        ("sqrt(a)", np.where(A < 0, np.nan, np.sqrt(np.abs(A)))),
        ("abs(a) > 3", np.where(np.isnan(A), np.nan, np.abs(A) > 3)),
        ("0 < a <= 6", np.where(np.isnan(A), np.nan, (A > 0) & (A <= 6))),
        ("a == b", np.where(NAN, np.nan, A == B)),
        ("where(a > b, a, -1)", np.where(NAN, np.nan, np.where(A > B, A, -1.0))),
        ("min(a, b, 1)", np.where(NAN, np.nan, np.minimum(np.minimum(A, B), 1))),
        ("max(a, b)", np.where(NAN, np.nan, np.maximum(A, B))),
        ("a - mean(a)", A - np.nanmean(A)),
        ("max(a) - min(a)", np.full(8, 10.0)),
        ("diff(a)", np.append(np.nan, np.diff(A))),
        ("diff(a) / 0.5", np.append(np.nan, np.diff(A)) / 0.5),
        ("9 ** 9 ** 9", np.full(8, np.nan)),  # beyond what a number holds: not known, and no hour of work
        ("2", np.full(8, 2.0)),
    ],
)
def test_a_formula_is_what_numpy_makes_of_it(text: str, expected: np.ndarray) -> None:
    np.testing.assert_array_equal(value(text), expected)


@given(seconds=st.floats(0.1, 5))
def test_a_mean_over_seconds_is_of_the_known_rows_about_each(seconds: float) -> None:
    expected = []
    for t in TIME:
        near = A[np.abs(TIME - t) <= seconds / 2]
        expected.append(np.mean(near[np.isfinite(near)]) if np.isfinite(near).any() else np.nan)
    np.testing.assert_allclose(value(f"mean(a, {seconds!r})"), expected, atol=1e-12)


def test_the_columns_of_a_formula_are_named() -> None:
    assert names("where(a > 1, slip_rl, 2) - min(b, abs(a))") == {"a", "b", "slip_rl"}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is empty"),
        ("a +", "cannot be read"),
        ("a b", "cannot be read at character"),
        ("(" * 300, "cannot be read"),
        ("-" * 300 + "a", "too many parts"),
        ("+".join("a" * 250), "too many parts"),
        ("a" * (LONGEST + 1), "longer than"),
        ("a.real", "a dot is not part of a name"),
        ("__import__('os').system('true')", "there is no function"),
        ("(lambda: 1)()", "there is no function"),
        ("open(a)", "there is no function open"),
        ("abs(a, b)", "abs takes 1"),
        ("abs(*a)", "is not arithmetic"),
        ("max(a, key=b)", "equals sign"),
        ("a[0]", "Subscript is not arithmetic"),
        ("a * 9,81", "write a number as 9.81"),
        ("max(a, 0,5)", "write a number as 9.81"),  # it was the largest of a, 0 and 5
        ("[a for a in b]", "is not arithmetic"),
        ("a if b else 1", "is not arithmetic"),
        ("a and b", "is not arithmetic"),
        ("'text'", "is not a number"),
        ("True", "is not a number"),
        ("9" * 400, "too large"),
        ("1j", "is not a number"),
        ("f'{a}'", "is not arithmetic"),
        ("(b := 1)", "is not arithmetic"),
        ("a @ b", "is not arithmetic"),
        ("a % b", "is not arithmetic"),
        ("mean(a, b)", "a number of seconds"),
        ("a\x00", "cannot be read"),
    ],
)
def test_nothing_but_arithmetic_is_let_through(text: str, problem: str) -> None:
    with pytest.raises(InputError, match="formula") as error:
        parsed(text)
    assert problem in str(error.value)
    assert "\n" not in str(error.value)

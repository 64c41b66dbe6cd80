"""Estimates as text: numbers as printf writes them, whatever they are."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from terragrip.estimation.estimator import Estimate
from terragrip.live.message import Columns
from terragrip.live.outputs import Row

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))  # for sink_messages.py
from sink_messages import measured_row


def row(values: dict[str, float], time: float = 1.5, predicted: bool = False) -> Row:
    places = {name: place for place, name in enumerate(values)}
    return Row(1.7e9 + 0.123456, {}, Estimate(time, "outlier", list(values.values()), places), predicted)


@given(st.lists(st.floats(), min_size=1, max_size=4), st.floats(0, 1e9))
def test_numbers_are_what_printf_writes_to_nine_digits(numbers, time):
    values = {f"slip_{k}": number for k, number in enumerate(numbers)}
    result = json.loads(Columns().json(row(values, time)))
    assert (result["time"], result["arrival"], result["event"]) == (time, 1.7e9 + 0.123456, "outlier")
    for name, number in values.items():
        if math.isfinite(number):
            assert result[name] == float(f"{number:.9g}")
        else:
            assert result[name] is None


def test_only_the_wanted_columns_are_written():
    values = {"slip_fl": 0.1, "slip_fl_std": 0.2, "nis": 3.0, "channels": 9.0}
    result = json.loads(Columns("slip_*, channels").json(row(values, predicted=True)))
    assert list(result) == [
        "kind",
        "time",
        "arrival",
        "event",
        "predicted",
        "slip_fl",
        "slip_fl_std",
        "channels",
    ]
    assert result["predicted"] is True
    assert json.loads(Columns("curve_*").json(row(values))).keys() == {
        "kind",
        "time",
        "arrival",
        "event",
        "predicted",
    }


def test_the_benchmarks_know_a_measured_row_when_one_comes():
    """bench_live and the soak once waited for rows by their first bytes, and counted none when these changed."""
    sent = Columns("nis").json(row({"nis": 3.0}))
    assert measured_row(sent) == json.loads(sent)
    assert measured_row(Columns("nis").json(row({"nis": 3.0}, predicted=True))) is None
    assert measured_row(b'{"kind":"status","predicted":false}') is None

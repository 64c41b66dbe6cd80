"""A calibration as a notebook shows it."""

from __future__ import annotations

import re

import pytest

from terragrip.errors import InputError
from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown

FOUND = Calibration(
    (
        Quantity("drive_torque_gain", 1.02, 0.01, "1", (Evidence("a.csv", 0.0, 60.0, 1200),), "compared", "fl", factor=2.5),
        Quantity("drawbar_offset", -14.0, 3.0, "N", (Evidence("a.csv", 0.0, 9.0, 300),), "at rest", factor=2.0),
    ),
    (Unknown("wheel_radius", "no pass at zero pull"),),
    notes=("a doubt",),
)  # fmt: skip


def test_html_shows_value_interval_unit_and_what_is_unknown() -> None:
    html = FOUND._repr_html_()
    cells = re.findall(r"<t[hd]\b[^>]*>([^<]*)<", html)[5:]  # behind the head
    assert cells[:5] == ["drive_torque_gain fl", "1.02", "0.995 to 1.045", "", "1200"]
    assert cells[5:10] == ["drawbar_offset", "-14", "-20 to -8", "N", "300"]
    assert "wheel_radius: no pass at zero pull" in html
    assert "a doubt" in html


def test_the_table_has_a_row_a_quantity() -> None:
    table = FOUND.to_pandas()
    row = table.loc["drawbar_offset"]
    assert (row["value"], row["std"], row["low"], row["high"], row["unit"]) == (-14.0, 3.0, -20.0, -8.0, "N")
    assert row["samples"] == 300
    assert table.loc["drive_torque_gain fl", "high"] == pytest.approx(1.045)


def test_the_figure_draws_each_interval_in_axes_of_its_unit() -> None:
    gain, offset = FOUND.plot().axes
    assert gain.get_xlabel() == "drive_torque_gain [–]"
    assert offset.get_xlabel() == "drawbar_offset [N]"
    lines = [line.get_xydata().tolist() for line in offset.get_lines()]
    assert lines == [[[-20.0, 0.0], [-8.0, 0.0]], [[-14.0, 0.0]]]
    assert [text.get_text() for text in gain.get_yticklabels()] == ["fl"]
    with pytest.raises(InputError, match="no quantity"):
        Calibration((), ()).plot()

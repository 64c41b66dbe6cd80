"""A library as a notebook shows it: every number of a soil in the table."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.literature import paper_soils

KNOWN = Soil(
    "clay",
    "effective",
    {"A": 0.61234, "k": 11.0, "d": 0.1},
    {"A": (0.5, 0.7), "k": (9.0, 13.0)},
    0.97,
    0.04,
    (
        {"slip": 0.1, "mean": 0.4, "std": 0.02, "count": 30.0},
        {"slip": 0.3, "mean": 0.55, "count": 12.0},
        {"slip": 0.5, "mean": None, "count": 0.0},
    ),
    (0.081, 0.012),
    0.05,
    "two fields",
)


def test_a_row_holds_parameters_intervals_fit_and_resistance() -> None:
    table = SoilLibrary({"clay": KNOWN, "hard": paper_soils()["hard"]}).to_pandas()
    clay = table.loc["clay"]
    for name, value in {
        "A": 0.61234, "A_low": 0.5, "A_high": 0.7, "k_low": 9.0, "k_high": 13.0, "r2": 0.97, "nrmse": 0.04,
        "resistance": 0.081, "resistance_std": 0.012,
    }.items():  # fmt: skip
        assert clay[name] == value, name
    assert (clay["model"], clay["source"]) == ("effective", "two fields")
    assert np.isnan(table.loc["hard", "resistance"])
    assert table.loc["hard", "a"] == 1.42
    assert table.index.name == "soil"


def test_html_shows_intervals_and_what_was_not_fitted() -> None:
    html = SoilLibrary({"clay": KNOWN}, not_fitted={"peat": "too few bins"})._repr_html_()
    assert "A 0.612 (0.5 to 0.7), k 11 (9 to 13)" in html
    assert "d 0.1" not in html  # held, not fitted
    assert "peat: too few bins" in html
    assert "0.081" in html
    assert "a 1.42" in SoilLibrary({"hard": paper_soils()["hard"]})._repr_html_()


def test_the_figure_draws_each_curve_and_its_bins() -> None:
    axes = SoilLibrary({"clay": KNOWN, "hard": paper_soils()["hard"]}).plot().axes[0]
    curves = [line for line in axes.get_lines() if line.get_label() in ("clay", "hard")]
    assert len(curves) == 2
    slip, mu = curves[0].get_data()
    assert slip.max() == pytest.approx(0.3)  # of its last bin: dotted beyond
    dotted = next(line for line in axes.get_lines() if line.get_linestyle() == ":")
    assert axes.get_xlim() == (0.0, dotted.get_xdata().max())
    np.testing.assert_allclose(mu, 0.61234 * (1 - np.exp(-11 * slip)) - 0.1 * slip, atol=1e-12)
    (bars,) = axes.containers
    np.testing.assert_allclose(bars.lines[0].get_xydata(), [[0.1, 0.4], [0.3, 0.55]])
    lengths = [np.ptp(segment[:, 1]) for segment in bars.lines[2][0].get_segments()]
    assert lengths == pytest.approx([0.04, 0.0])
    with pytest.raises(InputError, match="no soil to draw"):
        SoilLibrary({}).plot()

"""Residuals: white ones are called so, and those that remember say for how long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from terragrip.report import residuals
from terragrip.report.page import Picture, Table
from terragrip.report.runs import Run

Drive = Callable[..., Run]


def with_error(run: Run, error: np.ndarray) -> Run:
    table = run.estimates.copy()
    table["adhesion_rr"] = run.true("adhesion_rr") + error
    return replace(run, estimates=table)


def figures(run: Run) -> dict[str, tuple[str, ...]]:
    table = next(item for item in residuals.section(run).content if isinstance(item, Table))
    return {row[0]: row for row in table.rows}


def test_white_residuals_are_called_white(drive: Drive) -> None:
    run = drive(seconds=300.0)
    error = 0.02 * np.random.default_rng(1).standard_normal(len(run.time)) + 0.003
    _, mean, std, beyond, memory, white = figures(with_error(run, error))["µ − truth"]
    assert float(mean) == pytest.approx(0.003, abs=1e-3)
    assert float(std) == pytest.approx(0.02, rel=0.05)
    assert float(beyond.removesuffix(" %")) < 0.7
    assert (memory, white) == ("0.1", "yes")


def test_a_first_order_residual_is_forgotten_after_its_time_constant(drive: Drive) -> None:
    run = drive(seconds=900.0)
    rng, keep = np.random.default_rng(2), np.exp(-0.05 / 1.0)  # 1 s at 20 Hz
    error = np.zeros(len(run.time))
    for i in range(1, len(error)):
        error[i] = keep * error[i - 1] + 0.005 * rng.standard_normal()
    memory, white = figures(with_error(run, error))["µ − truth"][-2:]
    assert float(memory) == pytest.approx(1.0, abs=0.4)
    assert white == "no"


def test_the_figure_says_what_it_shows(drive: Drive) -> None:
    (picture,) = [item for item in residuals.section(drive()).content if isinstance(item, Picture)]
    assert "histogram" in picture.caption
    assert "autocorrelation" in picture.caption
    assert "κ − sensor" in picture.svg


def test_without_a_reference_the_section_says_so(drive: Drive) -> None:
    run = replace(drive(), truth=None, recording=None)
    result = residuals.section(run)
    assert result.omitted
    assert not result.content

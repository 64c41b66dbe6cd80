"""Sections: vehicle and tool on one soil, and their statistics."""

from __future__ import annotations

import numpy as np
import pytest

from ground_drives import COARSE, FINE, GRASS, drive
from terragrip.ground.analysis import analyse
from terragrip.ground.sections import Stretch, sections_of

LENGTH = 0.64 + 0.1 + 2.0
ONE = {"fine": 1.0}


def test_a_section_counts_from_where_the_tool_has_followed():
    estimates = drive(1, [("grass", GRASS, 40), ("fine", FINE, 40)])
    first, second = sections_of(estimates, [Stretch(0, 800, {"grass": 1.0}), Stretch(800, 1600, ONE)], LENGTH)
    assert (first.start, first.end, first.entered) == (0.0, 39.95, 0.0)
    assert second.entered == 40.0
    assert second.start == pytest.approx(40 + LENGTH / 0.6, abs=0.06)
    assert second.end == 79.95
    assert (first.label, second.label, second.soil) == ("grass", "fine", "fine")


def test_its_statistics_are_over_rows_without_an_event():
    estimates = drive(2, [("fine", FINE, 30)])
    estimates.event_codes[100:200] = 1
    estimates.columns["slip_rr"][300:310] = np.nan
    rows = np.ones(600, dtype=bool)
    rows[100:200] = rows[300:310] = False
    (result,) = sections_of(estimates, [Stretch(0, 600, ONE)], LENGTH)
    share = np.array([500, 500, 860, 860]) / 2720
    slip = np.column_stack([estimates[f"slip_{w}"] for w in ("fl", "fr", "rl", "rr")])[rows] @ share
    assert (result.slip_mean, result.slip_std) == pytest.approx((slip.mean(), slip.std()))
    mu = estimates["adhesion_rl"][rows]
    assert result.wheels["rl"]["adhesion_mean"] == pytest.approx(mu.mean())
    assert result.wheels["rl"]["adhesion_std"] == pytest.approx(mu.std())
    assert result.samples == rows.sum()


def test_a_force_sensor_gives_the_measured_ratio():
    estimates = drive(3, [("fine", FINE, 10)])
    estimates.columns["wheel_force_x_rr"] = np.full(200, 100.0)
    estimates.columns["wheel_force_z_rr"] = np.full(200, 400.0)
    estimates.columns["wheel_force_z_rr"][:50] = 1.0  # lifted
    (result,) = sections_of(estimates, [Stretch(0, 200, ONE)], LENGTH)
    assert result.measured == {"rr": {"force_ratio_mean": 0.25, "force_ratio_std": 0.0}}


def test_a_stretch_too_short_for_the_tool_is_no_section():
    pieces = [Stretch(0, 400, ONE), Stretch(400, 440, {"grass": 1.0}), Stretch(440, 800, ONE)]
    result = sections_of(drive(4, [("fine", FINE, 40)]), pieces, LENGTH)
    assert [s.entered for s in result] == [0.0, 22.0]


def test_they_come_from_the_changes_of_a_drive(library):
    ground = analyse(drive(5, [("grass", GRASS, 40), ("coarse", COARSE, 40)]), library)[0]
    first, second = ground.sections
    assert (first.soil, second.soil) == ("grass", "coarse")
    assert first.end == pytest.approx(40, abs=1)
    assert second.start - second.entered == pytest.approx(LENGTH / 0.6, abs=0.1)
    assert sum(second.probabilities.values()) == pytest.approx(1, abs=1e-3)
    assert first.resistance_mean == pytest.approx(GRASS.resistance, abs=0.01)

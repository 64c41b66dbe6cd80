"""What a run offers to compare, and the scores that come of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from terragrip.errors import InputError
from terragrip.ground.events import Event
from terragrip.report.runs import Run, label_stretches, stretches
from terragrip.report.scores import (
    compare,
    compare_truth,
    find,
    method_tables,
    sensor_table,
    truth_score,
    truth_table,
)
from terragrip.simulation import simulate

Drive = Callable[..., Run]


def test_stretches_cover_the_mask_and_nothing_else() -> None:
    mask = np.array([True, False, True, True, False, True])
    assert stretches(mask) == [(0, 0), (2, 3), (5, 5)]
    assert stretches(np.zeros(3, dtype=bool)) == []
    labels = np.array(["a", "a", "", "b", "a"], dtype=object)
    assert label_stretches(labels) == [("a", 0, 1), ("b", 3, 3), ("a", 4, 4)]
    assert label_stretches(np.array([], dtype=object)) == []


def test_a_run_refuses_a_truth_of_other_rows(drive: Drive) -> None:
    run = drive()
    with pytest.raises(InputError, match="same rows"):
        Run(run.name, run.estimates.iloc[1:].reset_index(drop=True), run.method, run.truth)


def test_a_lifted_wheel_has_no_measured_ratio(drive: Drive) -> None:
    run = drive()
    assert run.recording is not None
    run.recording.loc[10, "wheel_force_z_rr"] = 1.0
    run.recording.loc[11, "wheel_force_z_rr"] = np.nan
    ratio = run.measured_ratio()
    assert ratio is not None
    assert np.flatnonzero(np.isnan(ratio)).tolist() == [10, 11]
    assert run.sensor_wheel == "rr"


def test_measured_slip_is_the_hubs_and_bridges_channels_of_other_instants(drive: Drive) -> None:
    run = drive()
    measured = run.measured_slip()
    truth = run.true("slip_rr")
    assert measured is not None
    assert truth is not None
    rows = np.isfinite(measured)
    assert rows.sum() == len(measured) // 2
    # 2 cm/s of noise on 0.625 m/s is .03 of slip a row; the mean must not be off by the turn's .035
    assert np.mean((measured - truth)[rows]) == pytest.approx(0.0, abs=0.004)
    assert Run(run.name, run.estimates, run.method, None, run.recording).measured_slip() is None


def test_scores_know_what_was_put_in(drive: Drive) -> None:
    run = drive(seconds=600.0)
    score = truth_score(run)
    assert score is not None
    # the drive errs by 0.02, 0.01 and 0.01; a normal error's mean magnitude is sqrt(2/pi) of its SD
    size = np.sqrt(2 / np.pi)
    assert score.mu_mae == pytest.approx(0.02 * size, rel=0.03)
    assert score.slip_mae == pytest.approx(0.01 * size, rel=0.03)
    assert score.rho_s_mae == pytest.approx(0.01 * size, rel=0.03)
    for share in (score.mu_coverage, score.slip_coverage, score.rho_s_coverage):
        assert share == pytest.approx(0.95, abs=0.008)


def test_kappa_follows_the_sensor_and_mu_lies_above_it_by_the_soil_resistance(drive: Drive) -> None:
    comparisons = compare(drive())
    kappa = find(comparisons, run="multi2", method="bank", quantity="net_traction", against="sensor")
    mu = find(comparisons, run="multi2", method="bank", quantity="adhesion", against="sensor")
    assert kappa is not None
    assert mu is not None
    assert kappa.whole is not None
    assert kappa.without_stuck is not None
    assert mu.without_stuck is not None
    assert kappa.without_stuck.bias == pytest.approx(0.0, abs=0.002)
    assert mu.without_stuck.bias == pytest.approx(0.08, abs=0.002)
    # the stuck spell, where the sensor turns negative, must cost agreement
    assert kappa.without_stuck.r2 > kappa.whole.r2 + 0.1
    assert kappa.whole.count - kappa.without_stuck.count == 100


def test_the_truth_itself_bounds_what_can_be_scored_against_a_sensor(drive: Drive) -> None:
    run = drive()
    ceiling = {c.quantity: c for c in compare_truth(run)}
    estimated = {c.quantity: c for c in compare(run) if c.against == "sensor"}
    best, ours = ceiling["net_traction"].without_stuck, estimated["net_traction"].without_stuck
    assert best is not None
    assert ours is not None
    assert ours.r2 < best.r2 < 1.0
    assert compare_truth(Run(run.name, run.estimates, run.method, None, run.recording)) == []


def test_without_references_there_is_nothing_to_compare(drive: Drive) -> None:
    run = drive()
    bare = Run(run.name, run.estimates, run.method)
    assert compare(bare) == []
    assert truth_score(bare) is None
    assert bare.sensor_wheel is None
    assert bare.shown_wheel == "rr"
    assert not bare.stuck.any()


def test_tables_set_off_the_default_and_carry_the_papers_figures(drive: Drive) -> None:
    runs = [drive(method="bank"), drive(method="ukf")]
    tables = method_tables([c for run in runs for c in compare(run)], "bank")
    sensor, truth = tables
    assert sensor.strong == {0}
    assert sensor.header[6:9] == ("µ: R² whole", "µ: R² without spell", "µ: NRMSE without spell")
    assert sensor.rows[-1][6:9] == ("0.445", "0.848", "0.090")
    assert not any("paper" in row[0] for row in truth.rows)
    scores = [score for run in runs if (score := truth_score(run))]
    assert truth_table(scores, "ukf").strong == {1}


def test_rows_in_events_are_left_out_and_are_stuck_where_no_truth_says_it(drive: Drive) -> None:
    run = drive()
    events = (
        Event("stuck", 60.0, 64.95),
        Event("standstill", 0.0, 9.0),
    )
    estimates = Run(run.name, run.estimates, run.method, run.truth, run.recording, run.vehicle, events)
    kappa = next(c for c in compare(estimates) if (c.quantity, c.against) == ("net_traction", "sensor"))
    assert kappa.without_flagged is not None
    # a standstill is left out as it is, a stuck spell from 1 s before to 2 s after
    assert estimates.flagged[estimates.time <= 9.0].all()
    assert (
        estimates.flagged[estimates.time > 9.0]
        == ((estimates.time >= 59) & (estimates.time <= 66.95))[estimates.time > 9.0]
    ).all()
    assert kappa.without_flagged.count == (~estimates.flagged).sum()
    bare = Run(run.name, run.estimates, run.method, events=events)
    assert bare.stuck.sum() == 100
    assert (bare.stuck == run.stuck).all()


def test_the_sensor_reads_what_equation_1_says() -> None:
    """Simulated with exact sensors on a flat, even soil: the true kappa, over the sensor's load, is the sensor's reading."""
    result = simulate("constant", seed=1)
    table = result.recording.to_pandas()
    truth = result.truth.assign(true_slope=0.0)
    columns = {f"adhesion_{wheel}": truth[f"true_adhesion_{wheel}"] for wheel in result.vehicle.wheels}
    columns |= {
        f"net_traction_{wheel}": truth[f"true_net_traction_{wheel}"] for wheel in result.vehicle.wheels
    }
    columns |= {f"vertical_load_{axle}": truth[f"true_vertical_load_{axle}"] for axle in ("front", "rear")}
    estimates = pd.DataFrame({"time": truth["time"], **columns})
    run = Run("constant", estimates, "bank", truth, table, result.vehicle)
    measured, expected, true = run.measured_ratio(), run.sensor_ratio(), run.true_sensor_ratio()
    assert measured is not None
    assert expected is not None
    assert true is not None
    steady = (run.time > 10) & np.isfinite(measured)
    assert steady.sum() > 500
    np.testing.assert_allclose(expected[steady], measured[steady], atol=2e-3)
    np.testing.assert_allclose(true[steady], measured[steady], atol=2e-3)
    # kappa itself reads a seventh less: the sensor's load lacks the wheel
    assert np.median(measured[steady] / run.estimated("net_traction_rr")[steady]) == pytest.approx(
        1.15, abs=0.03
    )


def test_without_the_wheels_mass_the_sensor_is_compared_with_kappa_only(drive: Drive) -> None:
    run = drive()
    assert run.sensor_ratio() is None
    table = sensor_table(run)
    assert table is not None
    assert [row[0] for row in table.rows] == [
        "κ as it is",
        "µ, as the paper compares",
        "the paper's µ in its field",
    ]
    assert table.rows[-1][1:3] == ("0.445", "0.848 (cut by hand)")
    assert sensor_table(Run(run.name, run.estimates, run.method)) is None

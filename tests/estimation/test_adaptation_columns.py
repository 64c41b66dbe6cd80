"""A_k in the table: which states it stands for, which methods have it, and that it makes the row's process noise."""

from __future__ import annotations

import numpy as np
import pytest

from drives import WHEELS, drive, robot
from terragrip.estimation import METHODS, Estimates, TractionEstimator, estimate

pytestmark = pytest.mark.usefixtures("unchecked")

STATES = (
    *(f"wheel_speed_{w}" for w in WHEELS), "ground_speed",
    *(f"adhesion_{w}" for w in WHEELS), "soil_resistance",
)  # fmt: skip
COLUMNS = tuple(f"adaptation_{state}" for state in STATES)
SENSORS = {"wheel_speed": 0.03, "ground_speed": 0.02}
SECONDS = 10.0


def late_means(estimates: Estimates) -> dict[str, float]:
    """The geometric mean of each factor after 4 s, by state."""
    late = estimates.time > 4
    return {s: float(np.exp(np.log(estimates[f"adaptation_{s}"][late]).mean())) for s in STATES}


def restless(channel: str) -> Estimates:
    """Estimates of a drive one of whose channels is more restless than its sensor's noise says."""
    log = drive(SECONDS).recording
    jitter = 0.1 * np.random.default_rng(1).standard_normal(len(log))
    return estimate(
        log.with_channels(**{channel: log.channels[channel] + jitter}), robot(), "aukf", sensors=SENSORS
    )


@pytest.mark.parametrize("method", METHODS)
def test_only_methods_that_adapt_have_the_columns(method):
    log = drive(1.0).recording
    estimates = estimate(log, robot(), method)
    assert tuple(n for n in estimates.names if n.startswith("adaptation")) == (
        COLUMNS if method in ("aukf", "aukf-fs", "aukf-fs-drive") else ()
    )
    assert TractionEstimator.for_recording(log, robot(), method).columns == tuple(estimates.columns)


@pytest.mark.parametrize("method", ["aukf", "aukf-fs"])
def test_the_factors_start_at_1_and_stay_in_their_bounds(method):
    estimates = estimate(drive(SECONDS).recording, robot(), method)
    for name in COLUMNS:
        assert estimates[name][0] == 1
        assert 0.05 <= estimates[name].min() <= estimates[name].max() <= 50
        assert len(np.unique(estimates[name])) > 10, name  # it moves


@pytest.mark.parametrize("wheel", WHEELS)
def test_a_restless_wheel_raises_its_own_factors(wheel):
    factors = late_means(restless(f"wheel_speed_{wheel}"))
    own = {f"wheel_speed_{wheel}", f"adhesion_{wheel}"}
    assert min(factors[name] for name in own) > 5
    assert max(factors[name] for name in STATES if name not in own) < 1


def test_a_restless_ground_speed_raises_those_of_the_vehicle():
    factors = late_means(restless("ground_speed"))
    own = {"ground_speed", "soil_resistance"}
    assert min(factors[name] for name in own) > 5
    assert max(factors[name] for name in STATES if name not in own) < 1.5


def test_the_factor_decides_how_sure_the_filter_is():
    """Adhesion's variance grows with its process noise; the wheels differ in nothing else."""
    result = restless("wheel_speed_rr")
    late = result.time > 4
    steps = np.abs(np.diff(result["adhesion_rr"][late])), np.abs(np.diff(result["adhesion_rl"][late]))
    assert np.mean(steps[0]) > 3 * np.mean(steps[1])
    assert result["adhesion_rr_std"][late].mean() > 1.2 * result["adhesion_rl_std"][late].mean()


def test_smoothing_leaves_them_as_they_were():
    log = drive(SECONDS).recording
    forward, smoothed = (estimate(log, robot(), "aukf-fs", smooth=smooth) for smooth in (False, True))
    for name in ("supervisor", *COLUMNS):
        assert np.array_equal(forward[name], smoothed[name]), name


def test_a_restored_estimator_goes_on_with_them():
    log = drive(SECONDS).recording
    whole = estimate(log, robot(), "aukf-fs", sensors=SENSORS)
    estimator = TractionEstimator.for_recording(log, robot(), "aukf-fs", sensors=SENSORS)
    half = len(log) // 2
    estimator.update_block(log.select(slice(0, half)))
    rest = TractionEstimator.restore(estimator.snapshot()).update_block(log.select(slice(half, None)))
    for name in COLUMNS:
        assert np.array_equal(rest[name], whole[name][half:]), name

"""Standard deviations of slip, net traction and efficiency against sampling: draws from the filter's own joint distribution, with
the considered constants and the wheel radius, go through the definitions of physics.md 2."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drives import GRAVITY, MASS, RADIUS, TIRE, WHEELS, drive, robot
from terragrip import _kernel
from terragrip.estimation import TractionEstimator
from terragrip.estimation.forward import prepared
from terragrip.physics.loads import lateral_shares
from terragrip.physics.slip import slip as slip_of

DRAWS = 100_000
WHEEL_RADIUS = 0.02
SLOPE = 0.01
COLUMNS = 7  # torque gain of each wheel, drawbar, slope, the tyres' rolling resistance


def joint(estimator: TractionEstimator, recording: Any) -> tuple[Any, Any, Any, float, float]:
    """Mean (10,), covariance (10, 10) and considered columns (k, 10) after the recording's last row, state order, and the SD of
    a wheel's unseen load and of the errors of the ground speed beyond the filter's, in the row's scene."""
    engine, ffi, lib = estimator.engine, _kernel.ffi, _kernel.lib
    time, columns = prepared(estimator, recording)
    last = engine.record(time, columns)[-1].copy()
    assert len(last) > lib.tg_record_length(4, COLUMNS) > len(last) - 88  # the row's scene follows
    x, P, s = np.empty(10), np.empty((10, 10)), np.empty((COLUMNS, 10))
    pointers = (ffi.cast("double *", a.ctypes.data) for a in (last, x, P, s))
    assert lib.tg_record_moments(4, COLUMNS, *pointers) == lib.TG_OK
    return x, P, s, float(np.sqrt(last[-6])), float(np.sqrt(last[-5:-1].sum()))


@pytest.mark.parametrize("slip", [0.013, 0.016, 0.019, 0.03, 0.12, 0.35])  # the first ones pull about nothing
def test_spreads_agree_with_sampling(slip):
    made = drive(12.0, noise=0.02, slip=lambda t: slip + 0.0 * t, seed=5)  # quiet: no rough ground to add
    vehicle = robot(
        uncertainty={
            "drive_torque_gain": 0.02, "drawbar_offset": 6.0, "slope": SLOPE, "tire_rolling_resistance": 0.003,
            "wheel_radius": WHEEL_RADIUS,
        }
    )  # fmt: skip
    x, P, s, unseen, slow = joint(
        TractionEstimator.for_recording(made.recording, vehicle, "kalman"), made.recording
    )
    whole = TractionEstimator.for_recording(made.recording, vehicle, "kalman").update_block(made.recording)
    last = {name: whole[name][-1] for name in whole.columns}
    reported = np.array([last[f"adhesion_{w}"] for w in WHEELS])
    np.testing.assert_allclose(
        x[5:9], reported, rtol=0.02
    )  # the noise of its diagonals is smoothed in the report
    x[5:9] = reported

    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(x, P, DRAWS, method="cholesky") + rng.standard_normal((DRAWS, len(s))) @ s
    assert slow > 0
    drawn[:, 4] += slow * rng.standard_normal(DRAWS)
    error = WHEEL_RADIUS * rng.standard_normal(
        (DRAWS, 1)
    )  # of the radius: more of it, less force in a torque
    loads = np.repeat([last["vertical_load_front"] / 2, last["vertical_load_rear"] / 2], 2)
    mu, rho = drawn[:, 5:9], drawn[:, 9:]
    rho = rho - error * (x[5:9] @ loads) / (MASS * GRAVITY)
    mu = mu * (1 - error) + x[5:9] * unseen * rng.standard_normal((DRAWS, 4))
    left, _ = lateral_shares(2, GRAVITY * SLOPE, center_of_gravity_height=0.30, track=0.554)
    # no roll: the ground may be as steep to the side
    mu += (x[5:9] + TIRE) * (1 - 2 * left) * rng.standard_normal((DRAWS, 4))
    result = slip_of(drawn[:, :4], drawn[:, 4:5], RADIUS * (1 + error))
    net = mu - rho
    efficiency = np.where(net > 0, net / (mu + TIRE) * (1 - result), 0.0)
    for name, values in (("slip", result), ("net_traction", net), ("efficiency", efficiency)):
        mean, stated = (np.array([last[f"{name}_{w}{end}"] for w in WHEELS]) for end in ("", "_std"))
        sampled = np.sqrt(np.mean((values - mean) ** 2, axis=0))
        bent = name == "efficiency" and slip < 0.02  # over its spread, which is as large as itself
        np.testing.assert_allclose(stated, sampled, rtol=0.16 if bent else 0.04, err_msg=name)


def test_a_wheel_that_surely_does_not_pull_has_an_efficiency_of_0_without_doubt():
    """Something pushes: adhesion .05 where soil takes .15 of the load."""
    pushed = drive(60.0, rate=50.0, slip=lambda t: 0.0105 + 0.0 * t, resistance=lambda t: 0.15 + 0.0 * t)
    estimates = TractionEstimator.for_recording(pushed.recording, robot()).update_block(pushed.recording)
    for wheel in WHEELS:
        assert np.all(pushed.truth[f"net_traction_{wheel}"] < -0.09)
        assert np.all(estimates[f"efficiency_{wheel}"][1000:] == 0)
        assert np.all(estimates[f"efficiency_{wheel}_std"][1000:] < 0.02)

"""Rounding decides nothing: another origin of time, or the build in single precision that a controller runs, give the same events and the
same estimates to a thousandth of their spread. Snapshots of single precision continue to the bit, and no other takes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drives import WHEELS, drive, robot
from single_precision import kernel
from terragrip.errors import InputError
from terragrip.estimation import METHODS, Estimates, TractionEstimator, engine, estimate, settings
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")


@pytest.fixture
def single(monkeypatch: pytest.MonkeyPatch) -> Any:
    """From a call on, estimators are of single precision."""
    module = kernel()

    def switch() -> None:
        for user in (engine, settings):
            monkeypatch.setattr(user, "ffi", module.ffi)
            monkeypatch.setattr(user, "lib", module.lib)

    return switch


def turning(t: Any) -> Any:
    return 0.6 + 0.25 * np.sin(t / 2)


def faulty_drive(rate: float = 50.0) -> Recording:
    """Accelerometer, a second and more without ground speed, a spike."""
    log = drive(40.0, rate=rate, speed=turning, imu=True, seed=2).recording
    log.channels["ground_speed"][(log.time > 16.0) & (log.time < 18.0)] = np.nan
    log.channels["wheel_speed_rr"][int(6 * rate)] += 3.0
    return log


def assert_alike(one: Estimates, other: Estimates) -> None:
    np.testing.assert_array_equal(one["event"], other["event"])
    quantities = ("adhesion", "slip", "net_traction", "efficiency", "wheel_speed")
    for name in (
        *(f"{q}_{w}" for q in quantities for w in WHEELS),
        "ground_speed",
        "soil_resistance",
        "curve_a",
    ):
        sd = np.maximum(other[f"{name}_std"], 1e-4)  # the algebraic method knows its first speeds to the bit
        assert np.nanmax(np.abs(one[name] - other[name]) / sd) < 1e-3, name
        assert np.nanmax(np.abs(one[f"{name}_std"] - other[f"{name}_std"]) / sd) < 1e-3, name


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", [*METHODS][::-1])
def test_single_precision_gives_the_estimates_of_double(method, single):
    log = faulty_drive()
    double = estimate(log, robot(), method=method)
    single()
    rough = estimate(log, robot(), method=method)
    assert_alike(rough, double)
    assert not np.array_equal(rough["adhesion_rr"], double["adhesion_rr"])  # it is the other build


@pytest.mark.parametrize(
    ("method", "rate"),
    [*(("bank", rate) for rate in (10.0, 20.0, 50.0, 100.0)), ("algebraic", 10.0), ("aukf-fs", 10.0)],
)
@pytest.mark.parametrize("origin", [1.0 / 3.0, 1e4 / 7.0])
def test_another_origin_of_time_gives_the_same_estimates(origin, method, rate):
    """Rounding decided which rows a curve learned from: curve_a was .06 of its standard deviations another at 100 Hz, up to nine at 20;
    at 10 Hz, whether a step was predicted in one piece or two, which moved adhesions by .05. The first row of the algebraic method took
    its time for a step: its speed's standard deviation was .004 m/s at 0 s and .013 at a third, of noise of .02."""
    log = faulty_drive(rate)
    later = replace(log, time=log.time + origin)
    assert not np.array_equal(np.diff(later.time), np.diff(log.time))
    assert_alike(estimate(later, robot(), method=method), estimate(log, robot(), method=method))


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", [*METHODS][::-1])
def test_a_snapshot_of_single_precision_continues_to_the_bit(method, single):
    log = drive(6.0, rate=50.0, seed=3).recording
    samples = [
        {"time": float(t), **{name: float(v[k]) for name, v in log.channels.items()}}
        for k, t in enumerate(log.time)
    ]
    in_double = TractionEstimator(robot(), method).snapshot()
    single()
    whole, first = TractionEstimator(robot(), method), TractionEstimator(robot(), method)
    expected = [whole.update(sample).to_dict() for sample in samples]
    for sample in samples[:150]:
        first.update(sample)
    rest = TractionEstimator.restore(first.snapshot())
    assert [str(rest.update(sample).to_dict()) for sample in samples[150:]] == [
        str(e) for e in expected[150:]
    ]
    with pytest.raises(InputError, match="another version or machine"):
        TractionEstimator.restore(in_double)

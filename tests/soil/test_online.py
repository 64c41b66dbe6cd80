"""The curve while driving: the kernel against NumPy, what teaches it and what does not, and a ground that changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernel_curve import OnlineCurve
from terragrip.physics.adhesion import CURVES

EXPONENTIAL = CURVES["exponential"]


def g(slip):
    return EXPONENTIAL.value(slip, {"a": 1.0})


class Reference:
    """The same filter, written plainly for any number of pairs."""

    def __init__(self):
        self.a, self.P, self.column, self.surprise = 0.85, 0.25, 0.0, 0.0
        self.mean, self.silence = None, 0.0

    def update(self, dt, slip, mu, slip_std, mu_std, constant, radius, distance, share):
        self.P = min(self.P + 0.004 * distance, 0.25)
        use = (np.abs(slip) <= 0.6) & np.isfinite(mu + slip_std + mu_std + constant)
        if not use.any() or dt <= 0:
            self.silence += dt
            return
        slip, mu, slip_std, mu_std, constant, share = (
            x[use] for x in (slip, mu, slip_std, mu_std, constant, share)
        )
        h, rate = g(slip), EXPONENTIAL.slope(slip, {"a": 1.0})
        reach = np.minimum(2 * slip_std, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean_slope = (np.abs(h) - g(np.abs(slip) - reach)) / reach
        rate = np.where(reach > 0.01, np.fmax(rate, mean_slope), rate) * np.sqrt(self.a**2 + self.P)
        r = mu_std**2 + (rate * slip_std) ** 2 + (0.08 * self.a * h) ** 2 + 0.01**2
        both = np.hypot(constant, (np.abs(mu) + np.abs(rate) * (1 - np.abs(slip))) * radius)
        weight = share / share.sum()
        pair = np.array([weight @ mu, weight @ h])
        r, both = (weight @ np.sqrt(r)) ** 2, weight @ both
        elapsed = self.silence + dt
        self.mean = pair if self.mean is None else self.mean + elapsed / (0.5 + elapsed) * (pair - self.mean)
        self.silence = 0.0
        z, h = self.mean
        if abs(h) < 0.2075:
            return
        square = min((z - self.a * h) ** 2 / (h**2 * self.P + r + both**2), 25.0)
        self.surprise += dt / (1 + dt) * (square - self.surprise)
        if self.surprise > 4:
            self.P, self.column, self.surprise, self.mean = 0.25, 0.0, 0.0, pair
            z, h = pair
        r *= max(0.5 / dt, 1.0)
        gain = self.P * h / (h**2 * self.P + r)
        self.a += gain * (z - self.a * h)
        self.P *= 1 - gain * h
        self.column = (1 - gain * h) * self.column + abs(gain) * both

    @property
    def std(self):
        return np.hypot(np.sqrt(self.P), self.column)


@settings(max_examples=10)  # each of 150 steps
@given(seed=st.integers(0, 10_000), pairs=st.integers(1, 8))
def test_kernel_agrees_with_numpy(seed, pairs):
    rng = np.random.default_rng(seed)
    curve, reference = OnlineCurve(), Reference()
    true = 1.0
    for step in range(150):
        if step % 50 == 49:
            true = rng.uniform(0.3, 1.5)
        dt, distance = rng.uniform(0.001, 1.0), rng.uniform(0, 0.5)
        slip = rng.uniform(-0.7, 0.7, pairs)
        mu = true * g(slip) + 0.05 * rng.standard_normal(pairs)
        mu[rng.uniform(size=pairs) < 0.1] = np.nan
        slip_std, mu_std, constant = (rng.uniform(0, 0.05, pairs) for _ in range(3))
        radius, share = rng.uniform(0, 0.03), rng.uniform(0.1, 3, pairs)
        curve.update(
            dt, slip, mu, slip_std=slip_std, adhesion_std=mu_std, adhesion_constant_std=constant,
            radius_std=radius, distance=distance, share=share,
        )  # fmt: skip
        reference.update(dt, slip, mu, slip_std, mu_std, constant, radius, distance, share)
        assert curve.a == pytest.approx(reference.a, rel=1e-9, abs=1e-9)
        assert curve.a_std == pytest.approx(reference.std, rel=1e-9)


def drive(curve, rng, a, seconds, slip=(0.1, 0.4), rate=100, noise=0.02):
    """Rows at `rate` with noise that is alike over 0.3 s; returns a and a_std of each row."""
    error, result = 0.0, []
    keep = np.exp(-1 / (rate * 0.3))
    for _ in range(int(seconds * rate)):
        s = rng.uniform(*slip)
        error = keep * error + noise * np.sqrt(1 - keep**2) * rng.standard_normal()
        curve.update(1 / rate, s, a * float(g(s)) + error, adhesion_std=noise, distance=0.5 / rate)
        result.append((curve.a, curve.a_std))
    return np.array(result)


def test_the_interval_holds_the_truth():
    rng = np.random.default_rng(5)
    held = [np.abs(drive(OnlineCurve(), rng, a, 2)[-1] @ [1, 0] - a) for a in rng.uniform(0.4, 1.4, 60)]
    spread = [drive(OnlineCurve(), rng, a, 2)[-1, 1] for a in (0.4, 0.85, 1.4)]
    assert np.mean(np.array(held) < 1.96 * min(spread)) >= 0.85
    assert max(spread) < 0.12  # and it says something


def test_a_slip_that_may_be_none_teaches_little():
    """A start: adhesion of 0.08 at a slip of 0.2 known to 0.1 is a weak soil, or a firm one at 2 % slip."""
    spread = {}
    for slip_std in (0.0, 0.1):
        curve = OnlineCurve()
        for _ in range(20):
            curve.update(0.05, 0.2, 0.08, slip_std=slip_std, adhesion_std=0.01, distance=0.004)
        spread[slip_std] = curve.a_std
    assert spread[0.0] < 0.05
    assert spread[0.1] > 0.1


def test_a_new_ground_is_seen_within_a_second():
    rng = np.random.default_rng(1)
    curve = OnlineCurve()
    before = drive(curve, rng, 1.4, 10)
    after = drive(curve, rng, 0.4, 1)
    assert before[-1, 0] == pytest.approx(1.4, abs=0.15)
    assert after[-1, 0] == pytest.approx(0.4, abs=0.1)


def test_new_ground_forgets():
    curve = OnlineCurve()
    drive(curve, np.random.default_rng(1), 1.4, 5)
    curve.new_ground()
    assert (curve.a, curve.a_std) == (0.85, 0.5)


@pytest.mark.parametrize(
    "pair",
    [
        {"slip": 0.02, "adhesion": 0.3},
        {"slip": -0.049, "adhesion": -0.3},
        {"slip": 0.9, "adhesion": 0.3},
        {"slip": np.nan, "adhesion": 0.3},
        {"slip": 0.2, "adhesion": np.nan},
        {"slip": 0.2, "adhesion": 0.3, "slip_std": np.nan},
    ],
)
def test_what_teaches_nothing_leaves_the_interval_wide(pair):
    curve = OnlineCurve()
    for _ in range(1000):
        curve.update(0.01, **pair)
    assert (curve.a, curve.a_std) == (0.85, 0.5)


def test_more_rows_a_second_are_no_more_information():
    spread = []
    for rate in (10, 1000):
        curve = OnlineCurve()
        for _ in range(rate):
            curve.update(1 / rate, 0.2, 0.35, adhesion_std=0.03)
        spread.append(curve.a_std)
    assert spread[0] == pytest.approx(spread[1], rel=0.05)


def test_slip_noise_widens():
    sharp, blurred = OnlineCurve(), OnlineCurve()
    for _ in range(100):
        sharp.update(0.01, 0.1, 0.3, adhesion_std=0.01)
        blurred.update(0.01, 0.1, 0.3, adhesion_std=0.01, slip_std=0.05)
    assert blurred.a_std > 2 * sharp.a_std


def test_constant_errors_do_not_average_out():
    curve = OnlineCurve()
    for _ in range(100_00):
        curve.update(0.01, 0.2, 0.35, adhesion_std=0.01, adhesion_constant_std=0.02)
    assert curve.a_std >= 0.02 / float(g(0.2)) * 0.99


def test_distance_forgets_up_to_what_is_known_of_any_ground():
    curve = OnlineCurve()
    drive(curve, np.random.default_rng(3), 0.6, 5)
    known = curve.a_std
    curve.update(1.0, np.nan, np.nan, distance=5.0)
    assert curve.a_std > 1.5 * known
    curve.update(1.0, np.nan, np.nan, distance=1e6)
    assert curve.a_std == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"dt": -0.1}, "back in time"),
        ({"dt": np.nan}, "not a number"),
        ({"adhesion": np.inf}, "not a number"),
        ({"slip": np.full(9, 0.2)}, "more than 8"),
        ({"slip_std": -0.1}, "negative spread"),
        ({"adhesion_constant_std": -0.1}, "negative spread"),
        ({"radius_std": -0.1}, "negative spread"),
    ],
)
def test_refusals(change, expected):
    with pytest.raises(ValueError, match=expected):
        OnlineCurve().update(**{"dt": 0.01, "slip": 0.2, "adhesion": 0.3, **change})

"""Radii, torque scale and gains of a calibration, step by step, against closed forms and NumPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from terragrip.estimation.calibration import gains, radii, torque_scale
from terragrip.estimation.calibration.gains import ChannelErrors
from terragrip.estimation.calibration.sharing import SharedGains, Sharing, block_covariance, effective_blocks
from terragrip.estimation.calibration.windows import Windows, wheel_loads
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from window_table import LOAD, N, stating, table


def test_adhesion_of_driven_wheels_is_their_mean_by_load(vehicle: Vehicle) -> None:
    torque = np.tile([8.0, 9.0, 10.0, 11.0], (N, 1))
    own = (torque[0] - 0.2 * 2.0 / 0.18) / (0.2 * LOAD) - 0.02  # bearings: r ρ_w ω; tires: ρ_t
    adhesion = radii._adhesion(table(torque=torque), vehicle)
    np.testing.assert_allclose(adhesion, np.sum(own * LOAD) / np.sum(LOAD))
    axles = {**vehicle.to_dict()["axles"], "front": {"mass": 60.0, "wheels": ["fl", "fr"], "driven": False}}
    rear = Vehicle.from_dict({**vehicle.to_dict(), "axles": axles})
    adhesion = radii._adhesion(table(torque=torque), rear)
    np.testing.assert_allclose(adhesion[0], [own[0], own[1], *[np.mean(own[2:])] * 2])


def test_windows_of_most_pull() -> None:
    assert radii._most(np.linspace(0.0, 1.0, 101)) == pytest.approx(0.95)
    assert radii._most(np.zeros(5)) == 0.15
    assert radii._most(np.empty(0)) == 0.15


@pytest.mark.parametrize(
    ("stated", "adhesion", "rolling"),
    [
        ({}, 0.02, 0.0),
        ({"drive_torque_offset": 0.3}, 0.3 * 4 / (140 * GRAVITY * 0.2), 0.0),
        ({"drive_torque_gain": 0.1, "tire_rolling_resistance": 0.005}, np.hypot(0.02, 0.1 * 0.15), 0.005),
    ],
)
def test_what_passes_cannot_tell_is_in_the_variance_of_a_radius(
    vehicle: Vehicle, stated: dict[str, float], adhesion: float, rolling: float
) -> None:
    expected = (adhesion**2 / 4 + rolling**2) / 5.0**2
    np.testing.assert_allclose(radii._considered(stating(vehicle, **stated), 5.0), expected)


def bent(
    vehicle: Vehicle, pulls: np.ndarray, level: float, steepness: float, radius: float
) -> tuple[Windows, np.ndarray]:
    """Windows whose wheels slip by -(A/C) ln(1 - μ/A) at wheels of ``radius``."""
    slip = -(level / steepness) * np.log(1 - pulls / level)
    hub = np.ones((len(pulls), 4))
    return table(len(pulls), hub_speed=hub, wheel_speed=hub / radius / (1 - slip[:, None])), np.tile(
        pulls[:, None], 4
    )


def test_a_fit_of_radii_finds_the_curve_that_made_the_slip(vehicle: Vehicle) -> None:
    pulls = np.r_[np.linspace(0.04, 0.08, 60), np.linspace(0.1, 0.5, 60)]
    data, adhesion = bent(vehicle, pulls, 0.7, 6.0, 0.206)
    scale, variance, steepness, blocks = radii._fit(
        data,
        vehicle,
        adhesion,
        np.zeros(120, int),
        np.array([0.5]),
        np.ones((120, 4), bool),
        np.arange(120) // 6,
    )
    np.testing.assert_allclose(scale, 1.03, rtol=1e-3)
    np.testing.assert_allclose(steepness, 6.0, rtol=0.03)
    assert len(set(scale.tolist())) == 1
    assert 1.0 < blocks <= 20.0
    assert (np.sqrt(variance) < 1e-3).all()


def test_where_no_window_pulls_the_curve_keeps_its_priors_and_the_radius_their_spread(
    vehicle: Vehicle,
) -> None:
    """Slip s = -(A/C) ln(1 - μ/A) at C = 5, SD .8 of ln C, and A = .6, SD .6 of ln A; the rest of the error is next to none."""
    pulls = np.full(60, 0.1)
    data, adhesion = bent(vehicle, pulls, 0.6, 5.0, 0.2)
    code, used = np.zeros(60, int), np.ones((60, 4), bool)
    data.hub_speed[:] *= (1 + 1e-3 * np.where(np.arange(60) % 2, 1, -1))[:, None]
    scale, variance, steepness, _ = radii._fit(
        data, vehicle, adhesion, code, np.array([0.2]), used, np.arange(60) // 6
    )
    share = 0.1 / 0.6
    slip = -0.6 / 5 * np.log1p(-share)
    by_level = slip - 0.6 / 5 * share / (1 - share)  # d slip / d ln A
    np.testing.assert_allclose(scale, 1.0, atol=1e-4)
    assert steepness == pytest.approx([5.0], rel=1e-3)
    np.testing.assert_allclose(
        np.sqrt(variance), np.hypot(0.8 * slip, 0.6 * by_level) / (1 - slip), rtol=0.02
    )


def test_a_window_that_says_something_else_moves_no_radius(vehicle: Vehicle) -> None:
    pulls = np.r_[np.linspace(0.04, 0.08, 60), np.linspace(0.1, 0.5, 60)]
    data, adhesion = bent(vehicle, pulls, 0.7, 6.0, 0.206)
    used = np.ones((120, 4), bool)
    data.hub_speed[5] *= 1.5
    data.hub_speed[7], adhesion[7], used[7] = np.nan, np.nan, False
    scale, _, steepness, _ = radii._fit(
        data, vehicle, adhesion, np.zeros(120, int), np.array([0.5]), used, np.arange(120) // 6
    )
    np.testing.assert_allclose(scale, 1.03, rtol=2e-3)
    np.testing.assert_allclose(steepness, 6.0, rtol=0.05)


def rolled(vehicle: Vehicle, free: int, pull: float = 100.0, **more: Any) -> Windows:
    """Windows of 2 s on a curve of A = .7, C = 6 at a radius of .206, the first ``free`` without a load to tow."""
    pulls = np.r_[np.linspace(0.04, 0.08, 30), np.linspace(0.1, 0.5, 60)]
    data, adhesion = bent(vehicle, pulls, 0.7, 6.0, 0.206)
    torque = 0.2 * LOAD * (adhesion + 0.02) + 0.2 * 2.0 * data.wheel_speed
    drawbar = np.where(np.arange(90) < free, 41.0, pull)  # 3 % of the weight is 41.2
    return replace(data, torque=torque, drawbar=drawbar, length=2.0, start=2.0 * np.arange(90), **more)


def test_radii_come_from_passes_at_zero_pull_with_their_slip_and_evidence(vehicle: Vehicle) -> None:
    data = rolled(vehicle, 30)
    data.torque[3, 1] = np.nan
    rolling = radii.rolling_radii(data, vehicle, np.arange(90) // 6, ["log"])
    assert isinstance(rolling, radii.Rolling)
    np.testing.assert_allclose(rolling.radius, 0.206, rtol=1e-3)
    slips = -(0.7 / 6) * np.log(1 - np.linspace(0.04, 0.08, 30) / 0.7)
    assert rolling.slip == pytest.approx(np.delete(slips, 3).mean(), rel=0.05)
    assert [(e.source, e.start, e.end, e.samples) for e in rolling.rests_on] == [("log", 0.0, 60.0, 29 * 50)]
    _, variance, steepness, blocks = radii._fit(
        data, vehicle, radii._adhesion(data, vehicle), np.zeros(90, int), np.array([0.475]),
        np.isfinite(data.torque).all(axis=1)[:, None] & (radii._adhesion(data, vehicle) < 0.7 * 0.475), np.arange(90) // 6,
    )  # fmt: skip
    assert rolling.factor == pytest.approx(student.ppf(0.975, blocks - 1), rel=0.05)
    np.testing.assert_allclose(
        rolling.std, np.sqrt(variance + radii._considered(vehicle, float(steepness[0]))), rtol=0.05
    )


@pytest.mark.parametrize(("free", "known"), [(2, False), (3, True)])
def test_five_metres_without_pull_are_needed(vehicle: Vehicle, free: int, known: bool) -> None:
    result = radii.rolling_radii(rolled(vehicle, free), vehicle, np.arange(90) // 6, ["log"])
    assert isinstance(result, radii.Rolling) is known
    if not known:
        assert result.why == "4 m of straight passes at zero pull, and 5 m are needed"


def balance(n: int = 200, seed: int = 1, **more: Any) -> torque_scale._Balance:
    draws = np.random.default_rng(seed)
    force, noise = draws.normal(500.0, 100.0, n), draws.normal(0.0, 20.0, (2, n))
    base = torque_scale._Balance(
        1.2 * (force + 50.0),
        np.full(n, 50.0),
        force + noise[0],
        force + noise[1],
        np.ones((n, 1)),
        np.zeros(n),
        True,
        np.zeros(n),
    )
    return replace(base, **more)


def test_a_resistance_for_each_stretch_is_as_a_term_for_each() -> None:
    """A day has thousands of stretches: terms for all of them would take hours and all memory."""
    draws = np.random.default_rng(3)
    values, weight = draws.normal(0.0, 100.0, (200, 3)), draws.uniform(0.2, 1.0, 200)
    nuisance, stretch = (
        np.column_stack([np.arange(200) < 90, np.arange(200) >= 90, draws.normal(size=200)]),
        np.arange(200) // 6,
    )
    rows = balance(nuisance=nuisance.astype(float), stretch=stretch)
    own = balance(nuisance=np.column_stack([nuisance, stretch[:, None] == np.arange(34)]).astype(float))
    expected = torque_scale._centered(values, own, weight)
    np.testing.assert_allclose(torque_scale._centered(values, rows, weight), expected, atol=1e-9)
    alone = balance(nuisance=np.ones((200, 1)), stretch=stretch)  # the mean is none beside the stretches'
    np.testing.assert_allclose(
        torque_scale._centered(values, alone, weight).T
        @ (weight[:, None] * (stretch[:, None] == np.arange(34))),
        0.0,
        atol=1e-9,
    )


def test_the_scale_is_that_of_two_instruments() -> None:
    rows, weight = balance(), np.random.default_rng(2).uniform(0.2, 1.0, 200)
    scale, rest = torque_scale._slope(rows, weight)

    def centered(x: np.ndarray) -> np.ndarray:
        return x - np.average(x, weights=weight)

    x, y1, y2 = map(centered, (rows.thrust, rows.force, rows.other))
    assert scale == pytest.approx(np.sum(weight * x * (y1 + y2) / 2) / np.sum(weight * y1 * y2))
    np.testing.assert_allclose(rest, x - scale * (y1 + y2) / 2, atol=1e-8)
    assert scale == pytest.approx(1.2, abs=0.01)  # by one measure alone, noise would take 4 % of it
    wavy = balance(losses=rows.force / 10)
    _, losses, y1, y2 = (centered(v) for v in (wavy.thrust, wavy.losses, wavy.force, wavy.other))
    below = np.sum(weight * (y1 * y2 + losses * (y1 + y2) / 2))
    assert torque_scale._slope(wavy, weight)[0] == pytest.approx(np.sum(weight * x * (y1 + y2) / 2) / below)
    slips = 0.1 * rows.force
    steepness = torque_scale._partial_slope(slips, rows, weight)
    assert steepness == pytest.approx(np.sum(weight * 0.1 * y1 * (y1 + y2) / 2) / np.sum(weight * y1 * y2))


@pytest.mark.parametrize(("n", "blocks"), [(200, 20), (30, 15)])
def test_the_error_of_the_scale_is_a_jackknife_over_stretches(n: int, blocks: int) -> None:
    rows, weight = balance(n), np.ones(n)
    block = np.arange(n) * blocks // n
    without = [torque_scale._slope(rows, (block != b).astype(float))[0] for b in range(blocks)]
    expected = np.sqrt((blocks - 1) / blocks * np.sum((without - np.mean(without)) ** 2))
    assert torque_scale._jackknife(rows, weight) == pytest.approx(expected)


def test_a_slope_that_nothing_tells_is_three_tenths_of_it_over_the_force(vehicle: Vehicle) -> None:
    rows, weight = balance(slope_known=False), np.ones(200)
    per_radian = 0.3 * 140 * GRAVITY / np.std(rows.force)

    def spread(machine: Vehicle, of: Any = rows, left: float = 0.0) -> float:
        return torque_scale._unseen_slope(machine, of, weight, np.full(200, left * 140 * GRAVITY))

    assert spread(stating(vehicle, slope=0.02)) == pytest.approx(0.02 * per_radian)
    assert spread(stating(vehicle)) == pytest.approx(np.radians(0.5) * per_radian)
    assert spread(vehicle, balance()) == 0.0
    # On hills that nobody stated, what the balance leaves says how steep they are.
    assert spread(stating(vehicle, slope=0.02), left=0.06) == pytest.approx(0.06 * per_radian)
    assert spread(stating(vehicle, slope=0.0), left=0.06) == 0.0  # stated as level


def test_the_bars_gain_counts_where_there_is_one(vehicle: Vehicle) -> None:
    assert torque_scale._drawbar_gain(table(), stating(vehicle)) == 0.01
    assert torque_scale._drawbar_gain(table(), stating(vehicle, drawbar_gain=0.03)) == 0.03
    assert torque_scale._drawbar_gain(table(drawbar=np.zeros(N)), vehicle) == 0.0


@pytest.mark.parametrize(("every", "length"), [(1, 1.0), (10, 1.0), (20, 2.0), (35, 3.5)])
def test_a_window_spans_two_updates_of_the_slowest_torque(every: int, length: float) -> None:
    time = 0.05 * np.arange(400)
    slow = np.where(np.arange(400) % every == 0, 1.0, np.nan)
    log = Recording(
        time,
        {"drive_torque_fl": np.ones(400), "drive_torque_fr": slow, "pitch": np.where(time < 0.1, 1, np.nan)},
    )
    assert torque_scale._window_length([log]) == pytest.approx(length)


def test_the_balance_of_forces_of_windows(vehicle: Vehicle) -> None:
    """X = Σ M/r; losses Σ J ω'/r + Σ ρ_t F + ρ_w ω; Y = F_dx + m (dv/dt + g sinθ) by either sensor."""
    way = np.where(np.arange(N) < N // 2, 1.0, -1.0)
    spin = 0.5 * np.ones((N, 4))
    data = table(
        ground_speed=way, push=0.3 * np.ones(N), kinematic_push=0.2 * np.ones(N), wheel_acceleration=spin,
        acceleration=np.r_[np.nan, np.ones(N - 1)], pitch=np.zeros(N), wheel_speed=way[:, None] * table().wheel_speed,
    )  # fmt: skip
    rows = torque_scale._balance(data, vehicle)
    np.testing.assert_allclose(rows.thrust, 4 * 10.0 / 0.2)
    omega = 1 / 0.18
    np.testing.assert_allclose(
        rows.losses, 4 * 0.15 * 0.5 / 0.2 + way * (0.02 * 140 * GRAVITY + 4 * 2.0 * omega)
    )
    np.testing.assert_allclose(rows.force, 100.0 + 140 * 0.3)
    np.testing.assert_allclose(rows.other, 100.0 + 140 * np.r_[0.3, np.full(N - 1, 0.2)])
    np.testing.assert_allclose(rows.slip, 0.1 * way)
    assert rows.slope_known
    np.testing.assert_array_equal(rows.nuisance.sum(axis=1), 1.0)
    assert rows.nuisance.shape == (N, 2)
    for known in (10, 11):  # more than half
        some = np.where(np.arange(N) < known, 0.0, np.nan)
        assert torque_scale._balance(table(pitch=some), vehicle).slope_known is (known > 10)
        assert torque_scale._balance(table(acceleration=some), vehicle).slope_known is (known > 10)
    turning = table(
        hub_speed=np.ones((N, 4)) + np.linspace(0, 0.1, N)[:, None] * [-1, 1, -1, 1],
        soil=np.array(["a", "b"] * 10, object),
    )
    nuisance = torque_scale._balance(turning, vehicle).nuisance
    assert nuisance.shape == (N, 3)
    np.testing.assert_allclose(nuisance[:, 2], np.linspace(0, 0.2, N))


def test_rows_of_shared_curves(vehicle: Vehicle) -> None:
    data = table(wheel_acceleration=0.5 * np.ones((N, 4)))
    driven = np.array([0, 1, 3])
    rows = gains._rows(
        data, stating(vehicle, wheel_radius=0.01), np.array([0.1, 0.0, 0.2, 0.3]), np.arange(N), driven, 0.007
    )
    np.testing.assert_allclose(
        rows.known, 0.15 * 0.5 + 0.2 * (0.02 * LOAD + 2.0 / 0.18)[driven] * np.ones((N, 1))
    )
    np.testing.assert_allclose(rows.leverage, 0.2 * LOAD[driven] * np.ones((N, 1)))
    np.testing.assert_allclose(rows.slip, 0.1)
    np.testing.assert_allclose(rows.offset_std, [0.1, 1e-3, 0.3])
    assert (rows.radius_std, rows.slip_std) == (0.01, 0.007)
    assert gains._rows(data, stating(vehicle), np.zeros(4), np.arange(N), driven, 0.0).radius_std == 0.003


def test_constant_errors_of_channels_shift_loads_and_so_gains(vehicle: Vehicle) -> None:
    tall = Vehicle.from_dict(
        {**vehicle.to_dict(), "center_of_gravity_height": 0.3, "hitch_height": 0.25, "track": 0.5}
    )
    data, errors = table(), ChannelErrors(push=0.1, lateral=0.2, drawbar=30.0)
    sensitivity = np.random.default_rng(3).normal(size=(8, 4))
    fit = SharedGains(np.zeros(4), np.zeros(4), np.eye(8), N, 10, sensitivity)
    covariance = gains._considered_loads(fit, data, tall, np.arange(4), errors)

    def loads(drawbar: float = 100.0, push: float = 0.0, lateral: float = 0.0) -> np.ndarray:
        one = np.ones(1)
        return wheel_loads(
            tall, drawbar=drawbar * one, push=push * one, slope=0 * one, spin_torque=0 * one, lateral=lateral * one,
            measured=np.full((1, 2), np.nan),
        )[0]  # fmt: skip

    effects = [
        sensitivity @ (loads(**by) / loads() - 1)
        for by in ({"drawbar": 130.0}, {"push": 0.1}, {"lateral": 0.2})
    ]
    np.testing.assert_allclose(covariance, sum(np.outer(e, e) for e in effects))


def test_an_unmeasured_pull_is_what_the_wheels_do_beside_accelerating(vehicle: Vehicle) -> None:
    """Four torques of 10 N m on wheels of .2 m push 200 N."""
    four = np.arange(4)
    assert gains._unseen_pull(table(), vehicle, four) == pytest.approx(200.0)
    assert gains._unseen_pull(table(push=np.full(N, 0.1)), vehicle, four) == pytest.approx(
        200.0 - 0.1 * vehicle.mass
    )
    assert gains._unseen_pull(table(push=np.full(N, np.nan)), vehicle, four[2:]) == pytest.approx(100.0)
    assert gains._unseen_pull(table(torque=np.full((N, 4), -10.0)), vehicle, four) == 0.0


@pytest.mark.parametrize(("axle_load", "said"), [(0.0, False), (0.01, True)])
def test_intervals_speak_of_axle_loads_where_these_may_be_off(
    vehicle: Vehicle, axle_load: float, said: bool
) -> None:
    fit = SharedGains(np.zeros(4), np.zeros(4), 1e-4 * np.eye(8), N, 10, np.zeros((8, 4)))
    found = gains._quantities(fit, fit.covariance, fit.covariance, vehicle, np.arange(4), (), 0.0, axle_load)
    assert [(one.value, one.std) for one in found] == [(1.0, pytest.approx(0.01))] * 4
    assert all(("the intervals hold axle loads that are 1 % off" in one.sentence) is said for one in found)
    assert all(("axle loads" in one.sentence) is said for one in found)


def test_errors_that_outlast_a_block_are_in_the_standard_error() -> None:
    """The mean of 40 blocks whose errors last for four of them: blocks taken alone say half the error."""
    scores = []
    for seed in range(60):
        draws = np.random.default_rng(seed)
        values = np.repeat(draws.normal(size=10), 4) + 0.2 * draws.normal(size=40)
        score = (values - values.mean())[:, None]
        covariance = block_covariance(
            np.array([[40.0]]), np.ones((40, 1, 1)), score, np.arange(40), np.zeros((1, 1))
        )
        scores.append(values.mean() / np.sqrt(covariance[0, 0]))
    assert np.sqrt(np.mean(np.square(scores))) < 1.5  # 2.1 before


@pytest.mark.parametrize("seed", [0, 1])
def test_a_fit_without_a_block_is_one_step_from_the_optimum(seed: int) -> None:
    """CR3 of a linear fit: leave one block out, refit by NumPy."""
    draws = np.random.default_rng(seed)
    design, y = draws.normal(size=(40, 1, 3)), draws.normal(size=40)
    block, prior = np.repeat(np.arange(8), 5) * 3, 0.5 * np.eye(3)
    flat = design[:, 0]
    normal = flat.T @ flat + prior
    best = np.linalg.solve(normal, flat.T @ y)
    score = flat * (y - flat @ best)[:, None]
    shifts = []
    for label in np.unique(block):
        rest = block != label
        shifts.append(np.linalg.solve(flat[rest].T @ flat[rest] + prior, flat[rest].T @ y[rest]) - best)
    inverse = np.linalg.inv(normal)
    moved = np.array(shifts)  # neighbours up to a fifth of 8 blocks away: 2, of weights 2/3 and 1/3
    alike = 2 * (2 / 3 * np.sum(moved[1:] * moved[:-1], axis=0) + np.sum(moved[2:] * moved[:-2], axis=0) / 3)
    moved *= np.sqrt(np.maximum(1 + alike / np.sum(moved**2, axis=0), 1))
    expected = 7 / 8 * moved.T @ moved + inverse @ prior @ inverse
    np.testing.assert_allclose(block_covariance(normal, design, score, block, prior), expected)
    part = np.array([np.sum((flat[block == b] @ inverse[1]) ** 2) for b in np.unique(block)])
    assert effective_blocks(normal, design, block, 1) == pytest.approx(part.sum() ** 2 / np.sum(part**2))
    assert effective_blocks(normal, 0 * design, block, 1) == 1.0


def test_soils_that_disagree_widen_by_birges_ratio() -> None:
    """Two soils of 20 stretches whose wheels differ by ± 5 %; under 15 stretches a soil is not asked."""
    draws, n = np.random.default_rng(5), 240

    def rows(gain: float, each: int = 120, stretches: int = 20) -> Sharing:
        soil = np.arange(n) // each
        lever = 60.0 * np.ones((n, 2))
        torque = lever * 0.4 * (1 + 0.01 * draws.standard_normal((n, 2)))
        torque[:, 0] *= np.where(soil == 0, 1 + gain, 1 - gain)
        slip = np.linspace(0.1, 0.3, n)[:, None] * np.ones(2)
        return Sharing(
            torque, 0 * lever, lever, slip, soil, np.arange(n) * 2 * stretches // n, 1e-6, np.full(2, 1e-6)
        )

    assert gains._disagreement(rows(0.0)) == 1.0
    apart = gains._disagreement(rows(0.05))
    from terragrip.estimation.calibration.sharing import fit_shared_gains

    data = rows(0.05)
    fits = [fit_shared_gains(data.select(data.soil == k)) for k in (0, 1)]
    x, v = ([f.log_gain[1] for f in fits if f], [f.covariance[1, 1] for f in fits if f])
    mean = (x[0] / v[0] + x[1] / v[1]) / (1 / v[0] + 1 / v[1])
    expected = np.sqrt((x[0] - mean) ** 2 / v[0] + (x[1] - mean) ** 2 / v[1])
    assert gains._disagreement(data) == pytest.approx(expected)
    assert apart > 5
    assert gains._disagreement(rows(0.05, stretches=14)) == 1.0
    assert gains._disagreement(rows(0.05, each=n)) == 1.0

"""The machine's model, the filter of the kernel's shape, and the considered constants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kernel_twin import Considered, Constant, Input, Machine, Step, TractionFilter, TractionModel, Tuning
from kernel_twin.filters import jacobian
from kernel_twin.smoother import smooth

pytestmark = pytest.mark.usefixtures("unchecked")

Array = NDArray[Any]


def agreement(got: tuple[Array, Array], expected: tuple[Array, Array]) -> float:
    """Largest difference of the means in max(|x|, SD) and of the covariances in the SDs' product."""
    sd = np.sqrt(np.diag(expected[1]))
    mean = np.max(np.abs(got[0] - expected[0]) / np.maximum(np.abs(expected[0]), sd))
    return float(max(mean, np.max(np.abs(got[1] - expected[1]) / np.outer(sd, sd))))


def run(problem: Any, tuning: Tuning, dtype: Any = np.float64) -> tuple[TractionFilter, list[Step]]:
    filter = TractionFilter(problem.machine, tuning, problem.x0, problem.P0.astype(dtype))
    steps = []
    for k in problem.instants:
        if k.restart is not None:
            filter.restart(*k.restart)
        steps.append(filter.step(k.dt, k.before, k.now, k.q_input, k.y, k.r))
    return filter, steps


# ---- the model ----


@pytest.mark.parametrize("wheels", [1, 4, 8])
@pytest.mark.parametrize("dt", [0.0, 0.01, 0.9])
def test_matrices_are_the_derivatives_of_the_functions(wheels, dt, problem):
    case = problem(wheels, wheels, steps=1)
    model = TractionModel(case.machine.in_precision(np.longdouble))
    u = case.instants[0].now.in_precision(np.longdouble)
    x = case.x0.astype(np.longdouble)
    F = model.transition_matrix(x, u, dt)
    np.testing.assert_allclose(F, jacobian(lambda z: model.transition(z, u, dt), x), rtol=1e-9, atol=1e-9)
    H = model.output_matrix(x, u)
    np.testing.assert_allclose(H, jacobian(lambda z: model.output(z, u), x), rtol=1e-9, atol=1e-9)


def test_runge_kutta_stays_near_the_exact_solution():
    # one wheel: ω' = -a ω + c, a = r ρ_w/J; the substeps keep the error of a relaxation small long dt is
    machine = Machine(100.0, 10.0, 0.0, np.array([0.5]), np.array([0.25]), np.array([5.0]))
    model, held = TractionModel(machine), Input(np.array([8.0]), np.array([1000.0]), 30.0, 0.02)
    x = np.array([3.0, 1.0, 0.01, 0.05])
    a, c = 0.5 * 5.0 / 0.25, (8.0 - 0.5 * 0.01 * 1000) / 0.25
    for dt, count in ((0.01, 1), (0.1, 4), (1.0, 40)):
        assert model.substeps(dt) == count
        got = model.transition(x, held, dt)
        exact = c / a + (3.0 - c / a) * np.exp(-a * dt)
        assert got[0] == pytest.approx(exact, rel=1e-4)
        acceleration = 0.01 * 1000 / 100 - 30 / 100 - 0.05 * 10 * np.cos(0.02) - 10 * np.sin(0.02)
        assert got[1] == pytest.approx(1.0 + acceleration * dt, rel=1e-12)
        np.testing.assert_array_equal(got[2:], x[2:])


# ---- the filter ----


@pytest.mark.long  # the kernel's two, which agree with these, are in test_kernel_agreement.py
@pytest.mark.parametrize("policy", ["fixed", "adaptive", "supervised"])
def test_exact_and_unscented_agree(policy, problem):
    case = problem(8, wheels=3, steps=300, missing=0.1, spikes=0.02, accelerometer=True, restarts=True)
    options: dict[str, Any] = {"policy": policy, "huber": 2.5}
    exact, exact_steps = run(case, Tuning(case.walk, **options), np.longdouble)
    unscented, unscented_steps = run(case, Tuning(case.walk, engine="unscented", **options), np.longdouble)
    assert agreement(unscented.moments(), exact.moments()) < 1e-11
    for a, b in zip(exact_steps, unscented_steps, strict=True):
        assert a.gamma == b.gamma
        np.testing.assert_allclose(a.adaptation.astype(float), b.adaptation.astype(float), rtol=1e-9)


def test_exact_agrees_with_a_ten_line_filter(problem, ten_line_filter):
    case = problem(2, wheels=2, steps=1, condition=1e6, accelerometer=True)
    model, now = TractionModel(case.machine), case.instants[0].now
    steps, q_input = 200, case.instants[0].q_input
    ys = np.random.default_rng(0).normal(size=(steps, 4))
    origin = np.zeros(6)  # the model is affine: its offsets enter as known inputs
    shift, level = model.transition(origin, now, 0.02), model.output(origin, now)
    F, H = model.transition_matrix(origin, now, 0.02), model.output_matrix(origin, now)
    filter = TractionFilter(case.machine, Tuning(case.walk), case.x0, case.P0)
    augmented = np.zeros((7, 7))
    augmented[:6, :6], augmented[:6, 6], augmented[6, 6] = F, shift, 1
    Q = np.zeros((7, 7))
    Q[:6, :6] = np.diag(case.walk * 0.02 + q_input)
    P = np.zeros((7, 7))
    P[:6, :6] = case.P0
    expected = ten_line_filter(
        augmented,
        np.hstack([H, np.zeros((4, 1))]),
        Q,
        np.diag(case.instants[0].r),
        np.append(case.x0, 1.0),
        P,
        ys - level,
    )
    for y, (x, P) in zip(ys, expected, strict=True):
        filter.step(0.02, now, now, q_input, y, case.instants[0].r)
        assert agreement(filter.moments(), (x[:6], P[:6, :6])) < 1e-9


@pytest.mark.long  # without the traction model: test_reference.py
@pytest.mark.parametrize("policy", ["fixed", "supervised", "bank"])
def test_double_agrees_with_long_double(policy, problem):
    case = problem(31, wheels=2, steps=200, condition=1e5, missing=0.1, accelerometer=True, restarts=True)
    tuning = Tuning(case.walk, policy=policy, huber=3.0)
    assert agreement(run(case, tuning)[0].moments(), run(case, tuning, np.longdouble)[0].moments()) < 1e-8


@pytest.mark.parametrize("policy", ["fixed", "adaptive", "bank"])
def test_restart_keeps_the_parameters_and_forgets_the_motion(policy, problem):
    case = problem(6, wheels=2, steps=20)
    filter, _ = run(case, Tuning(case.walk, policy=policy))
    x, P = filter.moments()
    filter.restart(4.0, [1.0, 2.0, 3.0], [0.1, 0.2, 0.3])
    got_x, got_P = filter.moments()
    np.testing.assert_allclose(got_x, [1, 2, 3, *x[3:]], rtol=1e-12)
    np.testing.assert_allclose(got_P[:3, :3], np.diag([0.1, 0.2, 0.3]), atol=1e-15)
    np.testing.assert_allclose(got_P[:3, 3:], 0, atol=1e-20)  # the mean of equal lanes may round
    growth = got_P[3:, 3:] - P[3:, 3:]
    mode = filter._bank.probabilities @ [0.1, 1, 10, 100] if filter._bank else 1.0
    np.testing.assert_allclose(growth, np.diag(4.0 * mode * case.walk[3:]), rtol=1e-9, atol=1e-14)


def test_predict_is_a_step_without_measurements(problem):
    case = problem(7, wheels=1, steps=30)
    filter, _ = run(case, Tuning(case.walk, policy="supervised"))
    x, P = filter.moments()
    held = case.instants[-1].now
    filter.predict(0.5, held, np.zeros(4))
    F = filter.model.transition_matrix(x, held, 0.5)
    np.testing.assert_allclose(filter.moments()[0], filter.model.transition(x, held, 0.5), rtol=1e-12)
    assert np.all(np.diag(filter.moments()[1] - F @ P @ F.T) > 0)
    assert filter.time == pytest.approx(sum(k.dt for k in case.instants) + 0.5)


@pytest.mark.long  # its moments are those of ten lines above
def test_filter_finds_the_truth_and_knows_how_well(problem):
    case = problem(14, wheels=2, steps=2000, condition=100.0, accelerometer=True, missing=0.05)
    _, steps = run(case, Tuning(case.walk))
    nis = np.array([s.update.nis for s in steps[200:]])
    channels = np.array([s.update.present.sum() for s in steps[200:]])
    # a χ² sum of some 6 800 degrees of freedom has a relative SD of .017
    assert np.sum(nis) / np.sum(channels) == pytest.approx(1.0, abs=0.07)


def test_smoother_is_surer_than_the_filter_and_ends_with_it(problem):
    case = problem(15, wheels=1, steps=300, condition=100.0, steady_rate=True)
    filter = TractionFilter(case.machine, Tuning(case.walk), case.x0, case.P0)
    filtered, predictions = [], []
    for k in case.instants:
        predictions.append(filter.step(k.dt, k.before, k.now, k.q_input, k.y, k.r).prediction)
        filtered.append(filter.moments())
    smoothed = smooth(filtered, predictions[1:])
    for (_, P), (_, smoothed_P) in zip(filtered, smoothed, strict=True):
        gain = np.linalg.eigvalsh((P - smoothed_P) / np.sqrt(np.outer(np.diag(P), np.diag(P))))
        assert gain.min() > -1e-9
    assert np.mean([Ps[2, 2] / P[2, 2] for (_, P), (_, Ps) in zip(filtered, smoothed, strict=True)]) < 0.9
    np.testing.assert_array_equal(smoothed[-1][0], filtered[-1][0])


# ---- considered constants ----

ROBOT = Machine(139.0, 9.81, 0.02, np.full(4, 0.2), np.full(4, 0.27), np.full(4, 2.0))
LOAD = np.array([265.0, 265.0, 417.0, 417.0])


def steady_sensitivity(*constants: Constant) -> Array:
    """ξ after 30 s of steady travel."""
    dtype = np.float64
    walk = np.array([1e-6] * 5 + [1e-3] * 5)
    filter = TractionFilter(
        ROBOT, Tuning(walk), np.array([4.0] * 4 + [0.7] + [0.3] * 4 + [0.1]), np.eye(10) * 0.01
    )
    considered = Considered(filter.model, constants, dtype)
    held = Input(0.2 * (0.3 + 0.02) * LOAD + 0.2 * 2.0 * 4.0, LOAD, 0.3 * LOAD.sum() - 0.1 * 139 * 9.81)
    y, r = np.array([4.0] * 4 + [0.7, np.nan]), np.array([1e-3] * 4 + [4e-4, 1.0])
    for _ in range(600):
        x = filter.moments()[0]
        step = filter.step(0.05, held, held, np.zeros(10), y, r)
        assert step.prediction is not None
        considered.predict(step.prediction, x, held, 0.05)
        considered.update(step.update, step.prediction.mean, held)
    return considered.sensitivity


def test_considered_constants_shift_the_estimate_as_physics_6_says():
    m, g, r = 139.0, 9.81, 0.2
    columns = steady_sensitivity(
        Constant("drawbar_offset", 3.0),
        Constant("slope", np.radians(0.5)),
        Constant("drive_torque_offset", 1.0, wheel=2),
        Constant("tire_rolling_resistance", 0.01),
        Constant("drive_torque_gain", 0.02, wheel=0),
    ).T
    adhesion, resistance = columns[:, 5:9], columns[:, 9]
    np.testing.assert_allclose(adhesion[:2], 0, atol=1e-5)
    # an error of what the filter takes the pull or the slope for; physics.md 6 states the slope left out
    np.testing.assert_allclose(resistance[:2], [-1 / (m * g), -1.0], rtol=1e-3, atol=3e-6)
    np.testing.assert_allclose(adhesion[2], np.array([0, 0, 1, 0]) / (r * LOAD[2]), rtol=1e-3, atol=1e-6)
    assert resistance[2] == pytest.approx(1 / (r * m * g), rel=1e-3)
    np.testing.assert_allclose(adhesion[3], -1, rtol=1e-3)
    assert resistance[3] == pytest.approx(
        -LOAD.sum() / (m * g), rel=1e-3
    )  # κ does not shift where the loads fit
    torque = 0.2 * 0.32 * LOAD[0] + 0.2 * 2.0 * 4.0
    assert adhesion[4, 0] == pytest.approx(torque / (r * LOAD[0]), rel=1e-3)


def with_error(machine: Machine, u: Input, constant: Constant, error: float) -> tuple[Machine, Input]:
    """What the filter works with if it takes that constant ``error`` too high."""
    name, here = constant.name, np.arange(len(u.torque)) == constant.wheel
    torque = u.torque * (1 + error * here) if name == "drive_torque_gain" else u.torque
    torque = torque + error * here if name == "drive_torque_offset" else torque
    load = u.load * (1 + error) if name == "vertical_load" else u.load
    drawbar = u.drawbar * (1 + error) if name == "drawbar_gain" else u.drawbar
    drawbar = drawbar + error if name == "drawbar_offset" else drawbar
    slope = u.slope + error if name == "slope" else u.slope
    radius = machine.radius * (1 + error) if name == "wheel_radius" else machine.radius
    rho = machine.tire_rolling_resistance + (error if name == "tire_rolling_resistance" else 0)
    wrong = Machine(machine.mass, machine.gravity, rho, radius, machine.inertia, machine.bearing_resistance)
    return wrong, Input(torque, load, drawbar, slope)


@pytest.mark.parametrize("engine", ["exact", "unscented"])
def test_considered_sensitivity_is_the_change_of_the_estimate(engine, problem):
    """Against differences of the mean's recursion: the same data and gains, the constant a little wrong."""
    case = problem(17, wheels=2, steps=40, condition=1e3, accelerometer=True, missing=0.1)
    constants = [
        Constant("drive_torque_gain", 1.0, wheel=1),
        Constant("drive_torque_offset", 1.0, wheel=0),
        Constant("drawbar_gain", 1.0),
        Constant("drawbar_offset", 1.0),
        Constant("slope", 1.0),
        Constant("tire_rolling_resistance", 1.0),
        Constant("vertical_load", 1.0),
        Constant("wheel_radius", 1.0),
        Constant("acceleration_bias", 1.0),
    ]
    filter = TractionFilter(
        case.machine, Tuning(case.walk, engine=engine), case.x0, case.P0.astype(np.longdouble)
    )
    considered = Considered(filter.model, constants, np.longdouble)
    updates = []
    for k in case.instants:
        x = filter.moments()[0]
        step = filter.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)
        considered.predict(step.prediction, x, k.before.in_precision(np.longdouble), k.dt)
        considered.update(step.update, step.prediction.mean, k.now.in_precision(np.longdouble))
        updates.append(step.update)

    def mean(constant: Constant, error: float) -> Array:
        x = case.x0.astype(np.longdouble)
        for k, update in zip(case.instants, updates, strict=True):
            held, level = k.before.in_precision(np.longdouble), k.now.in_precision(np.longdouble)
            machine, before = with_error(case.machine, held, constant, error)
            x = TractionModel(machine).transition(x, before, k.dt)
            expected = TractionModel(machine).output(x, with_error(case.machine, level, constant, error)[1])
            expected[-1] += error if constant.name == "acceleration_bias" else 0
            x = x + update.gain @ (k.y - expected)[update.present]
        return x

    for column, constant in zip(considered.sensitivity.T, constants, strict=True):
        size = 1e-5
        difference = (mean(constant, size) - mean(constant, -size)) / (2 * size)
        assert np.max(np.abs(difference)) > 0, constant
        tolerance = 1e-7 * np.max(np.abs(difference))
        np.testing.assert_allclose(column, difference, rtol=0, atol=tolerance, err_msg=constant.name)


def test_considered_covariance_adds_up():
    model = TractionModel(ROBOT)
    considered = Considered(model, [Constant("slope", 0.1), Constant("drawbar_offset", 2.0)])
    considered.sensitivity[9] = [3.0, 0.5]
    considered.sensitivity[4] = [1.0, 0.0]
    covariance = considered.covariance()
    assert covariance[9, 9] == pytest.approx(0.3**2 + 1.0**2)
    assert covariance[4, 9] == pytest.approx(0.1 * 0.3)
    with pytest.raises(KeyError, match="colour"):
        Considered(model, [Constant("colour", 1.0)])._by_constant(
            Constant("colour", 1.0), Input(LOAD, LOAD), print
        )

"""The C kernel against the NumPy reference, which was written from the equations without reading the kernel.

The reference runs in long double (80 bit on x86), so what is measured is the kernel's own error. The norm: means in
units of max(|x_i|, SD_i), since a double cannot hold more digits of a state than its magnitude has, nor does anyone
need more than a share of its SD; covariances P_ij in units of SD_i SD_j, which is free of the states' scales.
Likelihoods and NIS are compared relative to 1 + their magnitude.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kernel_filter import KernelFilter, Report, allocated, checked, ffi, lib, report, writable
from kernel_twin import Step, TractionFilter, Tuning
from kernel_twin.smoother import smooth

Array = NDArray[Any]
TOLERANCE = 1e-9
METHODS = [
    (engine, policy) for engine in ("exact", "unscented") for policy in ("fixed", "adaptive", "supervised")
] + [("exact", "bank")]


def moments_error(got: tuple[Array, Array], expected: tuple[Array, Array]) -> tuple[float, float]:
    """Of the mean and of the covariance, in the norm of this module."""
    x, P = expected
    sd = np.sqrt(np.diag(P))
    mean = np.max(np.abs(got[0] - x) / np.maximum(np.abs(x), sd))
    return float(mean), float(np.max(np.abs(got[1] - P) / np.outer(sd, sd)))


def step_errors(got: Report, expected: Report) -> dict[str, float]:
    """Of every quantity that a step reports."""
    innovation, variance = np.abs(expected["innovation"]), expected["innovation variance"]
    units: dict[str, Any] = {
        "innovation": np.maximum(np.sqrt(variance), innovation),
        "innovation variance": variance,
        "weight": expected["weight"],
        "nis": 1 + expected["nis"],
        "log-likelihood": 1 + np.abs(expected["log-likelihood"]),
        "gamma": 1.0,
        "adaptation": expected["adaptation"],
        "mode": 1.0,
    }
    errors = {}
    for name, unit in units.items():
        error = np.abs((got[name] - expected[name]) / unit)
        assert np.array_equal(np.isnan(got[name]), np.isnan(error))
        errors[name] = float(np.fmax.reduce(error.ravel(), initial=0.0))
    return errors


def errors_by_step(case: Any, tuning: Tuning, tested: Any) -> Iterator[dict[str, float]]:
    """Of every quantity at every step of a problem, of the kernel or of the reference in another precision."""
    truth = TractionFilter(case.machine, tuning, case.x0, case.P0.astype(np.longdouble))
    for k in case.instants:
        if k.restart is not None:
            truth.restart(*k.restart)
            tested.restart(*k.restart)
        arguments = (k.dt, k.before, k.now, k.q_input, k.y, k.r)
        got = tested.step(*arguments)
        errors = step_errors(report(got) if isinstance(got, Step) else got, report(truth.step(*arguments)))
        errors["mean"], errors["covariance"] = moments_error(tested.moments(), truth.moments())
        yield errors


def assert_agree(case: Any, tuning: Tuning) -> None:
    """Every quantity of every step to 1e-9."""
    worst: dict[str, float] = {}
    for errors in errors_by_step(case, tuning, KernelFilter(case.machine, tuning, case.x0, case.P0)):
        worst = {name: max(error, worst.get(name, 0.0)) for name, error in errors.items()}
    beyond = {name: error for name, error in worst.items() if not error < TOLERANCE}
    assert not beyond, beyond


LONG = {"missing": 0.08, "spikes": 0.01, "accelerometer": True, "restarts": True}


@pytest.fixture(scope="session")
def long_problem(problem: Callable[..., Any]) -> Any:
    """5 000 steps of a badly scaled machine with three wheels."""
    return problem(2021, wheels=3, steps=5000, condition=1e9, **LONG)


def test_the_bank_has_one_default_of_its_scales():
    assert (
        list(lib.tg_default_settings().tuning.scales)
        == list(lib.tg_default_tuning().scales)
        == list(Tuning.scales)
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize(("engine", "policy"), METHODS)
def test_agrees_over_150_steps(engine, policy, problem):
    case = problem(2021, wheels=3, steps=150, condition=1e9, **LONG)
    assert_agree(case, Tuning(case.walk, engine=engine, policy=policy, huber=3.0))


@pytest.mark.long
@pytest.mark.parametrize(("engine", "policy"), METHODS)
def test_agrees_over_5000_steps(engine, policy, long_problem):
    assert_agree(long_problem, Tuning(long_problem.walk, engine=engine, policy=policy, huber=3.0))


@pytest.mark.long
@pytest.mark.parametrize("policy", ["supervised", "bank"])
def test_the_long_problem_exercises_what_it_should(policy, long_problem):
    tested = KernelFilter(
        long_problem.machine,
        Tuning(long_problem.walk, policy=policy, huber=3.0),
        long_problem.x0,
        long_problem.P0,
    )
    reports = [tested.step(k.dt, k.before, k.now, k.q_input, k.y, k.r) for k in long_problem.instants]
    assert sum(k.restart is not None for k in long_problem.instants) > 20
    assert sum(np.isnan(r["innovation"]).all() for r in reports) > 20
    assert np.mean([np.nanmin(r["weight"], initial=1.0) < 1 for r in reports]) > 0.01
    if policy == "supervised":
        assert np.ptp([r["gamma"] for r in reports]) > 0.5
        assert np.max(np.ptp(np.log([r["adaptation"] for r in reports]), axis=0)) > 1
    else:
        assert np.max(np.ptp([r["mode"] for r in reports], axis=0)) > 0.5


@pytest.mark.sample(5)
@pytest.mark.parametrize(("engine", "policy"), METHODS)
@pytest.mark.parametrize("wheels", range(1, 9))
def test_agrees_for_any_number_of_wheels(wheels, engine, policy, problem):
    rng = np.random.default_rng(wheels)
    case = problem(
        100 + wheels,
        wheels=wheels,
        steps=40,
        condition=10 ** rng.uniform(6, 10),
        scale=10 ** rng.uniform(-2, 4),
        missing=0.15 * (wheels % 2),
        spikes=0.03,
        accelerometer=wheels % 4 < 2,
        restarts=True,
    )
    tuning = Tuning(
        case.walk, engine=engine, policy=policy, huber=2.0 * (wheels % 3 > 0), mix_stride=1 + wheels % 3
    )
    assert_agree(case, tuning)


@pytest.mark.sample(3)
@pytest.mark.parametrize(("engine", "policy"), METHODS)
def test_agrees_where_mass_and_hitch_load_change(engine, policy, problem):
    case = problem(32, wheels=4, steps=120, condition=1e6, accelerometer=True, missing=0.1, loaded=True)
    assert np.ptp([k.now.mass for k in case.instants]) > 0.05 * case.machine.mass
    assert_agree(case, Tuning(case.walk, engine=engine, policy=policy, huber=3.0))


@pytest.mark.parametrize(("torque", "steps"), [(1.0, 300), (0.02, 60)])
def test_agrees_with_the_drive_supervisor(torque, steps, problem):
    """Also of torques so small that a change of them is judged by the share of the weight that a wheel bears."""
    case = problem(77, wheels=4, steps=steps, condition=1e6, missing=0.1, steady_rate=True)
    instants = [
        replace(
            k, **{n: replace(getattr(k, n), torque=torque * getattr(k, n).torque) for n in ("before", "now")}
        )
        for k in case.instants
    ]
    case = replace(case, instants=instants)
    tuning = Tuning(case.walk, policy="supervised", supervisor="drive", window=0.2)
    assert_agree(case, tuning)
    gammas = list(supervisor_output(case, tuning))
    assert len(np.unique(np.round(gammas, 3))) > 10  # it did have something to see


def supervisor_output(case: Any, tuning: Tuning) -> Iterator[float]:
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    for k in case.instants:
        yield tested.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)["gamma"]


@pytest.mark.parametrize("policy", ["fixed", "adaptive", "supervised"])
def test_exact_and_unscented_kernels_agree(policy, problem):
    case = problem(2021, wheels=3, steps=400, condition=1e9, **LONG)
    options: dict[str, Any] = {"policy": policy, "huber": 3.0}
    exact, unscented = (
        KernelFilter(
            case.machine,
            Tuning(case.walk, engine=engine, **options),
            case.x0,
            case.P0,
        )
        for engine in ("exact", "unscented")
    )
    for k in case.instants:
        for tested in (exact, unscented):
            if k.restart is not None:
                tested.restart(*k.restart)
            tested.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)
        assert max(moments_error(unscented.moments(), exact.moments())) < TOLERANCE


@pytest.mark.parametrize(("engine", "policy"), METHODS)
def test_prediction_alone_agrees(engine, policy, problem):
    case = problem(41, wheels=2, steps=40, condition=1e8, missing=0.1)
    tuning = Tuning(case.walk, engine=engine, policy=policy)
    truth = TractionFilter(case.machine, tuning, case.x0, case.P0.astype(np.longdouble))
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    for i, k in enumerate(case.instants):
        if i % 5 == 4:
            truth.predict(0.3, k.before, k.q_input)
            tested.predict(0.3, k.before, k.q_input)
        arguments = (k.dt, k.before, k.now, k.q_input, k.y, k.r)
        truth.step(*arguments)
        tested.step(*arguments)
        assert max(moments_error(tested.moments(), truth.moments())) < TOLERANCE


@pytest.mark.parametrize("engine", ["exact", "unscented"])
def test_kernel_sensitivities_agree_with_the_reference(engine, problem):
    case = problem(51, wheels=3, steps=200, condition=1e7, missing=0.1, accelerometer=True, restarts=True)
    tuning = Tuning(case.walk, engine=engine, policy="supervised", huber=2.0)
    truth = TractionFilter(case.machine, tuning, case.x0, case.P0.astype(np.longdouble))
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    for k in case.instants:
        for filter in (truth, tested):
            if k.restart is not None:
                filter.restart(*k.restart)
            filter.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)
        sd = np.sqrt(np.diag(truth.moments()[1]))
        for j in range(8):
            for got, expected, unit in zip(
                tested.sensitivity(j), truth.sensitivity(j), (sd, np.outer(sd, sd)), strict=True
            ):
                largest = np.max(np.abs(expected / unit))
                assert np.max(np.abs((got - expected) / unit)) < 1e-9 * max(1.0, largest)


@pytest.mark.parametrize("engine", ["exact", "unscented"])
def test_kernel_sensitivities_agree_with_differences_of_whole_runs(engine, problem):
    """A_k is still 1 without steps of A, so that e^h in a_j is e^h in the noise given."""
    case = problem(52, wheels=2, steps=80, condition=1e3, missing=0.1, accelerometer=True)

    def final(j: int, change: float) -> KernelFilter:
        walk = case.walk.copy()
        walk[j] *= np.exp(change)
        tuning = Tuning(walk, engine=engine, policy="adaptive", stride=10**6)
        tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
        for k in case.instants:
            tested.step(k.dt, k.before, k.now, k.q_input, k.y, k.r)
        return tested

    reached = final(0, 0.0)
    sd = np.sqrt(np.diag(reached.moments()[1]))
    size = 2e-3
    for j in range(6):
        ahead, behind = final(j, size).moments(), final(j, -size).moments()
        for got, unit, i in zip(reached.sensitivity(j), (sd, np.outer(sd, sd)), (0, 1), strict=True):
            difference = (ahead[i] - behind[i]) / (2 * size) / unit
            np.testing.assert_allclose(got / unit, difference, rtol=0, atol=3e-5 * np.max(np.abs(difference)))


class Deviations:
    """Constant deviations, a column each, in the kernel's form and carried along by the reference's gains."""

    def __init__(self, case: Any, columns: int) -> None:
        rng = np.random.default_rng(columns)
        n = case.wheels
        self.spin, self.push = rng.normal(size=(columns, n)), rng.normal(size=columns)
        self.reading = rng.normal(size=columns)
        self.kernel = ffi.new("tg_deviations *")
        for i in range(n):
            self.kernel.wheel_acceleration[i][0:columns] = self.spin[:, i].tolist()
        self.kernel.acceleration[0:columns] = self.push.tolist()
        self.kernel.accelerometer[0:columns] = self.reading.tolist()
        self.columns = np.zeros((2 * n + 2, columns), np.longdouble)
        self.prior = self.columns

    def restart(self, wheels: int) -> None:
        self.columns = self.columns.copy()
        self.columns[: wheels + 1] = 0

    def step(self, filter: TractionFilter, step: Step, x: Array, k: Any) -> None:
        """As paper eq. 2 and 3: an acceleration is a torque over inertia, a push over mass."""
        machine, u = filter.model.machine, k.before.in_precision(np.longdouble)
        plain = filter.model.transition(x, u, np.longdouble(k.dt))
        self.prior = step.prediction.transition @ self.columns
        for i in range(len(self.push)):
            torque, drawbar = (
                u.torque + machine.inertia * self.spin[i],
                u.drawbar - machine.mass * self.push[i],
            )
            pushed = filter.model.transition(
                x, replace(u, torque=torque, drawbar=drawbar), np.longdouble(k.dt)
            )
            self.prior[:, i] += pushed - plain
        expected = step.update.observation.matrix @ self.prior
        expected[-1] += self.reading
        self.columns = self.prior - step.update.gain @ expected[step.update.present]


@pytest.mark.sample(3)
@pytest.mark.parametrize("engine", ["exact", "unscented"])
@pytest.mark.parametrize("policy", ["fixed", "supervised"])
def test_considered_columns_and_smoother_agree(engine, policy, problem):
    """Forwards the filter with its considered columns, backwards the smoother with both."""
    case = problem(
        61, wheels=2, steps=150, condition=1e6, missing=0.1, spikes=0.02, accelerometer=True, restarts=True
    )
    assert any(k.restart for k in case.instants)
    tuning = Tuning(case.walk, engine=engine, policy=policy, huber=2.5)
    truth = TractionFilter(case.machine, tuning, case.x0, case.P0.astype(np.longdouble))
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    n, states, columns = 2, 6, 3
    deviations = Deviations(case, columns)
    consider = allocated("tg_consider *", lib.tg_consider_size())
    track = allocated("tg_track *", lib.tg_track_size())
    checked(lib.tg_consider_init(consider, tested.pointer, columns))
    checked(lib.tg_track_init(track, tested.pointer))
    records = np.zeros((len(case.instants), lib.tg_record_length(n, columns)))

    filtered, considered, predictions, prior_columns = [], [], [], []
    for k, record in zip(case.instants, records, strict=True):
        before_P, link = truth.moments()[1], np.eye(states, dtype=np.longdouble)
        if k.restart is not None:
            truth.restart(*k.restart)
            tested.restart(*k.restart)
            deviations.restart(n)
            link[: n + 1] = 0
            checked(lib.tg_consider_step(consider, tested.pointer, ffi.NULL))
            checked(lib.tg_track_step(track, tested.pointer))
        x = truth.moments()[0]
        arguments = (k.dt, k.before, k.now, k.q_input, k.y, k.r)
        step = truth.step(*arguments)
        tested.step(*arguments)
        deviations.step(truth, step, x, k)
        checked(lib.tg_consider_step(consider, tested.pointer, deviations.kernel))
        checked(lib.tg_track_step(track, tested.pointer))
        checked(lib.tg_record_take(writable(record), track, tested.pointer, consider))
        got = np.empty((columns, states))
        checked(lib.tg_consider_columns(consider, writable(got)))
        sd = np.sqrt(np.diag(truth.moments()[1]))
        size = np.maximum(np.max(np.abs(deviations.columns), axis=0), sd[:, np.newaxis])
        assert np.max(np.abs(got.T - deviations.columns) / size) < TOLERANCE
        filtered.append(truth.moments())
        considered.append(deviations.columns)
        prior_columns.append(deviations.prior)
        cross = before_P @ link.T @ step.prediction.transition.T
        predictions.append(replace(step.prediction, before=before_P, cross=cross))

    smoothed = smooth(filtered, predictions[1:])
    smoothed_columns = [
        smooth(
            [(c[:, i], P) for c, (_, P) in zip(considered, filtered, strict=True)],
            [replace(p, mean=c[:, i]) for p, c in zip(predictions[1:], prior_columns[1:], strict=True)],
        )
        for i in range(columns)
    ]
    x, P, s = np.empty(states), np.empty((states, states)), np.empty((columns, states))
    checked(lib.tg_record_moments(n, columns, writable(records[-1]), writable(x), writable(P), writable(s)))
    worst = 0.0
    for i in range(len(records) - 1, -1, -1):
        if i < len(records) - 1:
            here, following = writable(records[i]), writable(records[i + 1])
            checked(lib.tg_smooth_step(n, columns, here, following, writable(x), writable(P), writable(s)))
        worst = max(worst, *moments_error((x, P), smoothed[i]))
        sd = np.sqrt(np.diag(smoothed[i][1]))
        for got, chain in zip(s, smoothed_columns, strict=True):
            worst = max(
                worst, float(np.max(np.abs(got - chain[i][0]) / np.maximum(np.max(np.abs(chain[i][0])), sd)))
            )
    assert worst < TOLERANCE

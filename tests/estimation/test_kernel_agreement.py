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

from terragrip.estimation.reference import BankUpdate, Machine, Step, TractionFilter, Tuning, smooth

kernel = pytest.importorskip("terragrip._kernel")
ffi, lib = kernel.ffi, kernel.lib

Array = NDArray[Any]
TOLERANCE = 1e-9
METHODS = [
    (engine, policy) for engine in ("exact", "unscented") for policy in ("fixed", "adaptive", "supervised")
] + [("exact", "bank")]

PLAIN = ("huber", "alpha", "beta", "kappa", "rate", "memory", "stride", "window")
PLAIN += ("wheel_speed_min", "ground_speed_min", "dwell", "mix_stride")


class KernelFilter:
    """The kernel's filter floor with the reference's arguments."""

    def __init__(self, machine: Machine, tuning: Tuning, x0: Array, P0: Array) -> None:
        self.wheels, self.states = len(machine.radius), 2 * len(machine.radius) + 2
        self.pointer = allocated("tg_filter *", lib.tg_filter_size())
        checked(
            lib.tg_filter_init(
                self.pointer, kernel_machine(machine), kernel_tuning(tuning), reals(x0), reals(P0.ravel())
            )
        )

    def step(self, dt: float, before: Any, now: Any, q_input: Array, y: Array, r: Array) -> Any:
        out = ffi.new("tg_step *")
        checked(
            lib.tg_filter_step(
                self.pointer,
                dt,
                kernel_input(before),
                kernel_input(now),
                reals(q_input),
                reals(y),
                reals(r),
                out,
            )
        )
        return out

    def predict(self, dt: float, before: Any, q_input: Array) -> None:
        checked(lib.tg_filter_predict(self.pointer, dt, kernel_input(before), reals(q_input)))

    def restart(self, walk_time: float, outputs: Array, variances: Array) -> None:
        checked(lib.tg_filter_restart(self.pointer, walk_time, reals(outputs), reals(variances)))

    def moments(self) -> tuple[Array, Array]:
        x, P = np.empty(self.states), np.empty((self.states, self.states))
        checked(lib.tg_filter_moments(self.pointer, writable(x), writable(P)))
        return x, P

    def sensitivity(self, j: int) -> tuple[Array, Array]:
        dx, dP = np.empty(self.states), np.empty((self.states, self.states))
        checked(lib.tg_filter_sensitivity(self.pointer, j, writable(dx), writable(dP)))
        return dx, dP


def allocated(kind: str, size: int) -> Any:
    """Raw memory that lives as long as the pointer to it."""
    memory = ffi.new("char[]", size)
    return ffi.gc(ffi.cast(kind, memory), lambda _: memory)


def checked(status: int) -> None:
    assert status == lib.TG_OK, status


def reals(values: Any) -> Any:
    return ffi.new("tg_real[]", [float(v) for v in values])


def numbers(values: Any, count: int) -> Array:
    return np.array(ffi.unpack(values, count))


def writable(array: Array) -> Any:
    return ffi.cast("tg_real *", ffi.from_buffer(array))


def kernel_machine(machine: Machine) -> Any:
    out = ffi.new("tg_machine *")
    out.wheels = len(machine.radius)
    for name in ("mass", "gravity", "tire_rolling_resistance"):
        setattr(out, name, float(getattr(machine, name)))
    for name in ("radius", "inertia", "bearing_resistance"):
        getattr(out, name)[0 : out.wheels] = getattr(machine, name).tolist()
    return out


def kernel_input(u: Any) -> Any:
    out = ffi.new("tg_input *")
    out.torque[0 : len(u.torque)] = u.torque.tolist()
    out.load[0 : len(u.load)] = u.load.tolist()
    out.drawbar, out.slope = float(u.drawbar), float(u.slope)
    return out


def kernel_tuning(tuning: Tuning) -> Any:
    out = ffi.new("tg_tuning *", lib.tg_default_tuning())
    out.engine = {"exact": lib.TG_EXACT, "unscented": lib.TG_UNSCENTED}[tuning.engine]
    out.policy = {
        "fixed": lib.TG_FIXED,
        "adaptive": lib.TG_ADAPTIVE,
        "supervised": lib.TG_SUPERVISED,
        "bank": lib.TG_BANK,
    }[tuning.policy]
    out.supervisor = {"speeds": 0, "drive": 1}[tuning.supervisor]
    out.walk[0 : len(tuning.walk)] = list(tuning.walk)
    out.scales[0:4] = list(tuning.scales)
    for name in PLAIN:
        setattr(out, name, getattr(tuning, name))
    return out


def moments_error(got: tuple[Array, Array], expected: tuple[Array, Array]) -> tuple[float, float]:
    """Of the mean and of the covariance, in the norm of this module."""
    x, P = expected
    sd = np.sqrt(np.diag(P))
    mean = np.max(np.abs(got[0] - x) / np.maximum(np.abs(x), sd))
    return float(mean), float(np.max(np.abs(got[1] - P) / np.outer(sd, sd)))


def step_errors(got: Any, expected: Step, wheels: int) -> dict[str, float]:
    """Of every quantity that a step reports."""
    update = expected.update
    present = update.present
    channels, states = wheels + 2, 2 * wheels + 2
    assert got.channels == present.sum()
    innovation = numbers(got.innovation, channels)
    np.testing.assert_array_equal(np.isnan(innovation), ~present)

    def largest(values: Any) -> float:
        return float(np.max(np.abs(values), initial=0.0))

    variance = update.innovation_variance[present]
    seen = numbers(got.innovation_variance, channels)[present]
    mode = update.probabilities if isinstance(update, BankUpdate) else np.zeros(4)
    return {
        "innovation": largest(
            (innovation[present] - update.innovation[present])
            / np.maximum(np.sqrt(variance), np.abs(update.innovation[present]))
        ),
        "innovation variance": largest(seen / variance - 1),
        "weight": largest(numbers(got.weight, channels)[present] / update.weight[present] - 1),
        "nis": largest((got.nis - update.nis) / (1 + update.nis)),
        "log-likelihood": largest(
            (got.log_likelihood - update.log_likelihood) / (1 + abs(update.log_likelihood))
        ),
        "gamma": largest(got.gamma - expected.gamma),
        "adaptation": largest(numbers(got.adaptation, states) / expected.adaptation - 1),
        "mode": largest(numbers(got.mode, 4) - mode),
    }


def compare(case: Any, tuning: Tuning) -> dict[str, float]:
    """The largest error of each quantity over all steps of a problem."""
    truth = TractionFilter(case.machine, tuning, case.x0, case.P0.astype(np.longdouble))
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    worst: dict[str, float] = {}
    for k in case.instants:
        if k.restart is not None:
            truth.restart(*k.restart)
            tested.restart(*k.restart)
        arguments = (k.dt, k.before, k.now, k.q_input, k.y, k.r)
        errors = step_errors(tested.step(*arguments), truth.step(*arguments), case.wheels)
        errors["mean"], errors["covariance"] = moments_error(tested.moments(), truth.moments())
        worst = {name: max(error, worst.get(name, 0.0)) for name, error in errors.items()}
    return worst


def assert_agree(worst: dict[str, float], tolerance: float = TOLERANCE) -> None:
    beyond = {name: error for name, error in worst.items() if not error < tolerance}
    assert not beyond, beyond


LONG = {"missing": 0.08, "spikes": 0.01, "accelerometer": True, "restarts": True}


@pytest.fixture(scope="session")
def long_problem(problem: Callable[..., Any]) -> Any:
    """5 000 steps of a badly scaled machine with three wheels."""
    return problem(2021, wheels=3, steps=5000, condition=1e9, **LONG)


@pytest.mark.parametrize(("engine", "policy"), METHODS)
def test_agrees_over_5000_steps(engine, policy, long_problem):
    assert_agree(compare(long_problem, Tuning(long_problem.walk, engine=engine, policy=policy, huber=3.0)))


@pytest.mark.parametrize(("engine", "policy"), METHODS)
@pytest.mark.parametrize("wheels", range(1, 9))
def test_agrees_for_any_number_of_wheels(wheels, engine, policy, problem):
    rng = np.random.default_rng(wheels)
    case = problem(
        100 + wheels,
        wheels=wheels,
        steps=60,
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
    assert_agree(compare(case, tuning))


def test_agrees_with_the_drive_supervisor(problem):
    case = problem(77, wheels=4, steps=300, condition=1e6, missing=0.1, steady_rate=True)
    tuning = Tuning(case.walk, policy="supervised", supervisor="drive", window=0.2)
    assert_agree(compare(case, tuning))
    gammas = list(supervisor_output(case, tuning))
    assert len(np.unique(np.round(gammas, 3))) > 10  # it did have something to see


def supervisor_output(case: Any, tuning: Tuning) -> Iterator[float]:
    tested = KernelFilter(case.machine, tuning, case.x0, case.P0)
    for k in case.instants:
        yield tested.step(k.dt, k.before, k.now, k.q_input, k.y, k.r).gamma


@pytest.mark.parametrize("policy", ["fixed", "adaptive", "supervised"])
def test_exact_and_unscented_kernels_agree(policy, long_problem):
    options: dict[str, Any] = {"policy": policy, "huber": 3.0}
    exact, unscented = (
        KernelFilter(
            long_problem.machine,
            Tuning(long_problem.walk, engine=engine, **options),
            long_problem.x0,
            long_problem.P0,
        )
        for engine in ("exact", "unscented")
    )
    for k in long_problem.instants:
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
        self.kernel = ffi.new("tg_deviation[]", columns)
        for i in range(columns):
            self.kernel[i].wheel_acceleration[0:n] = self.spin[i].tolist()
            self.kernel[i].acceleration, self.kernel[i].accelerometer = self.push[i], self.reading[i]
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

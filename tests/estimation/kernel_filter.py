"""The kernel's filter floor with the reference's arguments and answers, through cffi."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernel_twin import Machine, Step, Tuning
from kernel_twin.bank import BankUpdate
from terragrip._kernel import ffi, lib

Array = NDArray[Any]
Report = dict[str, Array]
"""What one step did, a name a quantity; NaN where a channel was missing."""

PLAIN = ("huber", "alpha", "beta", "kappa", "rate", "memory", "stride", "window")
PLAIN += ("wheel_speed_min", "ground_speed_min", "dwell", "mix_stride")


class KernelFilter:
    """The kernel's filter floor with the reference's arguments."""

    def __init__(self, machine: Machine, tuning: Tuning, x0: Array, P0: Array) -> None:
        self.wheels, self.states = len(machine.radius), 2 * len(machine.radius) + 2
        self.pointer = allocated("tg_filter *", lib.tg_filter_size(kernel_tuning(tuning).policy))
        checked(
            lib.tg_filter_init(
                self.pointer, kernel_machine(machine), kernel_tuning(tuning), reals(x0), reals(P0.ravel())
            )
        )

    def step(
        self,
        dt: float,
        before: Any,
        now: Any,
        q_input: Array,
        y: Array,
        r: Array,
    ) -> Report:
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
        channels = self.wheels + 2
        innovation = numbers(out.innovation, channels)
        missing = np.isnan(innovation)
        assert out.channels == np.sum(~missing)
        return {
            "innovation": innovation,
            "innovation variance": np.where(missing, np.nan, numbers(out.innovation_variance, channels)),
            "weight": np.where(missing, np.nan, numbers(out.weight, channels)),
            "nis": np.array(out.nis),
            "log-likelihood": np.array(out.log_likelihood),
            "gamma": np.array(out.gamma),
            "adaptation": numbers(out.adaptation, self.states),
            "mode": numbers(out.mode, 4),
        }

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
    out.mass, out.hitch_load = float(u.mass), float(u.hitch_load)
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


def report(step: Step) -> Report:
    """The same of the reference."""
    update = step.update
    return {
        "innovation": update.innovation,
        "innovation variance": np.where(update.present, update.innovation_variance, np.nan),
        "weight": np.where(update.present, update.weight, np.nan),
        "nis": np.array(update.nis),
        "log-likelihood": np.array(update.log_likelihood),
        "gamma": np.array(step.gamma),
        "adaptation": step.adaptation,
        "mode": update.probabilities if isinstance(update, BankUpdate) else np.zeros(4),
    }

"""The machine as a model for the filters (paper eq. 9): paper eq. 2 and 3 for n wheels, affine in the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernel_twin.filters import Matrix, Vector, runge_kutta
from terragrip.physics.motion import ground_acceleration, specific_force, wheel_acceleration

STEP_BOUND = 0.25
"""Largest substep in time constants of the fastest wheel: Runge-Kutta then errs by 1e-5 of a change."""


@dataclass(frozen=True)
class Machine:
    """Constants of the machine, n wheels."""

    mass: Any
    """kg."""
    gravity: Any
    """m/s²."""
    tire_rolling_resistance: Any
    """ρ_t."""
    radius: NDArray[Any]
    """Torque arm and rolling radius r, (n,), m."""
    inertia: NDArray[Any]
    """J, (n,), kg m²."""
    bearing_resistance: NDArray[Any]
    """ρ_w, (n,), N s/rad."""

    def in_precision(self, dtype: Any) -> Machine:
        """The same machine in numbers of another dtype."""
        return Machine(*(np.asarray(getattr(self, name), dtype)[()] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Input:
    """What acts on the machine, held over one step."""

    torque: NDArray[Any]
    """M, (n,), N m at the wheel."""
    load: NDArray[Any]
    """F_z, (n,), N, positive."""
    drawbar: Any = 0.0
    """F_dx, N, backward pull positive."""
    slope: Any = 0.0
    """θ, rad, uphill positive."""
    mass: Any = 0.0
    """m, kg; 0: the machine's."""
    hitch_load: Any = 0.0
    """F_dz, N, what hangs on the hitch, down positive."""

    def in_precision(self, dtype: Any) -> Input:
        """The same input in numbers of another dtype."""
        return Input(*(np.asarray(getattr(self, name), dtype)[()] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class TractionModel:
    """State (ω_1..ω_n, v, μ_1..μ_n, ρ_s) and channels (ω_1..ω_n, v, a_x), each on the last axis."""

    machine: Machine

    @property
    def wheels(self) -> int:
        """n."""
        return len(self.machine.radius)

    @property
    def states(self) -> int:
        """2n + 2."""
        return 2 * self.wheels + 2

    def split(self, x: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """ω (..., n), v (...), μ (..., n), ρ_s (...) of the state."""
        n = self.wheels
        return x[..., :n], x[..., n], x[..., n + 1 : 2 * n + 1], x[..., 2 * n + 1]

    def mass(self, u: Input) -> Any:
        """m of the moment, kg."""
        return u.mass if u.mass != 0 else self.machine.mass

    def derivative(self, x: Vector, u: Input) -> Vector:
        """dx/dt (..., 2n+2) by paper eq. 2 and 3; μ and ρ_s stay (they walk by the process noise)."""
        wheel_speed, _, adhesion, _ = self.split(x)
        machine = self.machine
        spin = wheel_acceleration(
            wheel_speed,
            u.torque,
            adhesion,
            u.load,
            radius=machine.radius,
            inertia=machine.inertia,
            tire_resistance=machine.tire_rolling_resistance,
            bearing_resistance=machine.bearing_resistance,
        )
        acceleration = self._along(ground_acceleration, x, u)
        still = np.zeros((*x.shape[:-1], self.wheels + 1), spin.dtype)
        return np.concatenate([spin, acceleration[..., np.newaxis], still], axis=-1)

    def _along(self, law: Callable[..., Vector], x: Vector, u: Input) -> Vector:
        """What the forces along the vehicle make of x, by `ground_acceleration` or `specific_force` (...,) [m/s²]."""
        _, _, adhesion, soil_resistance = self.split(x)
        return law(
            adhesion,
            u.load,
            u.drawbar,
            soil_resistance,
            u.slope,
            mass=self.mass(u),
            gravity=self.machine.gravity,
            hitch_load=u.hitch_load,
        )

    def substeps(self, dt: Any) -> int:
        """Equal Runge-Kutta steps in dt, each at most a quarter of the fastest wheel's time constant."""
        rate = np.max(self.machine.radius * self.machine.bearing_resistance / self.machine.inertia)
        return max(1, int(np.ceil(np.real(rate) * dt / STEP_BOUND)))

    def transition(self, x: Vector, u: Input, dt: Any) -> Vector:
        """x after dt seconds with u held, by fourth-order Runge-Kutta as in the paper."""
        return runge_kutta(self.derivative, self.substeps(dt))(x, u, dt)

    def system_matrix(self, u: Input) -> Matrix:
        """A = ∂(dx/dt)/∂x, (2n+2, 2n+2)."""
        machine, n = self.machine, self.wheels
        A = np.zeros((self.states, self.states), np.result_type(machine.radius, u.load))
        wheel = np.arange(n)
        A[wheel, wheel] = -machine.radius * machine.bearing_resistance / machine.inertia
        A[wheel, n + 1 + wheel] = -machine.radius * u.load / machine.inertia
        A[n, n + 1 : 2 * n + 1] = u.load / self.mass(u)
        A[n, 2 * n + 1] = -machine.gravity * np.cos(u.slope) - u.hitch_load / self.mass(u)
        return A

    def transition_matrix(self, x: Vector, u: Input, dt: Any) -> Matrix:
        """F = ∂transition/∂x, whatever x: Runge-Kutta's exp(A dt), (Σ_k≤4 (A h)^k/k!)^N with h = dt/N."""
        count = self.substeps(dt)
        Ah = self.system_matrix(u) * (dt / count)
        identity = np.eye(self.states, dtype=Ah.dtype)
        one = identity + Ah @ (identity + Ah / 2 @ (identity + Ah / 3 @ (identity + Ah / 4)))
        power = identity
        for _ in range(count):
            power = one @ power
        return power

    def output(self, x: Vector, u: Input) -> Vector:
        """ŷ (..., n+2): wheel speeds, ground speed, and what an accelerometer reads (physics.md 1)."""
        force = self._along(specific_force, x, u)
        return np.concatenate([x[..., : self.wheels + 1], force[..., np.newaxis]], axis=-1)

    def output_matrix(self, x: Vector, u: Input) -> Matrix:
        """H = ∂output/∂x, (n+2, 2n+2). It does not depend on x."""
        n = self.wheels
        H = np.eye(n + 2, self.states, dtype=np.result_type(self.machine.radius, u.load))
        H[n + 1] = self.system_matrix(u)[n]  # the accelerometer sees dv/dt, but for the slope's constant
        return H


def with_constant_error(
    machine: Machine, u: Input, name: str, wheel: int | None, error: Any
) -> tuple[Machine, Input]:
    """The machine and input that a filter works with if one considered constant is wrong by ``error``.

    ``drive_torque_gain`` and ``drive_torque_offset`` [N m] of a wheel; ``drawbar_gain``, ``drawbar_offset``
    [N], ``slope`` [rad], ``tire_rolling_resistance``; ``wheel_radius`` and ``vertical_load``, relative, of
    all wheels alike.

    Raises
    ------
    KeyError: another name.
    """
    if name in ("drive_torque_gain", "drive_torque_offset"):
        here = np.arange(len(u.torque)) == wheel
        change = u.torque * error if name == "drive_torque_gain" else error
        return machine, replace(u, torque=u.torque + here * change)
    changed: dict[str, tuple[Machine, Input]] = {
        "drawbar_gain": (machine, replace(u, drawbar=u.drawbar * (1 + error))),
        "drawbar_offset": (machine, replace(u, drawbar=u.drawbar + error)),
        "slope": (machine, replace(u, slope=u.slope + error)),
        "vertical_load": (machine, replace(u, load=u.load * (1 + error))),
        "wheel_radius": (replace(machine, radius=machine.radius * (1 + error)), u),
        "tire_rolling_resistance": (
            replace(machine, tire_rolling_resistance=machine.tire_rolling_resistance + error),
            u,
        ),
    }
    return changed[name]

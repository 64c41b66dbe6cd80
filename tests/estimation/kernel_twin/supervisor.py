"""The fuzzy supervisor: how lively the machine is, as a number γ between 0.1 and 1 (physics.md 6 (R))."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

RULES = np.array([[0.1, 0.4, 0.8], [0.4, 0.6, 0.9], [0.8, 0.9, 1.0]])
"""Outputs of the zero-order Sugeno system: rows small, medium, large D_ω, columns D_v (R)."""
SNAPSHOTS = 50
"""How many instants of one window are kept."""
SLACK = 1e-6
"""s; two sums of the same time steps may differ by rounding."""
SLIP_SCALE = 0.25
"""The change of slip that counts as 1 (R, ours)."""


def memberships(change: Any) -> NDArray[Any]:
    """Degrees (small, medium, large), (3,), sum 1, of a relative change >= 0 (R)."""
    small = np.clip((0.06 - change) / 0.04, 0, 1)
    large = np.clip((change - 0.10) / 0.10, 0, 1)
    return np.array([small, 1 - small - large, large])


def supervise(row_change: Any, column_change: Any) -> Any:
    """γ = Σ w r/Σ w, w the product of memberships (R); the products of two partitions of 1 sum to 1."""
    return memberships(row_change) @ RULES @ memberships(column_change)


class Window:
    """Instants of some quantities over the last ``length`` seconds, at most 50 a window."""

    def __init__(self, length: float) -> None:
        self.length = length
        self._kept: deque[tuple[float, NDArray[Any]]] = deque()

    def changes(self, time: float, now: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """|now - a window ago| and mean |.| over the window for each quantity (k,); then keep this instant.

        "A window ago" is the newest kept instant at least ``length`` old, else the oldest; the mean is over
        the younger ones and now. NaN is "not seen yet" and gives NaN.
        """
        while len(self._kept) > 1 and self._kept[1][0] <= time - self.length + SLACK:
            self._kept.popleft()
        change = np.abs(now - self._kept[0][1]) if self._kept else np.zeros_like(now)
        younger = [values for _, values in self._kept][1:]
        mean = np.mean(np.abs([*younger, now]), axis=0)
        if not self._kept or time - self._kept[-1][0] >= self.length / SNAPSHOTS - SLACK:
            self._kept.append((time, now.copy()))
        return change, mean


class SpeedSupervisor:
    """γ from changes of wheel speeds and ground speed (the paper's choice of signals).

    D_ω = max_i |ω_i(k) - ω_i(k-W)|/max(mean|ω_i|, ω_min), D_v = |v(k) - v(k-W)|/max(mean|v|, v_min).

    Parameters
    ----------
    window: W, s. wheel_speed_min: ω_min, rad/s. ground_speed_min: v_min, m/s.
    """

    def __init__(self, window: float, wheel_speed_min: float, ground_speed_min: float) -> None:
        self._window = Window(window)
        self._floors = (wheel_speed_min, ground_speed_min)

    def gamma(self, time: float, wheel_speed: NDArray[Any], ground_speed: Any) -> Any:
        """γ at time [s] with the last known wheel speeds (n,) and ground speed, NaN before the first."""
        change, mean = self._window.changes(time, np.append(wheel_speed, ground_speed))
        floor = np.append(np.full(len(wheel_speed), self._floors[0]), self._floors[1])
        relative = np.nan_to_num(change / np.maximum(mean, floor), nan=0.0)
        return supervise(np.max(relative[:-1]), relative[-1])


class DriveSupervisor:
    """γ from changes of drive torques and slip (R, ours): wheel-speed loops hide a soil change from ω.

    D_ω becomes max_i |M_i(k) - M_i(k-W)|/max(mean|M_i|, M_min,i), D_v becomes |s(k) - s(k-W)|/0.25.

    Parameters
    ----------
    window: W, s. torque_min: M_min, (n,), N m.
    """

    def __init__(self, window: float, torque_min: ArrayLike) -> None:
        self._window = Window(window)
        self._floor = np.asarray(torque_min)

    def gamma(self, time: float, torque: NDArray[Any], slip: Any) -> Any:
        """γ at time [s] with the torques (n,) [N m] and the mean slip of the wheels, NaN at standstill."""
        change, mean = self._window.changes(time, np.append(torque, slip))
        relative = np.nan_to_num(change[:-1] / np.maximum(mean[:-1], self._floor), nan=0.0)
        return supervise(np.max(relative), np.nan_to_num(change[-1] / SLIP_SCALE, nan=0.0))

"""The set-point of slip while the machine drives: published as advice, beside the estimates. It commands nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from terragrip.advice.setpoint import STOP, SlipSetpoint
from terragrip.live.outputs import Row

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

FREED = 2.0
"""Seconds of trusted driving after which a machine that was stuck counts as free again."""
MOVING = 0.2
"""Share of the wanted speed from which it counts as driving."""


class _Predicted:
    """A predicted row: nothing was measured, so it is no ground for any speed."""

    def __init__(self, row: Row) -> None:
        self._estimate = row.estimate

    def __getitem__(self, name: str) -> Any:
        return (self._estimate.event or "predicted") if name == "event" else self._estimate[name]


class LiveSetpoint:
    """Messages of the set-point, one a row.

    Parameters and errors as `SlipSetpoint` has them. It starts anew with the service, from its safe state; after a stop it goes on where
    the machine is seen driving again for `FREED` seconds, for somebody else has freed it.
    """

    def __init__(self, vehicle: Vehicle, slip: float, speed: float) -> None:
        self.setpoint = SlipSetpoint(vehicle, slip, speed)
        self._driven_since: float | None = None
        self.last: dict[str, Any] | None = None

    def message(self, row: Row) -> dict[str, Any]:
        """What is advised after a row: ``state``, ``why``, and ``wheel_speed`` [rad/s] by driven wheel."""
        setpoint, estimate = self.setpoint, row.estimate
        speeds = setpoint.update(_Predicted(row) if row.predicted else estimate)
        self._watch_stop(row)
        self.last = {
            "time": estimate.time, "state": setpoint.state, "why": setpoint.why, "slip": setpoint.slip, "speed": setpoint.speed,
            "wheel_speed": speeds,
        }  # fmt: skip
        return self.last

    def _watch_stop(self, row: Row) -> None:
        """Go on after a stop, where the machine drives."""
        setpoint, estimate = self.setpoint, row.estimate
        drives = (
            setpoint.state == STOP
            and not (row.predicted or estimate.event or setpoint.doubt(estimate))
            and abs(estimate.ground_speed) > MOVING * setpoint.speed
        )
        if not drives:
            self._driven_since = None
        elif self._driven_since is None:
            self._driven_since = estimate.time
        elif estimate.time - self._driven_since >= FREED:
            setpoint.resume()
            self._driven_since = None

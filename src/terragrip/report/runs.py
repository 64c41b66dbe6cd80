"""What a report is made from: one run's estimates, and whatever they can be compared with."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError
from terragrip.estimation.columns import driven_of, wheels_with
from terragrip.report.clock import Clock
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    import pandas as pd

    from terragrip.ground.events import Event
    from terragrip.vehicle import Vehicle


LEAST_SENSOR_LOAD = 0.1
"""A reference sensor's ratio counts where it carries at least this share of its median load: a wheel in the
air has no adhesion, only noise over nothing."""


STUCK = ("stuck", "push")
FLAGGED = ("standstill", "stuck", "push", "immobilization", "outlier")
"""Events whose rows say little of the ground; at standstill the estimates are held, not made."""
BEFORE_STUCK = 1.0
"""Seconds before a stuck or push event that belong to it: the deceleration to a stop, and the time before the event is
reported (`stuck_duration`, 0.5 s, docs/events.md)."""
LEAST_PUSH = 1.0
"""An operator's push that counts [N]."""
AFTER_STUCK = 2.0
"""Seconds that a stuck spell's aftermath lasts: the vehicle jerks free and its tool follows. With them the spell
of the simulated `multi2` is as long as the 245-255 s that the paper leaves out."""


@dataclass(frozen=True)
class Run:
    """One recorded or simulated drive.

    `estimates` is an Estimates table (architecture.md, contracts). `truth`, of a simulation, and `recording`, what was
    measured, have the same rows; `vehicle` is the one that was estimated with. `events`: what the ground room
    found (kind, start, end). Each may be absent.
    """

    name: str
    estimates: pd.DataFrame
    method: str
    truth: pd.DataFrame | None = None
    recording: pd.DataFrame | None = None
    vehicle: Vehicle | None = None
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        for what, table in (("truth", self.truth), ("recording", self.recording)):
            if table is None:
                continue
            time = table["time"].to_numpy()
            if len(time) != len(self.estimates) or not np.array_equal(time, self.time):
                raise InputError(
                    f"the {what} and the estimates of one run need the same rows", place=self.name
                )

    @cached_property
    def time(self) -> Floats:
        """Time of each row [s]."""
        return self.estimates["time"].to_numpy(dtype=np.float64)

    @cached_property
    def began(self) -> datetime | None:
        """Clock time of time 0, where the log says it."""
        text = (self.estimates.attrs.get("recording") or {}).get("time_zero")
        try:
            return datetime.fromisoformat(text) if text else None
        except ValueError:
            return None

    @cached_property
    def clock(self) -> Clock:
        """How its times are read."""
        return Clock(self.began, float(self.time[-1] - self.time[0]))

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """The wheels with an estimated adhesion, of estimates without any those with a slip; in the table's order."""
        columns = [str(name) for name in self.estimates.columns]
        return wheels_with("adhesion", columns) or wheels_with("slip", columns)

    @cached_property
    def driven_wheels(self) -> tuple[str, ...]:
        """Those of `wheels` that the vehicle drives; all, where it drives none of them or is not known."""
        return driven_of(self.wheels, {} if self.vehicle is None else {"vehicle": self.vehicle.to_dict()})

    @cached_property
    def has_adhesion(self) -> bool:
        """Whether torques were measured; else there are slip and speeds alone."""
        return bool(wheels_with("adhesion", map(str, self.estimates.columns)))

    @cached_property
    def sensor_wheel(self) -> str | None:
        """The wheel that carries a reference force sensor, or None; of slip alone no sensor tells anything."""
        if not self.has_adhesion:
            return None
        columns = set(self._measured.columns)
        for wheel in self.wheels:
            if {f"wheel_force_x_{wheel}", f"wheel_force_z_{wheel}"} <= columns:
                return wheel
        return None

    @property
    def shown_wheel(self) -> str:
        """The wheel to draw: the one with the sensor, else the last driven one (rear right by custom)."""
        return self.sensor_wheel or self.driven_wheels[-1]

    @cached_property
    def _columns(self) -> pd.DataFrame:
        """The estimates without attributes, of which pandas makes a deep copy for each column: a tenth of a report's time."""
        columns = self.estimates.copy(deep=False)
        columns.attrs = {}
        return columns

    def estimated(self, name: str) -> Floats:
        """An estimated column as (n,) floats."""
        return self._columns[name].to_numpy(dtype=np.float64)

    def true(self, name: str) -> Floats | None:
        """The true column `true_<name>`, or None without a truth."""
        if self.truth is None or f"true_{name}" not in self.truth:
            return None
        return self.truth[f"true_{name}"].to_numpy(dtype=np.float64)

    def measured_ratio(self) -> Floats | None:
        """F_x/F_z of the reference sensor (paper eq. 4), (n,), NaN where it has no sample or no load.

        The sensor sits on the axle: it reads the net force (no soil resistance in it) over a load without
        the wheel's weight (physics.md 2), so it lies between mu and kappa of the ground.
        """
        wheel = self.sensor_wheel
        if wheel is None:
            return None
        force = self._measured[f"wheel_force_x_{wheel}"].to_numpy(dtype=np.float64)
        load = self._measured[f"wheel_force_z_{wheel}"].to_numpy(dtype=np.float64)
        typical = np.nanmedian(load) if np.isfinite(load).any() else np.nan
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(load > LEAST_SENSOR_LOAD * typical, force / load, np.nan)

    def sensor_ratio(self) -> Floats | None:
        """What the reference sensor reads if the estimates are right: :func:`axle_ratio`, (n,).

        None without a sensor or the mass of its wheel. Loads are the axle's estimated one, shared alike by its wheels; without an
        accelerometer the wheel's inertia is left out.
        """
        wheel, mass = self.sensor_wheel, self._wheel_mass
        if wheel is None or mass is None or self.vehicle is None:
            return None
        axle = next(name for name, axle in self.vehicle.axles.items() if wheel in axle.wheels)
        if f"vertical_load_{axle}" not in self.estimates:
            return None
        load = self.estimated(f"vertical_load_{axle}") / len(self.vehicle.axles[axle].wheels)
        measured = "acceleration_x" in self._measured
        force = self._everywhere("acceleration_x") if measured else np.zeros(len(load))
        return axle_ratio(self.estimated(f"net_traction_{wheel}"), load, force, mass)

    def true_sensor_ratio(self) -> Floats | None:
        """The same of a simulation's true net traction, load and motion, (n,): without the gradient under that one wheel."""
        wheel, mass = self.sensor_wheel, self._wheel_mass
        if mass is None:
            return None
        names = (f"net_traction_{wheel}", f"vertical_load_{wheel}", "acceleration", "slope")
        kappa, load, acceleration, slope = (self.true(name) for name in names)
        if kappa is None or load is None or acceleration is None or slope is None:
            return None
        return axle_ratio(kappa, load, acceleration + STANDARD_GRAVITY * np.sin(slope), mass)

    @property
    def _wheel_mass(self) -> float | None:
        """Mass of the wheel with the sensor [kg], None without one or where the vehicle file does not say."""
        if self.vehicle is None or self.sensor_wheel is None:
            return None
        return self.vehicle.wheel_data[self.vehicle.wheels.index(self.sensor_wheel)].mass

    def measured_slip(self) -> Floats | None:
        """Slip of the shown wheel from the recorded speeds (paper eq. 6), (n,), NaN where no ground speed is.

        The hub of a wheel off the middle runs at v - y times the yaw rate, of a steered one faster. Wheel speed and yaw rate are
        interpolated to the rows of the ground speed. None without a recording or a vehicle.
        """
        if self.recording is None or self.vehicle is None:
            return None
        from terragrip.physics.slip import hub_speed, slip

        wheel = self.vehicle.wheels.index(self.shown_wheel)
        hub = self.recording["ground_speed"].to_numpy(dtype=np.float64)
        if "angular_velocity_z" in self.recording:
            turn = self._everywhere("angular_velocity_z")
            hub = hub_speed(
                hub - self.vehicle.wheel_side[wheel] * turn, self.vehicle.wheel_ahead[wheel] * turn
            )
        turning = self._everywhere(f"wheel_speed_{self.shown_wheel}")
        return slip(turning, hub, float(self.vehicle.wheel_radius[wheel]))

    def _everywhere(self, channel: str) -> Floats:
        """A recorded channel (n,), linear between its samples."""
        values = self._measured[channel].to_numpy(dtype=np.float64)
        known = np.isfinite(values)
        return np.interp(self.time, self.time[known], values[known]) if known.any() else values

    @cached_property
    def soil(self) -> NDArray[np.object_]:
        """The soil's label at each row, "" where there is none: a run without labels, or a transition.

        A transition lasts until vehicle and tool are on the same soil (physics.md 7): by a simulation's truth, else by the distance
        driven and the vehicle's length.
        """
        for table in (self.estimates, self.recording, self.truth):
            if table is not None and "soil" in table:
                # Interned: a table of texts gives each row an object of its own.
                labels = [
                    sys.intern(x) if isinstance(x, str) else "" for x in table["soil"].to_numpy(dtype=object)
                ]
                result = np.array(labels, dtype=object)
                if self.truth is not None and "transition" in self.truth:
                    result[self.truth["transition"].to_numpy(dtype=np.bool_)] = ""
                elif self.vehicle is not None and "distance" in self.estimates:
                    from terragrip.soil.estimates import whole_length
                    from terragrip.soil.transitions import settled

                    result[~settled(self.estimated("distance"), result, whole_length(self.vehicle))] = ""
                return result
        return np.full(len(self.time), "", dtype=object)

    @cached_property
    def soils(self) -> tuple[str, ...]:
        """The soils of the run in order of their first appearance."""
        return tuple(dict.fromkeys(label for label in self.soil if label))

    @cached_property
    def stuck(self) -> Bools:
        """Where the vehicle is stuck: by the simulation's truth, else by the events of the estimates."""
        if self.truth is not None and "stuck" in self.truth:
            return self.truth["stuck"].to_numpy(dtype=np.bool_)
        return self._during(STUCK)

    @cached_property
    def outlier(self) -> Bools:
        """The longest stuck spell and AFTER_STUCK seconds after it: what the paper cuts out of `multi2` by hand."""
        result = np.zeros(len(self.time), dtype=np.bool_)
        spells = stretches(self.stuck)
        if spells:
            first, last = max(spells, key=lambda spell: self.time[spell[1]] - self.time[spell[0]])
            result = (self.time >= self.time[first]) & (self.time <= self.time[last] + AFTER_STUCK)
        return result

    @cached_property
    def flagged(self) -> Bools:
        """Rows that the product itself flags, without a look at truth or sensor: inside an event of FLAGGED, and from
        BEFORE_STUCK before to AFTER_STUCK after one of STUCK, the same for all."""
        result = self._during(FLAGGED)
        for first, last in stretches(self._during(STUCK)):
            start, end = self.time[first] - BEFORE_STUCK, self.time[last] + AFTER_STUCK
            result |= (self.time >= start) & (self.time <= end)
        return result

    def _during(self, kinds: tuple[str, ...]) -> Bools:
        """Rows inside an event of `kinds`, by the estimates' column or by `events`."""
        result = np.zeros(len(self.time), dtype=np.bool_)
        if "event" in self.estimates:
            result |= np.asarray(self.estimates["event"].isin(kinds).to_numpy(), dtype=np.bool_)
        for event in self.events:
            if event.kind in kinds:
                result |= event.rows(self.time)
        return result

    @cached_property
    def moving(self) -> Bools:
        """Rows with an estimate of slip: the others stand still or follow a gap."""
        return np.isfinite(self.estimated(f"slip_{self.shown_wheel}"))

    @cached_property
    def pushed(self) -> Bools:
        """Where, by a simulation's truth, the operator pushes: a force from outside that no sensor of the log tells."""
        assist = self.true("assist_force")
        return np.zeros(len(self.time), dtype=np.bool_) if assist is None else np.abs(assist) > LEAST_PUSH

    @cached_property
    def judged(self) -> Bools:
        """Rows in which estimates are held against the truth: it moves by itself, neither stuck nor pushed."""
        return self.moving & ~self.stuck & ~self.pushed

    @property
    def _measured(self) -> pd.DataFrame:
        """The table that carries the references: the recording where it is there, else the estimates."""
        return self.estimates if self.recording is None else self.recording


def axle_ratio(net_traction: Floats, load: Floats, specific_force: Floats, mass: float) -> Floats:
    """F_x/F_z in the axle of a wheel of `mass` [kg] (n,): (κ F_z - m_w a)/(F_z - m_w g) (physics.md 2, paper eq. 1).

    `net_traction` κ, `load` F_z [N] and `specific_force` dv/dt + g sinθ [m/s²] are (n,); NaN where the load is the wheel's own.
    """
    carried = load - mass * STANDARD_GRAVITY
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(carried > 0, (net_traction * load - mass * specific_force) / carried, np.nan)


def stretches(mask: Bools) -> list[tuple[int, int]]:
    """First and last row of each unbroken stretch of True in `mask` (n,)."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return list(
        zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True)
    )


def label_stretches(labels: NDArray[np.object_]) -> list[tuple[str, int, int]]:
    """(label, first row, last row) of each unbroken stretch of one non-empty label."""
    if not len(labels):
        return []
    starts = np.flatnonzero(np.concatenate(([True], labels[1:] != labels[:-1])))
    ends = np.concatenate((starts[1:], [len(labels)])) - 1
    return [(str(labels[a]), int(a), int(b)) for a, b in zip(starts, ends, strict=True) if labels[a]]

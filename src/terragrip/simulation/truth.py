"""The truth beside a recording: what no sensor tells, at the recording's own instants."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats
from terragrip.physics.efficiency import net_traction, tractive_efficiency
from terragrip.physics.slip import slip
from terragrip.simulation.trace import Trace
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    import pandas as pd


STANDSTILL_SPEED = 0.03  # m/s, of hub and rim
STUCK_SPEED = 0.1  # of the rim speed: below it the machine is stuck, wheels turning
FREE_SPEED = 0.4  # of the rim speed: above it the machine is free again
PUSH_FORCE = 5.0  # N


def truth_frame(trace: Trace, whole: Trace) -> pd.DataFrame:
    """The truth at the rows of ``trace``; ``whole`` is the run at its full rate, from which spells are taken.

    Signed quantities are in the direction of travel. ``true_adhesion_<w>`` = F_h/F_z (paper eq. 4); ``true_soil_resistance`` = rolling
    resistance over m g cosθ (paper eq. 3), ``true_soil_resistance_<axle>`` over the axle's load; ``true_slip_<w>`` from
    the wheel's own hub speed and true radius (paper eq. 6, NaN at standstill); ``true_slope`` holds what the local
    gradients under the wheels add. ``stuck``: wheels turn, the machine does not (hysteresis of ``STUCK_SPEED`` and
    ``FREE_SPEED``); ``transition``: a wheel or tool on a border, or on another soil than the rest.
    """
    import pandas as pd

    vehicle = trace.vehicle
    direction = _direction(trace)
    columns: dict[str, npt.NDArray[np.generic]] = {"time": trace["time"]}
    columns["true_ground_speed"] = trace["speed"]
    columns["true_acceleration"] = trace["acceleration"]
    columns["true_distance"] = trace["position"]
    weight = vehicle.mass * STANDARD_GRAVITY
    slope = np.arcsin(np.clip(np.sin(trace["slope"]) + trace["gradient_force"] / weight, -1, 1))
    columns["true_slope"] = slope
    columns["true_drawbar_force"] = trace["drawbar"]
    columns["true_assist_force"] = trace["assist"]
    resistance = direction * trace.rolling_force.sum(axis=1) / (weight * np.cos(slope))
    columns["true_soil_resistance"] = resistance
    axles = vehicle.axle_names
    for k, axle in enumerate(axles):
        columns[f"true_soil_resistance_{axle}"] = direction * trace["resistance"][:, k]
        columns[f"true_vertical_load_{axle}"] = trace.of_axles("load")[:, k]
    for i, wheel in enumerate(vehicle.wheels):
        adhesion = direction * trace["adhesion"][:, i]
        wheel_slip = slip(
            trace["wheel_speed"][:, i],
            trace["hub_speed"][:, i],
            trace.radius[i],
            standstill_speed=STANDSTILL_SPEED,
        )
        columns[f"true_adhesion_{wheel}"] = adhesion
        columns[f"true_slip_{wheel}"] = wheel_slip
        columns[f"true_net_traction_{wheel}"] = net_traction(adhesion, resistance)
        columns[f"true_efficiency_{wheel}"] = tractive_efficiency(
            adhesion, resistance, vehicle.tire_rolling_resistance, wheel_slip
        )
        columns[f"true_vertical_load_{wheel}"] = trace["load"][:, i]
        columns[f"true_wheel_speed_{wheel}"] = trace["wheel_speed"][:, i]
        columns[f"true_drive_torque_{wheel}"] = trace["torque"][:, i]
    for k in range(trace.tool_count):
        columns[f"true_tool_speed_{k + 1}"] = trace[f"tool{k + 1}_speed"]
        columns[f"true_draught_{k + 1}"] = trace[f"tool{k + 1}_draught"]
    columns |= soil_labels(trace)
    rows = np.clip(np.searchsorted(whole["time"], trace["time"] + 1e-9) - 1, 0, len(whole.rows) - 1)
    columns["stuck"] = stuck(whole)[rows]
    columns["push"] = trace["drawbar"] * direction < -PUSH_FORCE
    columns["standstill"] = _fastest(trace) < STANDSTILL_SPEED
    columns["motors_off"] = np.isnan(whole["command"])[rows]
    columns["driver"] = np.array(["normal", "boost", "ease", "push"], dtype=object)[
        whole["driver_mode"].astype(np.intp)[rows]
    ]
    return pd.DataFrame(columns)


def soil_labels(trace: Trace) -> dict[str, npt.NDArray[np.generic]]:
    """Soil names under the centre of gravity (``soil``), each axle and tool, and the flag ``transition`` (n,)."""
    middle, names = trace.terrain.middle, np.array(trace.terrain.names, dtype=object)
    columns: dict[str, npt.NDArray[np.generic]] = {}
    mixed = np.zeros(len(trace.rows), dtype=bool)
    reference = middle.label[trace.cell(trace.points["center"])]
    for point, position in trace.points.items():
        cell = trace.cell(position)
        columns["soil" if point == "center" else f"soil_{point}"] = names[middle.label[cell]]
        mixed |= middle.border[cell] | (middle.label[cell] != reference)
    columns["transition"] = mixed
    return columns


def stuck(trace: Trace) -> Bools:
    """Where the wheels turn and the machine does not move (n,), with hysteresis."""
    rim = np.abs(trace["wheel_speed"] * trace.radius).mean(axis=1)
    travel = np.abs(trace["speed"])
    begins = (travel < STUCK_SPEED * rim) & (rim > 0.1) & _turning_for(trace, rim, 0.5)
    ends = travel > FREE_SPEED * rim
    ends |= rim < STANDSTILL_SPEED
    state = np.where(begins, 1, np.where(ends, -1, 0))
    last = np.maximum.accumulate(np.where(state != 0, np.arange(len(state)), 0))
    return state[last] == 1


def _turning_for(trace: Trace, rim: Floats, least: float) -> Bools:
    """Where the wheels have turned for ``least`` s already: a start from rest is no immobilisation."""
    turning = rim > 0.1
    since = np.maximum.accumulate(np.where(~turning, trace["time"], -np.inf))
    return turning & (trace["time"] - since > least)


def _fastest(trace: Trace) -> Floats:
    rim = np.abs(trace["wheel_speed"] * trace.radius).max(axis=1)
    return np.maximum(rim, np.abs(trace["speed"]))


def _direction(trace: Trace) -> Floats:
    """+1 forward, -1 in reverse (n,), by ground and rims: wheels that spin forward while the vehicle slides back drive forward."""
    rim = (trace["wheel_speed"] * trace.radius).mean(axis=1)
    return np.where(trace["speed"] + rim < -1e-3, -1.0, 1.0)

"""What each number that is not known costs in width of the intervals: the machine is driven on paper (`drive`) and estimated with the
doubt of that number alone, with all of them, and with none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.estimation import RunOptions, estimated
from terragrip.estimation.consistency import NORMAL_95
from terragrip.recording import LogBlocks, Recording
from terragrip.vehicle import Vehicle
from terragrip.vehicle_maker.drive import drive
from terragrip.vehicle_maker.fields import fields
from terragrip.vehicle_maker.maker import Made, vehicle_of

_UNSEEN = (
    "acceleration_bias",
    "drawbar_force",
)  # of what the machine on paper does not have: an accelerometer, a pull without a cell
QUANTITIES = ("slip", "adhesion", "soil_resistance", "net_traction")


@dataclass(frozen=True)
class Cost:
    """Half the width of the 95 % intervals [-] by quantity (`QUANTITIES`, those that there are; medians while working), where ``what`` is
    not known; ``field`` names it, "" where it is none or all."""

    what: str
    field: str
    half_width: dict[str, float]


def interval_costs(made: Made) -> tuple[Cost, ...]:
    """The costs of what is assumed of a machine, the dearest first, between the intervals where all is known and where this file stands.

    They hold for the machine as it is assumed, working on firm ground with ordinary sensors (`drive`), by considered uncertainty through
    the filter (docs/physics.md 6).
    """
    if made.signals == "bus-speed":
        return _bus_costs(made)
    asked = [one for one in fields(made.machine, made.signals, made.known) if one.name not in _UNSEEN]
    true = vehicle_of(made.machine, "torque", made.known, ())
    recording = drive(true, made.machine.speed, made.signals, tows=made.machine.tows)
    spreads = {field.name for field in asked if field.is_spread}
    numbers = {name: value for name, value in made.known.items() if name not in spreads}

    def widths(doubted: list[str], known: dict[str, float], is_calibrated: bool = True) -> dict[str, float]:
        vehicle = vehicle_of(made.machine, made.signals, known, doubted, is_calibrated=is_calibrated)
        return _half_widths(recording, vehicle)

    found = [Cost("all is known and calibrated", "", widths([], numbers))]
    alone = [
        Cost(field.assumption, field.name, widths([field.name], numbers))
        for field in made.assumed
        if field.name not in _UNSEEN
    ]
    alone += [
        Cost(
            f"{field.name}: ± {made.known[field.name]:g} {field.unit}",
            field.name,
            widths([], numbers | {field.name: made.known[field.name]}),
        )
        for field in asked
        if field.name in spreads and field.name in made.known
    ]
    if "wheel_radius" in made.known:
        alone.append(
            Cost(
                "wheel_radius: by tape, ± 2 %",
                "wheel_radius",
                widths([], numbers, is_calibrated=False),
            )
        )
    alone.sort(key=lambda cost: -sum(cost.half_width.values()))
    everything = widths([field.name for field in made.assumed], dict(made.known), is_calibrated=False)
    return (*found, *alone, Cost("this vehicle file", "", everything))


def _bus_costs(made: Made) -> tuple[Cost, ...]:
    """Of a bus speed the zero of slip alone counts: calibrated, found in the log's light work, or nowhere."""
    sized = vehicle_of(made.machine, "torque", made.known, ())
    tree = made.vehicle.to_dict()
    calibrated = type(made.vehicle).from_dict(
        {**tree, "calibration": {"wheel_based_speed_gain": 1.0}, "uncertainty": {"wheel_radius": 0.003}}
    )
    found = []
    for what, vehicle, light in (
        ("calibrated on a pass without load, to 0.3 %", calibrated, False),
        ("this vehicle file, and light work in the log", made.vehicle, True),
        ("this vehicle file, and no light work in the log", made.vehicle, False),
    ):
        recording = drive(sized, made.machine.speed, "bus-speed", tows=True, has_light_work=light)
        found.append(Cost(what, "", _half_widths(recording, vehicle)))
    return tuple(found)


def _half_widths(recording: Recording, vehicle: Vehicle) -> dict[str, float]:
    """Half the width of the 95 % intervals, the median over the working rows, the mean over the driven wheels."""
    # What is driven on paper has no fault to search for, which takes longer than the estimates.
    (table,) = estimated(LogBlocks.of(recording), vehicle, RunOptions(checked=False))
    rows = (table.event_codes == 0) & (table.time > table.time[-1] / 2)
    found = {}
    for quantity in QUANTITIES:
        if quantity == "soil_resistance":
            names = ["soil_resistance"] if "soil_resistance" in table else []
        else:
            driven = (*table.vehicle.driven_wheels, "drive")
            names = [f"{quantity}_{w}" for w in table.wheels if w in driven and f"{quantity}_{w}" in table]
        if names:
            found[quantity] = NORMAL_95 * float(
                np.mean([np.nanmedian(table[f"{n}_std"][rows]) for n in names])
            )
    return found


def cost_table(costs: tuple[Cost, ...]) -> str:
    """The costs as lines of text, each column a quantity; what widens no interval by a tenth shares the last line."""
    names = [name for name in QUANTITIES if name in costs[0].half_width]
    known = costs[0].half_width
    small = [
        cost.field
        for cost in costs[1:-1]
        if cost.field and all(cost.half_width[name] < 1.1 * known[name] for name in names)
    ]
    shown = [cost for cost in costs if cost.field not in small]
    width = max(len(cost.what) for cost in shown) + 2
    lines = ["95 % interval, ±".ljust(width) + "".join(name.replace("_", " ").rjust(17) for name in names)]
    for cost in shown:
        cells = "".join(f"{cost.half_width[name]:17.3f}" for name in names)
        lines.append(cost.what.ljust(width) + cells)
    if small:
        lines.append(
            f"Of little effect: {', '.join(small)}{' (it counts in turns)' if small == ['track'] else ''}."
        )
    return "\n".join(lines)

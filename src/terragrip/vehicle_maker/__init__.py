"""Make a vehicle file from what is known of a machine; the one maker of command line and studio.

made = make("tractor-4wd", "torque", {"mass": "6.2 t", "wheel_radius": "0.83 m"})
made.assumed             # what is typical of the class, with spread and source
interval_costs(made)     # what each number that is not known costs in width of the intervals
made.save("tractor.yaml")
"""

from terragrip.vehicle_maker.classes import MachineClass, Typical, class_named, classes
from terragrip.vehicle_maker.costs import QUANTITIES, Cost, cost_table, interval_costs
from terragrip.vehicle_maker.fields import SIGNALS, Field, Signals, fields, read_values
from terragrip.vehicle_maker.maker import TORQUE_AT, Made, make

__all__ = [
    "QUANTITIES",
    "SIGNALS",
    "TORQUE_AT",
    "Cost",
    "Field",
    "MachineClass",
    "Made",
    "Signals",
    "Typical",
    "class_named",
    "classes",
    "cost_table",
    "fields",
    "interval_costs",
    "make",
    "read_values",
]

"""The kernel in plain NumPy, written apart from it: the oracle that its tests compare it with.

The filters, in any precision (`filters`, `unscented`, `adaptation`, `bank`, `smoother`), know nothing of machines; the machine's model,
the filter with the kernel's arguments, its supervisor, the considered constants and slip from speeds alone
are put together from them.
"""

from kernel_twin.consider import Considered, Constant
from kernel_twin.supervisor import DriveSupervisor, SpeedSupervisor, memberships, supervise
from kernel_twin.traction import Input, Machine, TractionModel
from kernel_twin.traction_filter import Step, TractionFilter, Tuning

__all__ = [
    "Considered",
    "Constant",
    "DriveSupervisor",
    "Input",
    "Machine",
    "SpeedSupervisor",
    "Step",
    "TractionFilter",
    "TractionModel",
    "Tuning",
    "memberships",
    "supervise",
]

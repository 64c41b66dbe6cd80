"""How vehicles are estimated live, whichever they are; and the core that does it for one."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.estimation.engine_estimator import EngineEstimator
from terragrip.estimation.methods import DEFAULT, method_named
from terragrip.live.core import WINDOW, Core, Settings
from terragrip.live.setpoint import LiveSetpoint

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.live.decode import Decoder
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle


@dataclass(frozen=True)
class Options:
    """What the command line says besides sources, sinks and vehicle.

    ground: report ground changes while driving; library: and which of these soils it is.
    setpoint: slip and ground speed wanted [m/s] of the set-point to publish beside the estimates; None: none is.
    All others are those of a run's `Settings`.

    Raises InputError on an unknown method.
    """

    method: str = DEFAULT
    window: float = WINDOW
    held: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    learn: bool = True
    ground: bool = False
    library: SoilLibrary | None = None
    setpoint: tuple[float, float] | None = None
    driveline: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        method_named(self.method)

    def promised(self, decoder: Decoder, vehicle: Vehicle) -> tuple[str, ...]:
        """The columns that a source's profile promises; of a vehicle with a driveline also what of its engine is optional, and what an
        earlier log of it had.
        """
        if vehicle.driveline is None or decoder.profile is None:
            return decoder.channels
        had = () if self.driveline is None else self.driveline["channels"]
        more = (
            name for name in decoder.profile.channels if name.startswith(("engine_", "pto_")) or name in had
        )
        return tuple(dict.fromkeys((*decoder.channels, *more)))

    def core(
        self, vehicle: Vehicle, sources: Sequence[str], channels: Collection[str]
    ) -> tuple[Core, LiveSetpoint | None]:
        """A core that has processed nothing, and its set-point.

        ``sources``: their names in the record. ``channels``: columns that they promise; empty: those of the first row.
        Raises InputError where the channels cannot give what is wanted.
        """
        settings = Settings(
            tuple(sources),
            self.method,
            self.window,
            tuple(dict.fromkeys(channels)),
            dict(self.held),
            self.ground or self.library is not None,
            dict(self.noise),
            self.learn,
            self.driveline,
        )
        core = Core(vehicle, settings, self.library)
        setpoint = None if self.setpoint is None else LiveSetpoint(vehicle, *self.setpoint)
        if core.estimator is not None:
            _refuse_without_slips(core.estimator, settings.ground, setpoint is not None)
        return core, setpoint


def has_slips(estimator: TractionEstimator) -> bool:
    """Whether its estimates hold the slip of each wheel, and what shows whether they can be trusted."""
    return not estimator.rims and not isinstance(estimator, EngineEstimator)


def _refuse_without_slips(estimator: TractionEstimator, ground: bool, setpoint: bool) -> None:
    if ground and estimator.rims:
        raise InputError(
            "changes of the ground are found in adhesion and soil resistance, which need drive torques",
            place="--ground", hint="leave it out: the sources give speeds alone",
        )  # fmt: skip
    if setpoint and not has_slips(estimator):
        raise InputError(
            "a set-point of slip needs the slip of each driven wheel",
            place="--setpoint", hint="leave it out: the sources give the drive train's speed alone",
        )  # fmt: skip

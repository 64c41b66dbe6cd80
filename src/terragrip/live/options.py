"""How vehicles are estimated live, whichever they are; and the core that does it for one."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from terragrip.errors import InputError
from terragrip.estimation.engine_estimator import EngineEstimator
from terragrip.estimation.methods import method_named
from terragrip.live.core import Core, Settings
from terragrip.live.setpoint import LiveSetpoint

if TYPE_CHECKING:
    from terragrip.estimation.estimator import TractionEstimator
    from terragrip.live.decode import Decoder
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle


@dataclass(frozen=True)
class Options(Settings):
    """What the command line says besides sinks and vehicle: a run's `Settings`, whose ``sources`` and ``channels`` `core` fills in.

    library: name which of these soils the ground is.
    setpoint: slip and ground speed wanted [m/s] of the set-point to publish beside the estimates; None: none is.

    Raises InputError on an unknown method.
    """

    library: SoilLibrary | None = None
    setpoint: tuple[float, float] | None = None

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
        given = {one.name: getattr(self, one.name) for one in fields(Settings)}
        known = {"sources": tuple(sources), "channels": tuple(dict.fromkeys(channels))}
        settings = Settings(**{**given, **known, "ground": self.ground or self.library is not None})
        core = Core(vehicle, settings, self.library)
        setpoint = None if self.setpoint is None else LiveSetpoint(vehicle, *self.setpoint)
        estimator = core.estimator
        if estimator is not None and settings.ground and estimator.rims:
            raise InputError(
                "changes of the ground are found in adhesion and soil resistance, which need drive torques",
                place="--ground", hint="leave it out: the sources give speeds alone",
            )  # fmt: skip
        if estimator is not None and setpoint is not None and not has_slips(estimator):
            raise InputError(
                "a set-point of slip needs the slip of each driven wheel",
                place="--setpoint", hint="leave it out: the sources give the drive train's speed alone",
            )  # fmt: skip
        return core, setpoint


def has_slips(estimator: TractionEstimator) -> bool:
    """Whether its estimates hold the slip of each wheel, and what shows whether they can be trusted."""
    return not estimator.rims and not isinstance(estimator, EngineEstimator)

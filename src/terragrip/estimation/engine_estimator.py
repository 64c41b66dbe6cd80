"""Sample by sample on a machine that logs its engine's torque: `DrivenMachine` on the last seconds, with the digits of a whole log."""

from __future__ import annotations

import json
import math
from base64 import b64decode, b64encode
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.driveline import DrivenMachine, by_engine
from terragrip.estimation.engine_torque import SHARE_STD, TAIL
from terragrip.estimation.estimator import Estimate, TractionEstimator, unusable
from terragrip.estimation.methods import DEFAULT
from terragrip.estimation.sealed import seal, understood, unseal

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.recording import Recording
    from terragrip.vehicle import Vehicle


_MAGIC = b"TGRIPEN1"
_NEEDED = (
    "adhesion_driven", "soil_resistance", "net_traction_driven", "efficiency_driven", "slip_driven", "curve_a", "curve_a_driven",
)  # fmt: skip


class EngineEstimator(TractionEstimator):
    """As `TractionEstimator`, of samples with engine torque and no wheel's: the sum of the drive torques by the vehicle's ``driveline``.

    ``machine`` says how (`DrivenMachine`); ``vehicle`` is its machine of driven wheels, whose columns the estimates have. ``fixed``: what
    the bus sends of its engine later changes nothing.
    """

    def __init__(
        self,
        machine: DrivenMachine,
        channels: Collection[str],
        method: str = DEFAULT,
        *,
        sensors: Mapping[str, float] | None = None,
        held: Mapping[str, float] | None = None,
        fixed: bool = False,
    ) -> None:
        super().__init__(
            machine.vehicle,
            method,
            sensors=sensors,
            held=held,
            channels=machine.own_channels,
            together=machine.together,
        )
        self.machine = machine
        self.fixed = fixed
        self.given = tuple(channels)
        self.converted: dict[str, float] = {}
        self._recent = np.empty((1 + len(self.given), 0))  # times [s] of the last rows, and what they gave
        self._places = {name: place for name, place in super().places.items() if machine.shows(name)}

    @property
    def places(self) -> dict[str, int]:
        """The position of each column in an estimate's values."""
        return self._places

    @property
    def inputs(self) -> tuple[str, ...]:
        """The bus's channels."""
        return self.given

    def update_at(self, time: float, sample: Mapping[str, float | None]) -> Estimate:
        """As of any machine; the sample has the bus's channels. ``converted`` then holds those of the machine of driven wheels."""
        row = [_number(sample.get(name)) for name in self.given]
        recent = self._recent
        if not (math.isfinite(time) and (time > recent[0, -1:]).all()) or any(map(math.isinf, row)):
            if any(map(math.isinf, row)):
                raise unusable({**sample, "time": time}, self.given)
            return super().update_at(time, {})  # which reports what is wrong with the time
        if not self.fixed:
            self._learn_engine(sample)
        first = int(np.searchsorted(recent[0], time - TAIL))
        self._recent = recent = np.column_stack([recent[:, first:], [time, *row]])
        given = dict(zip(self.given, recent[1:], strict=True))
        channels = {name: given[name] for name in self.machine.channels if name in given}
        values, drive = self.machine.converted(recent[0], channels, recent.shape[1] - 1)
        self.converted = {name: float(value[0]) for name, value in values.items() if value[0] == value[0]}
        return self._completed(super().update_at(time, self.converted), drive.std)

    def _learn_engine(self, sample: Mapping[str, float | None]) -> None:
        """Keep what the bus sends of its engine once: the reference torque, and whether it sends its friction."""
        machine, engine = self.machine, self.machine.engine
        reference = _number(sample.get("engine_reference_torque"))
        if engine.reference is not None and reference > 0 and reference != engine.reference:
            engine = replace(engine, reference=reference)
        channels = machine.channels
        if "engine_friction_share" not in channels and not math.isnan(
            _number(sample.get("engine_friction_share"))
        ):
            channels = (*channels, "engine_friction_share")
            engine = replace(engine, share=SHARE_STD, notes=())
        if engine is not machine.engine:
            self.machine = replace(machine, channels=channels, engine=engine)

    def _completed(self, estimate: Estimate, std: Floats) -> Estimate:
        values, places = list(estimate.values), estimate.places
        names = [n for name in _NEEDED for n in (name, f"{name}_std")]
        names += [f"vertical_load_{axle}" for axle in self.vehicle.axle_names]
        columns = {name: np.array([values[places[name]]]) for name in names}
        for name, value in self.machine.completed(columns, std).items():
            values[places[name]] = float(value[0])
        none = estimate.event == "push" and not np.isfinite(std[0])  # no torque shows that the wheels pull
        return Estimate(estimate.time, "" if none else estimate.event, values, self._places)

    def update_block(self, recording: Recording) -> Estimates:
        """Not available sample by sample: it needs a whole log, see :func:`terragrip.estimate`."""
        raise InputError(
            "estimates of a bus come sample by sample", hint="estimate the whole log with terragrip.estimate"
        )

    def snapshot(self) -> bytes:
        """Everything needed to continue later, bit for bit."""
        about = {
            "machine": self.machine.to_dict(),
            "given": self.given,
            "fixed": self.fixed,
            "tail": b64encode(self._recent.tobytes()).decode(),
            "inner": b64encode(super().snapshot()).decode(),
        }
        return seal(_MAGIC, json.dumps(about).encode())

    @classmethod
    @understood()
    def restore(cls, data: bytes) -> Self:
        """The estimator of a snapshot; raises InputError if the bytes are damaged or of another version."""
        from terragrip.vehicle import Vehicle

        about = json.loads(unseal(_MAGIC, data))
        inner = TractionEstimator.restore(b64decode(about["inner"]))
        known = about["machine"]
        machine = DrivenMachine.of_file(Vehicle.from_dict(known["vehicle"]), known["channels"], known)
        result = cls(
            machine, about["given"], inner.method, sensors=inner.noise, held=inner.held, fixed=about["fixed"]
        )
        result.guessed, result._engine = inner.guessed, inner._engine
        result._recent = np.frombuffer(b64decode(about["tail"])).reshape(len(result._recent), -1)
        return result


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def live_estimator(
    vehicle: Vehicle,
    method: str,
    channels: Collection[str],
    *,
    sensors: Mapping[str, float],
    held: Mapping[str, float],
    driveline: Mapping[str, Any] | None = None,
) -> TractionEstimator:
    """The estimator for samples of these ``channels`` as they come in; arguments as of `TractionEstimator`.

    ``driveline``: what an earlier log of a machine with engine torque showed of it, as its estimates hold it (``about["driveline"]``).
    Raises InputError as making an estimator does.
    """
    if not by_engine(channels, vehicle):
        return TractionEstimator(vehicle, method, channels=channels, held=held, sensors=sensors)
    machine = DrivenMachine.of_file(vehicle, channels, driveline)
    return EngineEstimator(machine, channels, method, sensors=sensors, held=held, fixed=driveline is not None)


def restored(snapshot: bytes) -> TractionEstimator:
    """The estimator of a snapshot, of either kind; raises InputError as `TractionEstimator.restore`."""
    kind = EngineEstimator if snapshot.startswith(_MAGIC) else TractionEstimator
    return kind.restore(snapshot)

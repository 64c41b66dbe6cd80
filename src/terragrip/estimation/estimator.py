"""The estimator: one sample in, one estimate out. A whole recording is its samples in order, with identical results."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Self

from terragrip.errors import InputError, nearest
from terragrip.estimation import rims as speeds
from terragrip.estimation.engine import EVENTS, Engine, estimate_slots, refusal
from terragrip.estimation.methods import DEFAULT, SLIP_ONLY, method_named
from terragrip.estimation.noise import DELAY, channel_noise, check_held, settings_in
from terragrip.estimation.rims import Rim, rims_of, speeds_alone
from terragrip.estimation.sealed import seal, understood, unseal
from terragrip.estimation.settings import Thresholds, sample_slots, settings_of
from terragrip.recording.lag import delay_of, lag_within
from terragrip.recording.schema import is_own, split_channel
from terragrip.vehicle import Vehicle, require_vehicle

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates
    from terragrip.estimation.slip_only import SlipReference
    from terragrip.estimation.turning import ShownTurn
    from terragrip.recording import Recording

_SNAPSHOT_MAGIC = b"TGRIPSN2"


class Estimate:
    """The estimate at one instant: a column of architecture.md, contracts by ``e["slip_fl"]`` or ``e.slip_fl``.

    ``time`` [s], ``event`` (a text of :data:`~terragrip.estimation.engine.EVENTS`), and the columns of
    :attr:`TractionEstimator.columns` as plain floats. A value is NaN only where ``event`` gives the reason.
    """

    __slots__ = ("event", "places", "time", "values")

    def __init__(self, time: float, event: str, values: Sequence[float], places: dict[str, int]) -> None:
        self.time = time
        self.event = event
        self.values = values
        self.places = places  # index of each column in `values`

    def __getitem__(self, name: str) -> Any:
        if name in self.places:
            return self.values[self.places[name]]
        if name in ("time", "event"):
            return getattr(self, name)
        raise KeyError(name)

    def __getattr__(self, name: str) -> float:
        try:
            return self.values[self.places[name]]
        except KeyError:
            raise AttributeError(f"an estimate has no {name!r}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(("time", *self.places, "event"))

    def to_dict(self) -> dict[str, float | str]:
        """All columns by name."""
        return {name: self[name] for name in self}

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{name}={self[name]:.4g}"
            for name in self.places
            if name.startswith(("adhesion", "slip", "soil"))
        )
        return f"Estimate(time={self.time:.6g}, event={self.event!r}, {shown})"


class TractionEstimator:
    """Estimates adhesion, soil resistance, slip and efficiency sample by sample.

    Parameters
    ----------
    vehicle: the machine; its ``calibration`` corrects the samples.
    method: a name of :data:`~terragrip.estimation.methods.METHODS`.
    sensors: standard deviations of the noise [SI], by channel (``wheel_speed_fl``) or sensor
        (``wheel_speed``); they override the vehicle file's. A value given in neither is guessed from the
        vehicle's size (``guessed`` lists those): better give it, or let :func:`estimate` determine it from a log.
    held: update period [s] of channels whose values are repeated between updates.
    channels: the columns of the samples. A drawbar force in ``channels`` is unknown before its first value, else it
        is 0; an undriven wheel has a torque only if ``channels`` has one, and rolls with the ground until a sample has its
        speed. Default: ground speed, and speeds and torques of driven wheels. With speeds and no torque
        (``wheel_speed_<wheel>`` or ``wheel_based_speed``) slip alone is estimated, whatever the ``method``: docs/methods.md.
    gap: s without any wheel or ground speed after which the motion restarts.
    standstill_speed: m/s under which vehicle and wheels count as standing.
    together: how many wheels each wheel of ``vehicle`` represents (`terragrip.estimation.driveline`).
    rims, dead_band: of slip alone, what an earlier log showed of its wheels, and the speed [m/s] below which they read 0; default: the
        vehicle file's radii, and 0.

    Raises InputError on an unknown method or sensor, or a vehicle that the kernel cannot work with.

    A row before a gap is flagged only in a run over a whole recording: a stream does not show that a gap follows.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        method: str = DEFAULT,
        *,
        sensors: Mapping[str, float] | None = None,
        held: Mapping[str, float] | None = None,
        channels: Collection[str] | None = None,
        gap: float | None = None,
        standstill_speed: float | None = None,
        together: int = 1,
        rims: Collection[Rim] = (),
        dead_band: float = 0.0,
    ) -> None:
        require_vehicle(vehicle)
        self.vehicle = vehicle
        self.method = method_named(method).name
        self.held = dict(held or {})
        check_held(self.held)
        self.dead_band = dead_band
        self.channels = default_channels(vehicle) if channels is None else tuple(channels)
        self.thresholds = Thresholds(gap=gap, standstill_speed=standstill_speed, together=together)
        self.slip_reference: SlipReference | None = None
        self.turn: ShownTurn | None = None
        self._accepted: set[str] = set()
        self.rims = tuple(rims)
        if not self.rims and speeds_alone(self.channels, vehicle):
            self.rims = rims_of(vehicle, self.channels)
        if self.rims:
            self.method = SLIP_ONLY.name
            slots, out = speeds.slots_in(self.rims), speeds.slots_out(self.rims)
        else:
            slots = sample_slots(vehicle)
            out = estimate_slots(vehicle, adaptive=method_named(self.method).adapts)
        self.noise, self.guessed = self._noise(tuple(slots), sensors)
        self._engine = Engine(self._settings(), slots, out)

    def _noise(
        self, inputs: tuple[str, ...], sensors: Mapping[str, float] | None
    ) -> tuple[dict[str, float], tuple[str, ...]]:
        """`channel_noise`; of a free wheel without a speed, which goes as the ground does, that of the ground speed."""
        noise, guessed = channel_noise(self.vehicle, inputs, sensors)
        if not self.rims:
            for wheel in self.vehicle.rolling_wheels(self.channels):
                if (name := f"wheel_speed_{wheel}") not in (sensors or {}):
                    noise[name] = noise["ground_speed"] / self.vehicle.radii[wheel]
        return noise, guessed

    def _settings(self) -> Any:
        """The kernel's settings for this estimator."""
        common: dict[str, Any] = {"noise": self.noise, "held": self.held, "thresholds": self.thresholds}
        if self.rims:
            return speeds.speed_settings(self.vehicle, self.rims, dead_band=self.dead_band, **common)
        return settings_of(self.vehicle, method_named(self.method), channels=self.channels, **common)

    @classmethod
    def for_recording(
        cls,
        recording: Recording,
        vehicle: Vehicle,
        method: str = DEFAULT,
        *,
        sensors: Mapping[str, float] | None = None,
        held: Mapping[str, float] | None = None,
        gap: float | None = None,
        standstill_speed: float | None = None,
        slip_reference: SlipReference | None = None,
        together: int = 1,
    ) -> Self:
        """An estimator set up as :func:`estimate` does it: noise and held channels that are not given are determined from the
        log. Without a torque in the log the zero of slip is determined, too (``slip_reference``; None: from the log)."""
        from terragrip.estimation.slip_only import slip_reference_in

        logged, periods = settings_in(recording, vehicle, sensors=sensors, held=held)
        mine = dict(sensors or {})
        if DELAY not in mine and vehicle.sensors.ground_speed_delay is None:
            known = recording.delay
            mine[DELAY] = delay_of(lag_within(recording.time, recording.channels)) if known is None else known
        if slip_reference is None and speeds_alone(recording.channels, vehicle):
            slip_reference = slip_reference_in(recording, vehicle)
        rims = () if slip_reference is None else slip_reference.rims
        used = speeds.slots_in(rims) if rims else sample_slots(vehicle)
        logged = {name: sd for name, sd in logged.items() if name in used}
        made = cls(
            vehicle,
            method,
            sensors={**logged, **mine},
            held=periods,
            channels=tuple(recording.channels),
            gap=gap,
            standstill_speed=standstill_speed,
            together=together,
            rims=rims,
            dead_band=0.0 if slip_reference is None else slip_reference.dead_band,
        )
        made.slip_reference = slip_reference
        return made

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of an estimate's columns besides ``time`` and ``event``."""
        return tuple(self.places)

    @property
    def places(self) -> dict[str, int]:
        """Index of each column in an estimate's values."""
        return self._engine.slots_out

    @property
    def engine(self) -> Engine:
        """The kernel's estimator that this one uses."""
        return self._engine

    def update(self, sample: Mapping[str, float | None]) -> Estimate:
        """Process one sample and return the estimate at its instant.

        ``sample`` maps ``time`` [s] and recording columns to SI numbers. A column that is absent, None or NaN
        was not measured at that instant; columns that the estimator does not use are ignored. Raises
        InputError, with the estimator unchanged, if time is missing or does not increase, a value is not a
        finite number, or a name is no column but like one that the estimator uses (mistyped, or of a wheel that the vehicle lacks).
        """
        try:
            names = sample.keys()
        except AttributeError as error:
            hint = "give a dict of numbers by column; a row of itertuples becomes one by row._asdict()"
            raise InputError(f"{type(sample).__name__} is no sample", hint=hint) from error
        if not self._accepted.issuperset(names):
            self._accept(names)
        time = sample.get("time")
        if time is None:
            raise unusable(sample, self._engine.inputs)
        return self.update_at(time, sample)

    def _accept(self, names: Collection[str]) -> None:
        """Remember the names of a sample's columns; raises InputError on one that is mistyped."""
        owners = ("", *self.vehicle.wheels, *self.vehicle.axle_names)
        for name in set(names) - self._accepted:
            own = is_own(name) and (split_channel(name) or ("", ""))[1] in owners
            like = None if own else nearest(name, self.inputs)
            if like:
                raise InputError(
                    f"the estimator knows no {name}",
                    place="sample",
                    hint=f"did you mean {like}? If not, leave it out",
                )
            self._accepted.add(name)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The columns of a sample that are used beside ``time``."""
        return self._engine.inputs

    def update_at(self, time: float, sample: Mapping[str, float | None]) -> Estimate:
        """As `update`, with the instant [s] as an argument beside the sample, and without a check of its names."""
        engine = self._engine
        try:
            status = engine.update(time, sample)
        except struct.error:
            status = self._update_known(time, sample)
        if status:
            raise self._refused(status, {**sample, "time": time})
        return self.latest()

    def latest(self) -> Estimate:
        """The kernel's latest estimate."""
        engine = self._engine
        out = engine.estimate
        return Estimate(out.time, EVENTS[out.event], engine.values(), engine.slots_out)

    def _update_known(self, time: float, sample: Mapping[str, float | None]) -> int:
        """A sample with None values; raises InputError on a value that is not a number."""
        known = {name: value for name, value in sample.items() if value is not None}
        try:
            return self._engine.update(time, known)
        except struct.error:
            raise unusable({**sample, "time": time}, self._engine.inputs) from None

    def update_block(self, recording: Recording) -> Estimates:
        """Process all rows of a recording, as `update` row by row. Raises InputError as `update` does."""
        from terragrip.estimation.forward import run

        return run(self, recording)

    def set_noise(self, sensors: Mapping[str, float], held: Mapping[str, float]) -> None:
        """Use these SDs [SI] by channel and update periods [s] from the next sample on; the estimate continues.

        As for a new estimator: an SD missing in ``sensors`` is the vehicle file's, else a guess; a channel missing in ``held`` is
        not held. Raises InputError as the constructor does.
        """
        self.noise, self.guessed = self._noise(self._engine.inputs, sensors)
        self.held = dict(held)
        self._engine.set_noise(self._settings())

    def new_ground(self) -> None:
        """Forget the adhesion curves (``curve_a``, ``curve_a_<wheel>``), because the ground has changed.

        Without this call a new ground is recognised after a few seconds, in which the intervals are too narrow (docs/kernel.md).
        """
        self._engine.new_ground()

    def snapshot(self) -> bytes:
        """Everything needed to continue later, bit for bit: vehicle, settings and state."""
        about = {
            "vehicle": self.vehicle.to_dict(),
            "method": self.method,
            "noise": self.noise,
            "guessed": self.guessed,
            "held": self.held,
            "channels": self.channels,
            "gap": self.thresholds.gap,
            "standstill_speed": self.thresholds.standstill_speed,
            "together": self.thresholds.together,
            "rims": [asdict(rim) for rim in self.rims],
            "dead_band": self.dead_band,
        }
        text = json.dumps(about).encode()
        body = struct.pack("<I", len(text)) + text + self._engine.snapshot()
        return seal(_SNAPSHOT_MAGIC, body)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies by `snapshot`: a copy goes on by itself, where a plain one would share the kernel's state."""
        return type(self).restore, (self.snapshot(),)

    @classmethod
    @understood()
    def restore(cls, data: bytes) -> Self:
        """The estimator of a snapshot; raises InputError if the bytes are damaged or of another version."""
        body = unseal(_SNAPSHOT_MAGIC, data)
        length = struct.unpack("<I", body[:4])[0]
        about = json.loads(body[4 : 4 + length])
        restored = cls(
            Vehicle.from_dict(about["vehicle"]),
            DEFAULT if about["rims"] else about["method"],
            sensors=about["noise"],
            held=about["held"],
            channels=about["channels"],
            gap=about["gap"],
            standstill_speed=about["standstill_speed"],
            together=about.get("together", 1),
            rims=[Rim(**rim) for rim in about["rims"]],
            dead_band=about["dead_band"],
        )
        restored.guessed = tuple(about["guessed"])
        restored._engine.restore(body[4 + length :])
        return restored

    def _refused(self, status: int, sample: Mapping[str, float | None]) -> InputError:
        if status == 2:
            return unusable(sample, ("time", *self._engine.inputs))
        return refusal(status, f"time {sample.get('time')}")


def default_channels(vehicle: Vehicle) -> tuple[str, ...]:
    """The columns that samples of this vehicle have at least: ground speed, and speeds and torques of driven wheels."""
    driven = vehicle.driven_wheels
    return (*(f"wheel_speed_{w}" for w in driven), "ground_speed", *(f"drive_torque_{w}" for w in driven))


def unusable(sample: Mapping[str, Any], names: Collection[str]) -> InputError:
    """The error that names the value in a sample that is not a finite number."""
    for name in ("time", *names):
        value = sample.get(name)
        try:
            sound = value is None or (not math.isinf(value) and (name != "time" or not math.isnan(value)))
        except (TypeError, OverflowError):
            sound = False
        if not sound or (name == "time" and value is None):
            hint = (
                "every sample needs a time in s"
                if name == "time"
                else "give SI numbers, NaN where not measured"
            )
            return InputError(
                f"{name} is {value!r}", place=f"sample at time {sample.get('time')!r}", hint=hint
            )
    return InputError("a value of the sample is not finite", hint="give SI numbers")

"""Sensors and faults of the scenario file."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from terragrip.document import Fault as Refusal
from terragrip.document import Part
from terragrip.simulation.quantities import Number, PositiveTime, Rate, Ratio, Share, Signed, Time


class Sensor(Part):
    """A sensor: reading = gain x true + offset + drift + noise, at ``rate`` [1/s], ``delay`` [s] late, rounded to
    ``resolution``; per channel, gain - 1 and offset have spreads ``gain_sd`` and ``offset_sd``.

    ``declared_delay`` is what the reader of the log takes off its time stamps. ``dropout``: share of samples lost, in
    spells of mean ``dropout_length`` [s]. ``bandwidth`` [Hz]: first-order low pass. ``drift``: standard deviation of a
    slow error of time constant ``drift_time`` [s]. ``wheels``: only these.
    """

    rate: Rate
    delay: Time = 0.0
    declared_delay: Time = 0.0
    noise: Number = 0.0
    resolution: Number = 0.0
    gain: Signed = 1.0
    gain_sd: Ratio = 0.0
    offset: Signed = 0.0
    offset_sd: Number = 0.0
    drift: Number = 0.0
    drift_time: PositiveTime = 30.0
    bandwidth: Number | None = None
    dropout: Share = 0.0
    dropout_length: Time = 0.0
    wheels: tuple[str, ...] | None = None


class Sensors(Part):
    """The sensors on board; absent: no such channel. Position noise is in metres."""

    wheel_speed: Sensor
    drive_torque: Sensor | None = None
    ground_speed: Sensor | None = None
    drawbar_force: Sensor | None = None
    acceleration: Sensor | None = None
    angular_velocity: Sensor | None = None
    pitch: Sensor | None = None
    vertical_load: Sensor | None = None
    wheel_force: Sensor | None = None
    position: Sensor | None = None


FaultKind = Literal["gap", "loss", "held", "spike", "sign", "dead", "jitter"]


class Fault(Part):
    """A fault on demand, in ``channel`` (a column or a sensor; absent: all) from ``at`` for ``duration`` [s].

    gap: no rows at all; loss: the channel is not measured; held: it repeats its last value; spike: ``count`` single
    samples off by ``size``; sign: it is negated; dead: it reads ``size``; jitter: its stamps scatter by ``size`` [s].
    Without ``at``, ``count`` of them lie anywhere in the run; without ``duration``, it lasts to the end.
    """

    kind: FaultKind
    channel: str | None = None
    at: Time | None = None
    duration: PositiveTime | None = None
    count: Annotated[int, Field(ge=1, le=10000)] = 1
    size: Signed = 0.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind == "gap" and self.duration is None:
            raise Refusal("a gap needs a duration", "add 'duration: 3 s'")
        if self.kind in ("spike", "jitter") and self.size == 0:
            raise Refusal(f"a {self.kind} needs a size", "add 'size:'")
        return self

"""What is simulated: the validated scenario file. Every number is SI; a text may carry a unit (``"30 cm"``).

Where an entry stands in the library, ``use: NAME`` takes it and the keys beside it override: see
:mod:`terragrip.simulation.library`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import pairwise
from math import dist
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from terragrip.document import Fault as Refusal
from terragrip.document import Part, validate
from terragrip.physics.adhesion import CURVES
from terragrip.simulation.quantities import (
    Angle,
    Coordinate,
    Force,
    Length,
    Mass,
    Number,
    PositiveLength,
    PositiveTime,
    Rate,
    Ratio,
    Share,
    Time,
    number_within,
)
from terragrip.simulation.scenario_sensors import Fault, Sensors
from terragrip.vehicle import Vehicle

LONGEST_ROUTE = 20_000.0  # m
LONGEST_RUN = 7200.0  # s: a trace takes 100 kB a second


class Clods(Part):
    """Earth clumps: how many per metre of track, and the mean height and length [m] of the bump a tyre makes of one."""

    density: Number
    height: PositiveLength
    length: PositiveLength


class Soil(Part):
    """A soil: its adhesion curve, rolling resistance ratio (``resistance`` + ``resistance_slip`` |s|), and how they vary.

    Variations are relative standard deviations over ``correlation_length`` [m]; ``roughness`` is the standard
    deviation [m] of the elevation that the tyre feels.
    """

    curve: dict[str, Any]
    resistance: Ratio
    resistance_slip: Ratio = 0.0
    adhesion_variation: Ratio = 0.0
    resistance_variation: Ratio = 0.0
    draught_variation: Ratio = 0.0
    correlation_length: PositiveLength = 1.0
    roughness: Length = 0.0
    clods: Clods | None = None

    @field_validator("curve")
    @classmethod
    def _known_curve(cls, value: dict[str, Any]) -> dict[str, Any]:
        name = value.get("name")
        model = CURVES.get(str(name))
        if model is None:
            raise Refusal("no such curve", f"curves are {', '.join(CURVES)}", ("name",))
        for key, number in value.items():
            if key != "name" and key not in model.names:
                raise Refusal(
                    f"{name} has no such parameter", f"its parameters are {', '.join(model.names)}", (key,)
                )
            if key != "name" and (isinstance(number, bool) or not isinstance(number, int | float)):
                raise Refusal("is not a number", "write a number", (key,))
        return value


class Tool(Part):
    """A towed tool. Draught = (friction x weight + dig_in + added) (1 + draught_speed v), built up over ``shear_length``.

    ``friction`` (draught over weight) and ``dig_in`` [N] are a number or a mapping by soil; ``added`` is extra draught
    [N] by the tool's position: ``[[position, force], ...]``. ``slack`` is the total play of its bar [m].
    """

    mass: Mass
    length: PositiveLength = 2.0
    friction: Ratio | dict[str, Ratio] = 0.0
    dig_in: Force | dict[str, Force] = 0.0
    added: tuple[tuple[Coordinate, Force], ...] = ()
    draught_speed: Ratio = 0.0
    shear_length: PositiveLength = 0.01
    slack: Length = 0.04
    stiffness: Annotated[float, number_within("N/m", high=1e8, above=True)] = 4e4
    damping: Annotated[float, number_within("N s/m")] = 800.0


class Segment(Part):
    """A stretch of one soil; ``length`` [m]."""

    soil: str
    length: PositiveLength


class Plot(Part):
    """A plot of a field: a polygon of one soil, ``corners`` [m, m]."""

    soil: str
    corners: tuple[tuple[Coordinate, Coordinate], ...] = Field(min_length=3)


class Slope(Part):
    """The slope of the ground: ``mean`` along a straight route, and hills of slope ``sd`` over ``length`` [m].

    ``twists``: the hills' heights under the wheels, which lie in no plane, shift loads through a chassis that resists warp;
    then there is no ``robot.load_variation``.
    """

    mean: Angle = 0.0
    sd: Angle = 0.0
    length: PositiveLength = 10.0
    twists: bool = False


class Route(Part):
    """Where it drives: straight over ``segments``, or along ``path`` over ``plots`` on the soil ``around``.

    A border between two soils is a ramp of ``border`` [m]; ``skew`` [m] is how much later the right track meets it on
    a straight route. Corners of the path are rounded by ``turn_radius``.
    """

    segments: tuple[Segment, ...] = ()
    plots: tuple[Plot, ...] = ()
    around: str | None = None
    path: tuple[tuple[Coordinate, Coordinate], ...] = ()
    turn_radius: PositiveLength = 2.0
    border: PositiveLength = 0.4
    skew: Coordinate = 0.1
    slope: Slope = Field(default_factory=Slope)
    start: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    heading: Annotated[float, number_within("rad", -10, 10)] = 0.0
    latitude: Annotated[float, number_within("1", -80, 80)] = 51.0
    longitude: Annotated[float, number_within("1", -180, 180)] = 13.5

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if bool(self.segments) == bool(self.path):
            raise Refusal("needs either segments or a path", "give 'segments:' or 'path:' with 'around:'")
        if self.path and (len(self.path) < 2 or self.around is None):
            raise Refusal("a path needs two points and the soil around", "add 'around: grass'")
        if any(segment.length < 2 * self.border for segment in self.segments):
            raise Refusal("one is shorter than two borders", "lengthen it or narrow 'border:'", ("segments",))
        if self.length > LONGEST_ROUTE:
            raise Refusal(f"is {self.length:g} m long", f"{LONGEST_ROUTE:g} m is the longest", ())
        return self

    @property
    def length(self) -> float:
        """Length [m], corners not yet rounded."""
        if self.segments:
            return sum(segment.length for segment in self.segments)
        return sum(dist(a, b) for a, b in pairwise(self.path))

    def soils(self) -> tuple[str, ...]:
        """Names of the soils on it, each once, in order of appearance."""
        names = [s.soil for s in self.segments] or [str(self.around), *(p.soil for p in self.plots)]
        return tuple(dict.fromkeys(names))


class SoftSpot(Part):
    """A place where wheels sink: at position ``at`` [m], or just before the machine when time ``at_time`` [s] comes.

    Added rolling resistance of the ``front`` and the ``rear`` axle, and the adhesion lost, over ``length`` [m], which begins
    and ends over ``edge`` [m] (default: half the length). Loose ground gives way further: the slip that an adhesion takes is
    1 + ``loosening`` of the ground's own (the shear displacement K of Janosi and Hanamoto). Slip digs wheels in: at full
    slip-sinkage the added resistance is 1 + ``sinkage`` of itself, and ``adhesion_fall`` is lost besides, so that the curve
    peaks and falls; sinkage follows slip over ``sinkage_length`` [m] of the rim's travel. With ``wear``, spinning wheels
    grind the spot away: to 1/e after that much slippage [m].
    """

    at: Coordinate | None = None
    at_time: Time | None = None
    ahead: Coordinate = 0.3
    length: PositiveLength = 0.6
    edge: PositiveLength | None = None
    front: Ratio = 0.0
    rear: Ratio = 0.0
    sinkage: Ratio = 0.0
    sinkage_length: PositiveLength = 0.5
    loosening: Ratio = 0.0
    adhesion_loss: Share = 0.0
    adhesion_fall: Share = 0.0
    wear: PositiveLength | None = None

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.at is None) == (self.at_time is None):
            raise Refusal("needs one place", "give 'at:' [m] or 'at_time:' [s]")
        if self.edge is not None and self.edge > 0.5 * self.length:
            raise Refusal("two edges are longer than it", "shorten 'edge:' to half the length", ("edge",))
        if self.adhesion_loss + self.adhesion_fall > 1:
            raise Refusal("more adhesion is lost than there is", "let both sum to 1", ("adhesion_fall",))
        return self


class Driver(Part):
    """What the operator does when the machine is stuck: waits, more speed, less speed, then pushes until it runs."""

    acts: bool = True
    stuck_ratio: Share = 0.15
    patience: Time = 2.0
    boost: Ratio = 1.4
    boost_time: Time = 2.0
    ease: Ratio = 0.5
    ease_time: Time = 1.0
    push_rate: Force = 100.0
    push_limit: Force = 400.0
    free_ratio: Share = 0.4
    free_time: Time = 1.0


class Robot(Part):
    """What a vehicle file does not hold: tyres, motors, control, and how far the true machine is from its file.

    ``power_limit`` [W] holds for all motors together, ``torque_limit`` [N m] for each wheel. ``chassis_torsion``: force at
    each wheel per metre of warp (one diagonal up). ``slip_speed`` [m/s]: slower than this, slip is taken over this
    speed. ``wheel_radius_sd`` is relative, common to all wheels. ``load_variation``: relative standard deviation by which each
    wheel's load differs from what springs and roughness make it, over ``load_variation_length`` [m] of travel, in no
    relation to the other wheels. ``load_softening``: adhesion at a slip goes as the load to minus this. ``steers``: in a curve
    each side is commanded the speed of its own track (else all wheels turn alike).
    """

    wheel_mass: Mass = 5.4
    tire_stiffness: Annotated[float, number_within("N/m", high=1e8, above=True)] = 8e4
    tire_damping: Annotated[float, number_within("N s/m")] = 600.0
    chassis_torsion: Annotated[float, number_within("N/m", high=1e8)] = 1500.0
    resistance_length: PositiveLength = 0.02
    load_softening: Share = 0.0
    slip_speed: Annotated[float, number_within("m/s", 1e-3, 1)] = 0.05
    wheel_rest_speed: Annotated[float, number_within("rad/s", 1e-4, 1)] = 0.02
    speed_gain: Annotated[float, number_within("N m s/rad")] = 20.0
    speed_integral: Annotated[float, number_within("N m/rad")] = 100.0
    motor_lag: PositiveTime = 0.01
    antiwindup_time: PositiveTime = 0.1
    torque_limit: Annotated[float, number_within("N m", above=True)] = 130.0
    power_limit: Annotated[float, number_within("W", above=True)] = 1600.0
    wheel_radius_sd: Share = 0.0
    load_variation: Annotated[float, number_within("1", 0, 0.3)] = 0.0
    load_variation_length: PositiveLength = 0.25
    steers: bool = False


class Scenario(Part):
    """One drive. ``speed``: points ``[time, speed]`` of the wheels' circumferential speed [m/s], linear between them;
    ``off`` for a speed switches the motors off until the next point."""

    PAGE: ClassVar[str | None] = "simulation#scenarios"

    name: str = ""
    description: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    vehicle: dict[str, Any]
    robot: Robot = Field(default_factory=Robot)
    route: Route
    soils: dict[str, Soil]
    tools: Annotated[tuple[Tool, ...], Field(max_length=2)] = ()
    speed: tuple[tuple[Time, Annotated[float, number_within("m/s", -5, 5)] | Literal["off"]], ...]
    duration: Annotated[float, number_within("s", 0.1, LONGEST_RUN)]
    soft_spots: Annotated[tuple[SoftSpot, ...], Field(max_length=8)] = ()
    driver: Driver = Field(default_factory=Driver)
    sensors: Sensors
    faults: tuple[Fault, ...] = ()
    step: Annotated[float, number_within("s", 1e-6, 0.005)] = 0.001
    log_rate: Rate = 200.0

    @field_validator("speed", mode="before")
    @classmethod
    def _yaml_off(cls, value: Any) -> Any:
        """YAML reads a bare ``off`` as false."""
        if not isinstance(value, list | tuple):
            raise Refusal("is not a list of points", "write e.g. '[[0, 0], [2, 0.6]]'")
        return [[p[0], "off"] if isinstance(p, list) and len(p) == 2 and p[1] is False else p for p in value]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        times = [time for time, _ in self.speed]
        if not times or times[0] != 0 or any(b <= a for a, b in pairwise(times)):
            raise Refusal("times must start at 0 and rise", "put the points in order", ("speed",))
        missing = next((s for s in self.route.soils() if s not in self.soils), None)
        if missing is not None:
            raise Refusal(
                f"the route's soil {missing!r} is not known", f"soils are {', '.join(self.soils)}", ("route",)
            )
        for k, tool in enumerate(self.tools):
            for key in ("friction", "dig_in"):
                figures = getattr(tool, key)
                odd = (
                    next((s for s in figures if s not in self.soils), None)
                    if isinstance(figures, dict)
                    else None
                )
                if odd is not None:
                    raise Refusal(
                        "no such soil", f"soils are {', '.join(self.soils)}", ("tools", k, key, odd)
                    )
        per_row = 1.0 / (self.log_rate * self.step)
        if abs(per_row - round(per_row)) > 1e-6 or per_row < 0.5:
            raise Refusal("must be a whole number of steps", "e.g. step 0.001, log_rate 200", ("log_rate",))
        return self

    @classmethod
    def load(cls, path_or_name: str | os.PathLike[str]) -> Self:
        """Read a scenario of the package by name, or a file (a path, or a name ending in .yaml).

        Raises InputError with the file, the key, its line and the fix.
        """
        from terragrip.simulation.library import scenario_document

        return validate(cls, scenario_document(path_or_name))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], file: str | None = None) -> Self:
        """Build from a mapping as a scenario file holds; raises InputError, which names ``file`` if given."""
        from terragrip.simulation.library import resolve

        return validate(cls, resolve(dict(data), file), file=file)

    def nominal_vehicle(self) -> Vehicle:
        """The vehicle as its user wrote it down, without the simulated machine's errors; raises InputError."""
        return Vehicle.from_dict(self.vehicle, file=self.name or None)

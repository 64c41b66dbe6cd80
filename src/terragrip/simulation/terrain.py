"""The ground of one drive: every field the plant needs, on one grid along the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Floats
from terragrip.physics.adhesion import CURVES
from terragrip.simulation.chassis import hill_loads
from terragrip.simulation.fields import Field, clods, on_grid, roughness, stream
from terragrip.simulation.route import Path, Soils, lay, soils_along
from terragrip.simulation.scenario import Scenario, Soil, Tool
from terragrip.vehicle import Vehicle

SPACING = 0.02  # m, on wheels of WHEEL_RADIUS
WHEEL_RADIUS = 0.2  # m: lengths of what a tyre feels grow with its radius
CURVE_INTERVALS = 1024
_STRIDE = 5  # fields vary over decimetres: every fifth point will do


@dataclass(frozen=True)
class Track:
    """The ground under one wheel track, per grid point (n,); names as in plant.h."""

    soils: Soils
    adhesion_scale: Floats
    resistance: Floats
    slip_resistance: Floats
    elevation: Floats
    gradient: Floats


@dataclass(frozen=True)
class Terrain:
    """The ground along a path: two tracks (left, right), the middle where tools run, slope, and the soils' curves.

    ``curve`` is (soils, intervals + 1, 2): adhesion and its derivative at equally spaced slips 0..1.
    ``friction`` and ``dig_in`` hold an array (n,) per tool.
    """

    names: tuple[str, ...]
    path: Path
    tracks: tuple[Track, Track]
    middle: Soils
    slope: Floats
    altitude: Floats
    curve: Floats
    friction: tuple[Floats, ...]
    dig_in: tuple[Floats, ...]
    spacing: float = SPACING
    load_variation: tuple[Floats, ...] = ()


def build(scenario: Scenario, vehicle: Vehicle, seed: int) -> Terrain:
    """The ground of a scenario for one seed, and what it does to the loads of each of the vehicle's wheels."""
    track_width, wheelbase = vehicle.track or 0.0, vehicle.wheelbase or 0.0
    scale = float(vehicle.wheel_radius.mean()) / WHEEL_RADIUS
    route = scenario.route
    names = route.soils()
    trail = sum(tool.length + tool.slack for tool in scenario.tools)
    path = lay(route, before=trail + 2.0 * scale, after=wheelbase + scale, spacing=SPACING * scale)
    sides = (0.5 * track_width, -0.5 * track_width)
    tracks = tuple(
        _track(scenario, names, path, offset, track_width, scale, seed, ("left", "right")[k])
        for k, offset in enumerate(sides)
    )
    middle = soils_along(route, names, path, 0.0, track_width)
    hills = Field(stream(seed, "slope"), route.slope.length, smooth=True)
    height = route.slope.sd * route.slope.length  # a Gaussian covariance has slope SD sd/length
    slope = route.slope.mean + np.arctan(height * hills.slope(path.east, path.north, path.heading))
    altitude = height * hills.at(path.east, path.north) + np.sin(route.slope.mean) * path.x
    draught = [_draught(scenario, tool, names, path, middle, seed) for tool in scenario.tools]
    return Terrain(
        names=names,
        path=path,
        tracks=(tracks[0], tracks[1]),
        middle=middle,
        slope=slope,
        altitude=altitude,
        curve=np.array([_curve(scenario.soils[name]) for name in names]),
        friction=tuple(friction for friction, _ in draught),
        dig_in=tuple(dig_in for _, dig_in in draught),
        spacing=SPACING * scale,
        load_variation=(
            tuple(hill_loads(scenario, vehicle, path, hills, height))
            if route.slope.twists
            else _load_variation(scenario, vehicle, path, seed)
        ),
    )


def _load_variation(scenario: Scenario, vehicle: Vehicle, path: Path, seed: int) -> tuple[Floats, ...]:
    """What each wheel's load varies by, relative and unknown to any load formula (n,) a wheel; none where the robot has none.

    Gaussian with a Matérn 3/2 covariance in the wheel's own travel (two first-order filters in a row), at most three
    standard deviations.
    """
    from scipy.signal import lfilter

    robot = scenario.robot
    if robot.load_variation <= 0:
        return ()
    keep = float(np.exp(-np.sqrt(3.0) * path.spacing / robot.load_variation_length))
    gain = np.sqrt((1 - keep**2) ** 3 / (1 + keep**2))  # makes the variance 1
    out = []
    for wheel in vehicle.wheels:
        lead = int(10 / (1 - keep))  # by then the filters have settled
        noise = stream(seed, f"load variation {wheel}").standard_normal(lead + len(path.x))
        unit = gain * lfilter([1.0], [1.0, -2 * keep, keep**2], noise)[lead:]
        out.append(robot.load_variation * np.clip(unit, -3.0, 3.0))
    return tuple(out)


def _curve(soil: Soil) -> Floats:
    model = CURVES[str(soil.curve["name"])]
    parameters = {key: float(value) for key, value in soil.curve.items() if key != "name"}
    slip = np.linspace(0.0, 1.0, CURVE_INTERVALS + 1)
    value = model.positive(slip, model.complete(parameters))  # without the intercept of a net-traction form
    return np.stack([value, model.slope(slip, parameters)], axis=1)


def _varied(
    scenario: Scenario,
    names: tuple[str, ...],
    soils: Soils,
    place: tuple[Floats, Floats],
    seed: int,
    what: str,
) -> Floats:
    """A factor of mean 1 (n,) that varies as each soil's ``<what>_variation`` says (log-normal: never negative)."""
    out = np.ones(len(soils.blend))
    for k, name in enumerate(names):
        soil = scenario.soils[name]
        spread = np.sqrt(np.log1p(getattr(soil, f"{what}_variation") ** 2))
        if spread > 0:
            field = Field(stream(seed, f"{what} {name}"), soil.correlation_length)
            share = soils.share(k)
            value = on_grid(field, *place, share > 0, _STRIDE)
            out += share * np.expm1(spread * value - 0.5 * spread**2)
    return out


def _mixed(scenario: Scenario, names: tuple[str, ...], soils: Soils, attribute: str) -> Floats:
    figures = [float(getattr(scenario.soils[name], attribute)) for name in names]
    return _shared(soils, figures)


def _shared(soils: Soils, figures: list[float]) -> Floats:
    """A figure of each soil, mixed as the soils are (n,)."""
    out = np.zeros(len(soils.blend))
    for k, figure in enumerate(figures):
        out += figure * soils.share(k)
    return out


def _track(
    scenario: Scenario,
    names: tuple[str, ...],
    path: Path,
    offset: float,
    width: float,
    scale: float,
    seed: int,
    side: str,
) -> Track:
    soils = soils_along(scenario.route, names, path, offset, width)
    place = path.beside(offset)
    resistance = _varied(scenario, names, soils, place, seed, "resistance")
    elevation = _mixed(scenario, names, soils, "roughness") * roughness(
        stream(seed, f"roughness {side}"), len(path.x), path.spacing, scale
    )
    elevation = elevation + _clods(scenario, names, soils, path, seed, side)
    return Track(
        soils=soils,
        adhesion_scale=_varied(scenario, names, soils, place, seed, "adhesion"),
        resistance=resistance * _mixed(scenario, names, soils, "resistance"),
        slip_resistance=resistance * _mixed(scenario, names, soils, "resistance_slip"),
        elevation=elevation,
        gradient=np.gradient(elevation, path.spacing),
    )


def _clods(
    scenario: Scenario, names: tuple[str, ...], soils: Soils, path: Path, seed: int, side: str
) -> Floats:
    out = np.zeros(len(path.x))
    for k, name in enumerate(names):
        spec = scenario.soils[name].clods
        if spec is not None:
            ones = np.ones(len(path.x))
            rng = stream(seed, f"clods {name} {side}")
            out += clods(rng, path.x, spec.density * soils.share(k), spec.height * ones, spec.length * ones)
    return out


def _draught(
    scenario: Scenario, tool: Tool, names: tuple[str, ...], path: Path, middle: Soils, seed: int
) -> tuple[Floats, Floats]:
    factor = _varied(scenario, names, middle, (path.east, path.north), seed, "draught")
    friction = _shared(middle, [_of(tool.friction, name) for name in names])
    dig_in = _shared(middle, [_of(tool.dig_in, name) for name in names])
    if tool.added:
        positions, forces = np.array(tool.added).T
        dig_in += np.interp(path.x, positions, forces)
    return factor * friction, factor * dig_in


def _of(value: float | dict[str, float], soil: str) -> float:
    """A tool's figure on a soil; a soil that a tool has no figure for is taken as the mean of those it has."""
    if isinstance(value, dict):
        return value[soil] if soil in value else float(np.mean(list(value.values())))
    return value

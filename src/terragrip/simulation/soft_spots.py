"""Drives that try a warning of immobilization: into soft spots, and over rough ground that is healthy (R).

Both are families: a seed draws soil, tool, speed and what lies in the way from ranges that hold most field robots' work.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES as CURVE_MODELS
from terragrip.simulation.fields import stream
from terragrip.simulation.library import library_soil
from terragrip.simulation.scenario import Scenario
from terragrip.units import STANDARD_GRAVITY

CURVES = ("prototype", "peaking")
"""The soil around: the paper's prototype curve, or Burckhardt's form, which peaks and falls as sand and snow do."""

WORK = 0.6
"""Share of what the ground bears at 25 % of slip that a healthy drive asks for."""
SOFTNESS = (0.9, 1.4)
"""What a soft spot asks for over what it bears, before wheels sink in by slip."""
WEIGHT, TOOL_WEIGHT = 139 * STANDARD_GRAVITY, 60 * STANDARD_GRAVITY
"""N, of the library's robot and cultipacker."""

_SOILS = ("fine", "wet", "coarse")
_ROUGH = {"density": 0.8, "height": 0.015, "length": 0.25}

Tree = dict[str, Any]


def soft_spot_drive(
    seed: int,
    curve: str = "prototype",
    *,
    rate: float = 100.0,
    drawbar: bool = True,
    ground_rate: float | None = None,
) -> Scenario:
    """A drive at a steady command into one soft spot, 40 s long; the driver does nothing about it.

    Drawn by ``seed``: soil, draught, speed .3 to .8 m/s, and the spot: 3 to 8 m long, beginning over a fifth to a half of
    it, with the adhesion it takes, the resistance it adds (so that ``SOFTNESS`` of what it bears is asked for), and how
    both get worse as wheels sink in. Some stop the machine, some only slow it: the truth's ``stuck`` tells.

    ``rate`` [1/s] of the sensors; ``drawbar``: with a drawbar cell; ``ground_rate`` [1/s]: the ground speed of a slow
    receiver. Raises InputError on another ``curve``.
    """
    rng = stream(seed, f"soft spot {curve}")
    ground = _ground(rng, curve)
    capacity = _capacity(ground)
    friction = rng.uniform(0.1, 0.6) * capacity * WEIGHT / TOOL_WEIGHT
    loss, softness = rng.uniform(0.05, 0.35), rng.uniform(*SOFTNESS)
    adhesion = capacity + float(ground["resistance"])  # of the ground; the spot takes `loss` of it
    added = softness * adhesion * (1 - loss) - float(ground["resistance"]) - friction * TOOL_WEIGHT / WEIGHT
    length, share = rng.uniform(3.0, 8.0), rng.uniform(0.3, 0.7)
    spot = {
        "at": 7.0 + 0.5 * length,
        "length": length,
        "edge": rng.uniform(0.2, 0.5) * length,
        "front": 2 * share * max(added, 0.0),
        "rear": 2 * (1 - share) * max(added, 0.0),
        "sinkage": rng.uniform(0.2, 1.0),
        "sinkage_length": rng.uniform(0.4, 1.5),  # a third of a turn of the wheel to more than a whole one
        "loosening": rng.uniform(
            1.0, 3.0
        ),  # K of 2 to 4 cm, loose sand or snow, against 1 cm of firm soil (Wong)
        "adhesion_loss": loss,
        "adhesion_fall": rng.uniform(0.1, 0.5),
    }
    speed = rng.uniform(0.3, 0.8)
    name = f"soft-spot-{curve}-{seed}"
    return Scenario.from_dict(
        {
            "name": name,
            "seed": seed,
            "sensors": _sensors(rate, drawbar, ground_rate),
            "soils": {"ground": ground},
            "route": {
                "segments": [{"soil": "ground", "length": 40.0}],
                "slope": {"sd": rng.uniform(0.0, 0.03), "length": 8.0},
            },
            "tools": [{"use": "cultipacker", "friction": {"ground": friction}}],
            "speed": [[0, "off"], [2, 0], [3, speed], [40, speed]],
            "duration": 40.0,
            "soft_spots": [spot],
            "driver": {"acts": False},
        },
        file=name,
    )


def healthy_drive(
    seed: int,
    curve: str = "prototype",
    *,
    duration: float = 120.0,
    rate: float = 100.0,
    drawbar: bool = True,
    ground_rate: float | None = None,
    faults: bool = False,
) -> Scenario:
    """A rough but healthy drive: clods, hills, loads that come, hit and go, speed changes, stops and starts.

    ``duration`` [s]. Stops are commanded; draught, hills and loads together ask for no more than what the ground bears
    (``WORK`` of it), short hits for more. Variations of the ground may still stop the machine: the truth's ``stuck``
    tells. Sensors as in `soft_spot_drive`, with ``faults`` also losses, gaps, spikes and held values. Raises InputError on
    another ``curve``.
    """
    rng = stream(seed, f"healthy {curve}")
    ground = _ground(rng, curve)
    spare = WORK * _capacity(ground)
    hills, pulls = spare * rng.dirichlet((1.0, 1.0, 1.0))[:2]
    length = 0.85 * duration + 5
    name = f"healthy-{curve}-{seed}"
    return Scenario.from_dict(
        {
            "name": name,
            "seed": seed,
            "sensors": _sensors(rate, drawbar, ground_rate),
            "faults": _faults(duration) if faults else [],
            "soils": {"ground": ground},
            "route": {
                "segments": [{"soil": "ground", "length": length}],
                "slope": {"sd": hills / 2.5, "length": rng.uniform(5.0, 12.0)},
            },
            "tools": [
                {
                    "use": "cultipacker",
                    "friction": {"ground": pulls * WEIGHT / TOOL_WEIGHT},
                    "added": _loads(rng, length, (spare - hills - pulls) * WEIGHT),
                }
            ],
            "speed": _speeds(rng, duration),
            "duration": duration,
            "driver": {"acts": False},
        },
        file=name,
    )


def _capacity(soil: Tree) -> float:
    """Pull over weight that a soil bears at 25 % of slip."""
    model = CURVE_MODELS[soil["curve"]["name"]]
    figures = {key: value for key, value in soil["curve"].items() if key != "name"}
    adhesion = float(model.positive(np.array([0.25]), model.complete(figures))[0])
    return adhesion - float(soil["resistance"]) - 0.25 * float(soil["resistance_slip"])


def _speeds(rng: np.random.Generator, duration: float) -> list[list[Any]]:
    """Commands: speeds held for 6 to 15 s, and at times a stop, a rest and a start."""
    points: list[list[Any]] = [[0, "off"], [2, 0]]
    time = 2.0
    while time < duration:
        ramp, speed, hold = rng.uniform(0.3, 2.0), rng.uniform(0.25, 0.85), rng.uniform(6, 15)
        points += [[time + ramp, speed], [time + ramp + hold, speed]]
        time += ramp + hold
        if rng.uniform() < 0.3:
            stop, rest = rng.uniform(0.3, 1.5), rng.uniform(1, 4)
            points += [[time + stop, 0], [time + stop + rest, 0]]
            time += stop + rest
    return points


def _loads(rng: np.random.Generator, length: float, most: float) -> list[list[float]]:
    """Extra draught by position [m, N]: stretches of up to ``most``, and short hits on roots and stones."""
    points, x = [[0.0, 0.0]], 2.0
    while x < length:
        if rng.uniform() < 0.5:
            ramp, size, stay = rng.uniform(0.3, 2.0), most * rng.uniform(0.4, 1.0), rng.uniform(2, 6)
        else:
            ramp, size, stay = rng.uniform(0.02, 0.08), rng.uniform(80, 300), rng.uniform(0.01, 0.04)
        points += [[x, 0.0], [x + ramp, size], [x + ramp + stay, size], [x + 2 * ramp + stay, 0.0]]
        x += 2 * ramp + stay + rng.uniform(1.0, 5.0)
    return points


def _ground(rng: np.random.Generator, curve: str) -> Tree:
    """A soil: one of the paper's, or a sand whose curve peaks and falls; half of them with clods."""
    if curve not in CURVES:
        raise InputError(f"no such curve {curve!r}", hint=f"curves are {', '.join(CURVES)}")
    soil: Tree = dict(library_soil(str(rng.choice(_SOILS))))
    if curve == "peaking":
        c1, c2, c3 = rng.uniform(0.5, 0.75), rng.uniform(10, 25), rng.uniform(0.1, 0.3)
        soil["curve"] = {"name": "burckhardt", "c1": c1, "c2": c2, "c3": c3}
        soil["resistance_slip"] = rng.uniform(0.05, 0.15)
    if rng.uniform() < 0.5:
        soil["clods"] = dict(_ROUGH)
        soil["roughness"] = 0.006
    return soil


def _faults(duration: float) -> list[Tree]:
    """Defects of a log, as many a minute as in `accuracy-faults`."""
    minutes = duration / 60
    return [
        {"kind": "loss", "channel": "ground_speed", "duration": 6, "count": max(1, round(minutes / 2))},
        {"kind": "gap", "duration": 0.6, "count": max(1, round(minutes))},
        {"kind": "spike", "channel": "ground_speed", "size": 0.8, "count": max(1, round(6 * minutes))},
        {"kind": "spike", "channel": "wheel_speed_fr", "size": 3, "count": max(1, round(3 * minutes))},
        {"kind": "held", "channel": "ground_speed", "duration": 0.5, "count": max(1, round(minutes))},
    ]


def _sensors(rate: float, drawbar: bool, ground_rate: float | None) -> Tree:
    """The sensor set ``clean`` at another rate, without reference force and position."""
    fitted: Tree = {"use": "clean", "wheel_force": None, "position": None}
    for name in ("wheel_speed", "drive_torque", "drawbar_force", "acceleration", "angular_velocity", "pitch"):
        fitted[name] = {"rate": rate}
    fitted["ground_speed"] = {"rate": ground_rate or rate}
    if ground_rate is not None:
        fitted["ground_speed"] |= {"noise": 0.04, "dropout": 0.02, "dropout_length": 1.0}
    if not drawbar:
        fitted["drawbar_force"] = None
    return fitted

"""False warnings, and false `stuck`, over patches of poor adhesion that a machine goes over.

    python benchmarks/warning_patches.py [--machines 44] [--seed 5720000] [--rate 10] [--by-momentum] [--coarse]

Development machines (terragrip.simulation.families) at a steady command over up to six patches that take adhesion and nothing
else. In balance they slip by .22 to .38 and cross within 1 to 2.5 s; --by-momentum: patches bear .2 to .8 of what is asked. --coarse:
the coarse sensors. No drawbar cell. A warning is false where no stop follows within 8 s, `stuck` where the machine never stops, or
more than half a second later.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from bench_warning import Tally, course_of, judge, starts, without
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.simulation import simulate
from terragrip.simulation.families import Kind, machines, scenario
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Scenario, Segment, SoftSpot
from terragrip.units import STANDARD_GRAVITY

PATCHES = 6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=44)
    parser.add_argument("--seed", type=int, default=5720000)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--by-momentum", action="store_true")
    parser.add_argument("--coarse", action="store_true")
    arguments = parser.parse_args()
    total, stuck, go_on, drives = Tally(), 0, 0, 0
    for kind, seed in machines("development", arguments.machines, arguments.seed):
        chosen = Kind(kind.mass, kind.curve, "coarse") if arguments.coarse else kind
        made = over_patches(chosen, seed, arguments.rate, arguments.by_momentum)
        if made is None:
            continue
        result = simulate(made, seed)
        course = course_of(result, False)
        try:
            warnings, said = starts(without(result.recording), result.vehicle)
        except InputError as error:
            print(f"left out: {error}", file=sys.stderr)
            continue
        total.add(judge(course, warnings, said))
        stuck += sum(not one >= course.stop - 0.5 for one in said)
        go_on += np.isnan(course.stop)
        drives += 1
    print(
        f"{drives} drives, {go_on} never stop: {total.false} false warnings in {total.seconds / 3600:.2f} h, {stuck} false stuck"
    )


def over_patches(kind: Kind, seed: int, rate: float, by_momentum: bool) -> Scenario | None:
    """A digging drive with patches in place of its soft spot; None where its ground leaves room for none."""
    made = scenario(kind, seed, rate=rate, task="digging")
    rng = stream(seed, f"{'momentum' if by_momentum else 'patches'} {kind}")
    vehicle, tool, soil = made.nominal_vehicle(), made.tools[0], made.soils["soil1"]
    curve = dict(soil.curve)
    model = CURVES[curve.pop("name")]
    figures = model.complete(curve)
    size, base = (vehicle.mass / 139.0) ** (1 / 3), vehicle.wheelbase or 0.0
    level, start = float(made.speed[-1][1]), made.speed[-2][0]
    asked = tool.friction["soil1"] * tool.mass / vehicle.mass + soil.resistance
    inertia = 1 + tool.mass / vehicle.mass
    if by_momentum:
        level *= rng.uniform(1, 1.6)
    spots, at = [], (10.0 if by_momentum else 8.0) * size
    for _ in range(PATCHES):
        if by_momentum:
            last, bears = rng.uniform(0.12, 0.4), asked * rng.uniform(0.2, 0.8)
            loss = max(1 - bears / max(model.positive(np.array([0.2, 0.4, 0.6, 0.9]), figures)), 0.02)
            way = level**2 * (1 - last**2) * inertia / (2 * STANDARD_GRAVITY * (asked - bears))
            length, loosening, edge = rng.uniform(0.5, 0.9) * way + 0.5 * base, 1.0, 0.1
            fits = length <= 20 * size
        else:
            slip, loosening = rng.uniform(0.22, 0.38), rng.uniform(1, 3)
            loss = 1 - asked / float(model.positive(np.array([slip / (1 + loosening)]), figures)[0])
            fits = loss >= 0.02
            if fits:
                length = max(rng.uniform(1.0, 2.5) * level * (1 - slip), 1.5 * base + 0.5 * size)
                length, edge = min(length, 10 * size), rng.uniform(0.1, 0.3)
        if not fits:
            continue
        spots.append(
            SoftSpot(
                at=at + 0.5 * length,
                length=length,
                edge=edge * length,
                loosening=loosening,
                adhesion_loss=min(loss, 0.95),
            )
        )
        at += length + rng.uniform(10 if by_momentum else 8, 15) * size
    if not spots:
        return None
    duration = start + (1.4 if by_momentum else 1.3) * at / level
    everywhere = {"at": 0.0, "length": 20 * at}  # where slip-sinkage is, it is all the way
    sinkage = tuple(one.model_copy(update=everywhere) for one in made.soft_spots[:-1])
    segment = Segment(soil="soil1", length=2 * at)
    return made.model_copy(
        update={
            "name": f"{kind}-healthy-{seed}",
            "soft_spots": (*sinkage, *spots),
            "speed": (*made.speed[:-2], (start, level), (duration, level)),
            "duration": duration,
            "route": made.route.model_copy(update={"segments": (segment,)}),
        }
    )


if __name__ == "__main__":
    main()

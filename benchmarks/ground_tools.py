"""Changes of the ground in field work: lanes with a tool in the ground, headlands where it is raised.

    python benchmarks/ground_tools.py [--machines 32] [--seed 9930000] [--rate 20] [--write]

Development machines (terragrip.simulation.families) that drive four lanes over two or three soils. The tool's draught, a quarter to
six tenths of what the softest soil bears, comes and goes within a second, two to ten lengths from each turn. With a drawbar cell,
and the same logs without it. A change near a border is that border's, the first of each; near the tool's coming or going it is the tool's
(what is near both is left out), and every other one is false for another reason. --write puts the table into docs/ground.md.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ground_families import borders
from marked import put
from terragrip.estimation import Estimates, estimate
from terragrip.ground.analysis import Settings, analyse
from terragrip.recording import Recording
from terragrip.simulation import SimulationResult, simulate
from terragrip.simulation.families import Kind, machines, scenario
from terragrip.simulation.family_soils import NoSinkage, capacity
from terragrip.simulation.fields import stream
from terragrip.simulation.scenario import Route, Scenario, Tool
from terragrip.soil.estimates import whole_length
from terragrip.units import STANDARD_GRAVITY

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/ground.md"
BEGIN = "<!-- made by benchmarks/ground_tools.py --write -->"
LANES, STRIPS = 4, 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=32)
    parser.add_argument("--seed", type=int, default=9930000)
    parser.add_argument("--rate", type=float, default=20.0)
    parser.add_argument("--write", action="store_true", help="put the table into docs/ground.md")
    arguments = parser.parse_args()
    counted: Counter[tuple[str, str, str, str]] = Counter()
    for kind, seed in machines("development", arguments.machines, arguments.seed):
        result = simulate(field_work(kind, seed, arguments.rate), seed)
        measured = estimate(result.recording, result.vehicle)
        spans = [(first, last) for first, last, *_ in borders(measured, result)]
        logs = {"no cell": estimate(without_cell(result.recording), result.vehicle)}
        if "drawbar_force" in result.recording.channels:
            logs["cell"] = measured
        for log, estimates in logs.items():
            for online in (False, True):
                way = "while driving" if online else "afterwards"
                for whose, cause in whose_changes(estimates, result, spans, online):
                    counted[log, way, whose, cause] += 1
    lines = [
        f"{arguments.machines} development machines from seed {arguments.seed}, {arguments.rate:g} Hz. "
        "Of so many changes so many are said to be the ground's alone:",
        "",
        "| log | way | of borders | of the tool | others |",
        "|---|---|---:|---:|---:|",
    ]
    for log in ("cell", "no cell"):
        for way in ("afterwards", "while driving"):
            cells = []
            for whose in ("border", "tool", "other"):
                alone, both = (counted[log, way, whose, cause] for cause in ("ground", "tool or ground"))
                cells.append(f"{alone} of {alone + both}")
            lines.append(f"| {log} | {way} | {' | '.join(cells)} |")
    print("\n".join(lines))
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))


def field_work(kind: Kind, seed: int, rate: float) -> Scenario:
    """A machine's scenario with lanes, headlands and a tool in place of its route."""
    made = scenario(kind, seed, rate=rate, duration=60.0)
    rng, vehicle, names = stream(seed, f"field {kind}"), made.nominal_vehicle(), made.route.soils()
    size = (vehicle.mass / 139.0) ** (1 / 3)
    beat, lane, wide = float(np.sqrt(size)), 60.0 * size, 6.0 * size
    bears = min(capacity(made.soils[name].model_dump(), NoSinkage()) for name in names)
    pull = max(bears, 0.05) * rng.uniform(0.25, 0.6) * vehicle.mass * STANDARD_GRAVITY
    speed = 0.8 * max(float(v) for _, v in made.speed if v != "off")
    ramp, spare = speed * rng.uniform(0.5, 1.0), 8.0 * size
    points, added = [(0.0, 0.0)], [(0.0, 0.0)]
    for k in range(LANES):
        far, begin = lane * ((k + 1) % 2), k * (lane + wide)
        points += [(far, k * wide), (far, (k + 1) * wide)][: 2 if k < LANES - 1 else 1]
        down, up = begin + spare, begin + lane - spare
        added += [(down, 0.0), (down + ramp, pull), (up, pull), (up + ramp, 0.0)]
    plots = []
    for k in range(1, STRIPS):
        left, right = k * lane / STRIPS, (k + 1 + k // (STRIPS - 1)) * lane / STRIPS
        corners = [(left, -wide), (right, -wide), (right, 9 * wide), (left, 9 * wide)]
        plots.append({"soil": names[k % len(names)], "corners": corners})
    tool = {"mass": 0.3 * vehicle.mass, "length": 2.0 * size, "friction": 0.01, "added": added, "slack": 0.0}
    bar = {"stiffness": 180.0 * vehicle.mass / size, "damping": 4.0 * vehicle.mass / beat}
    duration = 5 * beat + (LANES * (lane + wide) - 2 * wide) / speed
    everywhere = {"at": 0.0, "length": 20 * LANES * lane}  # where slip-sinkage is, it is all the way
    return made.model_copy(
        update={
            "route": Route(
                path=points, around=names[0], plots=plots, border=made.route.border, turn_radius=2.5 * size
            ),
            "tools": (Tool(**tool, **bar),),
            "speed": ((0.0, "off"), (2 * beat, 0.0), (3 * beat, speed), (duration, speed)),
            "duration": duration,
            "soft_spots": tuple(one.model_copy(update=everywhere) for one in made.soft_spots),
        }
    )


def without_cell(recording: Recording) -> Recording:
    """The recording without its drawbar force."""
    channels = {name: values for name, values in recording.channels.items() if name != "drawbar_force"}
    shown = np.logical_or.reduce([np.isfinite(values) for values in channels.values()])
    return replace(recording, channels=channels).select(shown)


def whose_changes(
    estimates: Estimates, result: SimulationResult, spans: list[tuple[float, float]], online: bool
) -> Iterator[tuple[str, str]]:
    """Of each change whose it is in truth, and its cause."""
    time, draught = (result.truth[name].to_numpy() for name in ("time", "true_draught_1"))
    second = max(round(0.5 / float(np.median(np.diff(time)))), 1)
    draught = np.convolve(draught, np.ones(second) / second, "same")
    down = draught > 0.5 * np.quantile(draught, 0.8)
    moves = time[np.flatnonzero(down[1:] != down[:-1])]
    margin = max(2.0, 0.5 * whole_length(estimates.vehicle) / float(np.median(estimates["ground_speed"])))
    free = list(spans)
    for change in analyse(estimates, settings=Settings(online=online))[0].changes:
        near = [(a, b) for a, b in free if a - margin <= change.time <= b + margin]
        tools = bool((np.abs(moves - change.time) <= margin).any())
        if near:
            free.remove(near[0])
        if not (near and tools):
            yield "border" if near else "tool" if tools else "other", change.cause


if __name__ == "__main__":
    main()

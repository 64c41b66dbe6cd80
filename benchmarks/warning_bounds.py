"""What a warning of immobilization could be at all: on development machines, against detectors that know what no machine knows.

    python benchmarks/warning_bounds.py [--stops 60] [--seed 0] [--write]

Four grounds and sensors, all of them development (docs/families.md): the development kinds; their masses and curves with the coarse
set of sensors; the development kinds with soft ground whose edge is a fifth as long and whose adhesion falls twice as far; and both.

true slip: how long before the stop the mean slip, by the truth, last passed 20 % and 30 %: what a threshold gains that neither lags nor
errs. A healthy drive under load comes near 20 %. not to be seen: stops before which the measured ground speeds, weighed by a detector that
knows the course of the slip and the noise beforehand (a matched filter), depart from their usual by less than SURE of its SDs: at
two looks a second, noise alone does that once in half an hour. best test: how many that filter is expected to miss, as noise also hides
what is a little above SURE. Torques are not in that bound. --write puts the table into docs/warning.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from bench_warning import SLOW, Course, course_of, judge, starts, without
from marked import put
from terragrip.simulation import SimulationResult, families, simulate
from terragrip.simulation.families import Kind

SURE = 3.5
RATES = (100.0, 10.0)
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/warning.md"
BEGIN = "<!-- made by benchmarks/warning_bounds.py --write -->"
GROUNDS = ("development", "coarse sensors", "sharp edges", "coarse sensors, sharp edges")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stop:
    """Of one stop [s]: the warning's lead (NaN: missed), the time since true slip passed 20 and 30 %; the SDs by which speeds
    show it."""

    lead: float
    since: tuple[float, float]
    shown: float
    slow: bool


def drives(ground: str, count: int, seed: int, rate: float) -> Iterator[SimulationResult]:
    for kind, number in families.machines("development", count, seed):
        chosen = Kind(kind.mass, kind.curve, "coarse") if "coarse sensors" in ground else kind
        scenario = families.scenario(chosen, number, rate=rate, task="digging")
        if "sharp edges" in ground:
            *others, spot = scenario.soft_spots
            fall = min(2 * spot.adhesion_fall, 1.0 - spot.adhesion_loss)
            sharp = spot.model_copy(update={"edge": 0.2 * (spot.edge or 0.0), "adhesion_fall": fall})
            scenario = scenario.model_copy(update={"soft_spots": [*others, sharp]})
        yield simulate(scenario, number)


def stop_of(result: SimulationResult) -> Stop | None:
    """None where the machine does not stop."""
    course = course_of(result, digging=True)
    tally = judge(course, *starts(without(result.recording), result.vehicle))
    if not tally.stops:
        return None
    since = tuple(_since(result, course, level) for level in (0.2, 0.3))
    lead = tally.leads[0] if tally.leads else np.nan
    return Stop(lead, (since[0], since[1]), _shown(result, course), course.speed <= SLOW)


def _speeds(result: SimulationResult) -> tuple[Array, Array]:
    """True mean rim speed of the driven wheels and true ground speed [m/s], row by row."""
    vehicle, truth = result.vehicle, result.truth
    driven = zip(vehicle.wheels, vehicle.wheel_radius, vehicle.driven, strict=True)
    rims = [np.abs(truth[f"true_wheel_speed_{w}"].to_numpy()) * r for w, r, on in driven if on]
    return np.mean(rims, axis=0), np.abs(truth["true_ground_speed"].to_numpy())


def _since(result: SimulationResult, course: Course, level: float) -> float:
    """Time from when the mean slip last was below ``level`` to the stop [s]."""
    rim, speed = _speeds(result)
    below = (course.time <= course.stop) & (1 - speed / np.maximum(rim, 1e-3) < level)
    return course.stop - float(course.time[below][-1])


def _shown(result: SimulationResult, course: Course) -> float:
    """SDs of its own noise by which the best linear detector sees the measured ground speed fall between edge and stop."""
    rim, speed = _speeds(result)
    measured = result.recording.channels["ground_speed"]
    rows = np.isfinite(measured) & (course.time < course.stop)
    driving = rows & (course.time < course.edge) & (rim > 0.5 * course.speed)
    usual = np.median((speed / np.maximum(rim, 1e-3))[driving]) if driving.any() else 1.0
    lost = np.maximum(usual * rim - speed, 0.0)[rows & (course.time >= course.edge)]
    return float(np.sqrt(np.sum(lost**2)) / np.std((measured - speed)[rows]))


def row(ground: str, rate: float, stops: list[Stop]) -> str:
    def median(values: list[float]) -> str:
        return f"{np.nanmedian(values):.1f}" if len(values) else "–"

    slow = [s for s in stops if s.slow]
    cells = [ground, f"{rate:g}", str(len(stops)), str(sum(np.isnan(s.lead) for s in stops))]
    cells.append(str(sum(s.shown < SURE for s in stops)))
    cells.append(f"{sum(norm.sf(s.shown - SURE) for s in stops):.0f}")
    cells.append(str(sum(np.isnan(s.lead) and s.shown < SURE for s in stops)))
    for some in (stops, slow):
        cells += [median([s.lead for s in some]), *(median([s.since[k] for s in some]) for k in (0, 1))]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--stops", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="of the first machine")
    parser.add_argument("--write", action="store_true", help="put the table into docs/warning.md")
    arguments = parser.parse_args()
    head = [
        "drives",
        "Hz",
        "stops",
        "missed",
        "not to be seen by speeds",
        "best test misses",
        "not to be seen, and missed",
    ]
    for what in ("", ", up to 1 m/s"):
        head += [f"lead{what} (s)", f"true slip at 20 %{what} (s)", f"at 30 %{what} (s)"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for ground in GROUNDS:
        for rate in RATES:
            found = [stop_of(result) for result in drives(ground, arguments.stops, arguments.seed, rate)]
            lines.append(row(ground, rate, [stop for stop in found if stop is not None]))
            print(lines[-1], flush=True)
    text = "\n".join(lines)
    if arguments.write:
        put(DOCUMENT, BEGIN, f"Machines from seed {arguments.seed}, `--stops {arguments.stops}`.\n\n{text}")


if __name__ == "__main__":
    main()

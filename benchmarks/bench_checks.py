"""What each limit of the checks of a log does: halved and doubled, false alarms and mistakes that are found.

    python benchmarks/bench_checks.py [--machines 24] [--only NAME ...] [--write]

The limits are those of recording/codes.py, pace.py, frozen.py, turns.py, dropouts.py, stretches.py, copies.py,
rest.py, rolling.py, turn_rates.py, forces.py, those of pitch.py for a zero that moves and its fewest samples, sides.py's
_APART and _SPUN, torques.py's least thrust and missing signs, plain_units.py's hour and empty machine, those of rescaled.py and leaps.py,
and mechanics.py's stretch and offset.
Right logs are development drives of three chassis (sprung, rigid, rolling), in turn at the rate drawn, 100, 20 and 10 Hz, and
the measured logs of ../shared/data; a false alarm is a log of them with a note. Mistakes are put into every third of the drives (torques
without a sign into all logs that have negative ones); one is found where its own note comes.

--write puts the table into docs/checks.md.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import importlib
import io
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bench_real_logs import EXAMPLES, SHARED, SOURCES
from marked import put
from terragrip.cli import main as terragrip
from terragrip.errors import InputError
from terragrip.formats import read
from terragrip.recording import Recording, once
from terragrip.recording.plausibility import CHECKS, _Log
from terragrip.simulation import families
from terragrip.units import STANDARD_GRAVITY
from terragrip.vehicle import Vehicle

BEGIN = "<!-- made by benchmarks/bench_checks.py --write -->"
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/checks.md"
RATES = (None, 100.0, 20.0, 10.0)
LIMITS = {
    "codes": "_FASTEST _SMALLEST _WEIGHTS _CODES _TIMES _BEYOND _MOST _SHORT _FEWEST _LEAP",
    "pace": "GRIP _OFTEN _OUTRUN _SPREAD _PART _DRIFT _CERTAIN _EVENLY _SHARED _COPY _DRIVEN",
    "frozen": "_TIMES _FINE _NOISY _CHANGED _COARSE _SEVERAL _CHANGES _GAINED _OFTEN _SECOND _RUN _RESOLVED _SHARE _LEAST _OFTENER _COMES",
    "turns": "SURE LEAST_TURN _CLEAR _SIZES _WIDE _OTHER _SURELY",
    "dropouts": "_BLINK _GOES_ON _SURE _FEWEST",
    "copies": "_NOISY _CHANNELS _CHANGES",
    "rest": "_STILL _ROLLING_OUT _SHIFT _SURE _ALIKE _TURNED _HELD _STOPS _THRUST _ONE_WHEEL _SLOPE",
    "forces": "_CALM _SLOW _MOVING _SLIP _LEAST _STARTS _COMMANDED _SURE _ALIKE _ACCELERATION _FORCE",
    "stretches": "LONG DRIVING _GAP _APART _LOOKS _STAYS",
    "torques": "_LEAST _MOVES _STEADY _NEAR _DIPS _BRAKES _FEWEST _AS_HARD",
    "pitch": "_FEWEST _LONG _MOVED _BEYOND",
    "rescaled": "_COARSEST _LONG _SPEED _TORQUE _BEYOND_SPEED _BEYOND_TORQUE _EVEN _PULLING _SHARE",
    "leaps": "_LEAST _BEYOND _SURE _STEPS _HALF _REST _SOON",
    "mechanics": "_STRETCH _OFFSET",
    "plain_units": "_ON_TIME _EMPTY",
    "sides": "_APART _SPUN",
    "rolling": "_LIGHT _RADIUS _TYRE _LIGHTEST _PULLING _MOST _RADII_SURE _SLOWER_LEAST _SURE _TURNING",
    "ground_noise": "_TWICE",
    "axles": "_LEAST _PULLING _STRAIGHT _SLIP _RADII _UNEVEN _SURE _RESTORED",
    "turn_rates": "_ALIKE _SCRUBBED _STEERED _MOST",
}
SHARES = {
    ("turns", "_CLEAR"),
    ("turns", "_SURELY"),
    ("pace", "_OFTEN"),
    ("rolling", "_MOST"),
    ("turn_rates", "_ALIKE"),
}
"""Of which the distance to 1 is halved and doubled."""

TURNS = ("angular_velocity_z", "latitude", "longitude")
"""Channels that show them."""

UNSIGNED = "have no sign"
"""Words of the note on it."""

Log = tuple[Recording, Vehicle]


def drives(count: int) -> list[Log]:
    """Development machines of each chassis."""
    result = []
    for chassis in ("sprung", "rigid", "rolling"):
        for k, (kind, seed) in enumerate(families.machines("development", count, 0, chassis)):  # type: ignore[arg-type]
            drawn = families.draw(kind, seed, rate=RATES[k % len(RATES)])
            result.append((drawn.recording, drawn.vehicle))
    return result


def measured() -> list[Log]:
    """The measured logs that have a vehicle, read as bench_real_logs does."""
    result = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for source in SOURCES:
            if not source.machine or source.name == "Husky":
                continue
            where = EXAMPLES / source.machine
            for k, file in enumerate(sorted((SHARED / "data").glob(source.files))):
                log, profile = source.prepare(file, folder), where / source.profile
                if not source.profile:
                    profile = folder / f"{source.name}{k}.yaml"
                    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                        terragrip(["inspect", str(log), "--write-profile", str(profile)])
                with contextlib.suppress(InputError):
                    result.append((read(log, profile), Vehicle.load(where / "vehicle.yaml")))
    return result


def changed(log: Recording, *words: str, by: Callable[[np.ndarray], Any]) -> Recording:
    """The log with the channels of some beginning changed."""
    channels = {n: by(v) if n.startswith(words) else v for n, v in log.channels.items()}
    return replace(log, channels=channels, delay=None)


def spoilt(log: Recording, vehicle: Vehicle) -> Iterator[tuple[str, str, Recording, Vehicle]]:
    """A name for each mistake, words of its note, the log with it, and the vehicle."""
    time, some = log.time, np.random.default_rng(3).random(len(log)) < 0.01
    middle = 0.5 * (time[0] + time[-1])
    late = (time > middle) & (time < middle + 8.0)
    row = int(np.argmax(late))
    torques = [n for n in log.channels if n.startswith("drive_torque_")]
    if any(np.nanmin(log.channels[n]) < 0 for n in torques):
        yield "torques without sign", UNSIGNED, changed(log, "drive_torque", by=np.abs), vehicle
    if not torques or not set(vehicle.wheels) <= set(log.wheels):
        return
    rims = [
        log.channels[f"wheel_speed_{w}"] * r
        for w, r in zip(vehicle.wheels, vehicle.wheel_radius, strict=True)
    ]

    def held(values: np.ndarray) -> np.ndarray:
        known = np.isfinite(values)
        return np.where(late & known, values[row:][known[row:]][0], values)

    size = float(np.nanquantile(np.abs(log.channels["ground_speed"]), 0.95))
    yield (
        "code 9999 in the speed",
        "a code for",
        changed(log, "ground_speed", by=lambda v: np.where(some, 9999.0, v)),
        vehicle,
    )
    yield (
        "code -99999 in a torque",
        "a code for",
        changed(log, torques[0], by=lambda v: np.where(some, -99999.0, v)),
        vehicle,
    )
    yield "time in minutes", "not be in seconds", replace(log, time=time / 60), vehicle
    ground, known = log.channels["ground_speed"], np.isfinite(log.channels["ground_speed"])
    fast = np.interp(time - 0.01 * (time - time[0]), time[known], ground[known])
    yield (
        "clocks 1 % apart",
        "drift apart",
        log.with_channels(ground_speed=np.where(known, fast, np.nan)),
        vehicle,
    )
    yield "odometry", "odometry", log.with_channels(ground_speed=np.mean(rims, axis=0)), vehicle
    rest = 0.08 * size
    yield "ground speed's zero", "zero is off", changed(log, "ground_speed", by=lambda v: v + rest), vehicle
    yield "speed held 8 s", "repeats", changed(log, "ground_speed", by=held), vehicle
    yield "torque held 8 s", "repeats", changed(log, torques[0], by=held), vehicle
    yield "hung 8 s", "the logger hung", changed(log, "", by=held), vehicle
    yield (
        "all speeds held 8 s",
        "All speeds keep",
        changed(log, "ground_speed", "wheel_", by=held),
        vehicle,
    )
    early = np.searchsorted(time, time[row] - 8.0)
    second = np.arange(early, early + late.sum())
    yield (
        "8 s written twice",
        "wrote a buffer twice",
        changed(log, "", by=lambda v: np.concatenate([v[:row], v[second], v[row + len(second) :]])),
        vehicle,
    )
    yield (
        "torque 0 for 8 s",
        "while all other torques",
        changed(log, torques[0], by=lambda v: np.where(late, 0.0, v)),
        vehicle,
    )
    yield (
        "wheel 0 for 8 s",
        "while the vehicle drives",
        changed(log, f"wheel_speed_{vehicle.wheels[0]}", by=lambda v: np.where(late, 0.0, v)),
        vehicle,
    )
    first = log.channels[torques[0]]
    most = float(np.nanquantile(first, 0.9))
    yield (
        "torque cut",
        "and never more",
        log.with_channels(**{torques[0]: np.fmin(first, most) + 0 * first}),
        vehicle,
    )
    yield (
        "speed in steps",
        "comes in steps",
        changed(log, "ground_speed", by=lambda v: np.round(4 * v / size) * size / 4),
        vehicle,
    )
    yield "radii 8 % small", "slower than the ground", log, with_radii(vehicle, 0.92)
    yield "radii 6 % large", "With hardly a torque", log, with_radii(vehicle, 1.06)
    yield (
        "gear ratio 1.25",
        "With hardly a torque",
        changed(log, "wheel_speed", by=lambda v: 1.25 * v),
        vehicle,
    )
    zero = 0.05 * vehicle.mass * STANDARD_GRAVITY * float(np.mean(vehicle.wheel_radius)) / len(torques)
    yield (
        "torques' zeros .05",
        "drive torques read the same",
        changed(log, "drive_torque", by=lambda v: v + zero),
        vehicle,
    )
    load = vehicle.mass * np.linspace(0.4, 0.1, len(time))
    yield "mass of the load alone", "of the load alone", log.with_channels(mass=load), vehicle
    yield (
        "summer time",
        "summer time",
        replace(log, time=np.where(time > middle, time + 3600.0, time)),
        vehicle,
    )
    zeros = np.random.default_rng(5).random(len(log)) < 0.03
    yield (
        "zeros in the speed",
        "zeros for values",
        changed(log, "ground_speed", by=lambda v: np.where(zeros & np.isfinite(v), 0.0, v)),
        vehicle,
    )
    yield "torque over 25", "drive torques over", changed(log, "drive_torque", by=lambda v: v / 25), vehicle
    mean = np.nanmean([log.channels[n] for n in torques], axis=0)
    yield "one torque for all", "are one signal", log.with_channels(**dict.fromkeys(torques, mean)), vehicle
    if {"acceleration_x", "pitch"} <= log.channels.keys():
        yield (
            "accelerometer's zero moved .3",
            "zero of one of the two moved",
            changed(log, "acceleration_x", by=lambda v: np.where(time > middle, v + 0.3, v)),
            vehicle,
        )
        yield (
            "accelerometer .5 off",
            "its bias or its mounting",
            changed(log, "acceleration_x", by=lambda v: v + 0.5),
            vehicle,
        )
    first = f"wheel_speed_{vehicle.wheels[0]}"
    blind = replace(log, channels={n: v for n, v in log.channels.items() if not n.startswith(TURNS)})
    yield "one rim 1.2 times", "Straight ahead the rim", changed(blind, first, by=lambda v: 1.2 * v), vehicle
    if "acceleration_x" in log.channels:
        yield (
            "accelerometer in g",
            "may be in g",
            changed(log, "acceleration_x", by=lambda v: v / 9.80665),
            vehicle,
        )
    yield (
        "rim 1.1 times from the middle",
        "its scale changed",
        changed(log, first, by=lambda v: np.where(time > middle, 1.1 * v, v)),
        vehicle,
    )
    yield (
        "ground 1.1 times from the middle",
        "go slower than their hubs",
        changed(log, "ground_speed", by=lambda v: np.where(time > middle, 1.1 * v, v)),
        vehicle,
    )
    yield (
        "torques .5 times from the middle",
        "neither the motion",
        changed(log, "drive_torque", by=lambda v: np.where(time > middle, 0.5 * v, v)),
        vehicle,
    )
    pounds = changed(log, "drive_torque", by=lambda v: v / 1.356)
    yield "torques in lbf ft", "In starts and stops", pounds, vehicle
    if "drawbar_force" in log.channels:
        drift = 0.2 * vehicle.mass * STANDARD_GRAVITY * (time - time[0]) / (time[-1] - time[0])
        yield (
            "drawbar drifts by .2",
            "drawbar_force drifts",
            changed(log, "drawbar_force", by=lambda v: v + drift),
            vehicle,
        )
        balance = "In starts and stops"
        yield "torques 1.5 times", balance, changed(log, "drive_torque", by=lambda v: 1.5 * v), vehicle
        yield "mass 1.6 times", balance, log, with_mass(vehicle, 1.6)
    if vehicle.sensors.ground_speed:
        yield "noise of a data sheet", "ground_speed: noise of", log, with_noise(vehicle, 0.25)
    if sum(axle.driven for axle in vehicle.axles.values()) > 1:
        yield "ballast", "check the masses of the axles", log, with_ballast(vehicle, 0.4)
    if vehicle.track:
        yield (
            "track doubled",
            "In turns the hubs",
            log,
            Vehicle.from_dict({**vehicle.to_dict(), "track": 2 * vehicle.track}),
        )


def with_radii(vehicle: Vehicle, factor: float) -> Vehicle:
    """The vehicle with all radii times a factor."""
    data = vehicle.to_dict()
    for part in (data, *data["axles"].values()):
        if part.get("wheel"):
            part["wheel"]["radius"] *= factor
    return Vehicle.from_dict(data)


def with_mass(vehicle: Vehicle, factor: float) -> Vehicle:
    """The vehicle with its mass, and that of its axles, times a factor."""
    data = vehicle.to_dict()
    for part in (data, *data["axles"].values()):
        part["mass"] *= factor
    return Vehicle.from_dict(data)


def with_noise(vehicle: Vehicle, factor: float) -> Vehicle:
    """The vehicle with the ground speed's stated noise times a factor."""
    data = vehicle.to_dict()
    data["sensors"]["ground_speed"] *= factor
    return Vehicle.from_dict(data)


def with_ballast(vehicle: Vehicle, share: float) -> Vehicle:
    """The vehicle with a share of its first driven axle's mass on the next one."""
    data = vehicle.to_dict()
    first, second, *_ = [data["axles"][name] for name, axle in vehicle.axles.items() if axle.driven]
    moved = share * first["mass"]
    first["mass"] -= moved
    second["mass"] += moved
    return Vehicle.from_dict(data)


class Replay(_Log):
    """A log whose checks are made again for a limit only where one reads it, or asks another one whose sentences changed."""

    again: Callable[[Replay, str], bool] | None = None

    def found(self, name: str) -> list[str]:
        self.asked.add(name)
        if self.again is not None and name not in self.seen:
            self.seen.add(name)
            if self.again(self, name):
                del self._found[name]
        return super().found(name)

    def part(self, found: dict[str, list[str]]) -> Replay:
        """The log with what is ``found`` in it, and nothing else made of it."""
        once._MADE.clear()
        result = copy.copy(self)
        result._found, result.asked, result.seen = found, set(), set()
        return result


class Case:
    """What the checks say of a log with the limits as they are, and which limits each of them reads."""

    def __init__(self, log: Recording, vehicle: Vehicle) -> None:
        self.log, self.vehicle = log, vehicle
        self.plain, self.codes = reading(lambda: Replay(log, vehicle))
        whole = self.plain.part({})
        self.said = {check.name: whole.found(check.name) for check in CHECKS}
        self.reads, self.asks = dict[str, set[str]](), dict[str, set[str]]()
        for name in self.said:
            one = self.plain.part({other: said for other, said in self.said.items() if other != name})
            self.reads[name] = reading(lambda one=one, name=name: one.found(name))[1]
            self.asks[name] = one.asked - {name}

    def notes(self, limit: str | None = None) -> list[str]:
        """What they say with another value of a ``limit``."""

        def again(log: Replay, name: str) -> bool:
            asked = (log.found(other) != self.said[other] for other in self.asks[name])
            return limit in self.reads[name] or any(asked)

        part = self.plain.part(dict(self.said))
        part.again = again
        if limit in self.codes and (other := Replay(self.log, self.vehicle)).codes != self.plain.codes:
            part = other.part({})
        return [note for check in CHECKS for note in part.found(check.name)]


def reading(make: Callable[[], Any]) -> tuple[Any, set[str]]:
    """What a function gives, and the limits, as module.NAME, that the code names which it runs."""
    ran: set[tuple[str, Any]] = set()
    sys.setprofile(lambda frame, *_: ran.add((frame.f_globals.get("__name__", ""), frame.f_code)))
    try:
        result = make()
    finally:
        sys.setprofile(None)
    return result, {limit for home, code in ran for limit in limits_in(home, code)}


@cache
def limits_in(home: str, code: Any) -> frozenset[str]:
    """The limits that a function's code names, its module's own and those that others lend it."""
    own, names = home.rpartition(".")[2], set(code.co_names)
    return frozenset(
        f"{module}.{name}"
        for module, listed in LIMITS.items()
        for name in names & set(listed.split())
        if module == own or name[0] != "_"
    )


def counts(
    right: list[Case], real: list[Case], wrong: list[tuple[str, str, Case]], limit: str | None = None
) -> tuple[int, int, dict[str, int]]:
    """False alarms on drives and on measured logs, and mistakes found, by name, with another value of a ``limit``."""
    found = dict.fromkeys((name for name, *_ in wrong), 0)
    for name, words, case in wrong:
        found[name] += any(words in note for note in case.notes(limit))
    return *(sum(bool(case.notes(limit)) for case in cases) for cases in (right, real)), found  # type: ignore[return-value]


@contextlib.contextmanager
def at(module: str, name: str, value: float) -> Iterator[None]:
    """A limit with another value, also where its module lends it to others."""
    lent = name[0] != "_"
    modules = [home for home in sys.modules if home.startswith("terragrip.recording.")]
    homes = [sys.modules[home] for home in modules if home.endswith(f".{module}") or lent]
    homes = [home for home in homes if hasattr(home, name)]
    usual = [getattr(home, name) for home in homes]
    for home in homes:
        setattr(home, name, value)
    yield
    for home, one in zip(homes, usual, strict=True):
        setattr(home, name, one)


def moved(module: str, name: str, value: float, factor: float) -> float:
    """A limit halved or doubled; a count stays one, a share is moved by its distance to 1."""
    if (module, name) in SHARES:
        return 1 - (1 - value) * factor
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--machines", type=int, default=24, help="of each chassis")
    parser.add_argument("--only", nargs="+", help="these limits, as module.NAME")
    parser.add_argument("--write", action="store_true", help="put the table into docs/checks.md")
    arguments = parser.parse_args()
    logs = drives(arguments.machines), measured()
    wrong = [
        (name, words, Case(*log))
        for k, one in enumerate([*logs[0], *logs[1]])
        for name, words, *log in spoilt(*one)
        if words == UNSIGNED or (k % 3 == 0 and k < len(logs[0]))
    ]
    right, real = ([Case(*log) for log in part] for part in logs)
    usual = counts(right, real, wrong)
    total = {name: sum(one == name for one, *_ in wrong) for name in usual[2]}
    head = ", ".join(f"{name} {usual[2][name]} of {total[name]}" for name in total)
    lines = [
        f"As they are: {usual[0]} false alarms on {len(right)} drives and {usual[1]} on {len(real)} measured logs; found: {head}.",
        "",
        "| limit | value | halved: drives | measured | found | doubled: drives | measured | found |",
        "|---|---:|---:|---:|---|---:|---:|---|",
    ]
    print(lines[0], flush=True)
    for module, names in LIMITS.items():
        home = importlib.import_module(f"terragrip.recording.{module}")
        for name in names.split():
            if arguments.only and f"{module}.{name}" not in arguments.only:
                continue
            value = getattr(home, name)
            cells = [f"`{module}.{name}`", f"{value:g}"]
            for factor in (0.5, 2.0):
                with at(module, name, moved(module, name, value, factor)):
                    alarms, on_real, found = counts(right, real, wrong, f"{module}.{name}")
                change = [f"{n} {found[n] - usual[2][n]:+d}" for n in found if found[n] != usual[2][n]]
                cells += [f"{alarms - usual[0]:+d}", f"{on_real - usual[1]:+d}", ", ".join(change) or "-"]
            lines.append("| " + " | ".join(cells) + " |")
            print(lines[-1], flush=True)
    if arguments.write:
        put(DOCUMENT, BEGIN, "\n".join(lines))
        print(f"written to {DOCUMENT}")


if __name__ == "__main__":
    main()

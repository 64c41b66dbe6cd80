"""Sixteen logs as loggers of other makes would write them, of one simulated drive: the headers are made up by us, the truth is known.

Columns, what they hold and which channel they are stand in made_up_loggers.csv: one row a column, ``value = factor * signal + offset``.
Ten loggers were looked at while the rules of `inspect` were repaired, six (``held`` = 1) once afterwards.
"""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Truth = dict[str, tuple[list[list[str]], str | None]]

TABLE = Path(__file__).with_suffix(".csv")
_RATE, _SECONDS, _TOP, _TRACK = 20.0, 180.0, 3.0, 1.6  # Hz, s, m/s, m
_RADII = {"fl": 0.4, "fr": 0.4, "rl": 0.6, "rr": 0.6}


@cache
def drive() -> dict[str, Floats]:
    """Signals (n,) in SI of a small tractor: it stands, accelerates, turns both ways, climbs and stops; slip about 12 %."""
    random = np.random.default_rng(16)
    time = np.arange(int(_SECONDS * _RATE)) / _RATE
    shape = np.interp(
        time,
        [0, 8, 16, 60, 66, 80, 84, 120, 150, 160, 172, 180],
        [0, 0, 1, 0.9, 0.5, 0.5, 0.8, 1, 0.7, 0.9, 0, 0],
    )
    speed = np.convolve(np.pad(_TOP * shape, 20, mode="edge"), np.ones(41) / 41, "valid")
    speed = np.clip(speed + 0.04 * _TOP * np.sin(0.7 * time) * (speed > 0.3), 0, None)
    turn = np.interp(time, [58, 62, 70, 74, 82, 118, 124, 132, 138], [0, 0.35, 0.35, 0, 0, 0, -0.3, -0.3, 0])
    turn *= speed > 0.1
    heading = 0.7 + np.cumsum(turn) / _RATE  # from east, to the left
    pitch, roll = np.radians(2.5) * np.sin(time / 14), np.radians(1.5) * np.sin(time / 8 + 1)
    slip = 0.12 + 0.04 * np.sin(time / 9)
    acceleration = np.gradient(speed, time)
    east, north = np.cumsum(speed * np.cos(heading)) / _RATE, np.cumsum(speed * np.sin(heading)) / _RATE

    def noise(size: float) -> Floats:
        return size * random.standard_normal(len(time))

    pull = (2500 + 900 * np.sin(time / 11)) * (speed > 0.1) + noise(40)
    result = {
        "time": time, "ground": speed + noise(0.02), "target": np.round(3.6 * speed) / 3.6, "wheels": speed / (1 - slip) + noise(0.01),
        "ground_1hz": np.repeat((speed + noise(0.02))[::20], 20), "distance": np.cumsum(speed) / _RATE, "slip": slip,
        "rate": turn + noise(0.004), "heading": heading, "compass": (90 - np.degrees(heading)) % 360, "pitch": pitch, "roll": roll,
        "rate_x": np.gradient(roll, time) + noise(0.004), "rate_y": -np.gradient(pitch, time) + noise(0.004),
        "acc_x": acceleration + 9.80665 * np.sin(pitch) + noise(0.08), "acc_z": 9.80665 + noise(0.12),
        "acc_y": speed * turn - 9.80665 * np.sin(roll) + noise(0.08), "acc_turn": np.gradient(turn, time) + noise(0.01),
        "latitude": 48.4 + north / 111_190, "longitude": 11.7 + east / (111_320 * np.cos(np.radians(48.4))),
        "altitude": 465 + np.cumsum(speed * np.sin(pitch)) / _RATE, "vel_n": speed * np.sin(heading), "vel_e": speed * np.cos(heading),
        "vel_d": -speed * np.sin(pitch) + noise(0.02), "odom_x": np.cumsum(speed / (1 - slip) * np.cos(heading)) / _RATE,
        "odom_y": np.cumsum(speed / (1 - slip) * np.sin(heading)) / _RATE, "pull": pull, "engine": 157 + 12 * np.sin(time / 5) + noise(1),
        "load": 0.38 + 0.12 * np.sin(time / 11) + noise(0.015), "noise": noise(1.0), "one": np.ones(len(time)),
    }  # fmt: skip
    for wheel, radius in _RADII.items():
        side = -1 if wheel[1] == "l" else 1
        rim = (speed + side * turn * _TRACK / 2) / (1 - slip)
        result[f"w_{wheel}"] = np.where(speed > 0.02, rim / radius, 0) + noise(0.005)
        result[f"rim_{wheel}"] = radius * result[f"w_{wheel}"]
        result[f"angle_{wheel}"] = np.cumsum(result[f"w_{wheel}"]) / _RATE
        force = (1400 * (acceleration + 0.08 * 9.80665) + pull) / 4
        result[f"torque_{wheel}"] = force * radius * (speed > 0.02) + noise(4)
    return result


@cache
def loggers() -> dict[str, list[dict[str, str]]]:
    """The rows of the table, by logger."""
    result: dict[str, list[dict[str, str]]] = {}
    with TABLE.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            result.setdefault(row["logger"], []).append(row)
    return result


def is_held_out(logger: str) -> bool:
    """Whether a logger was looked at only after the rules stood."""
    return loggers()[logger][0]["held"] == "1"


def write(logger: str, folder: Path) -> Path:
    """The logger's file: with semicolons and decimal commas where its first column says so."""
    rows, signals = loggers()[logger], drive()
    separator, point = rows[0]["separator"], "," if rows[0]["separator"] == ";" else "."
    table = [float(row["factor"]) * signals[row["signal"]] + float(row["offset"]) for row in rows]
    lines = [separator.join(row["column"] for row in rows)]
    lines += [
        separator.join(f"{x:.12g}".replace(".", point) for x in values) for values in zip(*table, strict=True)
    ]
    path = folder / f"{logger}.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def truth(logger: str) -> Truth:
    """Which columns may be which channel, and in which unit; columns of one channel whose rows share a ``group`` go together."""
    ways: dict[str, dict[str, list[str]]] = {}
    units: dict[str, str | None] = {}
    for row in loggers()[logger]:
        if row["channel"]:
            ways.setdefault(row["channel"], {}).setdefault(row["group"] or row["column"], []).append(
                row["column"]
            )
            unit = row["unit"] or None
            units[row["channel"]] = unit if units.get(row["channel"], unit) == unit else None
    return {channel: (list(groups.values()), units[channel]) for channel, groups in ways.items()}

"""CAN frames of a tractor whose slip is known, written as every kind of log."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import can
import numpy as np

WHEEL_BASED, GROUND_BASED = 0x0CFE48F0, 0x0CFE4980
START = 1_700_000_000.0

Frame = tuple[float, int, bytes]


@dataclass(frozen=True)
class Drive:
    """What truly happened, and the frames that tell of it. ``scale``: the tractor's supposed radius over the true one."""

    time: np.ndarray
    speed: np.ndarray
    slip: np.ndarray
    scale: float
    frames: list[Frame]


def drive(seed: int, duration: float = 400.0, scale: float = 1.03) -> Drive:
    """A drive with headlands of 1 % slip and work of 12 %: wheel-based speed at 10 Hz, ground speed at 5 Hz."""
    draws = np.random.default_rng(seed)
    time = np.arange(0, duration, 0.1)
    speed = 2.0 + 0.5 * np.sin(time / 20) + 0.2 * np.sin(time / 3)
    slip = np.where(time % 100 < 60, 0.12 + 0.02 * np.sin(time / 7), 0.01)
    slip = np.convolve(np.pad(slip, 10, mode="edge"), np.ones(21) / 21, "valid")
    frames = []
    for k, (t, v, s) in enumerate(zip(time.tolist(), speed, slip, strict=True)):
        rim = scale * v / (1 - s) + 0.01 * draws.standard_normal()
        frames.append((START + t, WHEEL_BASED, payload(rim)))
        if k % 2 == 0:
            frames.append((START + t + 0.004, GROUND_BASED, payload(v + 0.02 * draws.standard_normal())))
    return Drive(time, speed, slip, scale, frames)


def payload(speed: float, *, direction: int = 1) -> bytes:
    """Payload of wheel-based or ground-based speed and distance [m/s]."""
    return struct.pack("<HIBB", round(speed * 1000), 0, 255, 0xFC | direction)


def write_log(path: Path, frames: list[Frame], *, extended: bool = True) -> Path:
    """Write frames as the kind of log that the suffix names, by python-can."""
    with can.Logger(path) as log:
        for time, identifier, data in frames:
            log.on_message_received(
                can.Message(
                    timestamp=time, arbitration_id=identifier, is_extended_id=extended, data=data, channel=0
                )
            )
    return path

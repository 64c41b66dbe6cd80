"""Whatever a log holds, calibrate says what it can and cannot tell; it neither fails nor warns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terragrip.estimation import calibrate
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

Make = Callable[..., Recording]
VEHICLE = Vehicle.from_dict(
    {
        "mass": 50.0,
        "wheelbase": 0.5,
        "center_of_gravity_height": 0.2,
        "hitch_height": 0.2,
        "axles": {"front": {"mass": 20.0, "wheels": ["l", "r"]}, "rear": {"mass": 30.0, "wheels": ["b"]}},
        "wheel": {"radius": 0.15, "inertia": 0.05},
    }
)
KINDS = ("zero", "constant", "noise", "sine", "gaps", "spikes")


def channel(kind: str, t: np.ndarray, level: float, rng: np.random.Generator) -> np.ndarray:
    noise = rng.standard_normal(len(t))
    values = {
        "zero": 0 * t,
        "constant": level + 0 * t,
        "noise": level * noise,
        "sine": level * np.sin(t / 3),
        "gaps": np.where(np.arange(len(t)) % 7, np.nan, level + 0.1 * noise),
        "spikes": level + 1e6 * (rng.uniform(size=len(t)) < 0.01),
    }[kind]
    values[0] = level  # no channel is wholly empty: the reader sees to that
    return values


@settings(max_examples=40)
@given(
    kinds=st.lists(st.sampled_from(KINDS), min_size=9, max_size=9),
    level=st.sampled_from([1e-9, 0.3, 5.0, 1e4]),
    seconds=st.sampled_from([0.02, 3.0, 60.0]),
    seed=st.integers(0, 99),
)
def test_any_log(kinds: list[str], level: float, seconds: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.02)
    names = ["ground_speed", "drawbar_force", "acceleration_x", *(f"wheel_speed_{w}" for w in "lrb"),
             *(f"drive_torque_{w}" for w in "lrb")]  # fmt: skip
    log = Recording(t, {n: channel(k, t, level, rng) for n, k in zip(names, kinds, strict=True)})
    result = calibrate(log, VEHICLE)
    for quantity in result.quantities:
        assert np.isfinite([quantity.value, quantity.std, *quantity.interval]).all()
        assert quantity.samples > 0
    assert result.quantities or result.unknown
    assert "quantity" in result.table()


def test_rates_that_differ_give_the_same_gains(drive: Make, vehicle: Vehicle) -> None:
    gain = (1.02, 0.98, 1.01, 0.99)
    log = drive(gain=gain, standing=10)
    row = np.arange(len(log))
    sparse = {"ground_speed": 3, "drawbar_force": 5, "drive_torque_fl": 2, "wheel_speed_rr": 4}
    thin = log.with_channels(**{n: np.where(row % k, np.nan, log[n]) for n, k in sparse.items()})
    whole, part = calibrate(log, vehicle), calibrate(thin, vehicle)
    for wheel in vehicle.wheels:
        name = f"drive_torque_gain {wheel}"
        assert part[name].value == pytest.approx(whole[name].value, abs=3e-3)


def test_a_note_names_the_log_that_it_is_about(drive: Make, vehicle: Vehicle) -> None:
    """Of several logs by one profile one may be in other units; a note that all share names none."""
    right, other = drive(seed=1, standing=10), drive(seed=2, standing=10)
    other = other.with_channels(ground_speed=3.6 * other["ground_speed"])
    (note,) = [note for note in calibrate([right, other], vehicle).notes if "km/h" in note]
    assert note.startswith("log 2: ")
    assert not any(note.startswith("log ") for note in calibrate([other, other], vehicle).notes)

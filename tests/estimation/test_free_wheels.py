"""Free wheels that no sensor watches (casters, a tractor's front wheels): they roll with the ground (made log)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator, calibrate, estimate
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

MASS, REAR, LENGTH, TRACK, RADIUS, CASTER, AHEAD = 100.0, 65.0, 0.7, 0.6, 0.2, 0.1, 0.3
SLIP, MU, RHO, G = 0.06, 0.12, 0.05, 9.80665
TIRE = 0.02


def mower(**more: object) -> Vehicle:
    """Two driven wheels behind, two casters in front; the antenna is ahead of the driven axle."""
    free = {
        "driven": False,
        "steered": True,
        "bearing_resistance": 0,
        "wheel": {"radius": CASTER, "inertia": 0.002},
    }
    return Vehicle.from_dict(
        {
            "mass": MASS,
            "wheelbase": LENGTH,
            "track": TRACK,
            "center_of_gravity_height": 0.0,
            "antenna": {"x": AHEAD},
            "axles": {
                "front": {"mass": MASS - REAR, "wheels": ["fl", "fr"], **free},
                "rear": {"mass": REAR, "wheels": ["rl", "rr"]},
            },
            "wheel": {"radius": RADIUS, "inertia": 0.05},
            "tire_rolling_resistance": TIRE,
            "uncertainty": {"wheel_radius": 0.005},
            **more,
        }
    )


def drive(seed: int = 1) -> Recording:
    """Straight on and round curves of 2 m at .8 m/s, 25 Hz, after a stop; the ground speed at 5 Hz, as positions give it."""
    rng, time = np.random.default_rng(seed), np.arange(0, 120, 0.04)
    white = lambda sd: sd * rng.standard_normal(len(time))  # noqa: E731
    speed = 0.8 * np.clip((time - 6) / 3, 0, 1)
    yaw = np.convolve(
        np.where(time % 30 > 18, 0.4 * np.where(time % 60 > 30, 1, -1), 0.0), np.ones(25) / 25, "same"
    )
    yaw *= speed / 0.8
    moves, pull = np.tanh(speed / 0.02), (MU + TIRE) * REAR / 2 * G * RADIUS
    columns = {
        "time": time,
        "ground_speed": np.where(
            np.arange(len(time)) % 5 == 0, np.hypot(speed, AHEAD * yaw) + white(0.01), np.nan
        ),
        "angular_velocity_z": yaw + white(0.002),
    }
    for wheel, side in (("rl", TRACK / 2), ("rr", -TRACK / 2)):
        columns[f"wheel_speed_{wheel}"] = (speed - side * yaw) / (1 - SLIP) / RADIUS + white(0.01)
        columns[f"drive_torque_{wheel}"] = pull * moves + white(0.2)
    return Recording.from_frame(columns)


def test_they_need_no_column() -> None:
    """Their speed was asked for as ground speed over radius; of a speed by positions no profile could give that, and with the antenna's
    place the track was then named as wrong."""
    log = drive()
    found = estimate(log, mower())
    driving = log.time > 20
    for wheel in ("rl", "rr"):
        assert abs(np.median(found[f"slip_{wheel}"][driving]) - SLIP) < 0.005
        held = np.abs(found[f"slip_{wheel}"] - SLIP) < 1.96 * found[f"slip_{wheel}_std"]
        assert np.mean(held[driving]) > 0.9
        assert abs(np.median(found[f"adhesion_{wheel}"][driving]) - MU) < 0.01
    # what the driven wheels pull, less what the tyres of the free ones take
    assert (
        abs(np.median(found["soil_resistance"][driving]) - (MU * REAR - TIRE * (MASS - REAR)) / MASS) < 0.01
    )
    assert np.nanmax(np.abs(np.nanmedian(found["slip_fl"][driving]))) < 0.005
    assert any(note.startswith("No speed of fl, fr in the log") for note in found.notes)
    assert not [
        note for note in found.notes if "hubs differ" in note or "exchanged" in note or "guess" in note
    ]


def test_a_lost_receiver_leaves_adhesion_and_ends_no_slip() -> None:
    """With their speeds made of the ground speed, these were lost with it, and so was all that needs every wheel's speed."""
    log = drive()
    lost = (log.time > 60) & (log.time < 70)
    ground = np.where(lost, np.nan, log.channels["ground_speed"])
    found = estimate(log.with_channels(ground_speed=ground), mower())
    inside = (log.time > 63) & (log.time < 70)
    assert np.isfinite(found["adhesion_rl"][inside]).all()
    assert np.mean(np.abs(found["slip_rl"] - SLIP)[inside] < 1.96 * found["slip_rl_std"][inside]) > 0.9


def test_samples_and_snapshots_give_the_digits_of_the_log_and_a_measured_wheel_counts() -> None:
    log, machine = drive(), mower()
    whole = estimate(log, machine)
    one = TractionEstimator.for_recording(log, machine)
    for k in range(700):
        if k == 600:
            one = TractionEstimator.restore(one.snapshot())
        out = one.update({"time": log.time[k], **{n: float(v[k]) for n, v in log.channels.items()}})
    assert out["adhesion_rl"] == whole["adhesion_rl"][699]
    spins = {"time": float(log.time[700]), "wheel_speed_fl": 16.0, "wheel_speed_fr": 16.0}
    for k in range(100):
        out = one.update({**spins, "time": spins["time"] + 0.04 * k, "ground_speed": 0.8})
    assert out["slip_fl"] == pytest.approx(0.5, abs=0.05)


def test_a_driven_wheel_and_a_misspelt_free_one_are_still_asked_for() -> None:
    log = drive()
    without = replace(log, channels={n: v for n, v in log.channels.items() if n != "wheel_speed_rl"})
    with pytest.raises(InputError, match="column wheel_speed_rl: is missing"):
        estimate(without, mower())
    with pytest.raises(InputError, match="wheel_speed_fl"):
        estimate(log.with_notes("Columns that are not used: wheelspeed_fl."), mower())


def test_calibrate_gives_them_no_radius() -> None:
    """A speed that was made of the ground speed 'determined' the radius by which it had been made."""
    found = calibrate([drive(k) for k in range(2)], mower())
    radii = {q.wheel: q for q in found.quantities if q.key == "wheel_radius"}
    assert not {"fl", "fr"} & radii.keys()

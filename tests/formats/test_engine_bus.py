"""Engine torque on a J1939 bus: EEC1, EEC3 and the engine configuration, through the shipped tractor profile."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

import terragrip as tg
from can_frames import START, WHEEL_BASED, payload, write_log
from terragrip.formats import inspect

EEC1, EEC3, GROUND_BASED = 0x0CF00400, 0x18FEDF00, 0x0CFE4980
VEHICLE = {
    "mass": 6000.0,
    "wheelbase": 2.6,
    "center_of_gravity_height": 0.9,
    "hitch_height": 0.5,
    "axles": {
        "front": {"mass": 2500.0, "wheels": ["fl", "fr"]},
        "rear": {"mass": 3500.0, "wheels": ["rl", "rr"]},
    },
    "wheel": {"radius": 0.8, "inertia": 50.0},
    "driveline": {"efficiency": 0.85, "accessory_power": 8000.0, "reference_torque": 800.0},
}


def bus(path: Path) -> Path:
    """A minute of a J1939 bus, written to a log."""
    frames = []
    for k in range(600):
        time = START + 0.1 * k
        # 70 % of 800 N m, 8 % of it the engine's own friction, at 1600 rpm.
        frames.append((time, EEC1, struct.pack("<BBBHBBB", 0xF0, 195, 195, 12800, 255, 255, 255)))
        frames.append((time, EEC3, bytes([133]) + b"\xff" * 7))
        frames.append((time + 0.002, WHEEL_BASED, payload(2.0 + 0.001 * (k % 3))))
        frames.append((time + 0.004, GROUND_BASED, payload(2.0 + 0.001 * (k % 2))))
    return write_log(path, frames)


def test_the_shipped_profile_knows_the_engine(tmp_path: Path) -> None:
    recording = tg.read(bus(tmp_path / "log.blf"), "tractor-isobus")
    assert np.nanmax(np.abs(recording["engine_speed"] - 1600 * np.pi / 30)) < 1e-9
    assert np.nanmax(np.abs(recording["engine_torque_share"] - 0.70)) < 1e-12
    assert np.nanmax(np.abs(recording["engine_friction_share"] - 0.08)) < 1e-12
    estimates = tg.estimate(recording, tg.Vehicle.from_dict(VEHICLE))
    force = 0.85 * (0.62 * 800 * 1600 * np.pi / 30 - 8000) / 2.001
    assert abs(estimates["adhesion_driven"][-1] - force / (6000 * 9.80665)) < 5e-3


def test_inspect_proposes_the_engine_and_says_what_its_torque_is_good_for(tmp_path: Path) -> None:
    """It said that adhesion cannot be estimated, and left a friction out that never changes."""
    log = bus(tmp_path / "log.blf")
    with_driveline = inspect(log, vehicle=tg.Vehicle.from_dict(VEHICLE))
    assert with_driveline.proposals["engine_friction_share"].entry["from"] == "NominalFrictionTorque"
    assert not any("torque" in sentence for sentence in with_driveline.missing)
    (sentence,) = [s for s in inspect(log).missing if "torque" in s]
    assert "with a 'driveline' in the vehicle file the adhesion of all driven wheels together" in sentence
    (tmp_path / "p.yaml").write_text(with_driveline.profile)
    recording = tg.read(log, tmp_path / "p.yaml")
    assert np.nanmax(np.abs(recording["engine_friction_share"] - 0.08)) < 1e-12


def test_a_brake_switch_is_read_without_its_codes(tmp_path: Path) -> None:
    """CCVS1's byte 4, bits 5 and 6: 0 released, 1 pressed, 2 error, 3 not available."""
    states = (0, 1, 1, 3, 2, 0)
    frames = [
        (START + 0.1 * k, 0x18FEF100, b"\xff\x00\x02" + bytes([states[k // 10] << 4]) + b"\xff" * 4)
        for k in range(60)
    ]
    frames += [(START + 0.1 * k + 0.004, GROUND_BASED, payload(2.0)) for k in range(60)]
    log = write_log(tmp_path / "log.blf", frames)
    brake = tg.read(log, "tractor-isobus")["brake"]
    np.testing.assert_array_equal(brake[np.isfinite(brake)], np.repeat([0.0, 1.0, 1.0, 0.0], 10))
    assert inspect(log).proposals["brake"].entry["from"] == "BrakeSwitch"

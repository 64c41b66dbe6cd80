"""A stock tractor: from its bus log to slip, with the profile that comes with Terragrip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from can_frames import GROUND_BASED, WHEEL_BASED, Drive, drive, payload, write_log
from terragrip.cli import main
from terragrip.estimation import calibrate

TRACTOR = """name: tractor
mass: 6000 kg
wheelbase: 2.6 m
center_of_gravity_height: 0.9 m
axles:
  front: {mass: 2500 kg, wheels: [fl, fr], driven: false}
  rear: {mass: 3500 kg, wheels: [rl, rr]}
wheel: {radius: 0.8 m, inertia: 50 kg m^2}
"""


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    path = tmp_path / "tractor.yaml"
    path.write_text(TRACTOR)
    return path


def relative_slip(machine: Drive, time: np.ndarray, zero: float = 0.01) -> np.ndarray:
    """True slip, counted from the condition that is called zero."""
    return 1 - (1 - np.interp(time, machine.time, machine.slip)) / (1 - zero)


@pytest.mark.parametrize("seed", [1000, 1001])
@pytest.mark.parametrize("smooth", [False, True])
def test_slip_from_the_bus_alone(tmp_path: Path, vehicle: Path, seed: int, smooth: bool) -> None:
    machine = drive(seed)
    recording = tg.read(write_log(tmp_path / "log.blf", machine.frames), "tractor-isobus")
    estimates = tg.estimate(recording, tg.Vehicle.load(vehicle), smooth=smooth)
    error = estimates["slip_drive"] - relative_slip(machine, estimates.time)
    assert np.sqrt(np.mean(error**2)) < (0.006 if smooth else 0.009)
    absolute = estimates["slip_drive"] - np.interp(estimates.time, machine.time, machine.slip)
    assert np.mean(np.abs(absolute) < 1.96 * estimates["slip_drive_std"]) > 0.92
    # The tractor's radius is 3 % too large, and headlands slip by 1 %: both are in the zero-slip radius.
    ratio = estimates.about["zero_slip"]["drive"]
    assert ratio["ratio"] == pytest.approx(0.99 / machine.scale, abs=3 * ratio["std"])
    assert ratio["std"] < 0.013
    travelled = np.sum(machine.speed) * 0.1
    assert estimates["distance"][-1] == pytest.approx(travelled, rel=2e-3)
    lacking = ("adhesion", "soil_resistance", "net_traction", "efficiency", "supervisor")
    assert not [name for name in estimates.names if name.startswith(lacking)]


def test_the_command_line_says_what_is_missing(
    tmp_path: Path, vehicle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_log(tmp_path / "log.log", drive(1000, 120.0).frames)
    out = tmp_path / "estimates.parquet"
    words = ["estimate", str(log), "--vehicle", str(vehicle), "--profile", "tractor-isobus", "-o", str(out)]
    assert main(words) == 0
    output = capsys.readouterr().out
    assert "There is no drive torque: slip, speeds and distance are estimated" in output
    assert "Zero-slip radius of the drive in this log: 0.76" in output or "log: 0.77" in output
    assert tg.Estimates.read(out).wheels == ("drive",)
    assert main(["soils", str(out), "-o", str(tmp_path / "soils.json")]) == 2
    assert "has slip but no adhesion" in capsys.readouterr().err


def test_a_pass_without_load_makes_slip_absolute(tmp_path: Path, vehicle: Path) -> None:
    machine = drive(1000, 120.0)
    free = [
        (t, i, payload(machine.scale * np.interp(t - machine.frames[0][0], machine.time, machine.speed)))
        if i == WHEEL_BASED
        else (t, i, d)
        for t, i, d in machine.frames
    ]
    empty = tg.read(write_log(tmp_path / "empty.blf", free), "tractor-isobus")
    calibration = calibrate(empty, tg.Vehicle.load(vehicle))
    radius = calibration["wheel_radius rl"]
    assert radius.value == pytest.approx(0.8 / machine.scale, abs=3 * radius.std + 1e-3)
    assert "wheel_radius fl" not in calibration
    work = tg.read(write_log(tmp_path / "work.blf", machine.frames), "tractor-isobus")
    estimates = tg.estimate(work, calibration.apply(tg.Vehicle.load(vehicle)), smooth=True)
    truth = np.interp(estimates.time, machine.time, machine.slip)
    assert np.nanmean(estimates["slip_drive"] - truth) == pytest.approx(0, abs=0.003)


def test_a_radar_that_falls_silent_is_replaced_by_gnss(tmp_path: Path) -> None:
    frames = []
    for k in range(200):
        frames.append((0.1 * k, WHEEL_BASED, payload(2.0)))
        frames.append((0.1 * k + 0.01, GROUND_BASED, payload(65.535)))
        frames.append(
            (0.1 * k + 0.02, 0x09F8021C, bytes([255, 0xFC, 0, 0]) + (190).to_bytes(2, "little") + b"\xff\xff")
        )
    recording = tg.read(write_log(tmp_path / "log.blf", frames), "tractor-isobus")
    assert np.nanmedian(recording["ground_speed"]) == pytest.approx(1.9)
    assert "ground_speed is from SpeedOverGround." in recording.notes


WITHOUT_WHEELS = TRACTOR.replace("wheel: {radius: 0.8 m, inertia: 50 kg m^2}\n", "")


@pytest.mark.parametrize("smooth", [False, True])
def test_a_machine_known_by_its_bus_speed_alone_needs_no_wheel_radii(tmp_path: Path, smooth: bool) -> None:
    """The machine's own radius is in its speed: slip is the same to rounding with any radius, and without one."""
    machine = drive(1000, 120.0)
    recording = tg.read(write_log(tmp_path / "log.blf", machine.frames), "tractor-isobus")
    (tmp_path / "bus.yaml").write_text(WITHOUT_WHEELS)
    (tmp_path / "sized.yaml").write_text(TRACTOR)
    bare, sized = (tg.Vehicle.load(tmp_path / f"{name}.yaml") for name in ("bus", "sized"))
    assert not bare.knows_wheels
    found, known = (tg.estimate(recording, vehicle, smooth=smooth) for vehicle in (bare, sized))
    for name in ("slip_drive", "slip_drive_std", "ground_speed", "distance"):
        np.testing.assert_allclose(found[name], known[name], rtol=1e-6, atol=1e-9)
    # What needs a radius is not there, rather than for a wheel of 1 m.
    assert not [name for name in found.names if name.startswith(("wheel_speed", "zero_slip_radius"))]
    assert any("of the speed that the machine reports" in note for note in found.notes)
    error = found["slip_drive"] - relative_slip(machine, found.time)
    assert np.sqrt(np.nanmean(error**2)) < 0.009


def test_the_bus_speed_is_calibrated_without_radii(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = drive(1000, 120.0)
    free = [
        (t, i, payload(machine.scale * np.interp(t - machine.frames[0][0], machine.time, machine.speed)))
        if i == WHEEL_BASED
        else (t, i, d)
        for t, i, d in machine.frames
    ]
    (tmp_path / "bus.yaml").write_text(WITHOUT_WHEELS)
    empty, work = (
        write_log(tmp_path / f"{name}.blf", frames)
        for name, frames in (("empty", free), ("work", machine.frames))
    )
    words = ["--vehicle", str(tmp_path / "bus.yaml"), "--profile", "tractor-isobus"]
    assert main(["inspect", str(work), *words]) == 0
    target = tmp_path / "calibrated.yaml"
    assert main(["calibrate", str(empty), *words, "--light", "all", "-o", str(target)]) == 0
    assert "wheel_based_speed_gain" in capsys.readouterr().out
    calibrated = tg.Vehicle.load(target)
    assert calibrated.calibration.wheel_based_speed_gain == pytest.approx(machine.scale, rel=0.004)
    assert 0 < (calibrated.uncertainty.wheel_radius or 0) < 0.005
    out = tmp_path / "estimates.parquet"
    words[1] = str(target)
    assert main(["estimate", str(work), *words, "-o", str(out)]) == 0
    estimates = tg.Estimates.read(out)
    truth = np.interp(estimates.time, machine.time, machine.slip)
    assert np.nanmean(estimates["slip_drive"] - truth) == pytest.approx(0, abs=0.003)
    page = tmp_path / "report.html"
    assert main(["report", str(out), "-o", str(page)]) == 0
    assert "Slip counts from the calibrated speed." in page.read_text()


def test_what_needs_a_radius_asks_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Wheel speeds in rad/s, and torques, mean nothing without a radius."""
    (tmp_path / "bus.yaml").write_text(WITHOUT_WHEELS)
    time = np.arange(0, 20, 0.1)
    wheels = "".join(f",wheel_speed_{wheel}" for wheel in ("fl", "fr", "rl", "rr"))
    torques = ",drive_torque_rl,drive_torque_rr"
    for name, header, row in (("speeds", wheels, ",1" * 4), ("torques", wheels + torques, ",1" * 6)):
        log = tmp_path / f"{name}.csv"
        log.write_text(f"time,ground_speed{header}\n" + "".join(f"{t:.1f},1{row}\n" for t in time))
        out = tmp_path / f"{name}.parquet"
        assert main(["estimate", str(log), "--vehicle", str(tmp_path / "bus.yaml"), "-o", str(out)]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "has no wheel data; add e.g. 'wheel: {radius" in said
        assert not out.exists()

"""Stock machines: engine torque through the driveline gives the sum of drive torques, and intervals that say how little that is."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import terragrip as tg
from stock_tractor import StockMachine, stock_machine
from terragrip.errors import InputError
from terragrip.estimation.batch import RunOptions, estimated
from terragrip.ground.events import events
from terragrip.recording import LogBlocks, Recording
from terragrip.simulation.families import Kind, draw

DRAWN = [
    ("tractor", "saturating", "even", 301),
    ("tractor", "brixius", "plain", 302),
    ("tractor", "sinkage", "uncoupled", 303),
    ("robot", "brixius", "multirate", 304),
    ("tractor", "saturating", "plain", 305),
    ("robot", "sinkage", "even", 306),
    ("tractor", "brixius", "uncoupled", 307),
    ("robot", "saturating", "plain", 308),
]


@cache
def drawn(mass: str, curve: str, sensors: str, seed: int) -> StockMachine:
    return stock_machine(draw(Kind(mass, curve, sensors), seed), seed)


def covered(estimates: tg.Estimates, machine: StockMachine) -> np.ndarray:
    """Rows (n, 2) of a moving machine in which 1.96 SD hold the true adhesion and resistance."""
    rows = machine.moving & np.isfinite(estimates["adhesion_driven"]) & (estimates.event_codes == 0)
    pairs = (("adhesion_driven", machine.adhesion), ("soil_resistance", machine.resistance))
    inside = [np.abs(estimates[name] - true) < 1.96 * estimates[f"{name}_std"] for name, true in pairs]
    return np.stack(inside, axis=1)[rows]


def test_intervals_hold_the_truth_of_drawn_machines() -> None:
    inside = np.concatenate(
        [covered(tg.estimate((m := drawn(*one)).recording, m.vehicle), m) for one in DRAWN]
    )
    assert len(inside) > 4000
    assert (inside.mean(axis=0) > 0.92).all()


def test_without_the_spreads_of_the_driveline_intervals_do_not_hold() -> None:
    inside = []
    for one in DRAWN[:5]:
        machine = drawn(*one)
        data = machine.vehicle.to_dict()
        data["driveline"] |= {"efficiency_std": 0.0, "accessory_power_std": 0.0, "engine_torque_std": 0.0}
        inside.append(covered(tg.estimate(machine.recording, tg.Vehicle.from_dict(data)), machine))
    assert (np.concatenate(inside).mean(axis=0) < 0.9).all()


def test_columns_are_those_of_a_sum() -> None:
    machine = drawn(*DRAWN[0])
    estimates = tg.estimate(machine.recording, machine.vehicle)
    assert estimates.wheels == ("driven",)
    single = [f"adhesion_{wheel}" for wheel in machine.vehicle.wheels]
    assert not set(single) & set(estimates.names)
    assert any("the adhesion of single wheels is not determined" in note for note in estimates.notes)
    assert estimates.about["driveline"]["vehicle"]["axles"] == machine.vehicle.to_dict()["axles"]


@pytest.mark.parametrize("smooth", [False, True])
def test_blocks_change_no_digit(smooth: bool) -> None:
    machine = drawn(*DRAWN[1])
    whole = tg.estimate(machine.recording, machine.vehicle, smooth=smooth)
    parts = list(estimated(LogBlocks.of(machine.recording, 97), machine.vehicle, RunOptions(smooth=smooth)))
    for name in whole.columns:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), whole[name], name)


STEADY = """name: tractor
mass: 6000 kg
wheelbase: 2.6 m
center_of_gravity_height: 0.9 m
hitch_height: 0.5 m
axles:
  front: {mass: 2500 kg, wheels: [fl, fr]}
  rear: {mass: 3500 kg, wheels: [rl, rr]}
wheel: {radius: 0.8 m, inertia: 50 kg m^2}
driveline: {efficiency: 0.85, accessory_power: 8 kW}
"""


def steady(seconds: float = 60.0, ratio: float = 80.0) -> Recording:
    """At 2 m/s by 100 kW at the flywheel, no slip."""
    rows = int(10 * seconds)
    noise = 1e-3 * np.random.default_rng(0).standard_normal((3, rows))
    engine = 2.0 / 0.8 * ratio
    return Recording(
        0.1 * np.arange(rows),
        {
            "ground_speed": 2.0 + noise[0],
            "wheel_based_speed": 2.0 + noise[1],
            "engine_speed": np.full(rows, engine),
            "engine_torque": 100e3 / engine + noise[2],
            "drawbar_force": np.full(rows, 30e3) + noise[2],
        },
    )


@pytest.fixture
def tractor(tmp_path: Path) -> tg.Vehicle:
    (tmp_path / "tractor.yaml").write_text(STEADY)
    return tg.Vehicle.load(tmp_path / "tractor.yaml")


def test_power_over_speed_is_the_force(tractor: tg.Vehicle) -> None:
    """.85 of 92 kW at 2 m/s push with 39.1 kN, of which 30 kN pull; whatever the gear."""
    for ratio in (60.0, 90.0):
        estimates = tg.estimate(steady(ratio=ratio), tractor)
        weight = 6000 * 9.80665
        assert estimates["adhesion_driven"][-1] == pytest.approx(39100 / weight, rel=5e-3)
        assert estimates["soil_resistance"][-1] == pytest.approx(9100 / weight, rel=0.03)
        # 5 of 85 % of efficiency and half the accessories, both of the force of 46 kN.
        least = np.hypot(39100 * 0.05 / 0.85, 0.85 * 4000 / 2) / weight
        assert estimates["adhesion_driven_std"][-1] == pytest.approx(least, rel=0.2)


def test_backward_is_as_forward(tractor: tg.Vehicle) -> None:
    """In reverse gear the same power makes the same force: the gears take no less, and give none."""
    log = steady()
    signed = ("ground_speed", "wheel_based_speed", "drawbar_force")
    back = log.with_channels(**{name: -log[name] for name in signed})
    forward, backward = tg.estimate(log, tractor), tg.estimate(back, tractor)
    for name in ("adhesion_driven", "soil_resistance", "efficiency_driven", "slip_driven"):
        assert backward[name][-1] == pytest.approx(forward[name][-1], abs=2e-3), name


def test_a_gear_shift_is_set_aside(tractor: tg.Vehicle) -> None:
    log = steady()
    faster = log.time > 30.0
    speed, torque = log["engine_speed"], log["engine_torque"]
    shifted = log.with_channels(
        engine_speed=np.where(faster, speed / 1.2, speed),
        engine_torque=np.where(faster, 1.2 * torque, torque),
    )
    estimates = tg.estimate(shifted, tractor)
    missing = estimates.time[np.isnan(estimates["adhesion_driven"])]
    assert len(missing)
    assert ((missing > 29.9) & (missing < 31.5)).all()
    assert np.isfinite(estimates["slip_driven"]).all()
    assert estimates["adhesion_driven"][-1] == pytest.approx(39100 / 6000 / 9.80665, rel=5e-3)


def test_what_a_pto_takes_does_not_pull(tractor: tg.Vehicle) -> None:
    """60 kW more at the flywheel from 30 s on, all for the PTO: adhesion as before; none where the file does not give the power."""
    log = steady()
    turns = log.time > 30.0
    more = log["engine_torque"] + np.where(turns, 60e3 / log["engine_speed"], 0.0)
    baling = log.with_channels(engine_torque=more, pto_speed=np.where(turns, 56.5, 0.0))
    unknown = tg.estimate(baling, tractor)
    assert np.isnan(unknown["adhesion_driven"][turns]).all()
    assert np.isfinite(unknown["adhesion_driven"][5:][~turns[5:]]).all()
    assert np.isfinite(unknown["slip_driven"]).all()
    assert "gap" not in unknown["event"]
    assert any("The PTO turns in 50% of the log" in note for note in unknown.notes)
    unseen = replace(baling, channels={n: v for n, v in baling.channels.items() if n != "pto_speed"})
    (leap,) = [note for note in tg.estimate(unseen, tractor).notes if " leaps " in note]
    assert "a PTO, a pump or a brake took another part" in leap
    mowing = baling.with_channels(pto_speed=0 * log.time, pto_speed_front=baling["pto_speed"])
    np.testing.assert_array_equal(tg.estimate(mowing, tractor)["adhesion_driven"], unknown["adhesion_driven"])
    data = tractor.to_dict()
    data["driveline"] |= {"pto_power": "60 kW", "pto_power_std": "10 kW"}
    known = tg.estimate(baling, tg.Vehicle.from_dict(data))
    assert known["adhesion_driven"][-1] == pytest.approx(39100 / 6000 / 9.80665, rel=5e-3)
    assert known["adhesion_driven_std"][-1] > 1.5 * known["adhesion_driven_std"][290]


def test_a_share_needs_its_reference(tractor: tg.Vehicle) -> None:
    log = steady()
    channels = {n: v for n, v in log.channels.items() if n != "engine_torque"}
    shares = replace(log, channels={**channels, "engine_torque_share": log["engine_torque"] / 800 + 0.08})
    with pytest.raises(InputError, match="neither the log nor the vehicle file") as caught:
        tg.estimate(shares, tractor)
    assert "reference_torque" in str(caught.value.hint)
    with_reference = shares.with_channels(engine_reference_torque=np.full(len(log), 800.0))
    result = tg.estimate(with_reference, tractor)
    assert result["adhesion_driven"][-1] == pytest.approx(39100 / 6000 / 9.80665, rel=5e-3)
    assert any("own friction is not in the log" in note for note in result.notes)


def test_without_a_driveline_slip_alone(tractor: tg.Vehicle) -> None:
    data = tractor.to_dict()
    del data["driveline"]
    estimates = tg.estimate(steady(), tg.Vehicle.from_dict(data))
    assert not estimates.has_adhesion


def test_a_driveline_needs_wheels(tmp_path: Path) -> None:
    path = tmp_path / "v.yaml"
    path.write_text("\n".join(line for line in STEADY.splitlines() if not line.startswith("wheel:")))
    with pytest.raises(InputError, match="radius"):
        tg.Vehicle.load(path)


def test_a_receivers_delay_that_was_corrected_stays_in_the_intervals(tractor: tg.Vehicle) -> None:
    """What a shift leaves unknown was searched for anew in the shifted log, which shows hardly any."""
    log = replace(steady(), delay=0.06)
    assert tg.estimate(log, tractor).about["settings"]["noise"]["ground_speed_delay"] == 0.06


def test_without_a_torque_nothing_shows_that_the_wheels_pull_against_a_push(tractor: tg.Vehicle) -> None:
    """A trailer runs up from 40 s on, while a PTO takes an unknown part: the event said 'The wheels pull (adhesion nan ...'."""
    log = steady()
    late = log.time > 40.0
    pushed = log.with_channels(drawbar_force=np.where(late, -5e3, log["drawbar_force"]))
    assert "push" in tg.estimate(pushed, tractor)["event"][late]
    unknown = tg.estimate(pushed.with_channels(pto_speed=np.where(late, 56.5, 0.0)), tractor)
    assert "push" not in unknown["event"]
    assert not any("nan" in event.why for event in events(unknown))


def test_an_engine_that_droops_is_no_mistake_of_mass_or_torques(tractor: tg.Vehicle) -> None:
    """A pull that comes and goes slows the engine in one gear, so thrust falls as the rims gain, which a note called wrong."""
    log, noise = steady(120.0), np.random.default_rng(1).standard_normal((2, 1200))
    pull = 20e3 + 8e3 * np.sin(log.time / 1.7) + 4e3 * np.sin(log.time)
    speed = 2.2 - np.interp(log.time - 0.8, log.time, pull) / 1e5
    engine, force = speed / 0.8 * 80, pull + 6000 * np.gradient(speed, 0.1) + 5e3
    log = log.with_channels(
        ground_speed=speed + 0.002 * noise[0],
        wheel_based_speed=speed + 0.001 * noise[1],
        engine_speed=engine,
        engine_torque=force * 0.8 / 80 / 0.85 + 8e3 / engine,
    )
    unlogged = replace(log, channels={n: v for n, v in log.channels.items() if n != "drawbar_force"})
    notes = tg.estimate(unlogged, tractor).notes
    assert not any("In starts and stops" in note for note in notes)


def test_a_wheel_of_another_scale_and_a_gyroscope_of_the_wrong_sign_are_named(tractor: tg.Vehicle) -> None:
    """The mean of the driven wheels shows neither, so nothing was said of them."""
    time = np.arange(0.0, 240.0, 0.1)
    noise = 1e-3 * np.random.default_rng(2).standard_normal((8, len(time)))
    speed, turn = 1.5 + 0.5 * np.sin(time / 7), np.where(time % 40 > 30, 0.2, 0.0)
    side = {"fl": -0.9, "fr": 0.9, "rl": -0.9, "rr": 0.9}
    channels = {
        f"wheel_speed_{w}": (speed + y * turn) / 0.8 + n
        for (w, y), n in zip(side.items(), noise[:4], strict=True)
    }
    channels |= {
        "ground_speed": speed + noise[4],
        "angular_velocity_z": turn + noise[5],
        "engine_speed": speed / 0.8 * 80,
        "engine_torque": 400.0 + noise[6],
        "drawbar_force": 20e3 + noise[7],
    }
    wide = tg.Vehicle.from_dict(tractor.to_dict() | {"track": 1.8})
    log = Recording(time, channels)

    def notes(**changed: np.ndarray) -> str:
        return " ".join(tg.estimate(log.with_channels(**changed), wide).notes)

    assert "rim of" not in notes()
    assert "wrong sign" not in notes()
    assert "the rim of rl goes 1.10 times" in notes(wheel_speed_rl=1.1 * channels["wheel_speed_rl"])
    assert "angular_velocity_z is of the wrong sign" in notes(
        angular_velocity_z=-channels["angular_velocity_z"]
    )

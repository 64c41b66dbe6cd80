"""Engine torque through the gears and driven wheels as one, step by step, on signals whose every number is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rear_tractor import G, tractor
from terragrip.errors import InputError
from terragrip.estimation.driveline import DrivenMachine, _by_efficiency, by_engine, lumped
from terragrip.estimation.engine_torque import (
    EngineTorque,
    driveline_torque,
    earlier,
    held,
)
from terragrip.physics.driveline import torque_spread
from terragrip.physics.efficiency import tractive_efficiency
from terragrip.recording.schema import has_engine_torque
from terragrip.vehicle import Vehicle
from terragrip.vehicle_parts import Driveline


def gears(**more: float) -> Driveline:
    return Driveline(**{"accessory_power": 0.0, **more})


def test_a_value_stands_for_two_seconds_and_an_earlier_one_for_three() -> None:
    time = np.arange(0.0, 6.0, 0.5)
    values = np.where(time == 1.0, 7.0, np.nan)
    np.testing.assert_array_equal(held(time, values), np.where((time >= 1.0) & (time <= 3.0), 7.0, np.nan))
    np.testing.assert_array_equal(
        earlier(time, values, 0.5), np.where((time >= 1.5) & (time <= 4.0), 7.0, np.nan)
    )
    assert np.isnan(earlier(time, np.full(12, np.nan), 0.5)).all()
    every = earlier(time, 10 * time, 1.0)
    np.testing.assert_allclose(every, np.where(time >= 1.0, 10 * (time - 1.0), np.nan))


def test_how_a_log_tells_its_engines_torque() -> None:
    line = gears(efficiency=0.85, reference_torque=800.0)
    plain = EngineTorque.of(("engine_torque", "engine_torque_share"), line, 900.0)
    assert (plain.reference, plain.stated, plain.std, plain.notes) == (None, 0.0, 0.0, ())
    share = ("engine_torque_share",)
    assumed = EngineTorque.of(share, line, None)
    assert assumed.reference == 800.0
    assert assumed.std == pytest.approx(800 * np.hypot(0.02, 0.04))
    assert "8% ± 4% of the reference torque is assumed" in assumed.notes[0]
    both = EngineTorque.of((*share, "engine_friction_share"), line, 900.0)
    assert (both.reference, both.notes) == (900.0, ())
    assert both.std == pytest.approx(18.0)
    assert EngineTorque.of(share, gears(efficiency=0.85, engine_torque_std=5.0), 900.0).std == 5.0
    assert np.isnan(EngineTorque.of(share, gears(efficiency=0.85), None, waits=True).reference or 0.0)
    for wrong in (None, 0.0, -1.0, np.nan):
        with pytest.raises(InputError, match=r"l\.csv.*engine_torque_share"):
            EngineTorque.of(share, gears(efficiency=0.85), wrong, source="l.csv")
    assert replace(EngineTorque.from_dict(assumed.to_dict()), notes=assumed.notes) == assumed
    time = np.arange(4.0)
    channels = {
        "engine_torque_share": np.full(4, 0.5),
        "engine_friction_share": np.array([0.1, np.nan, np.nan, np.nan]),
    }
    np.testing.assert_allclose(both.at(channels, time), [360.0, 360.0, 360.0, np.nan])
    np.testing.assert_allclose(assumed.at({"engine_torque_share": np.full(4, 0.5)}, time), 336.0)
    np.testing.assert_allclose(plain.at({"engine_torque": time}, time), time)
    assert has_engine_torque(("engine_speed", "engine_torque_share"))
    assert not has_engine_torque(("engine_torque",))
    assert not has_engine_torque(("engine_speed",))


LINE = gears(efficiency=0.8, accessory_power=2000.0, engine_inertia=1.5)


def through(
    speed: np.ndarray, torque: float = 300.0, wheels: float | np.ndarray = 2.0, line: Driveline = LINE
) -> Any:
    time = 0.25 * np.arange(len(speed))
    channels = {"engine_speed": speed, "engine_torque": np.full(len(speed), torque)}
    return driveline_torque(line, EngineTorque(None, 10.0), time, channels, wheels * np.ones(len(speed)), 0.8)


def test_power_goes_through_the_gears_less_accessories_and_the_engines_own() -> None:
    steady = through(np.full(20, 200.0))
    np.testing.assert_allclose(steady.torque, 100 * 0.8 * (300 - 2000 / 200))
    np.testing.assert_allclose(steady.std, 0.8 * 100 * np.hypot(10.0, 1000 / 200))
    stated = gears(efficiency=0.8, accessory_power=2000.0, accessory_power_std=400.0)
    np.testing.assert_allclose(
        through(np.full(20, 200.0), line=stated).std, 0.8 * 100 * np.hypot(10.0, 400 / 200)
    )
    rising = 200.0 + np.arange(20)  # 4 rad/s a second
    np.testing.assert_allclose(
        through(rising).torque[2:], rising[2:] / 2 * 0.8 * (300 - 2000 / rising[2:] - 1.5 * 4.0), rtol=1e-9
    )
    overrun = through(np.full(20, 200.0), torque=-40.0)
    np.testing.assert_allclose(overrun.torque, 100 / 0.8 * (-40 - 10))
    reverse = through(np.full(20, 200.0), wheels=-2.0)
    np.testing.assert_allclose(reverse.torque, -steady.torque)
    motor = through(np.full(20, -200.0), torque=-300.0, wheels=-2.0)  # it turns backward itself
    np.testing.assert_allclose(motor.torque, -steady.torque)
    np.testing.assert_allclose(motor.std, steady.std)
    np.testing.assert_allclose(through(-rising, -300.0, -2.0).torque, -through(rising).torque)
    np.testing.assert_allclose(through(np.full(20, -200.0), torque=40.0, wheels=-2.0).torque, -overrun.torque)
    assert torque_spread(np.array([0.0, 1.0]), np.ones(2), 0.8, 1.0, 0.0).tolist()[1] == 0.8


@pytest.mark.parametrize(("step", "shifts"), [(1.079, False), (1.081, True), (0.921, False), (0.919, True)])
def test_a_step_of_eight_per_cent_is_a_gear_shift_for_a_second(step: float, shifts: bool) -> None:
    speed = np.where(np.arange(40) < 20, 200.0, 200.0 * step)
    result = through(speed)
    expected = np.zeros(40, dtype=bool)
    expected[20:24] = shifts  # .25 s a row: until a second after it
    np.testing.assert_array_equal(result.shift, expected)
    np.testing.assert_array_equal(np.isnan(result.torque), expected)
    np.testing.assert_array_equal(np.isnan(result.std), expected)
    fixed = through(speed, line=gears(efficiency=0.8, ratio=100.0))
    assert not fixed.shift.any()
    np.testing.assert_allclose(fixed.torque, 100 * 0.8 * 300)


@pytest.mark.parametrize(("speed", "known"), [(0.069, False), (0.071, True)])
def test_rims_that_hardly_turn_tell_no_ratio(speed: float, known: bool) -> None:
    wheels = speed * np.sqrt(G * 0.8) / 0.8
    assert np.isfinite(through(np.full(9, 200.0), wheels=wheels).torque).all() == known
    assert np.isfinite(through(np.full(9, 200.0), wheels=-wheels).torque).all() == known
    assert np.isnan(through(np.zeros(9)).torque).all()
    slow = through(np.full(9, 200.0), wheels=-wheels, line=gears(efficiency=0.8, ratio=100.0))
    assert np.sign(slow.torque[0]) == (-1 if known else 1)


def test_a_sum_of_torques_needs_a_driveline_and_no_wheels_torque() -> None:
    channels = ("wheel_based_speed", "ground_speed", "engine_speed", "engine_torque")
    line = tractor(driveline={"efficiency": 0.85, "accessory_power": 0})
    assert by_engine(channels, line)
    assert not by_engine(channels, tractor())
    assert not by_engine((*channels, "drive_torque_rl"), line)
    assert not by_engine(channels[:3], line)


def test_driven_wheels_become_one_where_their_masses_have_their_mean() -> None:
    line = {
        "driveline": {"efficiency": 0.8, "efficiency_std": 0.04, "accessory_power": 0},
        "bearing_resistance": 3.0,
        "drive_friction": 40.0,
        "hitch_overhang": 1.0,
    }
    vehicle = tractor(
        **line, uncertainty={"drive_torque_gain_common": 0.03, "drive_torque_gain": 0.1, "slope": 0.01}
    )
    data = lumped(vehicle, None)
    assert data["axles"] == {
        "undriven": {
            "mass": 2500.0,
            "wheels": ["undriven"],
            "wheel": {"radius": 0.5, "inertia": 20.0},
            "driven": False,
            "bearing_resistance": 6.0,
            "drive_friction": 0.0,
        },
        "driven": {
            "mass": 3500.0,
            "wheels": ["driven"],
            "wheel": {"radius": 0.8, "inertia": 100.0},
            "driven": True,
            "bearing_resistance": 6.0,
            "drive_friction": 80.0,
        },
    }
    assert (data["wheelbase"], data["hitch_overhang"]) == (pytest.approx(2.8), 1.0)
    assert data["uncertainty"] == {
        "drive_torque_gain_common": pytest.approx(np.hypot(0.03, 0.05)),
        "slope": 0.01,
    }
    known = lumped(vehicle, (0.82, 0.004))
    assert known["axles"]["driven"]["wheel"] == {
        "radius": 0.82,
        "inertia": pytest.approx(100 * (0.82 / 0.8) ** 2),
    }
    assert known["uncertainty"]["wheel_radius"] == 0.004
    assert lumped(vehicle, (0.82, 7.0))["uncertainty"]["wheel_radius"] == 1.0
    both = {**vehicle.to_dict()["axles"]["front"], "driven": True}
    all_driven = tractor(**line, axles={**vehicle.to_dict()["axles"], "front": both})
    data = lumped(all_driven, None)
    assert list(data["axles"]) == ["driven"]
    assert "wheelbase" not in data
    assert data["hitch_overhang"] == pytest.approx(1.0 + 2.8 * 2500 / 6000)
    assert data["axles"]["driven"]["wheel"]["inertia"] == pytest.approx(
        2 * 10 * (0.65 / 0.5) ** 2 + 2 * 50 * (0.65 / 0.8) ** 2
    )
    Vehicle.from_dict(data)


def test_efficiency_changes_by_adhesion_and_resistance_as_its_formula() -> None:
    vehicle = tractor(tire_rolling_resistance=0.03)
    mu, rho, slip, step = np.array([0.3, 0.5]), np.array([0.1, 0.2]), np.array([0.1, 0.2]), 1e-6

    def efficiency(mu: np.ndarray, rho: np.ndarray) -> np.ndarray:
        return (1 - slip) * (mu - rho) / (mu + 0.03)

    np.testing.assert_allclose(efficiency(mu, rho), tractive_efficiency(mu, rho, 0.03, slip))
    for by_mu, by_rho in ((1.0, 0.0), (0.0, 1.0), (0.4, 0.3)):
        change = (efficiency(mu + step * by_mu, rho + step * by_rho) - efficiency(mu, rho)) / step
        np.testing.assert_allclose(_by_efficiency(vehicle, mu, rho, slip, by_mu, by_rho), change, rtol=1e-4)
    low = _by_efficiency(vehicle, np.array([-0.2, 0.1]), np.array([0.1, 0.3]), slip, 0.1, 0.0)
    np.testing.assert_allclose(low, [0.9 / 0.02 * 0.1, 0.8 / 0.13 * 0.1])


def test_free_wheels_turn_as_measured_or_else_as_the_ground_goes_by() -> None:
    """Of two driven wheels the mean rim speed over the radius of one; free wheels whose speeds are not known slip nowhere."""
    line = {"driveline": {"efficiency": 0.8, "efficiency_std": 0.04, "accessory_power": 0}}
    channels = {
        "ground_speed": np.array([1.0, 2.0]),
        "engine_torque": np.array([400.0, 500.0]),
        "engine_speed": np.array([200.0, 200.0]),
        "wheel_speed_rl": np.array([1.4, 2.6]),
        "wheel_speed_rr": np.array([1.6, 2.8]),
    }
    time = np.array([0.0, 0.1])
    free = {"wheel_speed_fl": np.array([2.1, 4.1]), "wheel_speed_fr": np.array([2.3, 4.3])}
    for given, turns in ((channels, [2.0, 4.0]), ({**channels, **free}, [2.2, 4.2])):
        own, drive = DrivenMachine.of_file(tractor(**line), tuple(given)).converted(time, given, 0)
        np.testing.assert_allclose(own["wheel_speed_undriven"], turns)
        np.testing.assert_allclose(own["wheel_speed_driven"], [1.5, 2.7])
        np.testing.assert_allclose(own["drive_torque_driven"], [0.8 * 400 * 200 / 1.5, 0.8 * 500 * 200 / 2.7])
        np.testing.assert_array_equal(drive.torque, own["drive_torque_driven"])


def test_a_pto_on_the_bus_counts_though_the_earlier_log_had_none() -> None:
    line = {"driveline": {"efficiency": 0.8, "efficiency_std": 0.04, "accessory_power": 0}}
    bus = ("ground_speed", "engine_torque", "engine_speed", "wheel_speed_rl", "wheel_speed_rr")
    known = DrivenMachine.of_file(tractor(**line), bus).to_dict()
    machine = DrivenMachine.of_file(tractor(**line), (*bus, "pto_speed_front"), known)
    sent = dict.fromkeys((*bus, "pto_speed_front"), np.full(2, 100.0))
    channels = {name: sent[name] for name in machine.channels}
    assert np.isnan(machine.converted(np.array([0.0, 0.1]), channels, 0)[1].std).all()


def test_what_the_driveline_takes_widens_intervals_by_its_force_over_loads() -> None:
    """The spread of a torque over radius and load adds to adhesion's as independent ones do, and to a curve's scale in proportion, as
    though adhesion were .1 at least."""
    line = {"driveline": {"efficiency": 0.8, "efficiency_std": 0.04, "accessory_power": 0}}
    machine = DrivenMachine.of_file(tractor(**line), ("engine_torque", "engine_speed", "wheel_based_speed"))
    size, load, own = 5, 30_000.0, 0.01
    columns = {
        "vertical_load_driven": np.full(size, load),
        "adhesion_driven": np.array([0.4, 0.05, -0.4, 0.0, 0.4]),
        "curve_a": np.full(size, 0.9),
        "curve_a_driven": np.full(size, 0.7),
    }
    columns |= {
        n: np.full(size, 0.1)
        for n in ("soil_resistance", "slip_driven", "net_traction_driven", "efficiency_driven")
    }
    columns |= {f"{name}_std": np.full(size, own) for name in columns}
    std = np.array([240.0, 240.0, 240.0, 240.0, np.nan])  # N m, at a radius of .8 m: 300 N
    result = machine.completed(columns, std)
    share, divisor = 0.01, np.array([0.4, 0.1, 0.4, 0.1])
    for name, scale in (("curve_a", 0.9), ("curve_a_driven", 0.7)):
        assert result[f"{name}_std"] == pytest.approx([*np.hypot(own, scale * share / divisor), own])
    for name, change in (("adhesion_driven", share), ("soil_resistance", 300 / (6000 * G))):
        assert result[f"{name}_std"] == pytest.approx([*[np.hypot(own, change)] * 4, np.nan], nan_ok=True)
    assert result["net_traction_driven_std"][0] == pytest.approx(np.hypot(own, share - 300 / (6000 * G)))
    assert result["adhesion_driven"] == pytest.approx([0.4, 0.05, -0.4, 0.0, np.nan], nan_ok=True)
    tire = machine.vehicle.tire_rolling_resistance
    before, after = (
        0.9 * (mu - rho) / (mu + tire) for mu, rho in ((0.4, 0.1), (0.41, 0.1 + 300 / (6000 * G)))
    )
    assert result["efficiency_driven_std"][0] == pytest.approx(np.hypot(own, after - before), rel=0.02)

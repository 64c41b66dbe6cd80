"""The C plant's equations and its time stepping, against Python written from the text (docs/simulation.md) and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from terragrip.simulation import plant as plant_module
from terragrip.simulation import terrain as terrain_module

G = 9.80665
SLOPE, CURVE_A, RHO, RHO_SLIP = 0.03, 0.85, 0.12, 0.04
TOOLS = [
    {"mass": 60, "length": 2.0, "friction": 0.2, "dig_in": 50, "draught_speed": 0.5, "slack": 0.05},
    {
        "mass": 30,
        "length": 1.0,
        "dig_in": 40,
        "slack": 0.02,
        "shear_length": 0.02,
        "stiffness": 3e4,
        "damping": 500,
    },
]


@pytest.fixture
def uphill(quiet):
    return quiet(
        soils={
            "even": {
                "curve": {"name": "exponential", "a": CURVE_A},
                "resistance": RHO,
                "resistance_slip": RHO_SLIP,
            }
        },
        tools=TOOLS,
        route={"segments": [{"soil": "even", "length": 60}], "slope": {"mean": SLOPE}},
        speed=[[0, 0], [1, 0.5], [2, 0.8]],
        duration=2.5,
    )


def built(scenario, seed=0):
    vehicle = scenario.nominal_vehicle()
    ground = terrain_module.build(scenario, vehicle, seed)
    return plant_module.make_plant(scenario, vehicle, vehicle.wheel_radius, ground)


def c_derivative(plant, time, state):
    from terragrip.simulation._plant import ffi, lib

    out = np.empty(len(state))
    given = ffi.from_buffer("double[]", np.ascontiguousarray(state))
    status = lib.plant_derivative(plant.machine, plant.ground, time, given, ffi.from_buffer("double[]", out))
    assert status == lib.PLANT_OK
    return out


def buildup(limit, held, speed, length):
    """Dahl friction; five times stiffer when the load comes off; damped while it changes."""
    if held * speed < 0:
        length = 0.2 * length
    rate = speed / length * (limit - held * (1 if speed >= 0 else -1))
    return held + rate * 0.03 * length / (length + 0.03 * abs(speed)), rate


def reference(time, y):
    """The same machine from physics.md 1-3 and docs/simulation.md, flat ground, one soil."""
    m, L, lr, h, hd, c, r, J = 139.0, 0.638, 54 / 139 * 0.638, 0.30, 0.25, 0.10, 0.2, 0.15
    dy = np.zeros(30)
    w, v, torque, sums, z, zdot, x, rho = y[:4], y[4], y[5:9], y[9:13], y[13:17], y[17:21], y[21], y[22:24]
    command = np.interp(time, [0, 1, 2], [0, 0.5, 0.8]) / r
    want = 20 * (command - w) + sums
    give = np.clip(want, -130, 130)
    power = np.maximum(give * w, 0).sum()
    if power > 1600:
        give = np.where(give * w > 0, give * 1600 / power, give)
    dy[5:9] = (give - torque) / 0.01
    dy[9:13] = 100 * (command - w) + (give - want) / 0.1

    position, speed = x - c, v
    force = []
    for tool, (xt, vt) in zip(TOOLS, ((y[24], y[25]), (y[27], y[28])), strict=True):
        gap, half = position - xt - tool["length"], tool["slack"] / 2
        k, d = tool.get("stiffness", 4e4), tool.get("damping", 800)
        f = 0.0
        if gap > half:
            f = max(0, k * (gap - half) + d * (speed - vt))
        elif gap < -half:
            f = min(0, k * (gap + half) + d * (speed - vt))
        force.append(f)
        position, speed = xt, vt
    for k, tool in enumerate(TOOLS):
        xt, vt, held = y[24 + 3 * k : 27 + 3 * k]
        weight = tool["mass"] * G
        limit = (tool.get("friction", 0) * weight * np.cos(SLOPE) + tool["dig_in"]) * (
            1 + tool.get("draught_speed", 0) * abs(vt)
        )
        draught, rate = buildup(limit, held, vt, tool.get("shear_length", 0.01))
        behind = force[1] if k == 0 else 0.0
        dy[24 + 3 * k : 27 + 3 * k] = (
            vt,
            (force[k] - behind - draught - weight * np.sin(SLOPE)) / tool["mass"],
            rate,
        )

    s = np.clip((r * w - v) / np.maximum(np.maximum(np.abs(r * w), abs(v)), 0.05), -1, 1)
    mu = np.sign(s) * CURVE_A * (1 - 0.52 * np.exp(0.01 * abs(s)) - 0.48 * np.exp(-11.36 * abs(s)))
    static = 0.5 * m * G * np.array([lr / L, lr / L, 1 - lr / L, 1 - lr / L])
    load = np.maximum(0, static - 8e4 * z - 600 * zdot)
    dy[:4] = (torque - r * mu * load - r * 0.02 * load * np.clip(w / 0.02, -1, 1) - r * 2.0 * w) / J
    critical = RHO + RHO_SLIP * np.abs(s).reshape(2, 2).mean(axis=1)
    rolling = np.zeros(2)
    for a in range(2):
        rolling[a], dy[22 + a] = buildup(critical[a], rho[a], v, 0.02)

    # unknowns: dv/dt, front load, rear load
    weight, normal = m * G, m * G * np.cos(SLOPE)
    lhs = np.array([[m, rolling[0], rolling[1]], [m * h, L, 0], [0, 1, 1]])
    rhs = np.array(
        [
            (mu * load).sum() - force[0] - weight * np.sin(SLOPE),
            normal * lr - weight * np.sin(SLOPE) * h - force[0] * hd - J * dy[:4].sum(),
            normal,
        ]
    )
    dv, front, rear = np.linalg.solve(lhs, rhs)
    dy[4], dy[21] = dv, v
    dy[13:17] = zdot
    warp = np.array([1, -1, -1, 1])
    dy[17:21] = (load - np.array([front, front, rear, rear]) / 2 - 1500 * warp * (warp @ z)) / (static / G)
    return dy


def test_equations_agree_with_python(uphill):
    plant, rng = built(uphill), np.random.default_rng(3)
    scale = np.r_[
        np.full(4, 4.0), 0.8, np.full(4, 40.0), np.full(4, 60.0), np.full(4, 2e-3), np.full(4, 0.02), 3.0, 0.1, 0.1,
        np.tile([0.03, 0.8, 100.0], 2),
    ]  # fmt: skip
    for _ in range(400):
        y = scale * rng.standard_normal(30)
        y[21] += 10.0
        y[24], y[27] = y[21] - 2.1 + 0.06 * rng.standard_normal(), y[21] - 3.1 + 0.08 * rng.standard_normal()
        time = rng.uniform(0, 2.5)
        expected = reference(time, y)
        np.testing.assert_allclose(
            c_derivative(plant, time, y), expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max()
        )


def test_time_stepping_agrees_with_radau(uphill, drive):
    start = np.zeros(30)
    start[[24, 27]] = -2.1, -3.1
    solution = solve_ivp(reference, (0, 2.5), start, method="Radau", rtol=1e-8, atol=1e-9, max_step=0.02)
    end = solution.y[:, -1]
    for step, travel in ((1e-3, 2e-4), (1e-4, 2e-5)):
        trace = drive(uphill, step=step)
        np.testing.assert_allclose(trace["wheel_speed"][-1], end[:4], rtol=1e-5)
        np.testing.assert_allclose(trace["speed"][-1], end[4], rtol=1e-4)
        np.testing.assert_allclose(trace["torque"][-1], end[5:9], rtol=1e-3)
        # The kinks at first motion and first contact cost the large step its order, not its place.
        for name, index in (("position", 21), ("tool1_position", 24), ("tool2_position", 27)):
            np.testing.assert_allclose(trace[name][-1], end[index], atol=travel)


def test_second_order_under_step_halving(quiet, drive):
    """In smooth motion an error falls to a quarter when the step is halved."""
    scenario = quiet(tools=[], speed=[[0, 0], [4, 0.8]], duration=2.048)
    ends = [
        drive(scenario, step=h, stride=round(0.016 / h))["torque"][-1, 2] for h in (4e-3, 2e-3, 1e-3, 5e-4)
    ]
    first, second, third = np.abs(np.diff(ends))
    assert 3.0 < first / second < 5.5
    assert 3.0 < second / third < 5.5


def test_a_rough_drive_is_resolved_at_the_usual_step(drive):
    """Half the step moves speeds, slips and loads by far less than sensors can tell."""
    from terragrip.simulation import Scenario

    scenario = Scenario.load("accuracy-clean").model_copy(update={"duration": 60.0})
    coarse, fine = drive(scenario, seed=5, stride=10), drive(scenario, seed=5, step=5e-4, stride=20)
    moving = coarse["time"] > 5
    for name, limit in (("speed", 1e-3), ("slip", 2e-3), ("load", 1.0), ("torque", 0.3), ("drawbar", 2.0)):
        error = np.abs(coarse[name] - fine[name])[moving]
        assert np.sqrt((error**2).mean()) < limit, name


def test_energy_is_accounted_for(quiet, drive):
    """Work of the motors = kinetic energy + climb + what slip, tyres, bearings, soil, tool and bar take."""
    scenario = quiet(
        route={"segments": [{"soil": "even", "length": 60}], "slope": {"mean": 0.02}},
        tools=[{"mass": 60, "length": 2.0, "dig_in": 150, "friction": 0.1}],
        speed=[[0, 0], [1, 0.8], [4, 0.5]],
        duration=6,
    )
    t = drive(scenario)
    time, v, vt, w, load = t["time"], t["speed"], t["tool1_speed"], t["wheel_speed"], t["load"]

    def work(power):
        return np.trapezoid(power, time)

    motors = work((t["torque"] * w).sum(axis=1))
    slip = work((t["adhesion"] * load * (0.2 * w - v[:, None])).sum(axis=1))
    tyres = work((0.2 * 0.02 * load * np.clip(w / 0.02, -1, 1) * w).sum(axis=1))
    bearings = work((0.2 * 2.0 * w**2).sum(axis=1))
    soil = work(t.rolling_force.sum(axis=1) * v)
    tool = work(t["tool1_draught"] * vt)
    bar = work(t["drawbar"] * (v - vt))
    climb = (
        G
        * np.sin(0.02)
        * (
            139 * (t["position"][-1] - t["position"][0])
            + 60 * (t["tool1_position"][-1] - t["tool1_position"][0])
        )
    )
    kinetic = 0.5 * 139 * v[-1] ** 2 + 0.5 * 60 * vt[-1] ** 2 + 0.5 * 0.15 * (w[-1] ** 2).sum()
    assert motors > 500
    assert abs(motors - slip - tyres - bearings - soil - tool - bar - climb - kinetic) < 2e-3 * motors


def test_stiff_start_from_rest_stays_stable(quiet, drive):
    """Near rest on hard ground the wheels' time constant is 0.07 ms; steps of 1 and 5 ms neither ring nor differ."""
    hard = {"even": {"curve": {"name": "exponential", "a": 1.42}, "resistance": 0.05}}
    scenario = quiet(soils=hard, speed=[[0, 0], [1, 0], [6, 0.05]], duration=8)
    fine, coarse = drive(scenario, stride=5), drive(scenario, step=5e-3)
    assert np.abs(np.diff(coarse["wheel_speed"], axis=0)).max() < 0.02
    np.testing.assert_allclose(coarse["wheel_speed"], fine["wheel_speed"], atol=5e-3)
    np.testing.assert_allclose(coarse["speed"], fine["speed"], atol=5e-4)


def test_wheels_that_stop_past_the_peak_do_not_chatter(quiet, drive):
    """Where wheels lose their grip and stop, the recorded acceleration is that of the speed."""
    falling = {"even": {"curve": {"name": "burckhardt", "c1": 0.7, "c2": 30, "c3": 0.3}, "resistance": 0.05}}
    tool = {"mass": 60, "length": 2.0, "dig_in": 650}
    scenario = quiet(soils=falling, tools=[tool], speed=[[0, 0], [1, 0.6], [5, 0.6], [6, 0]], duration=8)
    trace = drive(scenario, stride=5)
    followed = np.cumsum(trace["acceleration"]) * 0.005
    assert np.abs(followed - trace["speed"]).max() < 0.05

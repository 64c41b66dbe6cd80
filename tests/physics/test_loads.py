"""Vertical loads against sums of forces and moments written out anew, and physics.md 3's own figure."""

import numpy as np
import pytest

from terragrip.physics.loads import GRAVITY, axle_loads, lateral_shares, load_levers, wheel_shares

ROBOT = {
    "axle_mass": [54.0, 85.0],
    "axle_position": [0.638, 0.0],
    "center_of_gravity_height": 0.30,
    "hitch_height": 0.25,
    "hitch_overhang": 0.10,
}


def test_a_level_standing_vehicle_carries_its_axle_masses():
    np.testing.assert_allclose(axle_loads(**ROBOT), np.array([54.0, 85.0]) * GRAVITY, rtol=1e-14)
    np.testing.assert_allclose(
        axle_loads([3.0, 5.0, 4.0], [2.0, 0.7, 0.0], center_of_gravity_height=1.0),
        np.array([3, 5, 4]) * GRAVITY,
    )


def test_pull_moves_the_load_of_physics_3():
    front = axle_loads(**ROBOT, drawbar=420.0)[0]
    moved = 54 * GRAVITY - front
    assert moved == pytest.approx(165, abs=0.5)
    assert moved / (54 * GRAVITY) == pytest.approx(0.31, abs=0.005)


def test_two_axles_follow_the_formula_of_physics_3():
    theta, a, fdx, fdz, spin = 0.15, 0.4, 300.0, 60.0, 1.7
    m, g, wheelbase, rear_arm = 139.0, 9.81, 0.638, 54 / 139 * 0.638
    front = (
        m * g * np.cos(theta) * rear_arm - m * (a + g * np.sin(theta)) * 0.30 - fdx * 0.25 - fdz * 0.10 - spin
    ) / wheelbase
    got = axle_loads(
        **ROBOT, drawbar=fdx, hitch_load=fdz, acceleration=a, slope=theta, spin_torque=spin, gravity=g
    )
    np.testing.assert_allclose(got, [front, m * g * np.cos(theta) + fdz - front], rtol=1e-13)


@pytest.mark.parametrize("position", [[0.638, 0.0], [2.4, 1.3, 0.0], [3.0, 2.9, 1.0, 0.0]])
def test_any_number_of_axles_balances_force_and_moment(position):
    rng = np.random.default_rng(4)
    mass = rng.uniform(20, 90, len(position))
    drawbar, hitch, accel, slope, spin = rng.uniform(0.1, 1, 5) * [300, 60, 1, 0.2, 3]
    got = axle_loads(
        mass,
        position,
        center_of_gravity_height=0.5,
        hitch_height=0.3,
        hitch_overhang=0.4,
        drawbar=drawbar,
        hitch_load=hitch,
        acceleration=accel,
        slope=slope,
        spin_torque=spin,
    )
    weight = mass.sum() * GRAVITY
    assert got.sum() == pytest.approx(weight * np.cos(slope) + hitch, rel=1e-13)
    pitch_up = (  # about the rear contact
        -weight * np.cos(slope) * (mass @ position) / mass.sum()
        + mass.sum() * (accel + GRAVITY * np.sin(slope)) * 0.5
        + drawbar * 0.3
        + hitch * 0.4
        + spin
    )
    assert got @ np.array(position) == pytest.approx(-pitch_up, rel=1e-12)


def test_equal_springs_change_in_a_straight_line():
    change = axle_loads(
        [50, 60, 70], [2.0, 1.5, 0.0], center_of_gravity_height=0.5, acceleration=1.0
    ) - axle_loads([50, 60, 70], [2.0, 1.5, 0.0], center_of_gravity_height=0.5)
    assert (change[0] - change[1]) / 0.5 == pytest.approx((change[1] - change[2]) / 1.5, rel=1e-12)
    assert change[0] < 0 < change[2]


def test_one_axle_carries_all():
    got = axle_loads(
        [80.0], [0.0], center_of_gravity_height=0.4, hitch_load=30.0, slope=0.2, drawbar=[0.0, 500.0]
    )
    np.testing.assert_allclose(got, np.full((2, 1), 80 * GRAVITY * np.cos(0.2) + 30), rtol=1e-14)


def test_loads_broadcast_over_time():
    drawbar = np.linspace(0, 400, 7)
    got = axle_loads(**ROBOT, drawbar=drawbar, slope=0.1)
    assert got.shape == (7, 2)
    for row, pull in zip(got, drawbar, strict=True):
        np.testing.assert_allclose(row, axle_loads(**ROBOT, drawbar=pull, slope=0.1), rtol=1e-14)


@pytest.mark.parametrize(
    ("mass", "position"),
    [
        ([54, 85], [0.0, 0.638]),
        ([54, -85], [0.638, 0.0]),
        ([54, 0], [0.638, 0.0]),
        ([54], [0.638, 0.0]),
        ([], []),
        ([[54, 85]], [[0.638, 0.0]]),
        ([54, 85], [0.7, 0.1]),
    ],
)
def test_impossible_axles_are_refused(mass, position):
    with pytest.raises(ValueError, match="ax"):
        axle_loads(mass, position, center_of_gravity_height=0.3)


def test_lateral_share_by_hand():
    # a_y h / (g track) = 2 * .3 / (10 * .5) = .12 to the left: the right wheel gains
    got = lateral_shares(2, 2.0, center_of_gravity_height=0.3, track=0.5, gravity=10.0)
    np.testing.assert_allclose(got, [0.38, 0.62], rtol=1e-14)
    np.testing.assert_allclose(lateral_shares(1, [0.0, 2.0], center_of_gravity_height=0.3, track=0.5), 1.0)


@pytest.mark.parametrize("wheels", [2, 3, 4])
def test_lateral_shares_balance_force_and_roll(wheels):
    got = lateral_shares(wheels, [-1.0, 0.0, 3.0], center_of_gravity_height=0.4, track=1.2)
    np.testing.assert_allclose(got.sum(axis=-1), 1.0, rtol=1e-14)
    left = np.linspace(0.6, -0.6, wheels)
    np.testing.assert_allclose(
        got @ left, -np.array([-1.0, 0.0, 3.0]) / GRAVITY * 0.4, rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize("position", [[0.638, 0.0], [2.0, 0.7, 0.0], [3.0, 2.0, 1.0, 0.0]])
def test_levers_add_no_weight_and_one_moment(position):
    levers = load_levers(position)
    assert levers.sum() == pytest.approx(0, abs=1e-15)
    assert levers @ np.array(position) == pytest.approx(1)
    assert load_levers([0.0]).tolist() == [0.0]


def test_wheel_shares_are_lateral_shares_of_every_axle():
    given = {"center_of_gravity_height": 0.4, "track": 1.2}
    level, leaning = wheel_shares([2, 3], axle_mass=[30.0, 70.0], **given)
    wanted = np.concatenate([lateral_shares(n, -1.7, **given) for n in (2, 3)])
    np.testing.assert_allclose(level + 1.7 * leaning, wanted, rtol=1e-14)
    unknown, none = wheel_shares([2], center_of_gravity_height=0.4, track=None, axle_mass=[9.0])
    assert unknown.tolist() == [0.5, 0.5]
    assert none.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("wheels", "pins", "front"),
    [([2, 2], {}, 30.0 * 0.9), ([2, 2], {0: 0.5}, 30.0 * 0.5), ([1, 2], {}, 0.0), ([2, 2], {0: 0.0}, 0.0)],
)
def test_what_an_axle_on_a_pin_leaves_of_a_roll_the_others_hold(wheels, pins, front):
    """About the ground the loads hold the moment of the whole mass, 100 kg at .9 m; a pin passes on what acts above it."""
    _, leaning = wheel_shares(
        wheels, center_of_gravity_height=0.9, track=1.6, axle_mass=[30.0, 70.0], pins=pins
    )
    left = np.concatenate([np.linspace(0.8, -0.8, n) if n > 1 else np.zeros(1) for n in wheels])
    moment = leaning * left * GRAVITY * np.repeat([30.0, 70.0], wheels)
    assert moment[: wheels[0]].sum() == pytest.approx(front, abs=1e-12)
    assert moment.sum() == pytest.approx(100.0 * 0.9)

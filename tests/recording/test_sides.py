"""What left and right wheels say against each other, on a skid-steered drive whose every number is known (made here, quasi-steady)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terragrip.recording import Recording, unit_warnings
from terragrip.recording.sides import exchanged_torques, side_warnings
from terragrip.simulation import families, simulate
from terragrip.vehicle import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
MASS, RADIUS, TRACK, G = 120.0, 0.18, 0.6, 9.80665
WEIGHT = MASS * G


def vehicle() -> Vehicle:
    axles = {"front": {"mass": 55, "wheels": ["fl", "fr"]}, "rear": {"mass": 65, "wheels": ["rl", "rr"]}}
    base = {"mass": MASS, "wheelbase": 0.6, "track": TRACK, "center_of_gravity_height": 0.25, "axles": axles}
    return Vehicle.from_dict({**base, "wheel": {"radius": RADIUS, "inertia": 0.1}})


def skidding(seed: int = 0, *, steered: bool = False) -> Recording:
    """Straight stretches and turns on hills at 20 Hz; each side slips by what it takes to scrub round. ``steered``: no side does."""
    rng, time = np.random.default_rng(seed), np.arange(0, 240, 0.05)
    turn = np.where(time % 30 > 20, 0.5 * np.sign(np.sin(time / 30 * np.pi)), 0.0)
    turn = np.convolve(turn, np.ones(20) / 20, "same")
    v = 1.0 + 0.2 * np.sin(time / 9)
    slope = 0.05 * np.sin(time / 12)
    force = 0.14 + np.sin(slope) + np.gradient(v, 0.05) / G  # of the weight
    scrub = 0.0 if steered else 0.25 * np.tanh(turn / 0.2)
    columns = {
        "time": time,
        "ground_speed": v + 0.01 * rng.standard_normal(len(time)),
        "angular_velocity_z": turn,
        "pitch": slope,
    }
    for wheel in WHEELS:
        side = 1 if wheel.endswith("l") else -1
        load = 0.25 * WEIGHT * (1.08 if wheel.startswith("r") else 0.92)
        mu = force - side * scrub
        slip = np.clip(mu / 4, -0.3, 0.3)
        columns[f"wheel_speed_{wheel}"] = (v - side * TRACK / 2 * turn) / (
            1 - slip
        ) / RADIUS + 0.02 * rng.standard_normal(len(time))
        columns[f"drive_torque_{wheel}"] = RADIUS * load * mu + 0.2 * rng.standard_normal(len(time))
    return Recording.from_frame(columns)


def notes_on(log: Recording, **factors: float) -> list[str]:
    """The notes on a log of which some channels are multiplied."""
    changed = {name: log.channels[name] * factor for name, factor in factors.items()}
    return unit_warnings(log.with_channels(**changed), vehicle())


def exchanged(log: Recording, *wheels: str) -> list[str]:
    a, b = (f"drive_torque_{w}" for w in wheels)
    return unit_warnings(log.with_channels(**{a: log.channels[b], b: log.channels[a]}), vehicle())


@pytest.mark.parametrize("seed", range(3))
def test_a_right_log_is_left_alone(seed: int) -> None:
    assert notes_on(skidding(seed)) == []
    assert notes_on(skidding(seed, steered=True)) == []


@pytest.mark.parametrize("axle", ["f", "r"])
def test_torques_exchanged_within_an_axle_are_named_by_skid_turns(axle: str) -> None:
    (note,) = exchanged(skidding(), f"{axle}l", f"{axle}r")
    assert note.startswith(
        f"drive_torque_{axle}l and drive_torque_{axle}r (or these wheels' speeds) may be exchanged: in turns"
    )


def test_a_steered_vehicle_does_not_show_torques_exchanged_within_an_axle() -> None:
    assert exchanged(skidding(steered=True), "fl", "fr") == []


def test_exchanged_torques_need_a_rate_of_turn() -> None:
    log = skidding()
    unseen = replace(log, channels={n: v for n, v in log.channels.items() if n != "angular_velocity_z"})
    assert exchanged(unseen, "fl", "fr") == []


def test_without_torques_none_are_exchanged() -> None:
    """Nor where an axle has one torque alone."""
    log = skidding()
    for lost in ("drive_torque", "drive_torque_fl"):
        left = replace(log, channels={n: v for n, v in log.channels.items() if not n.startswith(lost)})
        assert exchanged_torques(left, vehicle(), log.channels["angular_velocity_z"]) == []


@pytest.mark.parametrize(("size", "said"), [(1.0, True), (0.05, False)])
def test_torques_that_hardly_differ_in_turns_show_no_exchange(size: float, said: bool) -> None:
    """Differences below a thirtieth of a wheel's load may be the ground's, or the sensors'."""
    log, torques = skidding(), {}
    for left, right in (("fl", "fr"), ("rl", "rr")):
        torques[f"drive_torque_{left}"] = size * log.channels[f"drive_torque_{right}"]
        torques[f"drive_torque_{right}"] = size * log.channels[f"drive_torque_{left}"]
    turn = log.channels["angular_velocity_z"]
    assert bool(exchanged_torques(log.with_channels(**torques), vehicle(), turn)) is said


@pytest.mark.parametrize(("gain", "said"), [(0.9, False), (0.75, True), (1.35, True)])
def test_a_torque_of_another_scale_is_named_straight_ahead(gain: float, said: bool) -> None:
    notes = notes_on(skidding(), drive_torque_rl=gain)
    assert bool(notes) is said
    if said:
        assert notes[0].startswith(
            f"Straight ahead drive_torque_rl is {gain:.2f} times drive_torque_rr, and other axles' torques are alike"
        )


def test_torques_uneven_on_both_axles_are_the_load() -> None:
    assert notes_on(skidding(), drive_torque_rl=0.75, drive_torque_fl=0.75) == []


@pytest.mark.parametrize("known", [None, "roll", "acceleration_y"])
@pytest.mark.parametrize("pivots", [True, False])
def test_torques_across_a_slope_are_the_load(pivots: bool, known: str | None) -> None:
    """A right mower across 4 degrees: drive_torque_rl was .70 times drive_torque_rr, 'check the scale'. Its front axle pivots, so the rear
    one holds it; or a differential keeps the front torques alike, which a measured slope alone explains."""
    data = vehicle().to_dict()
    data |= {"center_of_gravity_height": 0.45 if pivots else 0.67}
    data["axles"]["front"]["pivots"] = pivots
    mower, log, sideways = Vehicle.from_dict(data), skidding(), 0.75
    level, lost = mower.wheel_shares
    lean = {w: 1 - k * sideways for w, k in zip(WHEELS, lost / level, strict=True) if pivots or w[0] == "r"}
    torques = {f"drive_torque_{w}": k * log.channels[f"drive_torque_{w}"] for w, k in lean.items()}
    across = {"roll": np.arcsin(sideways / G), "acceleration_y": sideways}
    shown = {known: np.full(len(log), across[known])} if known else {}
    notes = side_warnings(log.with_channels(**torques, **shown), mower, log.channels["angular_velocity_z"])[1]
    assert bool(notes) is (not pivots and known is None)
    scaled = log.with_channels(drive_torque_rl=0.7 * log.channels["drive_torque_rl"], roll=np.zeros(len(log)))
    assert len(side_warnings(scaled, mower, log.channels["angular_velocity_z"])[1]) == 1


def test_small_gains_of_two_axles_do_not_add_up_to_a_scale() -> None:
    assert notes_on(skidding(), drive_torque_rl=0.87, drive_torque_fl=1.1) == []


@pytest.mark.parametrize(("scale", "said"), [(1.03, False), (1.1, True)])
def test_a_rim_that_goes_faster_straight_ahead_is_named(scale: float, said: bool) -> None:
    notes = notes_on(skidding(), wheel_speed_fl=scale)
    assert bool(notes) is said
    if said:
        assert notes[0].startswith(
            f"Straight ahead the rim of fl goes {scale:.2f} times as fast as that of fr"
        )


def test_a_torque_that_falls_where_its_neighbour_rises_is_named() -> None:
    assert any(
        n.startswith("drive_torque_rr falls where") for n in notes_on(skidding(), drive_torque_rr=-1.0)
    )


def little(gain: float = 1.0, *, offset: float = 0.0, gyroscope: bool = True) -> list[str]:
    """The notes on a drive at a third of the pull, whose rear left torque has a gain, and an offset [N m]."""
    log = skidding(steered=True)
    small = {n: v / 3 for n, v in log.channels.items() if n.startswith("drive_torque")}
    small["drive_torque_rl"] = gain * small["drive_torque_rl"] + offset
    changed = log.with_channels(**small)
    left_out = () if gyroscope else ("angular_velocity_z",)
    kept = {n: v for n, v in changed.channels.items() if n not in left_out}
    rims, torques = side_warnings(replace(changed, channels=kept), vehicle(), kept.get("angular_velocity_z"))
    return rims + torques


@pytest.mark.parametrize("gyroscope", [True, False])
def test_a_torque_of_another_scale_is_named_where_the_vehicle_pulls_little(gyroscope: bool) -> None:
    (note,) = little(0.7, gyroscope=gyroscope)
    assert note.startswith("Straight ahead drive_torque_rl is 0.70 times drive_torque_rr")


def test_an_offset_of_a_small_torque_is_no_scale() -> None:
    assert little() == []
    assert little(offset=1.0) == []


def test_torques_of_a_free_axle_around_zero_have_no_sign() -> None:
    log = skidding()
    wave = 0.5 * np.sin(log.time / 7)
    free = log.with_channels(drive_torque_fl=0.1 + wave, drive_torque_fr=-0.1 - wave)
    assert [
        n for n in side_warnings(free, vehicle(), free.channels["angular_velocity_z"])[1] if "falls" in n
    ] == []


def on_a_track(factor: float, *, steered: bool = False) -> list[str]:
    data = vehicle().to_dict()
    data["track"] = TRACK * factor
    data["axles"]["front"]["steered"] = steered
    log = skidding(steered=steered)
    return [
        note
        for note in unit_warnings(log, Vehicle.from_dict(data))
        if note.startswith("In turns the hubs differ")
    ]


@pytest.mark.parametrize(("factor", "said"), [(0.1, True), (0.4, False), (1.0, False), (2.0, True)])
def test_a_track_that_no_scrubbing_explains_is_named(factor: float, said: bool) -> None:
    assert bool(on_a_track(factor)) is said


@pytest.mark.parametrize(("factor", "said"), [(0.5, True), (1.0, False), (2.0, True)])
def test_steered_wheels_scrub_less(factor: float, said: bool) -> None:
    assert bool(on_a_track(factor, steered=True)) is said


def test_an_uneven_torque_hides_no_wrong_unit_of_a_speed() -> None:
    """A ground speed in knots was left alone where two torques of an axle differed."""
    notes = " ".join(notes_on(skidding(), ground_speed=1 / 0.5144, drive_torque_fl=1.4))
    assert "drive_torque_fl is 1.4" in notes
    assert "ground_speed may be in knots" in notes


def test_simulated_torques_of_left_and_right_exchanged_are_named_and_right_ones_are_not() -> None:
    """The paper's robot turns with a thirtieth of a wheel's load; a machine whose sides pull alike shows nothing, whatever chance does."""
    run = simulate("multi1", 2)
    swapped = dict(run.recording.channels)
    for axle in run.vehicle.axles.values():
        left, right = (f"drive_torque_{wheel}" for wheel in (axle.wheels[0], axle.wheels[-1]))
        swapped[left], swapped[right] = swapped[right], swapped[left]
    notes = unit_warnings(replace(run.recording, channels=swapped), run.vehicle)
    assert any("in turns the wheel that is faster than its hub would brake" in note for note in notes)
    alike = families.draw(families.Kind("robot", "brixius", "even", "rolling"), 36078)
    assert unit_warnings(alike.recording, alike.vehicle) == []


@pytest.mark.parametrize("factor", [1.2, 1 / 1.2])
def test_one_rim_that_is_apart_where_the_other_axle_is_level_is_named_without_a_gyroscope(
    factor: float,
) -> None:
    """A wrong number of teeth: the wheel's slip was .17 off, and a gyroscope alone told it."""
    log = skidding()
    bare = replace(log, channels={n: v for n, v in log.channels.items() if n != "angular_velocity_z"})
    assert notes_on(bare) == []
    (note,) = notes_on(bare, wheel_speed_fl=factor)
    assert note.startswith(f"Straight ahead the rim of fl goes {factor:.2f} times as fast as that of fr")
    assert not any("Straight ahead the rim" in one for one in notes_on(bare, wheel_speed_fl=1.07))


def test_a_furrow_wheel_that_slips_while_the_axle_pulls_is_no_radius() -> None:
    """A fifth of the drive is road, with hardly a pull; a scale is there, too."""
    log = skidding(steered=True)
    road, channels = log.time < 54, dict(log.channels)
    channels |= {n: np.where(road, 0.2 * v, v) for n, v in channels.items() if n.startswith("drive_torque")}
    rims = channels["wheel_speed_rr"]
    furrow = replace(log, channels=channels | {"wheel_speed_rr": np.where(road, 1.0, 1.08) * rims})
    said = "Straight ahead the rim of rl"
    assert not any(said in note for note in side_warnings(furrow, vehicle(), log["angular_velocity_z"])[0])
    scaled = replace(log, channels=channels | {"wheel_speed_rr": 1.08 * rims})
    assert any(said in note for note in side_warnings(scaled, vehicle(), log["angular_velocity_z"])[0])


def test_wheels_of_a_vehicle_that_is_dug_in_may_spin_unlike() -> None:
    """Each as fast as its drive lets it, on ground that stands: no scale, radius or unit is wrong. (Simulated machines 9705 and 9729 of
    the rolling chassis were accused.)"""
    log = skidding()
    rng, still = np.random.default_rng(1), log.time > 60
    ground = np.where(still, 0.0, log.channels["ground_speed"]) + 0.02 * rng.standard_normal(len(log))
    spun = np.where(still, 1.3, 1.0) * log.channels["wheel_speed_rl"]
    notes = unit_warnings(log.with_channels(ground_speed=ground, wheel_speed_rl=spun), vehicle())
    assert not [note for note in notes if "wheel_speed_" in note]
    stuck = log.with_channels(ground_speed=0.02 * rng.standard_normal(len(log)))
    assert not [note for note in unit_warnings(stuck, vehicle()) if "times the ground speed" in note]

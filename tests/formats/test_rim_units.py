"""The unit of wheel speeds that state none, by the vehicle's radii: never sure and wrong, on simulated and on measured drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.arrays import Floats
from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.recognition import propose
from terragrip.formats.rim_units import ROTATION, SPEED
from terragrip.simulation import families
from terragrip.units import factor_to
from terragrip.vehicle import Vehicle

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
UNITS = (*ROTATION, *SPEED)
TIME = np.arange(0.0, 60.0, 0.1)
GROUND = 1.0 + 0.5 * np.sin(TIME / 5)
SLIP = 0.05 + 0.04 * np.sin(TIME / 9)


def machine(front: float, rear: float) -> Vehicle:
    """Two driven axles with wheels of these radii [m]."""
    axle = {"mass": 100.0, "driven": True}
    return Vehicle.model_validate(
        {
            "mass": 200.0,
            "wheelbase": 1.5,
            "center_of_gravity_height": 0.5,
            "axles": {
                "front": {**axle, "wheels": ["fl", "fr"], "wheel": {"radius": front, "inertia": 0.5}},
                "rear": {**axle, "wheels": ["rl", "rr"], "wheel": {"radius": rear, "inertia": 0.5}},
            },
        }
    )


def in_unit(turning: Floats, radius: float, unit: str) -> Floats:
    """A wheel's turning [rad/s] as a logger of this unit writes it."""
    return (
        turning / factor_to(unit, "rad/s") if unit in ROTATION else turning * radius / factor_to(unit, "m/s")
    )


def proposed(
    turning: Mapping[str, Floats],
    radii: Mapping[str, float],
    unit: str,
    ground: Floats,
    time: Floats,
    vehicle: Vehicle,
) -> dict[str, Proposal]:
    """What is proposed of wheels logged in a unit that is not stated, beside a ground speed in m/s."""
    columns = {f"wheel_{wheel}_speed": in_unit(one, radii[wheel], unit) for wheel, one in turning.items()}
    columns["gps_speed"] = ground
    clocks = dict.fromkeys(columns, time)
    result = propose(columns, (), {"gps_speed": "m/s"}, clocks, vehicle=vehicle)
    return {channel: one for channel, one in result.items() if channel.startswith("wheel_speed_")}


def drive(vehicle: Vehicle) -> tuple[dict[str, Floats], dict[str, float]]:
    radii = dict(zip(vehicle.wheels, map(float, vehicle.wheel_radius), strict=True))
    return {wheel: GROUND / (1 - SLIP) / radius for wheel, radius in radii.items()}, radii


@pytest.mark.long  # measured drives: above and below
def test_on_development_machines_it_is_never_sure_and_wrong() -> None:
    """Simulated: machines of 5 kg to 12 t at work, nine units each; file and machine agree on the radius within some per cent."""
    sure = dict.fromkeys(UNITS, 0)
    count = 0
    for kind, seed in families.machines("development", 10):
        result = families.draw(kind, seed, rate=20.0)
        turned = {w: result.recording[f"wheel_speed_{w}"] for w in result.vehicle.wheels}
        # inspect reads wheels by numbers; what the machine's are called does not matter
        names = {wheel: str(number) for number, wheel in enumerate(result.vehicle.wheels, 1)}
        tree = result.vehicle.model_dump(mode="json", exclude_unset=True)
        tree.pop("calibration", None)
        for axle in tree["axles"].values():
            axle["wheels"] = [names[wheel] for wheel in axle["wheels"]]
        vehicle = Vehicle.model_validate(tree)
        radii = dict(zip(vehicle.wheels, map(float, vehicle.wheel_radius), strict=True))
        turning = {names[wheel]: one for wheel, one in turned.items()}
        for unit in UNITS:
            ground = result.recording["ground_speed"]
            for one in proposed(turning, radii, unit, ground, result.recording.time, vehicle).values():
                assert one.doubt or one.unit == unit, (kind, seed, unit, one)
                sure[unit] += not one.doubt
                count += unit == "rpm"
    assert sure["rpm"] > 0.7 * count
    assert sure["km/h"] > 0.7 * count
    assert sure["rad/s"] > 0.4 * count
    assert sure["m/s"] > 0.3 * count


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("machine_name", "log"),
    [
        ("alostar_4wd", "alostar_4wd/log3300-180-3300-180.txt"),
        ("alostar_4wd", "alostar_4wd/log3300-180-3300-180-2.txt"),
        ("alostar_4wd", "alostar_4wd/log90-2.txt"),  # turns on the spot
        ("alostar_4wd", "alostar_4wd/log90-3.txt"),
        ("alostar_4wd", "alostar_4wd/log90-90-90-90.txt"),
        ("alostar_4wd", "alostar_4wd/log_3300x.txt"),
        ("drive_warthog", "drive_warthog/raw20hz/warthog_wheels_grass.csv.gz"),
        ("drive_warthog", "drive_warthog/raw20hz/warthog_wheels_grass_2024_7_29_14h46s15.csv.gz"),
        ("pathfinder_rover", "pathfinder_rover/s5t1_odom_gps_10hz.csv.gz"),  # a poor receiver
        ("pathfinder_rover", "pathfinder_rover/test17run_odom_gps_10hz.csv.gz"),
    ],
)
def test_on_measured_drives_it_is_never_sure_and_wrong(
    shared: Callable[[str], Path], machine_name: str, log: str
) -> None:
    vehicle = Vehicle.load(EXAMPLES / machine_name / "vehicle.yaml")
    recording = tg.read(shared(f"data/{log}"), EXAMPLES / machine_name / "profile.yaml")
    radii = dict(zip(vehicle.wheels, map(float, vehicle.wheel_radius), strict=True))
    turning = {wheel: recording[f"wheel_speed_{wheel}"] for wheel in vehicle.wheels}
    seen = set()
    for unit in UNITS:
        result = proposed(turning, radii, unit, recording["ground_speed"], recording.time, vehicle)
        assert result
        for one in result.values():
            assert one.doubt or one.unit == unit, (unit, one)
            seen.add(bool(one.doubt))
    on_the_spot_or_poor = "log90" in log or "s5t1" in log
    assert (False in seen) != on_the_spot_or_poor


def test_where_two_units_fit_both_are_named_with_a_question_mark() -> None:
    """A radius of 1/3.6 m turns as many rad/s as its rim goes km/h: no log of equal wheels can tell."""
    vehicle = machine(1 / 3.6, 1 / 3.6)
    for unit in ("rad/s", "km/h"):
        one = proposed(*drive(vehicle), unit, GROUND, TIME, vehicle)["wheel_speed_fl"]
        assert "in rad/s" in one.doubt
        assert "in km/h" in one.doubt
    one = proposed(*drive(vehicle), "rpm", GROUND, TIME, vehicle)["wheel_speed_fl"]
    assert (one.unit, one.doubt) == ("rpm", "")
    assert "0.278 m" in one.evidence[-1]


def test_terragrips_own_name_says_rad_s_where_that_is_possible() -> None:
    for radius in (1 / 3.6, 0.6):
        vehicle = machine(radius, radius)
        turning, _ = drive(vehicle)
        columns = {f"wheel_speed_{wheel}": one for wheel, one in turning.items()} | {"ground_speed": GROUND}
        one = propose(columns, (), {}, dict.fromkeys(columns, TIME), vehicle=vehicle)["wheel_speed_fl"]
        assert (one.unit, one.doubt, one.confidence) == ("rad/s", "", 1.0)


@pytest.mark.parametrize("unit", ["rad/s", "m/s"])
def test_unequal_wheels_of_two_driven_axles_tell_turning_from_rim_speed(unit: str) -> None:
    for rear, sure in ((0.95, True), (0.75, False)):
        vehicle = machine(0.75, rear)
        one = proposed(*drive(vehicle), unit, GROUND, TIME, vehicle)["wheel_speed_rl"]
        assert one.unit == unit or not sure
        assert (one.doubt == "") == sure


def test_a_drive_that_says_nothing_leaves_the_question_mark() -> None:
    vehicle = machine(0.3, 0.3)
    turning, radii = drive(vehicle)
    noise = np.abs(np.random.default_rng(3).standard_normal(len(TIME)))
    for ground in (0.01 * noise, 0.3 * noise.cumsum() % 2):  # it stands, its wheels turn; a broken speed
        for one in proposed(turning, radii, "rpm", ground, TIME, vehicle).values():
            assert one.doubt
    # motors called wheels: their gear ratio looks like cm/s, or like nothing
    for ratio, said in ((29.0, "(in cm/s)"), (17.0, "in any unit")):
        turned = {wheel: ratio * one for wheel, one in turning.items()}
        assert said in proposed(turned, radii, "rad/s", GROUND, TIME, vehicle)["wheel_speed_fl"].doubt


def test_a_stated_unit_that_the_radius_contradicts_is_in_doubt() -> None:
    vehicle = machine(0.6, 0.6)
    turning, radii = drive(vehicle)
    columns = {f"wheel_{wheel}_speed": in_unit(one, radii[wheel], "m/s") for wheel, one in turning.items()}
    columns["gps_speed"] = GROUND
    stated = {**dict.fromkeys(columns, "rad/s"), "gps_speed": "m/s"}
    clocks = dict.fromkeys(columns, TIME)
    assert propose(columns, (), stated, clocks)["wheel_speed_fl"].doubt == ""  # a wheel of 0.95 m is one
    assert "radius of 0.6 m" in propose(columns, (), stated, clocks, vehicle=vehicle)["wheel_speed_fl"].doubt


def test_inspect_with_a_vehicle_writes_a_profile_that_estimates_right(tmp_path: Path) -> None:
    """Rim speeds in km/h, unit not stated: the scale holds the vehicle's radius, and the slip comes out."""
    (tmp_path / "v.yaml").write_text(
        "mass: 100 kg\naxles: {only: {mass: 100 kg, wheels: [l, r]}}\nwheel: {radius: 0.55 m, inertia: 1 kg m^2}\n"
        "sensors: {wheel_speed: 0.02, ground_speed: 0.01, drive_torque: 1}\n"
    )
    rim = 3.6 * GROUND / (1 - 0.1)
    table = {"time": TIME, "gps_speed_mps": GROUND, "wheel_left_speed": rim, "wheel_right_speed": rim}
    log, profile, out = (tmp_path / name for name in ("log.csv", "p.yaml", "e.parquet"))
    pd.DataFrame(table).to_csv(log, index=False)
    words = ["--vehicle", str(tmp_path / "v.yaml")]
    assert main(["inspect", str(log), *words, "--write-profile", str(profile)]) == 0
    assert "?" not in "".join(
        line for line in profile.read_text().splitlines() if "# ?" in line or "wheel_speed" in line
    )
    assert main(["estimate", str(log), *words, "--profile", str(profile), "-o", str(out), "--quiet"]) == 0
    slip = Estimates.read(out)["slip_l"]
    assert np.median(slip) == pytest.approx(0.1, abs=0.01)

"""A mass that changes, as a channel: against the same machine weighed, a closed form, and differences of the estimate itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import terragrip as tg
from drives import MASS, WHEELS, drive, robot, with_values
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator, estimate
from terragrip.estimation.calibration.procedure import _refuse_other_load
from terragrip.estimation.estimates import Estimates
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording

pytestmark = pytest.mark.usefixtures("unchecked")

METHODS = ("kalman", "bank", "ukf", "aukf-fs", "algebraic")
AT = (0.2, 0.5)  # of the tank: m ahead of the rear axle, m high


def tanker(**changes: object) -> tg.Vehicle:
    """The robot with a tank, and a scale that is known."""
    sensors = robot().to_dict()["sensors"] | {"mass": 0.5, "hitch_load": 4.0}
    return robot(payload={"x": AT[0], "z": AT[1]}, sensors=sensors, **changes)


def filled(kilograms: float, **options: object) -> Recording:
    return drive(20.0, imu=True, payload=lambda t: kilograms + 0 * t, payload_at=AT, **options).recording


def without(recording: Recording, name: str) -> Recording:
    return replace(recording, channels={n: v for n, v in recording.channels.items() if n != name})


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_mass_is_the_machine_that_weighs_it(method):
    """The same log by the file of the machine as filled, and by the mass that stands in the log."""
    log = drive(20.0, payload=lambda t: 60.0 + 0 * t, payload_at=AT).recording
    log = with_values(log, "mass", slice(None), MASS + 60.0)
    loaded = tanker().loaded(MASS + 60.0)
    assert loaded.axle_mass[0] == pytest.approx(54 + 60 * AT[0] / 0.638)
    by_file = estimate(without(log, "mass"), loaded, method)
    by_channel = estimate(log, tanker(), method)
    late = by_file.time > 5  # what is not known at the start is broader on a heavier machine
    for name in by_file.columns:
        if name.endswith("_std") or name.startswith(("curve", "warning", "adaptation", "nis", "distance")):
            continue
        # what wheels do beyond axles and sides is weighed by the file's loads at rest, which the payload shifts (warp.c)
        weighed = name.startswith(("adhesion_", "net_traction_", "efficiency_"))
        np.testing.assert_allclose(
            by_channel[name][late],
            by_file[name][late],
            rtol=1e-6,
            atol=2e-3 if weighed else 1e-7,
            err_msg=name,
        )


@pytest.mark.parametrize("method", METHODS)
def test_the_mass_of_the_file_as_a_channel_changes_nothing(method):
    log = drive(10.0, imu=True).recording
    plain = estimate(log, tanker(), method)
    said = estimate(log.with_channels(mass=np.full(len(log), MASS)), tanker(), method)
    for name in ("soil_resistance", "vertical_load_front", *(f"adhesion_{w}" for w in WHEELS)):
        np.testing.assert_allclose(said[name], plain[name], rtol=1e-10, atol=1e-13, err_msg=name)


def test_a_tank_that_fills():
    """The adhesion's bias goes away and the interval holds the truth; by the file alone it does not."""
    way = {"payload": lambda t: 4.0 * t, "payload_at": AT}
    made = [drive(30.0, imu=True, seed=seed, **way) for seed in range(4)]
    inside, outside, off, off_plain = [], [], [], []
    for one in made:
        knows = estimate(one.recording, tanker())
        lacks = estimate(without(one.recording, "mass"), tanker())
        late = one.recording.time > 10  # 40 kg and more on 139
        for wheel in WHEELS:
            for found, hits, errors in ((knows, inside, off), (lacks, outside, off_plain)):
                error = (found[f"adhesion_{wheel}"] - one.truth[f"adhesion_{wheel}"])[late]
                hits.append(np.mean(np.abs(error) < 1.96 * found[f"adhesion_{wheel}_std"][late]))
                errors.append(np.mean(error))
        for axle in ("front", "rear"):
            np.testing.assert_allclose(
                knows[f"vertical_load_{axle}"][late], one.truth[f"vertical_load_{axle}"][late], rtol=0.02
            )
    assert np.mean(inside) > 0.9
    assert np.mean(outside) < 0.3
    assert np.max(np.abs(off)) < 0.01
    assert np.mean(off_plain) > 0.1


@pytest.mark.parametrize(
    ("method", "places"), [("kalman", {}), ("algebraic", {}), ("kalman", {"payload": {"x": -0.3}})]
)
def test_the_spread_of_the_mass_is_what_an_error_of_it_does(method, places):
    """Against a difference: the log's mass wrong by one SD moves the estimate by the column that one SD of it makes, a payload's behind
    the rear axle, too."""
    log = with_values(
        drive(12.0, noise=0.2, imu=True, slip=lambda t: 0.12 + 0 * t).recording, "pitch", slice(None), 0.0
    )
    log = log.with_channels(mass=np.full(len(log), MASS + 30.0))
    share, size = 0.1, 1e-4
    quiet = robot(uncertainty={}, sensors=tanker().to_dict()["sensors"] | {"mass": 1e-3}, **places)
    plain = estimate(log, quiet, method)
    doubtful = estimate(
        log,
        quiet.model_copy(update={"uncertainty": quiet.uncertainty.model_copy(update={"mass": share})}),
        method,
    )
    moved = [
        estimate(with_values(log, "mass", slice(None), (MASS + 30.0) * (1 + sign * size)), quiet, method)
        for sign in (1, -1)
    ]
    for name in ("soil_resistance", "adhesion_fl", "adhesion_rr", "net_traction_rl"):
        difference = (moved[0][name][-1] - moved[1][name][-1]) / (2 * size)
        column = np.sqrt(doubtful[f"{name}_std"][-1] ** 2 - plain[f"{name}_std"][-1] ** 2) / share
        assert column == pytest.approx(abs(difference), rel=0.05, abs=2e-4), name


def test_between_samples_the_last_one_stands():
    log = filled(40.0, noise=0.0)
    sparse = with_values(log, "mass", np.arange(len(log)) % 100 != 0, np.nan)
    often, seldom = estimate(log, tanker()), estimate(sparse, tanker())
    np.testing.assert_allclose(seldom["vertical_load_rear"], often["vertical_load_rear"], rtol=1e-9)
    late = with_values(log, "mass", log.time < 6, np.nan)
    doubt = estimate(late, tanker())["adhesion_rl_std"]
    assert doubt[400] > 3 * doubt[-1]  # nobody knows yet what is in the tank


def test_a_mass_that_is_none_is_passed_over_and_flagged():
    log = filled(40.0, noise=0.0)
    rows = [500, 700, 900]
    broken = with_values(log, "mass", rows, [0.0, -1.0, 1e7])
    whole, found = estimate(log, tanker()), estimate(broken, tanker())
    assert list(found["event"][rows]) == ["outlier"] * 3
    np.testing.assert_allclose(found["vertical_load_rear"], whole["vertical_load_rear"], rtol=1e-9)


def test_a_bale_that_falls_down_counts_from_the_second_sample():
    log = filled(40.0, noise=0.0)
    unloaded = estimate(with_values(log, "mass", log.time >= 10, MASS), tanker())
    load = unloaded["vertical_load_front"] + unloaded["vertical_load_rear"]
    assert load[990] == pytest.approx((MASS + 40) * 9.80665, rel=1e-6)
    assert load[1100] == pytest.approx(MASS * 9.80665, rel=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("t", 1e-3), ("lb", 1 / 0.45359237)])
def test_a_mass_in_another_unit_is_refused_with_it(unit, factor):
    log = filled(40.0, noise=0.0)
    wrong = with_values(log, "mass", slice(None), log.channels["mass"] * factor)
    if factor > 1:
        assert isinstance(estimate(wrong, tanker()), Estimates)  # 395 kg: a tank could hold that
        wrong = with_values(log, "mass", slice(None), log.channels["mass"] * factor * 10)
    with pytest.raises(InputError, match=r"column mass: reads .* kg, the vehicle file has 139 kg") as caught:
        estimate(wrong, tanker())
    assert factor > 1 or f"'unit: {unit}'" in str(caught.value)


def test_sample_by_sample_and_after_a_snapshot_every_digit_is_the_same():
    log = drive(
        8.0,
        imu=True,
        payload=lambda t: 4 * t,
        payload_at=AT,
        hitch=lambda t: 100 + 20 * t,
        hitch_overhang=0.2,
    ).recording
    machine = tanker(hitch_overhang=0.2)
    whole = TractionEstimator.for_recording(log, machine).update_block(log)
    one = TractionEstimator.for_recording(log, machine)
    for k, time in enumerate(log.time):
        if k == 300:
            one = TractionEstimator.restore(one.snapshot())
        row = one.update_at(time, {name: values[k] for name, values in log.channels.items()})
        assert all(np.array_equal(row[name], whole[name][k], equal_nan=True) for name in one.columns)


def test_calibrate_refuses_another_load():
    with pytest.raises(InputError, match="column mass: calibrate needs the load of the vehicle file, 139 kg"):
        tg.calibrate(filled(40.0), tanker())


@pytest.mark.parametrize(("share", "refused"), [(0.019, False), (0.021, True), (-0.021, True)])
def test_calibrate_takes_loads_within_a_fiftieth_of_the_mass(share, refused):
    rows = np.full(20, 139 * (1 + share)), np.full(20, share * 139 * GRAVITY)
    for name, values in zip(("mass", "hitch_load"), rows, strict=True):
        log = Recording(np.arange(20.0), {name: np.r_[np.nan, values[1:]]})
        if refused:
            with pytest.raises(InputError, match=f"column {name}: calibrate needs the load"):
                _refuse_other_load(log, tanker())
        else:
            _refuse_other_load(log, tanker())


def test_a_vehicle_file_says_where_the_payload_is():
    assert tanker().payload_share == pytest.approx([AT[0] / 0.638, 1 - AT[0] / 0.638])
    assert robot().payload_share == pytest.approx([54 / 139, 85 / 139])
    again = tg.Vehicle.from_dict(tanker().to_dict())
    assert again == tanker()
    bucket = robot(
        payload={"x": 1.7 * 0.638, "z": 0.4}
    )  # a loader's, ahead of the front axle: it lifts the rear one
    assert bucket.payload_share == pytest.approx([1.7, -0.7])
    with pytest.raises(InputError, match=r"payload.x: 20 m is far from between the axles"):
        robot(payload={"x": 20.0})
    with pytest.raises(InputError, match=r"payload.x"):
        robot(payload={"z": 1.0})


def test_a_tank_on_a_tractor_that_tells_engine_torque():
    """The driven wheels as one: the payload moves with the axles that stand for all."""
    from terragrip.estimation.driveline import lumped

    tractor = robot(
        axles={
            "front": {"mass": 54.0, "wheels": ["fl", "fr"], "driven": False},
            "rear": {"mass": 85.0, "wheels": ["rl", "rr"]},
        },
        payload={"x": 0.1, "z": 0.5},
        driveline={"efficiency": 0.9, "accessory_power": 10.0},
    )
    made = tg.Vehicle.from_dict(lumped(tractor, None))
    assert made.axle_names == ("undriven", "driven")
    assert made.payload_share == pytest.approx(tractor.payload_share)

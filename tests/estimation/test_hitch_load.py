"""What hangs on the hitch, as a known vertical force: against the formula of the loads, the truth, and differences of the estimate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import terragrip as tg
from drives import MASS, WHEELS, drive, robot, with_values
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator, estimate
from terragrip.physics.loads import GRAVITY, axle_loads

pytestmark = pytest.mark.usefixtures("unchecked")

OVERHANG = 0.25


def carrier(**changes: Any) -> tg.Vehicle:
    sensors = robot().to_dict()["sensors"] | {"hitch_load": 4.0}
    return robot(**{"hitch_overhang": OVERHANG, "sensors": sensors, **changes})


def carrying(newtons: Any, **options: Any) -> Any:
    return drive(20.0, imu=True, hitch=newtons, hitch_overhang=OVERHANG, **options)


def test_the_formula_of_the_loads():
    made = carrying(lambda t: 200 + 40 * np.sin(t / 4), noise=0.0, speed=lambda t: 0.7 + 0 * t)
    found = estimate(made.recording, carrier())
    pull, hanging = made.recording.channels["drawbar_force"], made.recording.channels["hitch_load"]
    wanted = axle_loads(
        (54.0, 85.0), (0.638, 0.0), center_of_gravity_height=0.30, hitch_height=0.25, hitch_overhang=OVERHANG,
        drawbar=pull, hitch_load=hanging,
    )  # fmt: skip
    late = found.time > 3
    assert np.ptp(hanging[late]) > 70
    for k, axle in enumerate(("front", "rear")):
        np.testing.assert_allclose(found[f"vertical_load_{axle}"][late], wanted[late, k], atol=2.0)
    assert np.min(found["vertical_load_front"][late]) < 54 * GRAVITY - 200 * OVERHANG / 0.638


def test_adhesion_and_resistance_are_those_of_what_the_wheels_carry():
    """A sixth of the weight more on the wheels; who does not know of it sees other soil, and says so too surely."""
    made = [carrying(lambda t: 230.0 + 0 * t, seed=seed) for seed in range(4)]
    inside, off, off_plain = [], [], []
    for one in made:
        plain = replace(
            one.recording, channels={n: v for n, v in one.recording.channels.items() if n != "hitch_load"}
        )
        knows, lacks = estimate(one.recording, carrier()), estimate(plain, carrier())
        late = one.recording.time > 6
        for name in ("soil_resistance", *(f"adhesion_{w}" for w in WHEELS)):
            error = (knows[name] - one.truth[name])[late]
            inside.append(np.mean(np.abs(error) < 1.96 * knows[f"{name}_std"][late]))
            off.append(np.mean(error))
        off_plain.append(np.mean((lacks["adhesion_rl"] - one.truth["adhesion_rl"])[late]))
    assert np.mean(inside) > 0.9
    assert np.max(np.abs(off)) < 0.01
    assert np.mean(off_plain) > 0.1


def test_backwards_it_presses_down_all_the_same():
    forward = carrying(lambda t: 200.0 + 0 * t, noise=0.0)
    back = carrying(lambda t: 200.0 + 0 * t, noise=0.0, direction=-1)
    late = forward.recording.time > 6
    for made in (forward, back):
        found = estimate(made.recording, carrier())
        np.testing.assert_allclose(
            found["soil_resistance"][late], made.truth["soil_resistance"][late], atol=0.004
        )
        np.testing.assert_allclose(found["adhesion_rl"][late], made.truth["adhesion_rl"][late], atol=0.01)


@pytest.mark.parametrize("method", ["kalman", "algebraic"])
@pytest.mark.parametrize(
    ("spread", "size"), [({"hitch_load_offset": 20.0}, 20.0), ({"hitch_load_gain": 0.1}, 20.0)]
)
def test_its_spread_is_what_an_error_of_it_does(method, spread, size):
    """200 N, of which an SD of 20 N: the estimate by 1 N more and less against the column."""
    log = carrying(lambda t: 200.0 + 0 * t, noise=0.2, slip=lambda t: 0.12 + 0 * t).recording
    log = with_values(log, "hitch_load", slice(None), 200.0)
    quiet = carrier(uncertainty={}, sensors=robot().to_dict()["sensors"] | {"hitch_load": 1e-3})
    plain, doubtful = estimate(log, quiet, method), estimate(log, replaced(quiet, spread), method)
    more, less = (
        estimate(with_values(log, "hitch_load", slice(None), 200.0 + d), quiet, method) for d in (1, -1)
    )
    for name in ("soil_resistance", "adhesion_fl", "adhesion_rr"):
        difference = size * (more[name][-1] - less[name][-1]) / 2
        column = np.sqrt(doubtful[f"{name}_std"][-1] ** 2 - plain[f"{name}_std"][-1] ** 2)
        assert column == pytest.approx(abs(difference), rel=0.05), name


def replaced(vehicle: tg.Vehicle, spreads: dict[str, float]) -> tg.Vehicle:
    return vehicle.model_copy(update={"uncertainty": vehicle.uncertainty.model_copy(update=spreads)})


def test_one_axle_carries_it_all():
    log = drive(8.0, noise=0.0).recording
    channels = {n: v for n, v in log.channels.items() if not n.endswith(("_fl", "_fr"))}
    cart = tg.Vehicle.from_dict(
        {
            "mass": MASS,
            "axles": {"only": {"mass": MASS, "wheels": ["rl", "rr"]}},
            "wheel": {"radius": 0.2, "inertia": 0.15},
        }
    )
    found = estimate(replace(log, channels=channels | {"hitch_load": np.full(len(log), 300.0)}), cart)
    assert found["vertical_load_only"][-1] == pytest.approx(MASS * GRAVITY + 300)


def test_where_it_acts_has_to_be_known():
    log = carrying(lambda t: 200.0 + 0 * t).recording
    with pytest.raises(
        InputError, match=r"column hitch_load: .* the vehicle has no hitch_overhang; add e.g. 'hitch_overhang"
    ):
        estimate(log, robot())
    with pytest.raises(
        InputError, match="hitch_overhang"
    ):  # while samples come in there is no log to look through
        TractionEstimator(robot(), channels=tuple(log.channels))


def test_before_its_first_value_it_is_unknown():
    log = carrying(lambda t: 100.0 + 0 * t).recording
    late = with_values(log, "hitch_load", log.time < 8, np.nan)
    found = estimate(late, carrier())
    assert found["adhesion_rl_std"][700] > 3 * found["adhesion_rl_std"][-1]

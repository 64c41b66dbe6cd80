"""The whole way in small, on the simulated campaign (development seeds): runs on one soil make the library, multi1 is recognised by it."""

from __future__ import annotations

import numpy as np
import pytest

from ground_library import learned
from terragrip.estimation import TractionEstimator, estimate
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.live import LiveGround
from terragrip.simulation import simulate
from terragrip.simulation.campaign import run_seed

pytestmark = [
    pytest.mark.usefixtures("unchecked"),
    pytest.mark.long,  # in closed form: test_recognition.py, test_changes.py, test_live.py
]


def run(name, seed):
    return simulate(name, run_seed(seed, name), machine_seed=seed)


@pytest.fixture(scope="module")
def simulated_library():
    """Four runs a soil, of another machine than the one that is recognised."""
    names = [f"{soil}-{k}" for soil in ("fine", "wet", "coarse", "grass") for k in ("01", "02", "06", "09")]
    return learned([estimate((r := run(name, 1000)).recording, r.vehicle) for name in names])


@pytest.fixture(scope="module")
def analysis():
    result = run("multi1", 1003)
    return result, estimate(result.recording, result.vehicle)


def test_soils_and_borders_of_a_simulated_drive(analysis, simulated_library):
    result, analysed = analysis
    ground, table = analyse(analysed, simulated_library, "multi1")
    truth = result.truth
    one = truth["soil"].replace({"wet": "fine"}).to_numpy()
    named = np.where(table["soil_estimate"] == "wet", "fine", table["soil_estimate"])
    assert (named == one).mean() > 0.88
    time, mixed = truth["time"].to_numpy(), truth["transition"].to_numpy()
    starts, ends = (
        time[np.flatnonzero(np.diff(np.concatenate(([0], mixed, [0]))) == k) - (k < 0)] for k in (1, -1)
    )
    near = [
        [a - 2 <= change.time <= b + 2 for change in ground.changes]
        for a, b in zip(starts, ends, strict=True)
    ]
    assert np.mean([any(row) for row in near]) > 0.85
    assert np.mean(np.any(near, axis=0)) > 0.85
    assert all(0 < change.std < 5 and 0.5 < change.probability <= 1 for change in ground.changes)


def test_streamed_through_the_estimator_it_is_the_same(analysis, simulated_library):
    """Recording to estimator to ground, sample by sample, for a minute and a half; the estimator learns of each change."""
    result, analysed = analysis
    estimator = TractionEstimator.for_recording(result.recording, result.vehicle)
    live, states = LiveGround(estimator, simulated_library), []
    channels = {name: values.tolist() for name, values in result.recording.channels.items()}
    for k, time in enumerate(result.recording.time.tolist()):
        if time > 90:
            break
        state = live.update(estimator.update({"time": time, **{name: v[k] for name, v in channels.items()}}))
        states += [state] * (state is not None)
    ground = analyse(analysed, simulated_library, settings=Settings(online=True))[0]
    expected = ground.timeline.probabilities[: len(states)]
    np.testing.assert_array_equal(
        [[s.probabilities[n] for n in ground.timeline.names] for s in states], expected
    )
    assert [s.change for s in states if s.change] == [
        c for c in ground.changes if c.reported <= states[-1].time
    ]
    assert any(s.change for s in states)

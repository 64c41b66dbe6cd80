"""While driving: the same as a whole drive looked at without looking ahead, broken off and gone on with or not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ground_drives import COARSE, FINE, GRASS, VEHICLE, drive
from terragrip.errors import InputError
from terragrip.estimation import TractionEstimator
from terragrip.estimation.engine import EVENTS
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.live import LiveGround
from terragrip.soil.library import SoilLibrary
from terragrip.vehicle import Vehicle


class Row(SimpleNamespace):
    """One row of a table as the estimator gives it."""

    def __getitem__(self, name):
        return getattr(self, name)


def rows(estimates):
    columns = {name: estimates[name] for name in estimates.names}
    return [Row(**{name: values[k] for name, values in columns.items()}) for k in range(len(estimates))]


@pytest.fixture
def estimates():
    """A drive with a standstill, a gap in its rows and a stretch without slip."""
    result = drive(1, [("grass", GRASS, 25), ("fine", FINE, 25), ("coarse", COARSE, 25)])
    result.event_codes[200:230] = EVENTS.index("standstill")
    result.columns["slip_fl"][200:230] = np.nan
    result.time[900:] += 3.3
    return result


@pytest.fixture
def estimator(monkeypatch):
    """An estimator whose columns are those of the drawn drives, and which counts new grounds."""
    made = TractionEstimator(Vehicle.from_dict(VEHICLE))
    there = set(drive(0, [("fine", FINE, 1)]).columns)
    monkeypatch.setattr(TractionEstimator, "columns", property(lambda self: tuple(there)))
    made.new_grounds = 0

    def new_ground():
        made.new_grounds += 1

    made.new_ground = new_ground
    return made


def follow(live, some):
    return [state for state in map(live.update, some) if state is not None]


def test_it_is_the_whole_drive_without_looking_ahead(estimates, estimator, library):
    live = LiveGround(estimator, library)
    states = follow(live, rows(estimates))
    states.append(live.finish())
    ground, table = analyse(estimates, library, settings=Settings(online=True))
    result = np.array([[s.probabilities[n] for n in ground.timeline.names] for s in states])
    np.testing.assert_array_equal(result, ground.timeline.probabilities)
    assert [s.known for s in states] == ground.timeline.known.tolist()
    assert tuple(s.change for s in states if s.change) == ground.changes
    assert len(ground.changes) == 2
    assert estimator.new_grounds == 2
    # a row of the table holds what had been said before it
    at = {s.time: s.soil for s in states[:-1]}
    time, soil = estimates.time, table["soil_estimate"]
    assert all(soil[int(np.searchsorted(time, t))] == name for t, name in at.items())
    assert np.isnan(table["soil_probability"][0])


def test_broken_off_anywhere_it_goes_on_as_if_never(estimates, estimator, library):
    every = rows(estimates)
    whole = follow(LiveGround(estimator, library), every)
    for cut in (1, 333):
        first = LiveGround(estimator, library)
        states = follow(first, every[:cut])
        second = LiveGround.restore(first.snapshot(), estimator, library)
        assert states + follow(second, every[cut:]) == whole


def test_a_snapshot_of_another_library_or_damaged_is_refused(estimates, estimator, library):
    live = LiveGround(estimator, library)
    follow(live, rows(estimates)[:100])
    for data in (b"", b"{}", live.snapshot()[:-5]):
        with pytest.raises(InputError, match="damaged"):
            LiveGround.restore(data, estimator, library)
    with pytest.raises(InputError, match="another version, vehicle or library"):
        LiveGround.restore(live.snapshot(), estimator, SoilLibrary({}))


def test_nothing_is_said_before_anything_is_known(estimator, library):
    live = LiveGround(estimator, library)
    assert live.finish() is None
    assert live.update(rows(drive(2, [("fine", FINE, 1)]))[0]) is None
    state = live.finish()
    assert not state.known
    assert max(state.probabilities.values()) < 0.5

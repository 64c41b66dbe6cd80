"""The ground while driving: changes and soils come through, and a restart changes none of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from drives import drive
from machine import events, rows_of
from terragrip.estimation import TractionEstimator
from terragrip.ground.live import GroundState, LiveGround
from terragrip.live import read_record
from terragrip.live.core import Core, Settings
from terragrip.live.options import Options
from terragrip.live.outputs import Event
from terragrip.live.pipeline import Pipeline
from terragrip.live.service import Service
from terragrip.soil.library import Soil, SoilLibrary


@pytest.fixture(scope="module")
def recording():
    """Soft ground from 20 s on."""
    return drive(40.0, resistance=lambda t: np.where(t > 20, 0.20, 0.05)).recording


@pytest.fixture(scope="module")
def library():
    curve = {"A": 0.5, "k": 10.0, "d": 0.0}  # that of `drive`
    soils = {
        name: Soil(name, "effective", curve, resistance=(resistance, 0.01), spread=0.02)
        for name, resistance in (("hard", 0.05), ("soft", 0.20))
    }
    return SoilLibrary(soils)


@pytest.fixture(scope="module")
def by_hand(recording, library, vehicle):
    """What the estimator and the ground say, sample by sample."""
    estimator = TractionEstimator(vehicle, channels=tuple(recording.channels))
    ground = LiveGround(estimator, library)
    estimates, states = [], []
    for time, values in rows_of(recording):
        estimates.append(estimator.update({"time": time, **values}))
        states.append(ground.update(estimates[-1]))
    return estimates, [state for state in states if state is not None]


def test_a_restart_goes_on_with_the_same_ground(tmp_path, recording, library, vehicle, by_hand):
    settings = Settings(("replay:test",), channels=tuple(recording.channels), ground=True)
    got, rows = [], list(rows_of(recording))
    for first, last in ((0, 1234), (1234, 2222), (2222, len(rows))):
        pipeline = Pipeline(Core(vehicle, settings, library), tmp_path, rows=700)
        for time, values in rows[first:last]:
            got += [out for out in pipeline.process(time, 0, time, values) if isinstance(out, GroundState)]
        pipeline.write()
        pipeline.recorder.abandon() if last < len(rows) else pipeline.close()
    estimates, states = by_hand
    assert [(g.time, g.soil, g.probabilities) for g in got] == [
        (s.time, s.soil, s.probabilities) for s in states
    ]
    assert [bool(g.change) for g in got] == [s.change is not None for s in states]
    _, kept = read_record(tmp_path)
    assert kept.columns["curve_a"].tolist() == [estimate.curve_a for estimate in estimates]
    lines = [
        json.loads(line)
        for p in sorted(tmp_path.glob("ground-*.jsonl"))
        for line in p.read_text().splitlines()
    ]
    assert [line["soil"] for line in lines] == [state.soil for state in states]


@pytest.mark.asyncio
async def test_soils_and_changes_are_published(tmp_path, recording, library, vehicle, by_hand):
    log = tmp_path / "drive.parquet"
    recording.to_pandas().to_parquet(log)
    service = Service(vehicle, [f"replay:{log}?speed=max"], options=Options(library=library))
    seen = []
    service.listeners.append(seen.append)
    await service.run()
    changes = [message.data for message in seen if message.kind == "ground"]
    reported = [state.change.time for state in by_hand[1] if state.change is not None]
    assert [change["time"] for change in changes] == reported
    assert min(abs(time - 20.0) for time in reported) < 1.0
    assert {change["cause"] for change in changes} == {"ground"}
    texts = events(service, "ground_change")
    assert len(texts) == len(reported)
    assert all(text.startswith("the ground changed at") for text in texts)
    soils = [message.data for message in seen if message.kind == "soil"]
    assert [(soil["time"], soil["soil"], soil["probabilities"]) for soil in soils] == [
        (state.time, state.soil, state.probabilities) for state in by_hand[1]
    ]
    assert soils[-1]["probability"] == max(soils[-1]["probabilities"].values())


def test_without_a_drawbar_force_a_change_may_be_a_tools(recording, vehicle):
    channels = tuple(name for name in recording.channels if name != "drawbar_force")
    core, got = Core(vehicle, Settings(("replay:test",), channels=channels, ground=True)), []
    for time, values in rows_of(recording):
        got += core.process(time, 0, time, {name: values[name] for name in channels if name in values})
    changes = [out.change for out in got if isinstance(out, GroundState) and out.change is not None]
    texts = [out.text for out in got if isinstance(out, Event) and out.kind == "ground_change"]
    nearest = int(np.argmin([abs(change.time - 20.0) for change in changes]))
    assert changes[nearest].cause == "tool or ground"  # resistance alone
    assert texts[nearest].startswith("the ground, or a tool, changed at")

"""Live estimates of a stock tractor: slip from its speeds alone, the same sample by sample as at once."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import terragrip as tg
from terragrip import TractionEstimator
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.live.core import Core, Settings
from terragrip.live.links.can import CanSink
from terragrip.live.outputs import Row
from terragrip.live.service import Service
from terragrip.live.uri import Uri
from terragrip.vehicle import Vehicle

CHANNELS = ("ground_speed", "wheel_based_speed")


def tractor(**more: object) -> Vehicle:
    front = {"mass": 2500, "wheels": ["fl", "fr"], "driven": False}
    rear = {"mass": 3500, "wheels": ["rl", "rr"]}
    wheel = {"radius": 0.8, "inertia": 50}
    base = {
        "mass": 6000,
        "wheelbase": 2.8,
        "center_of_gravity_height": 1.0,
        "axles": {"front": front, "rear": rear},
    }
    return Vehicle.from_dict({**base, "wheel": wheel, "sensors": {"ground_speed": 0.02}, **more})


def calibrated() -> Vehicle:
    return tractor(calibration={"wheel_radius": {"rl": 0.824, "rr": 0.824}})


def drive(rows: int = 2000) -> dict[str, np.ndarray]:
    """Half at 12 % slip, half without; the machine's own speed 3 % too small (simulated); each speed at 5 Hz, in turn, and a gap."""
    draws, time = np.random.default_rng(1000), np.arange(rows) / 10
    speed, slip = 2 + 0.3 * np.sin(time / 20), np.where(time < rows / 20, 0.12, 0.0)
    ground = speed + 0.02 * draws.standard_normal(rows)
    rim = speed / (1 - slip) / 1.03 + 0.01 * draws.standard_normal(rows)
    ground[::2], rim[1::2] = np.nan, np.nan
    ground[1500:1550] = rim[1500:1550] = np.nan
    return {"time": time, "ground_speed": ground, "wheel_based_speed": rim}


def samples(frame: dict[str, np.ndarray]) -> list[dict[str, float]]:
    return [
        dict(zip(frame, row, strict=True)) for row in zip(*(c.tolist() for c in frame.values()), strict=True)
    ]


def test_sample_by_sample_is_what_the_whole_log_gives() -> None:
    frame, vehicle = drive(), calibrated()
    whole = tg.estimate(tg.Recording.from_frame(frame), vehicle, sensors={"wheel_based_speed": 0.01}, held={})
    one = TractionEstimator(vehicle, channels=CHANNELS, sensors={"wheel_based_speed": 0.01})
    result = [one.update(sample) for sample in samples(frame)]
    for name in ("slip_drive", "slip_drive_std", "ground_speed", "wheel_speed_drive", "distance", "nis"):
        assert np.allclose([e[name] for e in result], whole[name], rtol=1e-9, atol=1e-12, equal_nan=True), (
            name
        )
    events = whole["event"].tolist()
    before_gap = events.index("gap")  # only a whole log knows what follows
    assert [e.event for e in result[:before_gap]] == events[:before_gap]
    assert "gap" in [e.event for e in result]
    steady = [e.slip_drive for e in result if 20 < e.time < 90]
    assert np.mean(steady) == pytest.approx(0.12, abs=0.005)
    assert result[-1].zero_slip_radius_drive == pytest.approx(0.824)


def test_a_snapshot_goes_on_bit_for_bit() -> None:
    rows = samples(drive())
    one = TractionEstimator(calibrated(), channels=CHANNELS, held={"ground_speed": 0.2})
    for row in rows[:700]:
        one.update(row)
    other = TractionEstimator.restore(one.snapshot())
    assert other.method == "slip-only"
    for row in rows[700:]:
        np.testing.assert_array_equal(one.update(row).values, other.update(row).values)
    with pytest.raises(InputError):
        TractionEstimator.restore(one.snapshot()[:-3])


def test_what_cannot_be_taken_is_named_and_leaves_the_filter_alone() -> None:
    one = TractionEstimator(calibrated(), channels=CHANNELS)
    one.update({"time": 1.0, "ground_speed": 2.0, "wheel_based_speed": 2.1})
    state = one.snapshot()
    for sample in (
        {"ground_speed": 2.0},
        {"time": 1.0},
        {"time": 2.0, "ground_speed": np.inf},
        {"time": np.nan},
    ):
        with pytest.raises(InputError):
            one.update(sample)
    assert one.snapshot() == state


def test_without_samples_the_intervals_grow() -> None:
    one = TractionEstimator(calibrated(), channels=CHANNELS)
    for row in samples(drive())[:100]:
        one.update(row)
    spread = [one.update({"time": 10 + 0.2 * k}).slip_drive_std for k in range(1, 6)]
    assert all(np.diff(spread) > 0)


def test_a_held_channel_counts_once() -> None:
    vehicle = calibrated()
    held, bare = (
        TractionEstimator(vehicle, channels=CHANNELS, held={"ground_speed": 0.5}),
        TractionEstimator(vehicle, channels=CHANNELS),
    )
    for k in range(50):
        values = {"time": k / 10, "ground_speed": 2.0 + 0.01 * (k // 5), "wheel_based_speed": 2.0 + 0.002 * k}
        taken, plain = held.update(values), bare.update(values)
        assert taken.channels == (2 if k % 5 == 0 else 1)
        assert plain.channels == 2


def test_the_core_takes_up_where_it_was() -> None:
    settings = Settings(("udp://x",), channels=CHANNELS, learn=False)
    rows, core = samples(drive(600)), Core(calibrated(), settings)
    outputs = []
    for k, row in enumerate(rows):
        if k == 300:
            core = Core.from_state(json.loads(json.dumps(core.state())))
        time = row.pop("time")
        outputs += core.process(time, 0, time, {n: v for n, v in row.items() if v == v})
    outputs += core.flush()
    slips = [one.estimate.slip_drive for one in outputs if isinstance(one, Row)]
    assert len(slips) == 600
    straight = TractionEstimator(calibrated(), channels=CHANNELS)
    assert slips[-1] == [straight.update(row) for row in samples(drive(600))][-1].slip_drive


def test_a_replayed_log_is_recorded_as_slip(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    import pandas as pd

    pd.DataFrame(drive(600)).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "v.yaml").write_text(json.dumps(calibrated().to_dict()))
    profile = {"channels": {"ground_speed": "ground_speed", "wheel_based_speed": "wheel_based_speed"}}
    (tmp_path / "p.yaml").write_text(json.dumps(profile))
    command = ["live", "--source", f"replay:{tmp_path}/log.csv?speed=max", "--vehicle", str(tmp_path / "v.yaml"),
               "--profile", str(tmp_path / "p.yaml")]  # fmt: skip
    assert main([*command, "--record", str(tmp_path / "record")]) == 0
    parts = [pq.read_table(p) for p in sorted((tmp_path / "record").glob("estimates-*.parquet"))]
    assert sum(len(part) for part in parts) == 600
    assert "slip_drive" in parts[0].column_names
    assert not [name for name in parts[0].column_names if name.startswith(("adhesion_", "soil_res"))]
    capfd.readouterr()
    assert main([*command, "--ground"]) == 2
    assert "need drive torques" in capfd.readouterr().err


@pytest.mark.asyncio
async def test_sinks_get_the_columns_there_are() -> None:
    from terragrip.formats import Profile

    profile = Profile.from_dict({"channels": {name: name for name in CHANNELS}})
    service = Service(calibrated(), ["udp://127.0.0.1:0"], ["studio://127.0.0.1:0"], profile=profile)
    hello = json.loads(await anext(service.sinks[0][1].broadcast.subscribe()))
    assert hello["wheels"] == ["drive"]
    assert "slip_drive" in hello["columns"]
    assert not any(name.startswith("adhesion") for name in hello["columns"])


def test_can_frames_give_the_drives_slip_for_each_driven_wheel() -> None:
    import cantools

    from terragrip.live.links.can import DBC

    one = TractionEstimator(calibrated(), channels=CHANNELS)
    for row in samples(drive())[:200]:
        estimate = one.update(row)
    sink = CanSink(Uri.parse("can:x?interface=virtual", {"can": ("interface", "rate")}, "sink"), calibrated())
    base = cantools.database.load_file(DBC)
    reported = {
        base.get_message_by_frame_id(i).name: base.decode_message(i, data)
        for i, data in sink.frames(Row(0.0, {}, estimate))
    }
    assert reported["TG_Wheel3"]["Slip3"] == pytest.approx(estimate.slip_drive, abs=1e-3)
    absent = base.get_message_by_name("TG_Wheel1").get_signal_by_name("Slip1")
    assert reported["TG_Wheel1"]["Slip1"] == pytest.approx(
        absent.offset + absent.scale * ((1 << absent.length) - 1)
    )

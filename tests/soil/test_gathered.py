"""What soils are learned from, run after run, and what of the machine goes with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.estimation.drives import drive, robot

from terragrip.errors import InputError
from terragrip.estimation import Estimates, estimate
from terragrip.physics.adhesion import CURVES
from terragrip.soil.bins import BinSettings
from terragrip.soil.estimates import (
    GatheredRuns,
    distinct,
    labelled_blocks,
    pairs_of,
    repeated,
    soils_of,
    torque_scale_sd,
    whole_length,
)
from terragrip.soil.fit import AdhesionCurve
from terragrip.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("one_form")


def machine(**more: object) -> Vehicle:
    axles = {
        "front": {"mass": 60, "wheels": ["l", "r"], "driven": False},
        "rear": {"mass": 80, "wheels": ["x", "y"]},
    }
    base = {
        "mass": 140,
        "wheelbase": 0.6,
        "center_of_gravity_height": 0.3,
        "hitch_height": 0.2,
        "axles": axles,
    }
    return Vehicle.from_dict({**base, "wheel": {"radius": 0.2, "inertia": 0.15}, **more})


def run_of(seed: int, rows: int = 400, **uncertainty: float) -> Estimates:
    """A run at 5 Hz and 1 m/s, clay and then loam, whose rear wheels follow a = .8 and .5."""
    draws, time = np.random.default_rng(seed), 0.2 * np.arange(rows)
    soil = np.where(np.arange(rows) < rows // 2, "clay", "loam").astype(object)
    slip = 0.27 + 0.23 * np.sin(time / 4 + draws.uniform(0, 6))
    columns = {
        "distance": time,
        "ground_speed": np.ones(rows),
        "soil_resistance": 0.1 + 0.01 * draws.standard_normal(rows),
    }
    for wheel in ("l", "r", "x", "y"):
        height = CURVES["exponential"].value(slip, {"a": 1.0}) * np.where(soil == "clay", 0.8, 0.5)
        columns |= {
            f"slip_{wheel}": slip,
            f"slip_{wheel}_std": np.full(rows, 0.005),
            f"adhesion_{wheel}": height,
        }
    vehicle = machine(uncertainty=uncertainty)
    about = {"method": "bank", "vehicle": vehicle.to_dict()}
    return Estimates(time, columns, np.zeros(rows, dtype=np.uint8), {"soil": soil}, about, ())


@pytest.mark.parametrize(
    ("known", "sd"),
    [
        ({}, 0.0),
        ({"drive_torque_gain": 0.1}, 0.05),
        ({"drive_torque_gain": 0.06, "drive_torque_gain_common": 0.04}, 0.05),
    ],
)
def test_the_scale_of_all_torques_errs_by_the_mean_of_four_and_what_they_share(
    known: dict[str, float], sd: float
) -> None:
    assert torque_scale_sd(machine(uncertainty=known)) == pytest.approx(sd)


def test_the_way_onto_a_soil_is_from_the_front_axle_to_the_end_of_the_tool() -> None:
    assert whole_length(machine()) == pytest.approx(0.6)
    assert whole_length(machine(hitch_overhang=0.4, tool_length=2.5)) == pytest.approx(3.5)


def test_pairs_are_of_driven_wheels_that_have_settled_on_a_soil() -> None:
    estimates = run_of(1)
    clay, loam = pairs_of(estimates, "one")
    assert (clay.run, clay.soil, loam.soil) == ("one", "clay", "loam")
    assert clay.slip.size == 2 * 200
    assert loam.slip.size == 2 * 197  # not over the first .6 m
    np.testing.assert_array_equal(clay.slip[:200], estimates["slip_x"][:200])
    (named,) = pairs_of(estimates, "one", "field")
    assert (named.soil, named.slip.size) == ("field", 800)
    blocks = dict(labelled_blocks(estimates, None, "f"))
    assert {name: int(b.usable.sum()) for name, b in blocks.items()} == {"clay": 200, "loam": 197}


def test_runs_add_up_join_and_come_apart_by_soil() -> None:
    first, second = GatheredRuns(), GatheredRuns()
    first.add(run_of(1, drive_torque_gain=0.1), "one")
    second.add(run_of(2), "two")
    second.add(run_of(3, 200), "three", "sand")
    first.join(second)
    assert first.runs == ["one", "two", "three"]
    assert [p.soil for p in first.pairs] == ["clay", "loam", "clay", "loam", "sand"]
    assert {name: len(b) for name, b in first.blocks.items()} == {"clay": 2, "loam": 2, "sand": 1}
    assert (first.masses, first.makers, first.wheels) == ([140.0] * 3, {"bank"}, 4)
    assert first.periods == pytest.approx([0.2] * 3)
    assert first.common_sd == pytest.approx(0.05)
    clay = first.only("clay")
    assert {p.soil for p in clay.pairs} == {"clay"} == set(clay.blocks)
    assert clay.runs == first.runs
    plain = AdhesionCurve(bins=BinSettings(by="pull"), bootstrap=0)
    campaign = first.learn(plain)
    assert campaign.soils["clay"].soil.parameters["a"] == pytest.approx(0.8, rel=0.01)
    assert campaign.soils["loam"].soil.parameters["a"] == pytest.approx(0.5, rel=0.01)
    assert campaign.soils["clay"].soil.source == "3 runs: one, two, three"
    first.join(second)
    assert first.learn(plain).soils["loam"].soil.source == "5 runs: one, two, three and 2 more"


def test_a_run_of_one_row_teaches_nothing_and_says_why() -> None:
    """A warning of NumPy's in the studio's soils."""
    one = GatheredRuns()
    one.add(run_of(1).select([0]), "one", "clay")
    campaign = one.learn(AdhesionCurve(bins=BinSettings(by="pull"), bootstrap=0))
    assert not campaign.soils
    assert campaign.words[0].startswith("clay: not fitted, 0 slip bins")


def test_a_file_given_twice_and_slip_without_adhesion_are_refused(tmp_path: Path) -> None:
    paths = [tmp_path / "a.parquet", tmp_path / "b.parquet"]
    assert distinct(paths) == paths
    with pytest.raises(InputError, match=r"a\.parquet.*given twice"):
        distinct([*paths, tmp_path / "x" / ".." / "a.parquet"])
    bare = run_of(1)
    for wheel in ("l", "r", "x", "y"):
        del bare.columns[f"adhesion_{wheel}"]
    with pytest.raises(InputError, match="one: has slip but no adhesion"):
        GatheredRuns().add(bare, "one")


def test_files_are_counted_and_the_fit_after_them(tmp_path: Path) -> None:
    files = [tmp_path / f"{seed}.parquet" for seed in range(2)]
    for seed, file in enumerate(files):
        run_of(seed).write(file)
    seen: list[tuple[int, int]] = []
    soils_of(files, AdhesionCurve(bootstrap=0), progress=lambda *done: seen.append(done))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def _driven(path: Path, time: np.ndarray, speed: np.ndarray, std: float = 0.03) -> Path:
    columns = {"ground_speed": speed, "ground_speed_std": np.full(len(time), std)}
    about = {"method": "bank", "recording": {"time_zero": "2026-05-04T08:00:00+00:00"}}
    Estimates(time, columns, np.zeros(len(time), dtype=np.uint8), {}, about, ()).write(path)
    return path


def test_files_of_one_drive_are_named_and_drives_alike_are_not(tmp_path: Path) -> None:
    """The same drive under two names, or as a part of a longer one, counted twice without a word."""
    draws, time = np.random.default_rng(5), 0.1 * np.arange(600)
    speed = np.interp(time, [0, 5, 50, 60], [0, 2, 2, 0])
    noise, other = 0.03 * draws.standard_normal((2, 600))
    whole = _driven(tmp_path / "whole.parquet", time, speed + noise)
    part = _driven(tmp_path / "part.parquet", time[200:500], (speed + noise)[200:500])
    again = _driven(tmp_path / "again.parquet", time, speed + noise + 0.01 * other)  # by another method
    for second in (part, again):
        (words,) = repeated([whole, second])
        assert words.startswith(
            f"{second.name} holds the same drive as whole.parquet, so its rows count twice"
        )
    (tmp_path / "b").mkdir()
    namesake = _driven(tmp_path / "b" / "whole.parquet", time, speed + noise)
    assert f"{namesake} holds the same drive as {whole}," in repeated([whole, namesake])[0]
    convoy = _driven(tmp_path / "convoy.parquet", time, speed + other)
    cruise = [
        _driven(tmp_path / f"{k}.parquet", time, 2 + 0.2 * one, 0.1) for k, one in enumerate((noise, other))
    ]
    after = np.concatenate(
        ((speed + noise)[500:], 2 + other[:500])
    )  # a sixth of it once more, as hourly files overlap
    overlap = _driven(tmp_path / "next.parquet", 50 + time, after)
    assert repeated([whole, convoy, *cruise, overlap]) == []


def test_simulated_runs_of_one_ground_speed_whose_wheels_slip_otherwise_are_two(tmp_path: Path) -> None:
    """Without noise, from 0 on: runs on two soils with one speed command were one."""
    runs = [
        drive(60, rate=20, noise=0, speed=lambda t: 1 + 0.3 * np.sin(t / 3), slip=lambda t, s=s: s + 0 * t)
        for s in (0.05, 0.1)
    ]
    files = [tmp_path / f"{k}.parquet" for k in range(3)]
    for file, run, method in zip(files, (runs[0], runs[1], runs[0]), ("bank", "bank", "kalman"), strict=True):
        estimate(run.recording, robot(), method=method).write(file)
    assert repeated(files[:2]) == []
    assert len(repeated([files[0], files[2]])) == 1

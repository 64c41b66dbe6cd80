"""Every road from a log to estimates gives the same digits: command line, Python, studio, campaign, sample by sample, live."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.estimation import Estimates
from terragrip.recording.chunks import CHUNK, CHUNKS, sampled_rows
from terragrip.recording.survey import LogBlocks, survey_of
from terragrip.report import campaign
from terragrip.simulation import simulate
from terragrip.vehicle import Vehicle

RUN = "grass-01"


@pytest.fixture(scope="module")
def drive() -> Any:
    """A simulated run whose first rows tell neither noise nor held channels of the rest: a wheel gets noisier, a speed is held."""
    result = simulate(RUN, 1000)
    log, draws = result.recording, np.random.default_rng(1000)
    late = np.arange(len(log)) > len(log) // 2
    noisy = log["wheel_speed_fl"] + np.where(late, 0.2, 0.0) * draws.standard_normal(len(log))
    held = np.repeat(log["ground_speed"][::10], 10)[: len(log)]
    held[:150] = log["ground_speed"][:150]
    sensors = {"sensors": {}}  # so that all noise is learned from the log
    vehicle = Vehicle.from_dict({**result.vehicle.to_dict(), **sensors})
    return log.with_channels(wheel_speed_fl=noisy, ground_speed=held), vehicle, result


@pytest.fixture
def folder(drive: Any, tmp_path: Path) -> Path:
    log, vehicle, _ = drive
    log.to_pandas().to_csv(tmp_path / "log.csv", index=False)
    log.to_pandas().to_parquet(tmp_path / "log.parquet", index=False)
    vehicle.save(tmp_path / "vehicle.yaml")
    return tmp_path


Road = Callable[[Path, Any, pytest.MonkeyPatch], Any]


def command(folder: Path, log: str, *words: str) -> Estimates:
    out = folder / "out.parquet"
    given = [str(folder / log), "--vehicle", str(folder / "vehicle.yaml"), "-o", str(out), "-q", *words]
    assert main(["estimate", *given]) == 0
    return Estimates.read(out)


def by_command(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    return command(folder, "log.csv")


def by_command_in_blocks(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    patch.setattr("terragrip.formats.parquet._LONG", 0)
    patch.setattr("terragrip.formats.parquet.ROWS", 150)
    return command(folder, "log.parquet")


def by_command_in_text_blocks(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    patch.setattr("terragrip.formats.csv._LONG", 0)
    patch.setattr("terragrip.formats.csv.ROWS", 1)
    patch.setattr("terragrip.formats.csv._BLOCK", 100_000)
    return command(folder, "log.csv")


def by_file_of_a_recording(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    patch.setattr("terragrip.from_log.ROWS", 150)
    tg.estimate_file(drive[0], drive[1], folder / "out.parquet")
    return Estimates.read(folder / "out.parquet")


def by_studio(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    words = ["estimate", "log.csv", "--vehicle", "vehicle.yaml", "-o", "out.parquet"]
    subprocess.run(
        [sys.executable, "-m", "terragrip.cli.job", *words], check=True, timeout=600, cwd=folder
    )  # as a job runs
    return Estimates.read(folder / "out.parquet")


def by_campaign(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Estimates:
    log, vehicle, result = drive
    patch.setattr(campaign, "_simulated", lambda name, seed: with_log(result, log))
    return Estimates.read(campaign._estimate(RUN, 1000, vehicle, folder).path)


def with_log(result: Any, log: Any) -> Any:
    from dataclasses import replace

    return replace(result, recording=log)


def by_sample(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Mapping[str, Any]:
    log, vehicle, _ = drive
    known = Estimates.read_about(settings_of(folder))["settings"]
    names = [name for name in log.channels if name not in log.references]
    one = tg.TractionEstimator(vehicle, sensors=known["noise"], held=known["held"], channels=names)
    rows = zip(log.time.tolist(), *(log[name].tolist() for name in names), strict=True)
    out = [one.update(dict(zip(("time", *names), row, strict=True))) for row in rows]
    return {name: np.array([e[name] for e in out]) for name in out[0]}


def by_live(folder: Path, drive: Any, patch: pytest.MonkeyPatch) -> Mapping[str, Any]:
    words = [
        "--vehicle",
        folder / "vehicle.yaml",
        "--settings",
        settings_of(folder),
        "--record",
        folder / "live",
        "--quiet",
    ]
    source = f"replay:{folder / 'log.csv'}?speed=max"
    command_line = [sys.executable, "-m", "terragrip", "live", "--source", source, *map(str, words)]
    subprocess.run(command_line, check=True, timeout=600)  # a process of its own, as live has
    parts = sorted((folder / "live").glob("estimates*.parquet"))
    return pd.concat([pd.read_parquet(part) for part in parts])


def settings_of(folder: Path) -> Path:
    command(folder, "log.csv")
    return folder / "out.parquet"


ROADS: tuple[Road, ...] = (
    by_command,
    by_command_in_blocks,
    by_command_in_text_blocks,
    by_file_of_a_recording,
    by_studio,
    by_campaign,
    by_sample,
    by_live,
)


@pytest.mark.parametrize("road", ROADS)
def test_every_road_gives_the_same_digits(
    road: Road, drive: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, vehicle, _ = drive
    whole = tg.estimate(log, vehicle)
    assert set(whole.about["settings"]["held"]) == {"ground_speed"}
    result = road(folder, drive, monkeypatch)
    for name in ("time", *whole.columns):
        if name not in log.references and name not in ("latitude", "longitude", "altitude"):
            assert np.array_equal(np.asarray(result[name]), whole[name], equal_nan=True), name
    assert [str(event) for event in result["event"]] == whole["event"].tolist()
    if isinstance(result, Estimates):
        assert result.about["settings"] == whole.about["settings"]


def test_smoothing_in_blocks_gives_the_same_digits(
    drive: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, vehicle, _ = drive
    whole = tg.estimate(log, vehicle, smooth=True)
    monkeypatch.setattr("terragrip.formats.parquet._LONG", 0)
    monkeypatch.setattr("terragrip.formats.parquet.ROWS", 150)
    result = command(folder, "log.parquet", "--smooth")
    for name in whole.columns:
        assert np.array_equal(result[name], whole[name], equal_nan=True), name
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_an_optional_channel_without_values_is_left_out_at_every_length(
    drive: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Taken for measured, but unknown, a grade that was never logged would widen every interval."""
    log, _, _ = drive
    log.to_pandas().assign(pitch=np.nan).to_parquet(folder / "log.parquet", index=False)
    whole = command(folder, "log.parquet")
    monkeypatch.setattr("terragrip.formats.parquet._LONG", 0)
    monkeypatch.setattr("terragrip.formats.parquet.ROWS", 150)
    result = command(folder, "log.parquet")
    assert np.array_equal(result["adhesion_rr_std"], whole["adhesion_rr_std"], equal_nan=True)
    assert any("pitch has no value" in note for note in result.notes)
    assert set(result.notes) == set(whole.notes)


@pytest.mark.parametrize("rows", [100, CHUNK * CHUNKS, CHUNK * CHUNKS + 1, 7 * CHUNK * CHUNKS + 345])
@pytest.mark.parametrize("block", [10_000, 77_777, 10_000_000])
def test_the_sample_of_a_log_does_not_depend_on_its_blocks(rows: int, block: int) -> None:
    time = np.arange(rows) / 10
    log = tg.Recording(time, {"ground_speed": np.sin(time), "pitch": np.full(rows, np.nan)})
    known = survey_of(LogBlocks.of(log, block))
    expected = log.select(sampled_rows(rows))
    assert known.rows == rows
    assert known.empty == ("pitch",)
    assert np.array_equal(known.sample.time, expected.time)
    assert np.array_equal(known.sample["ground_speed"], expected["ground_speed"])
    assert CHUNK * CHUNKS / 2 < len(known.sample) <= CHUNK * CHUNKS or rows == len(known.sample)
    assert known.sample.time[-1] > 0.85 * time[-1]

"""``terragrip advise`` as a user calls it."""

import json

import numpy as np
import pytest

from advice_drives import VEHICLE, drive, slip_only
from terragrip.cli.entry import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    VEHICLE.save("v.yaml")
    drive(soil="hard").write("drive.parquet")
    return tmp_path


def called(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(main(["advise", *arguments]))
    out = capsys.readouterr()
    return ended.value.code or 0, out.out, out.err


def test_it_says_and_writes_the_same_best_slip(folder, capsys):
    code, said, _ = called(capsys, "drive.parquet", "--vehicle", "v.yaml", "-o", "advice.json")
    best = json.loads((folder / "advice.json").read_text())["best_efficiency"]
    assert code == 0
    assert f"best efficiency: {best['slip']:.1%} slip" in said
    assert best["interval"][0] < best["slip"] < best["interval"][1]


def test_a_pull_that_nothing_measured_gives_no_advice_on_load(folder, capsys):
    estimates = drive()
    advised = {}
    for channels in (["ground_speed", "drawbar_force"], ["ground_speed"]):
        estimates.about["settings"] = {"channels": channels}
        estimates.write("one.parquet")
        called(capsys, "one.parquet", "--vehicle", "v.yaml", "-o", "advice.json")
        advised[len(channels)] = json.loads((folder / "advice.json").read_text())
    assert advised[1]["best_efficiency"] == advised[2]["best_efficiency"]
    assert advised[2]["actions"]
    assert advised[1]["actions"] == advised[1]["limits"] == []
    assert "no drawbar_force was in the log" in advised[1]["missing"][0]


def test_a_library_among_the_estimates_is_refused_with_its_option(folder, capsys):
    (folder / "soils.json").write_text('{"soils": {}}')
    code, _, error = called(capsys, "drive.parquet", "soils.json", "--vehicle", "v.yaml")
    assert (code, len(error.strip().splitlines())) == (2, 1)
    assert "--soils" in error


def test_another_vehicles_file_is_refused_in_one_line(folder, capsys):
    text = (folder / "v.yaml").read_text().replace("fl", "left").replace("fr]", "right]")
    (folder / "other.yaml").write_text(text)
    code, _, error = called(capsys, "drive.parquet", "--vehicle", "other.yaml", "-o", "advice.json")
    assert code == 2
    assert len(error.strip().splitlines()) == 1
    assert "adhesion_left" in error
    assert not (folder / "advice.json").exists()


def test_a_vehicle_of_the_same_wheels_and_another_mass_is_refused(folder, capsys):
    """A robot's file for a tractor's estimates was advised on, without a word."""
    estimates = drive(soil="hard")
    estimates.about["vehicle"] = {**VEHICLE.to_dict(), "mass": 30 * VEHICLE.mass}
    estimates.write("tractor.parquet")
    code, _, error = called(capsys, "tractor.parquet", "--vehicle", "v.yaml")
    assert (code, len(error.strip().splitlines())) == (2, 1)
    assert f"the vehicle has {VEHICLE.mass:.4g} kg, that of the estimates {30 * VEHICLE.mass:.4g} kg" in error


def test_no_such_file_is_one_line(folder, capsys):
    code, _, error = called(capsys, "nowhere.parquet", "--vehicle", "v.yaml")
    assert (code, len(error.strip().splitlines())) == (2, 1)


def test_slip_alone_gives_shares_of_time(folder, capsys):
    slip_only(np.full(200, 0.25)).write("slip.parquet")
    code, said, _ = called(capsys, "slip.parquet", "--vehicle", "v.yaml", "-o", "a.json")
    data = json.loads((folder / "a.json").read_text())
    assert code == 0
    assert data["drive"]["share_above"] == pytest.approx(1.0)
    assert data["best_efficiency"] is None
    assert "Load less" in said

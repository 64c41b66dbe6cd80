"""A controller that is built from `terragrip new controller` and the kernel's sources computes the digits of the command line."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.cli import main
from terragrip.errors import InputError
from terragrip.estimation.c_header import _number, c_header, estimator_of
from terragrip.estimation.engine import EVENTS

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tg.Estimates, tg.Recording]:
    """A folder with estimates and the header of them."""
    folder = tmp_path_factory.mktemp("controller")
    result = tg.simulate("constant", 7)
    recording = result.recording.select(slice(0, 1500))
    estimates = tg.estimate(recording, result.vehicle)
    estimates.write(folder / "estimates.parquet")
    words = [
        "new",
        "controller",
        str(folder / "estimates.parquet"),
        "-o",
        str(folder / "terragrip_settings.h"),
    ]
    assert main(words) == 0
    return folder, estimates, recording


def test_the_same_digits(made: tuple[Path, tg.Estimates, tg.Recording]) -> None:
    folder, estimates, recording = made
    compiler = shlex.split(sysconfig.get_config_var("CC") or "cc")[0]
    kernel = sorted(str(path) for path in (ROOT / "kernel/src").glob("*.c"))
    words = [
        compiler,
        "-std=c99",
        "-O0",
        "-ffp-contract=off",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        "-Wno-psabi",
    ]
    words += [f"-I{ROOT / 'kernel/include'}", f"-I{ROOT / 'kernel/src'}", f"-I{folder}"]
    program = folder / "program"
    subprocess.run(
        [*words, str(ROOT / "examples/controller/main.c"), *kernel, "-lm", "-o", str(program)], check=True
    )
    about = tg.Estimates.read_about(folder / "estimates.parquet")
    used = [name for name in estimator_of(about, "").inputs if name in recording.channels]
    columns = {"time": recording.time} | {name: recording[name] for name in used}
    rows = pd.DataFrame(columns).to_csv(index=False, header=False)
    printed = subprocess.run([str(program)], input=rows, capture_output=True, text=True, check=True).stdout
    (folder / "out.csv").write_text(printed)
    result = pd.read_csv(folder / "out.csv", float_precision="round_trip")
    assert len(result) == len(estimates)
    for name in result.columns.drop(["time", "event"]):
        np.testing.assert_array_equal(result[name], estimates[name], name)
    assert [EVENTS[k] for k in result["event"]] == list(estimates["event"])


def test_the_header_compiles_without_warnings_in_single_precision_and_in_cpp(
    made: tuple[Path, tg.Estimates, tg.Recording],
) -> None:
    strict = shlex.split(
        "-Wall -Wextra -Wpedantic -Wconversion -Wdouble-promotion -Werror -fsyntax-only -DTG_FLOAT"
    )
    source = made[0] / "in.c"
    source.write_text(
        '#include "terragrip_settings.h"\nint main(void) { return terragrip_settings.axles < 1; }\n'
    )
    for words in (["cc", "-std=c99", "-xc"], ["c++", "-std=c++17", "-xc++"]):
        if shutil.which(words[0]):
            subprocess.run([*words, *strict, f"-I{ROOT / 'kernel/include'}", str(source)], check=True)


def test_estimates_that_need_more_than_the_kernel_are_refused(
    made: tuple[Path, tg.Estimates, tg.Recording], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, estimates, recording = made
    names = [name for name in recording.channels if not name.startswith("drive_torque")]
    speeds = tg.Recording.from_frame(recording.to_pandas()[["time", *names]])
    tg.estimate(speeds, estimates.vehicle).write(tmp_path / "slip.parquet")
    assert main(["new", "controller", str(tmp_path / "slip.parquet"), "-o", str(tmp_path / "x.h")]) == 2
    assert "of slip without torques" in capsys.readouterr().err
    assert not (tmp_path / "x.h").exists()


def test_smoothed_estimates_and_names_that_are_one_in_capitals_are_refused(
    made: tuple[Path, tg.Estimates, tg.Recording],
) -> None:
    about = tg.Estimates.read_about(made[0] / "estimates.parquet")
    with pytest.raises(tg.InputError, match="smoothed"):
        estimator_of({**about, "smooth": True}, "")
    vehicle = {
        **about["vehicle"],
        "axles": {"front": {"mass": 54, "wheels": ["w", "W"]}, "rear": {"mass": 85, "wheels": ["rl", "rr"]}},
    }
    with pytest.raises(tg.InputError, match="case only"):
        estimator_of({**about, "vehicle": vehicle}, "")
    axles = {"a": about["vehicle"]["axles"]["front"], "A": about["vehicle"]["axles"]["rear"]}
    with pytest.raises(tg.InputError, match="case only"):
        estimator_of({**about, "vehicle": {**about["vehicle"], "axles": axles}}, "")


def test_a_turn_by_positions_is_refused(made: tuple[Path, tg.Estimates, tg.Recording]) -> None:
    _, estimates, recording = made
    angle = recording.time / 8  # a circle of 8 m at 1 m/s
    frame = recording.to_pandas().drop(columns=[n for n in recording.channels if n.startswith("angular")])
    frame["latitude"], frame["longitude"] = 48 + 7.2e-5 * (1 - np.cos(angle)), 11 + 1.07e-4 * np.sin(angle)
    turned = tg.estimate(tg.Recording.from_frame(frame), estimates.vehicle)
    with pytest.raises(tg.InputError, match="rate of turn from positions"):
        estimator_of(turned.about, "")


@pytest.mark.parametrize(
    ("name", "value"), [("gap", "x"), ("noise", [1]), ("held", {"ground_speed": "x"}), ("channels", 3)]
)
def test_settings_changed_by_hand_are_named(
    made: tuple[Path, tg.Estimates, tg.Recording], name: str, value: object
) -> None:
    about = made[1].about
    with pytest.raises(InputError, match=f"e.parquet: has .* as its {name}; estimate the log again"):
        estimator_of({**about, "settings": {**about["settings"], name: value}}, "e.parquet")
    with pytest.raises(InputError, match="does not contain the vehicle and the method"):
        estimator_of({key: about[key] for key in about if key != "method"}, "e.parquet")


def test_numbers_come_back_to_the_last_bit(made: tuple[Path, tg.Estimates, tg.Recording]) -> None:
    folder, _, _ = made
    estimator = estimator_of(tg.Estimates.read_about(folder / "estimates.parquet"), "")
    header = c_header(estimator, "A test */ that does not end the comment.")
    assert f".mass = {estimator.engine.settings().machine.mass!r}" in header
    assert header.count("*/ that") == 0
    about = tg.Estimates.read_about(folder / "estimates.parquet")
    vehicle = {**about["vehicle"], "calibration": {"drawbar_offset": -5.25}}
    assert "-5.25" in c_header(estimator_of({**about, "vehicle": vehicle}, ""), "")
    assert [_number(sign * np.inf) for sign in (1, -1)] == ["(tg_real)INFINITY", "-(tg_real)INFINITY"]

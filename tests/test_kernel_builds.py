"""The choice among the kernel's builds: by processor, by TERRAGRIP_KERNEL, refused where it cannot run."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from terragrip import _kernel
from terragrip.errors import InputError

ROOT = Path(__file__).resolve().parents[1]


def run_with(build: str, code: str) -> str:
    """Return what ``code`` prints in a fresh process with TERRAGRIP_KERNEL=build."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "TERRAGRIP_KERNEL": build},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def built(wanted: str) -> str:
    """Return the build that a fresh process takes with TERRAGRIP_KERNEL=wanted."""
    return run_with(wanted, "from terragrip import _kernel; print(_kernel.build)")


def test_portable_can_be_asked_for() -> None:
    assert built("portable") == "portable"


def test_unknown_build_is_an_input_error() -> None:
    with pytest.raises(InputError, match="TERRAGRIP_KERNEL is 'sse9'; set it to portable or avx2"):
        _kernel._choose("sse9")


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_either_compiler_knows_every_flag_that_is_not_spared(
    compiler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`setup.py` builds without the spared flags where they fail; clang alone could not build the package while one was none of them."""
    if shutil.which(compiler) is None:
        pytest.skip(f"NOT TESTED: {compiler} is missing")
    monkeypatch.syspath_prepend(ROOT)
    from cffi_build import FLAGS, HIDDEN, SPARED, kernel_bindings

    empty = tmp_path / "empty.c"
    empty.write_text("int nothing;\n")
    for binding in kernel_bindings():
        flags = [flag for flag in (*FLAGS, HIDDEN, *binding.flags) if flag not in SPARED]
        done = subprocess.run([compiler, *flags, "-fsyntax-only", empty], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_older_processor_gets_portable_and_never_loads_avx2(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[str] = []

    def load(name: str) -> SimpleNamespace:
        loaded.append(name)
        return SimpleNamespace(lib=SimpleNamespace(tg_cpu_has_avx2=lambda: 0))

    monkeypatch.setattr(_kernel, "import_module", load)
    assert _kernel._choose(None)[0] == "portable"
    with pytest.raises(InputError, match="cannot run"):
        _kernel._choose("avx2")
    assert set(loaded) == {"terragrip._kernel_portable"}


def test_able_processor_takes_avx2_by_default() -> None:
    portable = _kernel._choose("portable")[1]
    if not portable.lib.tg_cpu_has_avx2():
        pytest.skip("NOT TESTED: this processor has no AVX2")
    assert _kernel._choose(None)[0] == "avx2"
    assert built("avx2") == "avx2"


DRIVE = """
import hashlib, json
import numpy as np, pandas as pd
import terragrip as tg

rng, time = np.random.default_rng(5), np.arange(0, 20, 0.01)
vehicle = tg.Vehicle.from_dict({
    "name": "cart", "mass": 139.0, "wheelbase": 0.638, "center_of_gravity_height": 0.3, "hitch_height": 0.25,
    "axles": {"front": {"mass": 54.0, "wheels": ["fl", "fr"]}, "rear": {"mass": 85.0, "wheels": ["rl", "rr"]}},
    "wheel": {"radius": 0.2, "inertia": 0.15}, "tire_rolling_resistance": 0.02, "bearing_resistance": 2.0,
})
pull, speed = 200 + 60 * np.sin(time / 4), 0.6 + 0.05 * np.sin(time / 7)
table = {"time": time, "ground_speed": speed + 0.02 * rng.standard_normal(len(time))}
for wheel in vehicle.wheels:
    table[f"wheel_speed_{wheel}"] = speed / 0.18 + 0.03 * rng.standard_normal(len(time))
    table[f"drive_torque_{wheel}"] = 0.05 * (pull + 110) + 2 + rng.standard_normal(len(time))
table["drawbar_force"] = pull + 4 * rng.standard_normal(len(time))
recording = tg.Recording.from_frame(pd.DataFrame(table))
digests = {}
for method in ("ekf", "ukf", "aukf", "aukf-fs", "kalman", "bank"):
    estimates = tg.estimate(recording, vehicle, method=method).to_pandas().select_dtypes("number")
    digests[method] = hashlib.sha256(estimates.to_numpy(np.float64).tobytes()).hexdigest()
print(json.dumps(digests))
"""


def test_both_builds_give_the_same_bits() -> None:
    if not _kernel._choose("portable")[1].lib.tg_cpu_has_avx2():
        pytest.skip("NOT TESTED: this processor has no AVX2")
    portable, avx2 = (json.loads(run_with(build, DRIVE)) for build in ("portable", "avx2"))
    assert len(set(portable.values())) > 3, "the methods differ, so equal digests tell something"
    assert portable == avx2

"""One step of the filter inside C: compiles kernel_step.c with the kernel's sources and flags."""

from __future__ import annotations

import shlex
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np

from peer import GRAVITY, FloatArray, Problem

ROOT = Path(__file__).resolve().parents[1]


def run(problem: Problem, folder: Path) -> dict[str, tuple[FloatArray, float]]:
    """Last state (2 n + 2,) and seconds a step, by method, of `problem`, with this processor's build."""
    sys.path.insert(0, str(ROOT))
    from cffi_build import FLAGS

    from terragrip import _kernel

    extra = ("-mavx2", "-mfma") if _kernel.build == "avx2" else ()
    compiler = shlex.split(sysconfig.get_config_var("CC") or "cc")[0]
    program = folder / "kernel_step"
    sources = [str(path) for path in sorted((ROOT / "kernel/src").glob("*.c"))]
    command = [compiler, *FLAGS, *extra, "-I", str(ROOT / "kernel/include"), "-I", str(ROOT / "kernel/src")]
    own = str(Path(__file__).with_suffix(".c"))
    subprocess.run([*command, own, *sources, "-o", str(program), "-lm"], check=True)
    data = folder / "problem.bin"
    _write(problem, data)
    printed = subprocess.run([str(program), str(data)], check=True, capture_output=True, text=True).stdout
    result = {}
    for line in printed.splitlines():
        name, nanoseconds, *state = line.split()
        result[name] = (np.array(state, dtype=np.float64), 1e-9 * float(nanoseconds))
    return result


def _write(problem: Problem, path: Path) -> None:
    """The problem as doubles, in the order that kernel_step.c reads."""
    machine = problem.machine
    steps, wheels = problem.load.shape
    head = [wheels, steps, problem.dt, machine.mass, GRAVITY, machine.tire_rolling_resistance]
    constants = [machine.radius, machine.inertia, machine.bearing_resistance, problem.walk, problem.start]
    rows = np.column_stack([problem.torque, problem.load, problem.drawbar, problem.measured])
    pieces = [head, *constants, problem.start_covariance.ravel(), problem.noise, rows.ravel()]
    path.write_bytes(np.concatenate([np.asarray(piece, dtype=np.float64) for piece in pieces]).tobytes())

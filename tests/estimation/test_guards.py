"""What must not be built is not built: the kernel with fast-math, and a program of one precision with a kernel of the other."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from single_precision import HEADER, ROOT, compiler, library


def compiled(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [*compiler(), "-std=c99", f"-I{HEADER.parent}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
@pytest.mark.parametrize("source", ["filter.c", "estimator.c", "speeds.c"])
def test_fast_math_is_refused(source: str, flag: str) -> None:
    path = str(ROOT / "kernel/src" / source)
    assert compiled("-fsyntax-only", path).returncode == 0
    refused = compiled("-fsyntax-only", flag, path)
    assert refused.returncode != 0
    assert "compile without -ffast-math" in refused.stderr


def test_a_program_does_not_link_with_a_kernel_of_the_other_precision(tmp_path: Path) -> None:
    program = tmp_path / "program.c"
    program.write_text('#include "terragrip.h"\nint main(void) { return tg_filter_size(TG_FIXED) == 0; }\n')
    common = [str(program), str(library()), "-lm", "-o", str(tmp_path / "program")]
    assert compiled("-DTG_FLOAT", *common).returncode == 0
    refused = compiled(*common)
    assert refused.returncode != 0
    assert "tg_kernel_in_double_precision" in refused.stderr

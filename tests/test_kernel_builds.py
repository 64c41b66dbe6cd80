"""The choice among the kernel's builds: by processor, by TERRAGRIP_KERNEL, refused where it cannot run."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from terragrip import _kernel
from terragrip.errors import InputError


def built(wanted: str) -> str:
    """Return the build that a fresh process takes with TERRAGRIP_KERNEL=wanted."""
    done = subprocess.run(
        [sys.executable, "-c", "from terragrip import _kernel; print(_kernel.build)"],
        env={**os.environ, "TERRAGRIP_KERNEL": wanted},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_portable_can_be_asked_for() -> None:
    assert built("portable") == "portable"


def test_unknown_build_is_an_input_error() -> None:
    with pytest.raises(InputError, match="TERRAGRIP_KERNEL is 'sse9'; set it to portable or avx2"):
        _kernel._choose("sse9")


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

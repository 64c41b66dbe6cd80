"""The compiled kernel: ``ffi`` and ``lib`` of the fastest build that this processor runs.

Two builds hold the same functions: ``portable`` runs anywhere, ``avx2`` on x86-64 processors with AVX2 and
FMA. Both give the same bits. The environment variable ``TERRAGRIP_KERNEL`` (``portable`` or ``avx2``) overrides
the choice.
"""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from terragrip.errors import InputError

BUILDS = ("portable", "avx2")


def _choose(wanted: str | None) -> tuple[str, Any]:
    """Return the name and the module of the build to use; ``wanted`` None takes the fastest."""
    if wanted is not None and wanted not in BUILDS:
        raise InputError(
            f"TERRAGRIP_KERNEL is {wanted!r}", hint=f"set it to {' or '.join(BUILDS)}, or leave it unset"
        )
    portable = import_module("terragrip._kernel_portable")
    # The AVX2 module is not even imported before the check: its very loading may run AVX2 code.
    able = bool(portable.lib.tg_cpu_has_avx2()) and find_spec("terragrip._kernel_avx2") is not None
    if wanted == "avx2" and not able:
        raise InputError("TERRAGRIP_KERNEL is 'avx2', which this machine cannot run", hint="unset it")
    if wanted == "portable" or not able:
        return "portable", portable
    return "avx2", import_module("terragrip._kernel_avx2")


build, _module = _choose(os.environ.get("TERRAGRIP_KERNEL"))
ffi: Any = _module.ffi
lib: Any = _module.lib

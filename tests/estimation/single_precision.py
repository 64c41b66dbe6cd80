"""The kernel in single precision, as a controller runs it: compiled for the tests alone, once for each state of its sources."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

from cffi import FFI

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
from cffi_build import FLAGS, declarations  # noqa: E402

HEADER = ROOT / "kernel/include/terragrip.h"


def library() -> Path:
    """The kernel in single precision as a shared library, in build/single."""
    sources = sorted((ROOT / "kernel/src").glob("*.c"))
    texts = (path.read_bytes() for path in (HEADER, *sorted((ROOT / "kernel/src").glob("*.[ch]"))))
    state = hashlib.sha256(b"".join(texts)).hexdigest()[:16]
    path = ROOT / "build/single" / f"terragrip-{state}.so"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        made = path.with_suffix(f".{os.getpid()}")
        command = [*compiler(), *FLAGS, "-O0", "-DTG_FLOAT", "-shared", "-fPIC", f"-I{HEADER.parent}"]
        subprocess.run([*command, *map(str, sources), "-lm", "-o", str(made)], check=True)
        made.replace(path)  # at once, for another test worker may be at the same
    return path


def compiler() -> list[str]:
    """The C compiler's command."""
    return os.environ.get("CC", "cc").split()


def kernel() -> SimpleNamespace:
    """``ffi`` and ``lib`` as `terragrip._kernel` has them."""
    ffi = FFI()
    ffi.cdef(declarations(HEADER, "float"))
    return SimpleNamespace(ffi=ffi, lib=ffi.dlopen(str(library())))

"""The compiled part of the second plant: made once from drive.c against the installed MuJoCo, kept in build/."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
BUILT = HERE.parents[1] / "build/second_plant"


@cache
def native() -> tuple[Any, Any]:
    """``ffi, lib`` of drive.h. Raises RuntimeError where MuJoCo or a C compiler is missing."""
    import mujoco
    from cffi import FFI

    package = Path(mujoco.__file__).parent
    library = next(package.glob("libmujoco.*"), None)
    if library is None:
        raise RuntimeError(f"no libmujoco beside {package}: install mujoco from PyPI")
    source, header = HERE / "drive.c", HERE / "drive.h"
    key = hashlib.sha256(source.read_bytes() + header.read_bytes() + str(library).encode()).hexdigest()[:16]
    target = BUILT / f"drive-{key}.so"
    if not target.exists():
        BUILT.mkdir(parents=True, exist_ok=True)
        handle, made = tempfile.mkstemp(suffix=".so", dir=BUILT)
        os.close(handle)
        flags = [
            "-std=c99",
            "-O2",
            "-fno-math-errno",
            "-shared",
            "-fPIC",
            f"-I{package / 'include'}",
            f"-I{HERE}",
        ]
        links = [str(library), f"-Wl,-rpath,{package}", "-lm", "-o", made]
        call = [*shlex.split(os.environ.get("CC", "cc")), *flags, str(source), *links]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"drive.c does not compile:\n{done.stderr}")
        os.replace(made, target)
    ffi = FFI()
    text = header.read_text(encoding="utf-8")
    ffi.cdef(re.search(r"/\* cdef begin \*/(.*?)/\* cdef end \*/", text, re.DOTALL).group(1))
    return ffi, ffi.dlopen(str(target))

"""The C extensions: what each is compiled from, with which flags, and what Python sees of it.

``setup.py`` and nothing else imports this. Each extension is bound in cffi's API mode. Where Python's own C
headers are missing (a Debian machine without ``python3-dev``) the same sources become a plain shared library,
bound in ABI mode: a slower call, the same numbers.
"""

from __future__ import annotations

import platform
import re
import sysconfig
from dataclasses import dataclass
from pathlib import Path

from cffi import FFI
from setuptools import Extension

ROOT = Path(__file__).resolve().parent
CPU_CHECK = "int tg_cpu_has_avx2(void);"

# Without -ffast-math: NaN means "missing" here. errno and floating-point traps are read by nobody. -O3 doubles the compile time,
# so only the build that nearly everybody runs has it (docs/decisions/0090). Contraction to fused multiply-add stays off, so that
# the portable and the AVX2 build give the same bits. Python's own flags come first, among them -fwrapv: our C has no signed overflow (the
# sanitizers look for it), and loops that might have one take 4 % more instructions.
FLAGS = (
    "-std=c99",
    "-O2",
    "-g0",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-wrapv",
    "-ffp-contract=off",
    "-Wno-psabi",
)
HIDDEN = "-fvisibility=hidden"
LINK_TIME = "-flto"
SPARED = ("-fno-tree-loop-distribute-patterns", LINK_TIME)
"""Flags of the AVX2 build that clang, or a linker without a plugin, does not know; ``setup.py`` then builds without them: the same bits.
Loops over a few wheels stay loops (a call of memset takes more instructions); link-time optimization saves 3 % of a row's time."""


@dataclass(frozen=True)
class Binding:
    """One extension module: its name, public headers, C sources, extra flags and extra declarations."""

    name: str
    headers: tuple[Path, ...]
    sources: tuple[Path, ...]
    flags: tuple[str, ...] = ()
    declarations: str = ""

    def ffi(self, *, api: bool) -> FFI:
        """Parse the headers' declarations; in API mode also the C code that includes them."""
        builder = FFI()
        builder.cdef("".join(declarations(header) for header in self.headers) + self.declarations)
        included = "".join(f'#include "{header.name}"\n' for header in self.headers)
        builder.set_source(self.name, included + self.declarations if api else None)
        return builder


def declarations(header: Path, real: str = "double") -> str:
    """Return the text between ``/* cdef begin */`` and ``/* cdef end */``, with TG_REAL put in."""
    text = header.read_text(encoding="utf-8")
    match = re.search(r"/\* cdef begin \*/(.*?)/\* cdef end \*/", text, re.DOTALL)
    if match is None:
        raise SystemExit(f"{header}: no /* cdef begin */ ... /* cdef end */ section")
    return match.group(1).replace("TG_REAL", real)


def bindings() -> list[Binding]:
    """Return every extension of this machine, in build order."""
    return [*kernel_bindings(), *plant_bindings()]


def kernel_bindings() -> list[Binding]:
    """Return the kernel's builds: any processor, and AVX2 (x86-64 only)."""
    header = ROOT / "kernel/include/terragrip.h"
    sources = tuple(sorted((ROOT / "kernel/src").glob("*.c")))
    if not sources:
        return []
    python = ROOT / "kernel/python"
    found = [
        Binding(
            "terragrip._kernel_portable", (header,), (*sources, python / "cpu.c"), declarations=CPU_CHECK
        ),
    ]
    if platform.machine() in ("x86_64", "AMD64"):
        # The generic schedule, made for older processors too, costs 5 % here (docs/decisions/0090).
        found.append(
            Binding(
                "terragrip._kernel_avx2",
                (header,),
                sources,
                flags=("-O3", "-mavx2", "-mfma", "-mtune=skylake", *SPARED),
            )
        )
    return found


def plant_bindings() -> list[Binding]:
    """Return the simulation's plant."""
    folder = ROOT / "src/terragrip/simulation"
    sources = tuple(sorted(folder.glob("plant*.c")))
    return [Binding("terragrip.simulation._plant", (folder / "plant.h",), sources)] if sources else []


def python_headers_exist() -> bool:
    """Tell whether Python.h is there, which API mode needs."""
    return any(Path(sysconfig.get_path(key), "Python.h").exists() for key in ("include", "platinclude"))


def extension(binding: Binding, generated: Path) -> Extension:
    """Write the binding's generated file and return the extension to compile.

    API mode writes C under ``generated``. ABI mode writes the Python module beside the package's own, which
    loads the shared library named ``<module>_library``.
    """
    api = python_headers_exist()
    folders = {path.parent.relative_to(ROOT) for path in (*binding.headers, *binding.sources)}
    name, sources, flags = binding.name, list(binding.sources), [*FLAGS, *binding.flags]
    if api:
        glue = generated / f"{binding.name}.c"
        glue.parent.mkdir(parents=True, exist_ok=True)
        binding.ffi(api=True).emit_c_code(str(glue))
        sources.insert(0, glue)
        flags.append(HIDDEN)
    else:
        emit_abi_module(binding)
        name = f"{binding.name}_library"
    limited = not sysconfig.get_config_var("Py_GIL_DISABLED")
    return Extension(
        name,
        sources=[str(source.relative_to(ROOT)) for source in sources],
        include_dirs=sorted(map(str, folders)),
        define_macros=[] if limited else [("_CFFI_NO_LIMITED_API", None)],
        extra_compile_args=flags,
        extra_link_args=list(flags) if LINK_TIME in flags else [],
        libraries=["m"],
        py_limited_api=limited,
    )


def emit_abi_module(binding: Binding) -> None:
    """Write an ABI-mode binding's Python module, with ``ffi`` and ``lib`` as an API-mode module has."""
    path = ROOT / "src" / Path(*binding.name.split(".")).with_suffix(".py")
    binding.ffi(api=False).emit_python_code(str(path))
    with path.open("a", encoding="utf-8") as module:
        module.write(
            "\nfrom pathlib import Path as _Path\n\n"
            f"lib = ffi.dlopen(str(next(_Path(__file__).parent.glob('{path.stem}_library*.so'))))\n"
        )

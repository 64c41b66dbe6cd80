"""Build the C extensions and the studio's pages; everything else about the package stands in pyproject.toml."""

from __future__ import annotations

import os
import sys
from copy import copy
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.errors import CompileError, LinkError

sys.path.insert(0, str(Path(__file__).resolve().parent))
import build_pages
from cffi_build import ROOT, SPARED, bindings, extension


class BuildBindings(build_ext):
    """Compile each extension in a folder of its own: the kernel's files are compiled with several flags."""

    build_temp: str

    def build_extension(self, ext: Extension) -> None:
        apart = copy(self)
        apart.build_temp = os.path.join(self.build_temp, ext.name)
        try:
            super(BuildBindings, apart).build_extension(ext)
        except (CompileError, LinkError):
            if not set(SPARED) & set(ext.extra_compile_args):
                raise
            ext.extra_compile_args = [flag for flag in ext.extra_compile_args if flag not in SPARED]
            ext.extra_link_args = []
            super(BuildBindings, apart).build_extension(ext)


class BuildPackage(build_py):
    """The pages first, where Node is: a wheel then holds them."""

    def run(self) -> None:
        if not self.editable_mode:  # in a clone the Makefile builds them
            build_pages.main()
        super().run()


setup(
    cmdclass={"build_ext": BuildBindings, "build_py": BuildPackage},
    ext_modules=[extension(binding, ROOT / "build" / "glue") for binding in bindings()],
    options={"build_ext": {"parallel": 2}, "bdist_wheel": {"py_limited_api": "cp311"}},
)

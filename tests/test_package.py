"""The package's front door: every public name resolves, and importing it stays light."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import pytest

import terragrip

HEAVY = ("matplotlib", "pandas", "pint", "polars", "pyarrow", "pydantic", "scipy", "typer", "yaml")


@pytest.mark.parametrize("name", terragrip.__all__)
def test_every_public_name_resolves(name: str) -> None:
    assert getattr(terragrip, name) is not None
    assert name in dir(terragrip)


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = terragrip.no_such_name


def test_version_is_the_installed_one() -> None:
    assert terragrip.__version__ == version("terragrip")


def test_import_loads_nothing_heavy() -> None:
    code = f"import sys, terragrip; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

"""`terragrip doctor` says what an installation lacks, and its exit code tells a broken kernel from a missing package."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from terragrip import doctor
from terragrip.cli import main


def without(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Make the installed metadata of some packages disappear."""
    real = metadata.version

    def version(name: str) -> str:
        if name in names:
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", version)


def found(subject: str) -> doctor.Finding:
    (one,) = [finding for finding in doctor.findings() if finding.subject == subject]
    return one


def test_a_whole_installation_is_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    shown, error = capsys.readouterr()
    assert "ok     kernel" in shown
    assert error == ""


def test_the_kernel_agrees_with_the_closed_form_and_a_wrong_constant_shows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert doctor.kernel_error() < 1e-9
    monkeypatch.setattr("terragrip.units.STANDARD_GRAVITY", 9.7)  # the oracle's alone: the kernel has its own
    assert doctor.kernel_error() > 1e-3


def test_a_wrong_kernel_is_a_defect(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "kernel_error", lambda: float("nan"))
    assert main(["doctor"]) == 1
    shown, error = capsys.readouterr()
    assert "DEFECT kernel" in shown
    assert error.count("\n") == 1


def test_a_missing_package_of_an_extra_is_a_note_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without(monkeypatch, "asammdf", "matplotlib")
    assert found("formats").state == "note"
    assert found("formats").text.endswith("missing asammdf; pip install 'terragrip[formats]'")
    assert "missing matplotlib" in found("studio").text, "the studio draws with the report's packages"
    assert main(["doctor"]) == 0


def test_a_missing_package_of_its_own_has_to_be_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without(monkeypatch, "scipy")
    assert main(["doctor"]) == 2
    assert "FIX    packages   missing scipy; pip install terragrip" in capsys.readouterr().out


def test_every_extra_is_listed_with_its_purpose() -> None:
    declared = set(metadata.metadata("terragrip").get_all("Provides-Extra") or ())
    assert set(doctor.EXTRAS) == declared - {"all", "dev"}


def test_a_used_port_and_a_closed_folder_are_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import socket
    import tempfile

    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        monkeypatch.setattr(doctor, "PORT", other.getsockname()[1])
        assert "--port 0" in found("port").text
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "gone"))
    assert found("temporary").state == "fix"


def test_the_shell_completes_commands_and_options() -> None:
    def complete(words: str, position: int) -> list[str]:
        done = subprocess.run(
            [sys.executable, "-m", "terragrip"],
            env={
                **os.environ,
                "_TERRAGRIP_COMPLETE": "complete_bash",
                "COMP_WORDS": words,
                "COMP_CWORD": str(position),
            },
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    assert complete("terragrip est", 1) == ["estimate"]
    assert "--vehicle" in complete("terragrip estimate --v", 2)

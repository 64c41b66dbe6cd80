"""The wheel, as a user installs it: no compiler, an empty environment, first without extras, then with report and studio.

One test, so that the workers of a run do not each build a wheel and fill an environment (a minute); `make test-long` runs it,
and `make test` looks at what goes into the source distribution that the wheel is built from.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import urllib.error
import urllib.request
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LARGEST = 6_000_000
VEHICLE = ("--vehicle", "drive/vehicle.yaml")
PAGES = ROOT / "src/terragrip/studio/static/index.html"


def run_quietly(*words: str) -> subprocess.CompletedProcess[str]:
    """Python in the repository's folder."""
    return subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)


def build_source(folder: Path) -> Path:
    """The source distribution, as ``make wheel`` builds it."""
    folder.mkdir()
    code = f"from setuptools import build_meta; build_meta.build_sdist({str(folder)!r})"
    made = run_quietly("-c", code)
    assert made.returncode == 0, made.stderr
    (source,) = folder.glob("*.tar.gz")
    return source


def build_wheel(folder: Path) -> Path:
    """Built as ``make wheel`` does: from the source distribution, so that what that lacks shows."""
    source = build_source(folder)
    words = ["-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", str(folder), str(source)]
    made = run_quietly(*words)
    assert made.returncode == 0, made.stdout + made.stderr
    (built,) = folder.glob("*.whl")
    return built


@dataclass(frozen=True)
class Environment:
    """A virtual environment of its own, whose PATH holds nothing else: no compiler, no Node."""

    folder: Path

    def run(self, *words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        environment = {"PATH": str(self.folder / "bin"), "HOME": str(self.folder), "LANG": "C.UTF-8"}
        environment |= {k: v for k, v in os.environ.items() if k.startswith("PIP_") or k.endswith("_proxy")}
        program = str(self.folder / "bin" / words[0])
        done = subprocess.run(
            [program, *words[1:]],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == code, done.stdout + done.stderr
        return done

    def install(self, what: str) -> None:
        # Constraints with hashes would ask for one of the wheel itself.
        lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
        pins = self.folder / "pins.txt"
        pins.write_text(re.sub(r" \\\n    --hash=\S+", "", lock), encoding="utf-8")
        limits = ["-c", str(pins)]
        self.run(
            "python",
            "-m",
            "pip",
            "install",
            "--quiet",
            "--only-binary",
            ":all:",
            "--prefer-binary",
            *limits,
            what,
        )


def test_the_source_distribution_holds_every_source_and_every_file_of_the_package(tmp_path: Path) -> None:
    with tarfile.open(build_source(tmp_path / "dist")) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    tracked = run_git(
        "ls-files", "src/terragrip", "kernel", "setup.py", "cffi_build.py", "pyproject.toml", "LICENSE"
    )
    wanted = {name for name in tracked if not name.startswith("kernel/tests")}
    assert len(wanted) > 200
    assert wanted <= names
    built = {str(path.relative_to(ROOT)) for path in PAGES.parent.rglob("*") if path.is_file()}
    assert built <= names


def run_git(*words: str) -> list[str]:
    """Lines that git prints; skips the test where this is no clone."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("NOT TESTED: this is no clone, or there is no git")
    return subprocess.run(
        ["git", *words], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.mark.long
def test_the_wheel_installs_without_a_compiler_and_works(tmp_path: Path) -> None:
    wheel = build_wheel(tmp_path / "dist")
    check_contents(wheel)
    environment = Environment(tmp_path / "environment")
    subprocess.run([sys.executable, "-m", "venv", str(environment.folder)], check=True)
    environment.install(str(wheel))
    check_without_extras(environment)
    environment.install(f"{wheel}[report,studio]")
    check_with_extras(environment)


def check_contents(wheel: Path) -> None:
    assert re.search(r"-cp311-abi3-\w+\.whl$", wheel.name)
    assert wheel.stat().st_size <= LARGEST
    names = zipfile.ZipFile(wheel).namelist()
    assert not [name for name in names if name.endswith((".c", ".h")) or name.startswith("tests")]
    assert [name for name in names if name.endswith("licenses/LICENSE")]
    built = {str(path.relative_to(ROOT / "src")) for path in PAGES.parent.rglob("*") if path.is_file()}
    assert built <= set(names)


def check_without_extras(bare: Environment) -> None:
    """A CSV is estimated; whatever needs more names the extra that holds it."""
    bare.run("terragrip", "simulate", "fine-10", "-o", "drive", "--seed", "3", "--quiet")
    code = "import pandas as pd; pd.read_parquet('drive/recording.parquet').to_csv('log.csv', index=False)"
    bare.run("python", "-c", code)
    bare.run("terragrip", "estimate", "log.csv", *VEHICLE, "-o", "drive.parquet", "-q")
    assert "off the closed form" in bare.run("terragrip", "doctor").stdout
    (bare.folder / "log.mf4").write_bytes(b"MDF     4.10    TGT 15.0" + bytes(400))
    (bare.folder / "log.blf").write_bytes(b"LOGG" + bytes(400))
    for extra, words in (
        ("report", ["report", "drive.parquet", "-o", "report.html"]),
        ("studio", ["studio", "--port", "0"]),
        ("formats", ["inspect", "log.mf4"]),
        ("formats", ["estimate", "log.blf", *VEHICLE, "-o", "blf.parquet"]),
        ("live", ["live", "--source", "can:vcan0", *VEHICLE, "--sink", "mqtt://127.0.0.1/x"]),
    ):
        error = bare.run("terragrip", *words, code=2).stderr
        assert error.count("\n") == 1, error
        assert f"pip install 'terragrip[{extra}]'" in error


def check_with_extras(full: Environment) -> None:
    full.run("terragrip", "report", "drive.parquet", "-o", "report.html", "-q")
    assert "<svg" in (full.folder / "report.html").read_text(encoding="utf-8")
    assert (full.folder / "report.pdf").read_bytes().startswith(b"%PDF")
    page = served_page(full)
    assert "<script" in page if PAGES.is_file() else page


def served_page(environment: Environment) -> str:
    """What the studio of the environment answers at its address."""
    program = [str(environment.folder / "bin/terragrip"), "studio", ".", "--port", "0"]
    with subprocess.Popen(program, cwd=environment.folder, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            address = ""
            while not address:
                line = server.stdout.readline()
                assert line, "the studio ended before it named its address"
                address = "".join(re.findall(r"http://\S+", line))
            for _ in range(600):
                try:
                    return urllib.request.urlopen(address, timeout=60).read().decode()
                except urllib.error.URLError:
                    time.sleep(0.1)
            raise AssertionError(f"{address} does not answer")
        finally:
            server.terminate()

"""What an installation can do: versions, extras, the kernel against a known answer, pages, ports, browser, permissions."""

from __future__ import annotations

import os
import platform
import re
import socket
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

State = Literal["ok", "note", "fix", "defect"]

EXTRAS = {
    "formats": "logs of CAN, MDF, ROS, MCAP, MATLAB, NMEA",
    "report": "HTML and PDF reports",
    "studio": "the pages in the browser",
    "live": "the service on a machine",
    "ground": "changes of the ground, the classifier",
    "fleet": "many logs on Dask",
    "geo": "maps, GeoPackage, a map's background from a GeoTIFF",
}
"""What each extra is for, in the order of the list."""
PORT = 8750
"""The studio's."""


@dataclass(frozen=True)
class Finding:
    """One line of the list.

    ``state``: `ok`; `note`, something optional is absent; `fix`, what the user has to set right; `defect`, one of ours.
    """

    subject: str
    state: State
    text: str


def findings() -> Iterator[Finding]:
    """Every finding, in the order of the list; none raises."""
    yield _versions()
    yield from _packages()
    yield _kernel()
    yield _pages()
    yield _port()
    yield _browser()
    yield from _folders()
    yield _devices()


def _versions() -> Finding:
    from terragrip import __version__

    system = f"{platform.system()} {platform.machine()}"
    return Finding("terragrip", "ok", f"{__version__}, Python {platform.python_version()}, {system}")


def _packages() -> Iterator[Finding]:
    """What the package needs, then what each extra would need; by the installed metadata."""
    try:
        required = metadata.requires("terragrip") or []
    except metadata.PackageNotFoundError:
        yield Finding("packages", "fix", "terragrip is not installed; pip install terragrip")
        return
    absent = _absent(required, None)
    if absent:
        yield Finding("packages", "fix", f"missing {', '.join(absent)}; pip install terragrip")
    else:
        shown = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "pandas", "pyarrow"))
        yield Finding("packages", "ok", shown)
    for extra, purpose in EXTRAS.items():
        absent = _absent(required, extra)
        missing = f"{purpose}: missing {', '.join(absent)}; pip install 'terragrip[{extra}]'"
        yield Finding(extra, "note" if absent else "ok", missing if absent else purpose)


def _absent(required: list[str], extra: str | None) -> list[str]:
    """Names of the packages of an extra (None: of the package itself) that are not installed."""
    names = []
    for line in required:
        requirement, _, condition = line.partition(";")
        of = re.search(r"extra\s*==\s*['\"]([\w-]+)['\"]", condition)
        if (of.group(1) if of else None) != extra:
            continue
        name = re.match(r"\s*([\w.-]+)", requirement)
        inner = re.match(r"\s*terragrip\[([\w,-]+)\]", requirement)
        if inner:
            names += [n for one in inner.group(1).split(",") for n in _absent(required, one)]
        elif name and not _installed(name.group(1)):
            names.append(name.group(1))
    return names


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _kernel() -> Finding:
    try:
        from terragrip import _kernel

        error = kernel_error()
    except ImportError as failure:
        return Finding("kernel", "fix", f"does not load ({failure}); install the wheel of this platform")
    except Exception as failure:  # noqa: BLE001 - whatever the kernel raises on a known drive is the finding
        return Finding("kernel", "defect", f"fails on a known drive ({type(failure).__name__}: {failure})")
    text = f"build {_kernel.build}, off the closed form of a known drive by {error:.1e}"
    return Finding("kernel", "ok" if error < 1e-3 else "defect", text)


def kernel_error() -> float:
    """Largest error of slip, adhesion and soil resistance at the end of a known drive with exact sensors.

    Two driven wheels at steady speeds, 20 s; the pull rises at half time. In closed form (physics.md 1): s = 1 - v/(r ω),
    μ = T/(r F_z) - ρ_t, and Σ μ F_z = F_dx + ρ_s m g.
    """
    import numpy as np

    import terragrip as tg
    from terragrip.units import STANDARD_GRAVITY

    mass, radius, tire, slip, soil = 100.0, 0.2, 0.02, 0.1, 0.08
    vehicle = tg.Vehicle.from_dict(
        {
            "name": "known",
            "mass": mass,
            "axles": {"a": {"mass": mass, "wheels": ["l", "r"]}},
            "wheel": {"radius": radius, "inertia": 0.1},
            "tire_rolling_resistance": tire,
            "sensors": {"wheel_speed": 0.01, "ground_speed": 0.01, "drive_torque": 0.1, "drawbar_force": 0.5},
        }
    )
    time, weight, speed = np.arange(0.0, 20.0, 0.01), mass * STANDARD_GRAVITY, 1.0
    adhesion = np.where(time < 10.0, 0.2, 0.3)
    values: dict[str, Any] = {
        "ground_speed": speed,
        "drawbar_force": (adhesion - soil) * weight,
        **{f"wheel_speed_{w}": speed / (radius * (1 - slip)) for w in "lr"},
        **{f"drive_torque_{w}": (adhesion + tire) * radius * weight / 2 for w in "lr"},
    }
    channels = {name: np.zeros(time.size) + value for name, value in values.items()}
    estimates = tg.estimate(tg.Recording(time=time, channels=channels), vehicle, method="kalman")
    expected = {"slip_l": slip, "adhesion_r": adhesion[-1], "soil_resistance": soil}
    return float(max(abs(estimates[name][-1] - value) for name, value in expected.items()))


def _pages() -> Finding:
    page = Path(__file__).parent / "studio" / "static" / "index.html"
    if page.is_file():
        return Finding("pages", "ok", "the studio's pages are here")
    return Finding(
        "pages", "note", "the studio's pages are not built; install a wheel, or make studio (Node.js)"
    )


def _port() -> Finding:
    with socket.socket() as trial:
        try:
            trial.bind(("127.0.0.1", PORT))
        except OSError as failure:
            text = f"{PORT} on 127.0.0.1 cannot be used ({failure.strerror}); terragrip studio --port 0 uses a free one"
            return Finding("port", "note", text)
    return Finding("port", "ok", f"{PORT} on 127.0.0.1 is free")


def _browser() -> Finding:
    import webbrowser

    try:
        name = getattr(webbrowser.get(), "name", "")
    except webbrowser.Error:
        return Finding(
            "browser", "note", "none on this machine; open the studio from another (studio --address)"
        )
    return Finding("browser", "ok", str(name) or "there is one")


def _folders() -> Iterator[Finding]:
    for subject, folder in (("folder", Path.cwd()), ("temporary", Path(tempfile.gettempdir()))):
        try:
            with tempfile.TemporaryFile(dir=folder) as trial:
                trial.write(b"\0")
            yield Finding(subject, "ok", f"{folder} can be written")
        except OSError as failure:
            state: State = "fix" if subject == "temporary" else "note"
            advice = "set TMPDIR to another" if subject == "temporary" else "give -o in another folder"
            yield Finding(subject, state, f"{folder} cannot be written ({failure.strerror}); {advice}")


def _devices() -> Finding:
    """Serial ports and CAN interfaces for the live service; by Linux's folders, so nothing of them elsewhere."""
    serial = [path for kind in ("ttyUSB*", "ttyACM*") for path in sorted(Path("/dev").glob(kind))]
    shut = [str(path) for path in serial if not os.access(path, os.R_OK | os.W_OK)]
    if shut:
        text = f"{', '.join(shut)}: permission denied; sudo usermod -a -G dialout $USER, then log in again"
        return Finding("devices", "note", text)
    can = [path.parent.name for path in sorted(Path("/sys/class/net").glob("*/type")) if _text(path) == "280"]
    names = [*map(str, serial), *can]
    if not names:
        where = "" if sys.platform == "linux" else " (looked for on Linux only)"
        return Finding("devices", "ok", f"no serial port, no CAN interface{where}")
    return Finding("devices", "ok", ", ".join(names))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except OSError:
        return ""

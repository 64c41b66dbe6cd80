"""What soils that yield do at small slips: Wong and Reece's rigid wheel on Wong's table of soils, apart from either plant.

    python benchmarks/wheel_stresses.py

Prints for three sizes of wheel the adhesion without slip over the resistance (c of advice/curves.py), the adhesion's course and the best
slip. Stresses: sigma = (kc/b + kphi) z^n, tau = (c + sigma tan phi)(1 - e^{-j/K}), the largest at (.4 + .2 s) of the entry angle (Wong and
Reece 1967; soils: Wong, Theory of Ground Vehicles, table 2.3). No deflection of the tyre, no slip-sinkage: a hard wheel is the worst case.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SOILS = {
    "dry sand": (1.1, 0.99, 1528.43, 1.04, 28, 0.025),
    "sandy loam": (0.7, 5.27, 1515.04, 1.72, 29, 0.025),
    "sandy loam, moist": (0.9, 52.53, 1127.97, 4.83, 20, 0.025),
    "clayey soil": (0.5, 13.19, 692.15, 4.14, 13, 0.01),
    "heavy clay": (0.11, 1.84, 103.27, 20.69, 6, 0.006),
    "LETE sand": (0.79, 102, 5301, 1.3, 31.1, 0.012),
    "upland sandy loam": (1.10, 74.6, 2080, 3.3, 33.7, 0.015),
    "lean clay": (0.2, 16.43, 1724.69, 68.95, 20, 0.006),
}
"""n, kc [kN/m^(n+1)], kphi [kN/m^(n+2)], c [kPa], phi [deg], K [m]; K by kind of soil as in the same book."""
WHEELS = {"light robot": (0.1, 0.05, 40.0), "robot": (0.2, 0.1, 340.0), "tractor": (0.7, 0.5, 2e4)}
"""Radius, width [m], load [N]."""
TIRE = 0.02


def forces(
    entry: float, slip: float, soil: tuple[float, ...], radius: float, width: float
) -> tuple[float, float, float]:
    """Vertical force, pull and torque over radius [N] of a wheel that enters the ground at an angle [rad]."""
    n, kc, kphi, cohesion, phi, shear = soil
    top, angle = (0.4 + 0.2 * slip) * entry, np.linspace(0.0, entry, 200)
    front = np.where(angle >= top, angle, entry - angle / top * (entry - top))
    depth = radius * np.maximum(np.cos(front) - np.cos(entry), 0)
    normal = 1e3 * (kc / width + kphi) * depth**n
    way = radius * ((entry - angle) - (1 - slip) * (np.sin(entry) - np.sin(angle)))
    along = (1e3 * cohesion * (normal > 0) + normal * np.tan(np.radians(phi))) * -np.expm1(
        -np.maximum(way, 0) / shear
    )
    parts = (
        normal * np.cos(angle) + along * np.sin(angle),
        along * np.cos(angle) - normal * np.sin(angle),
        along,
    )
    vertical, pull, rim = (radius * width * float(np.trapezoid(part, angle)) for part in parts)
    return vertical, pull, rim


def wheel(
    slip: float, soil: tuple[float, ...], radius: float, width: float, load: float
) -> tuple[float, float]:
    """(mu, rho_s) in the paper's split at the sinkage that carries the load."""
    low, high = 0.02, 1.3
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if forces(middle, slip, soil, radius, width)[0] < load else (low, middle)
    _, pull, rim = forces(high, slip, soil, radius, width)
    return rim / load - TIRE, (rim - pull) / load - TIRE


def main() -> None:
    slips = np.linspace(0.0, 0.6, 61)
    print(
        "| wheel | soil | mu / rho_s without slip | mu at 0, .05, .1, .2, .4 | rho_s at 0, .4 | best slip |"
    )
    print("|---|---|---|---|---|---|")
    for size, (radius, width, load) in WHEELS.items():
        for soil, constants in SOILS.items():
            mu, rho = np.array([wheel(s, constants, radius, width, load) for s in slips]).T
            pull = mu - rho
            efficiency = np.where(pull > 0, pull / np.maximum(mu + TIRE, 1e-9) * (1 - slips), 0.0)
            best = f"{slips[efficiency.argmax()]:.2f}" if efficiency.max() > 0 else "pulls nothing"
            course = " ".join(f"{mu[i]:.2f}" for i in (0, 5, 10, 20, 40))
            print(
                f"| {size} | {soil} | {mu[0] / rho[0]:.2f} | {course} | {rho[0]:.2f} {rho[40]:.2f} | {best} |"
            )


if __name__ == "__main__":
    main()

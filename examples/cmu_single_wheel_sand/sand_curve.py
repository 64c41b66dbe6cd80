"""A wheel in sand, from forces measured by others to an adhesion-slip curve.

The data (Catherine Pavlov, Carnegie Mellon University, github.com/robomechanics/3d-terramechanics, MIT-style licence) are means of
single-wheel runs: a smooth wheel of 0.058 m radius under about 24 N in sand, forces by a 6-axis sensor. Longitudinal force is negative
forward and vertical force negative downward, so F_y/F_z is the net traction ratio kappa = mu - rho. The sensor sees kappa, not mu:
at zero slip the wheel does not pull but is dragged, and a curve through (0, 0) cannot follow.

Run:  python sand_curve.py single_wheel_averages.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terragrip.soil.bins import Bins, BinSettings, bin_pairs
from terragrip.soil.choice import compare_forms
from terragrip.soil.fit import AdhesionCurve

LEVELS = BinSettings(width=0.05, lower=-0.025, upper=1.025, minimum=1)
"""One bin for each of the slips that were driven; each holds three runs."""


def straight_runs(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slip and net traction ratio, each (runs,), of the smooth wheel driven straight (slip angle 0)."""
    with path.open(newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["wheel"] == "smooth" and float(row["beta"]) == 0]
    slip = np.array([float(row["slip"]) for row in rows])
    kappa = np.array([float(row["avg_Fy"]) / float(row["avg_Fz"]) for row in rows])
    return slip, kappa


def levels(path: Path) -> Bins:
    """The runs at slips of 0 and more, one bin a slip level, each run a cluster of its own."""
    slip, kappa = straight_runs(path)
    return bin_pairs(slip, kappa, np.arange(slip.size), LEVELS)


def main(path: Path) -> None:
    """Print bins, both fits and the verdict."""
    bins = levels(path)
    for row in bins.to_list():
        print(f"slip {row['slip']:5.2f}  kappa {row['mean']:6.3f}  SD {row['std']:.3f}  runs {row['count']}")
    for title, intercept in (("through zero", False), ("with an intercept", True)):
        curve = AdhesionCurve(intercept=intercept).fit_bins(bins)
        values = ", ".join(
            f"{name} {curve.parameters_[name]:.3f} ({low:.3f} to {high:.3f})"
            for name, (low, high) in curve.interval_.items()
        )
        print(f"prototype {title}: R2 {curve.r2_:.3f}, NRMSE {curve.nrmse_:.3f}, {values}")
    print(compare_forms(bins).sentence)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Advice in newtons for a machine whose mass is in the log."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from advice_drives import VEHICLE, drive
from terragrip.advice.analysis import advise
from terragrip.vehicle import Vehicle


def allowed(**columns: np.ndarray) -> float:
    """The speed [m/s] that the power allows at the advised load."""
    vehicle = Vehicle.from_dict(VEHICLE.to_dict() | {"power": 60e3})
    made = drive(vehicle=vehicle)
    made = replace(made, columns=made.columns | {n: np.full(len(made), v) for n, v in columns.items()})
    (one,), _ = (list(part.values()) for part in advise([made], vehicle))
    texts = [action.what for action in one.actions if "power" in action.what]
    return float(re.search(r"([\d.]+) m/s", texts[0])[1])


def test_twice_the_mass_is_pulled_half_as_fast() -> None:
    assert allowed(mass=12000.0) == pytest.approx(allowed() / 2, rel=0.03)

"""GroundClassifier on real runs (BorealTC, Husky): a few short runs of each ground; all of them are benchmarks/'s."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from terragrip import GroundClassifier

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"

LEARNT = {
    "ASPHALT": ("01", "03", "05"),
    "FLOORING": ("00", "01", "07"),
    "ICE": ("00", "05", "09"),
    "SANDY_LOAM": ("01", "05", "08", "10"),
    "SNOW": ("06", "11", "14", "18", "23"),
}
HELD_OUT = {"ASPHALT": "04", "FLOORING": "03", "ICE": "02", "SANDY_LOAM": "12", "SNOW": "16"}


@pytest.mark.long  # simulated grounds: test_classifier.py
def test_five_real_grounds_on_runs_never_seen(
    shared: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = shared("data/borealtc_husky")
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    import borealtc

    def table(ground: str, number: str):
        return borealtc.run(folder / "pro" / ground / f"pro_{number}.csv").table

    pairs = [(table(ground, number), ground) for ground, numbers in LEARNT.items() for number in numbers]
    classifier = GroundClassifier(max_windows=300).fit([t for t, _ in pairs], [g for _, g in pairs])
    shown = [table(ground, number) for ground, number in HELD_OUT.items()]
    grounds = list(HELD_OUT)
    right = [classifier.score([t], [g]) for t, g in zip(shown, grounds, strict=True)]
    assert np.mean(right) > 0.7  # chance: 0.2
    wheels = [t.drop(columns=list(borealtc.BODY.values())) for t in shown]
    assert np.mean([classifier.score([t], [g]) for t, g in zip(wheels, grounds, strict=True)]) > 0.45

"""The simple baseline beside the Bayesian detector: ADWIN (Bifet and Gavaldà 2007, by river) on each signal alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from river import drift

from terragrip.ground.changes import Change
from terragrip.ground.signals import GROUND, LAWS, signals_of
from terragrip.soil.blocks import Blocks

_SPAN = 0.25
"""SDs over all grounds that the unit interval is laid over. ADWIN's bound asks for values within it; here that bound would see nothing for
half a minute. Span and `delta` are those that do best on the development seeds: the baseline at its best."""


def adwin_changes(blocks: Blocks, names: tuple[str, ...] = GROUND, delta: float = 0.05) -> tuple[Change, ...]:
    """Changes as ADWIN would have reported them while driving, `delta` its confidence; at a change all signals start anew.

    A change's time is when it is reported; ADWIN gives no spread and no probability: std is NaN, probability 1.
    """
    make: Any = drift.ADWIN  # river carries no types
    signals, reported = signals_of(blocks, names), []
    unit = np.array([(LAWS[n].mean, _SPAN * LAWS[n].sd) for n in names])
    detectors = [make(delta=delta, clock=1) for _ in names]
    for k, row in enumerate((signals - unit[:, 0]) / unit[:, 1] + 0.5):
        if not np.isfinite(row).all():
            continue
        for detector, x in zip(detectors, row, strict=True):
            detector.update(float(x))
        result = [d for d in detectors if d.drift_detected]
        if result:
            now = float(blocks.end[k])
            reported.append(Change(now, float("nan"), 1.0, {}, now))
            detectors = [make(delta=delta, clock=1) for _ in names]
    return tuple(reported)

"""Synthetic pairs of many runs: a common curve, runs that differ in level, samples that scatter."""

from __future__ import annotations

import numpy as np

from terragrip.physics.adhesion import CURVES


def pairs(seed, model="exponential", runs=15, samples=400, run_spread=0.06, scatter=0.05, **parameters):
    """Slip, adhesion and run labels; the first parameter (the level) varies by run with `run_spread`."""
    rng = np.random.default_rng(seed)
    level = next(iter(parameters))
    run = np.repeat(np.arange(runs), samples)
    slip = rng.uniform(0.0, 0.65, runs * samples)
    factor = 1 + run_spread * rng.standard_normal(runs)
    drawn = {**parameters, level: parameters[level] * factor[run]}
    mu = CURVES[model].value(slip, drawn) + scatter * rng.standard_normal(slip.size)
    return slip, mu, run
